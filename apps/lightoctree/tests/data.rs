//! `synth` and `dataset` as a user runs them.
#![allow(clippy::unwrap_used, missing_docs)]

use std::path::Path;

use assert_cmd::Command;
use lightoctree::geometry::pixel_direction;
use lightoctree::imaging::{self, ExrOptions, Image};
use serde_json::Value;

fn lightoctree(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("lightoctree").unwrap();
    command.current_dir(folder).arg("--quiet");
    command
}

/// Runs, expects success, returns stdout.
fn done(folder: &Path, args: &[&str]) -> String {
    let output = lightoctree(folder).args(args).output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Runs, expects the exit code, returns stderr.
fn refused(folder: &Path, code: i32, args: &[&str]) -> String {
    let output = lightoctree(folder).args(args).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {message}");
    assert!(!message.contains("panicked"), "{message}");
    message
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

/// Two small photos and panoramas of a room, few points: a second or two a room.
const SMALL: &str =
    r#"{"shots": 2, "panoramas": 2, "panorama_height": 16, "octree_depth": 5, "room": {"crop_size": [48, 32]}}"#;

#[test]
fn synth_is_resumable_and_the_same_however_it_is_split() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("small.json"), SMALL).unwrap();
    let common = ["synth", "--scenes", "3", "--scenes-per-shard", "1", "--config", "small.json", "--seed", "4"];
    let run = |more: &[&str]| done(at, &[&common[..], more].concat());
    let summary = json(&run(&["-o", "whole", "--threads", "1", "--json"]));
    assert_eq!((summary["shards_written"].as_u64(), summary["shards_there"].as_u64()), (Some(3), Some(3)));
    // in two parts, on other thread counts
    run(&["-o", "parts", "--shard", "2/2", "--threads", "2"]);
    assert!(!at.join("parts/rooms-000000.tar").exists() && at.join("parts/rooms-000001.tar").exists());
    run(&["-o", "parts", "--shard", "1/2", "--threads", "3"]);
    for shard in ["rooms-000000.tar", "rooms-000001.tar", "rooms-000002.tar", "manifest.json"] {
        let read = |folder: &str| std::fs::read(at.join(folder).join(shard)).unwrap();
        assert!(read("whole") == read("parts"), "{shard} differs");
    }
    // what is there stays; what is missing is made
    let first = at.join("whole/rooms-000000.tar");
    let written = std::fs::metadata(&first).unwrap().modified().unwrap();
    std::fs::remove_file(at.join("whole/rooms-000002.tar")).unwrap();
    let summary = json(&run(&["-o", "whole", "--json"]));
    assert_eq!((summary["shards_written"].as_u64(), summary["shards_there"].as_u64()), (Some(1), Some(3)));
    assert_eq!(std::fs::metadata(&first).unwrap().modified().unwrap(), written);
    let other =
        refused(at, 2, &["synth", "--scenes", "3", "--scenes-per-shard", "1", "--config", "small.json", "-o", "whole"]);
    assert_eq!(other, "error: whole was begun with another seed; repeat that command, or choose another folder\n");

    let found = json(&done(at, &["dataset", "inspect", "whole", "--json"]));
    assert_eq!((found["layout"].as_str(), found["samples_in_all"].as_u64()), (Some("shards"), Some(6)));
    assert_eq!((found["summary"]["scenes"].as_u64(), found["summary"]["samples"].as_u64()), (Some(3), Some(6)));
    let text = done(at, &["dataset", "inspect", "whole"]);
    assert!(text.contains("train") && text.contains("lamps that burn") && text.contains("depth, m"), "{text}");
    done(
        at,
        &["dataset", "preview", "whole", "--photos", "6", "--panoramas", "3", "--columns", "3", "-o", "sheet.png"],
    );
    let sheet = imaging::read_photo(at.join("sheet.png")).unwrap().photo;
    // two rows of photos and one of panoramas
    assert_eq!((sheet.width(), sheet.height()), (6 + 3 * 246, 6 + 2 * 166 + 126));
}

#[test]
fn panoramas_become_shards() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::create_dir(at.join("maps")).unwrap();
    let map = Image::from_fn(64, 32, |x, y| pixel_direction(x, y, 64, 32).to_array().map(|v| 1.2 + v));
    for name in ["hall", "attic"] {
        imaging::write_radiance(at.join("maps").join(format!("{name}.hdr")), &map, &ExrOptions::default()).unwrap();
    }
    done(at, &["dataset", "convert", "maps", "--crops", "3", "--samples-per-shard", "4", "-o", "shards"]);
    assert!(at.join("shards/samples-000001.tar").exists() && !at.join("shards/samples-000002.tar").exists());
    let found = json(&done(at, &["dataset", "inspect", "shards", "--json", "--samples", "4"]));
    assert_eq!(found["samples_in_all"].as_u64(), Some(6));
    assert_eq!((found["summary"]["samples"].as_u64(), found["summary"]["views"].as_u64()), (Some(4), Some(4)));
    done(at, &["dataset", "inspect", "maps", "--layout", "panoramas"]);
}

#[test]
fn what_cannot_be_done_is_said_with_the_right_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    refused(at, 2, &["synth", "-o", "rooms"]);
    refused(at, 2, &["synth", "--scenes", "1", "--shard", "3/2", "-o", "rooms"]);
    std::fs::write(at.join("bad.json"), r#"{"shots": 0}"#).unwrap();
    let message = refused(at, 2, &["synth", "--scenes", "1", "--config", "bad.json", "-o", "rooms"]);
    assert_eq!(message, "error: bad.json: shots is 0; it must lie in 1 to 64\n");
    std::fs::write(at.join("bad.json"), r#"{"shot": 1}"#).unwrap();
    let message = refused(at, 2, &["synth", "--scenes", "1", "--config", "bad.json", "-o", "rooms"]);
    assert!(message.starts_with("error: bad.json: unknown field `shot`"), "{message}");
    let config = json(&done(at, &["synth", "--print-config", "--octree-depth", "8"]));
    assert_eq!((config["shots"].as_u64(), config["octree_depth"].as_u64()), (Some(6), Some(8)));

    let message = refused(at, 1, &["dataset", "inspect", "."]);
    assert!(message.contains("none of the layouts that are known"), "{message}");
    std::fs::write(at.join("broken.tar"), [7; 2000]).unwrap();
    let message = refused(at, 1, &["dataset", "inspect", "broken.tar"]);
    assert!(message.starts_with("error: broken.tar: no tar archive, or a damaged one"), "{message}");
    refused(at, 2, &["dataset", "preview", "broken.tar", "-o", "sheet.gif"]);
    std::fs::create_dir(at.join("full")).unwrap();
    std::fs::write(at.join("full/letter.txt"), "dear").unwrap();
    refused(at, 2, &["synth", "--scenes", "1", "-o", "full"]);
}
