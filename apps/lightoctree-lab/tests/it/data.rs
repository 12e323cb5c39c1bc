//! `synth` and `dataset` on the command line.

use std::path::Path;
use std::time::{Duration, SystemTime};

use lo_geometry::pixel_direction;
use lo_imaging as imaging;
use lo_imaging::{ExrOptions, Image};

use crate::support::{done, json, refused};

/// Rooms with two small photos, few points and coarse light: about a second per room.
const SMALL: &str = "shots = 2\npanoramas = 2\npanorama_height = 16\noctree_depth = 5\n[room]\ncrop_size = [48, 32]\n[light]\nspacing_m = 0.5\ngather_rays = 16\nlight_rays = 4\n";

#[test]
fn synth_is_resumable_and_the_same_however_it_is_split() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("small.toml"), SMALL).unwrap();
    let common = ["synth", "--scenes", "3", "--scenes-per-shard", "1", "--config", "small.toml", "--seed", "4"];
    let run = |more: &[&str]| done(at, &[&common[..], more].concat());
    let summary = json(&run(&["-o", "whole", "--threads", "1", "--json"]));
    assert_eq!((summary["shards_written"].as_u64(), summary["shards_there"].as_u64()), (Some(3), Some(3)));
    // In two parts, with other numbers of threads.
    run(&["-o", "parts", "--shard", "2/2", "--threads", "2"]);
    assert!(!at.join("parts/rooms-000000.tar").exists() && at.join("parts/rooms-000001.tar").exists());
    run(&["-o", "parts", "--shard", "1/2", "--threads", "3"]);
    for shard in ["rooms-000000.tar", "rooms-000001.tar", "rooms-000002.tar", "manifest.json"] {
        let read = |folder: &str| std::fs::read(at.join(folder).join(shard)).unwrap();
        assert!(read("whole") == read("parts"), "{shard} differs");
    }
    // Existing shards are kept, missing ones are generated.
    let first = at.join("whole/rooms-000000.tar");
    let written = std::fs::metadata(&first).unwrap().modified().unwrap();
    std::fs::remove_file(at.join("whole/rooms-000002.tar")).unwrap();
    let summary = json(&run(&["-o", "whole", "--json"]));
    assert_eq!((summary["shards_written"].as_u64(), summary["shards_there"].as_u64()), (Some(1), Some(3)));
    assert_eq!(std::fs::metadata(&first).unwrap().modified().unwrap(), written);
    let other =
        refused(at, 2, &["synth", "--scenes", "3", "--scenes-per-shard", "1", "--config", "small.toml", "-o", "whole"]);
    assert_eq!(
        other,
        "error: whole was created with other settings (seed differs); repeat that command, or choose another folder\n"
    );

    // With more rooms, the first shards are kept.
    std::fs::create_dir(at.join("grown")).unwrap();
    let text = std::fs::read_to_string(at.join("whole/manifest.json")).unwrap();
    std::fs::write(at.join("grown/manifest.json"), text.replace("\"scenes\": 3", "\"scenes\": 2")).unwrap();
    for shard in ["rooms-000000.tar", "rooms-000001.tar"] {
        std::fs::copy(at.join("whole").join(shard), at.join("grown").join(shard)).unwrap();
    }
    let summary = json(&run(&["-o", "grown", "--json"]));
    assert_eq!((summary["shards_written"].as_u64(), summary["shards_there"].as_u64()), (Some(1), Some(3)));
    for file in ["rooms-000002.tar", "manifest.json"] {
        let read = |folder: &str| std::fs::read(at.join(folder).join(file)).unwrap();
        assert!(read("whole") == read("grown"), "{file} differs");
    }
    let fewer = refused(at, 2, &[&common[..2], &["2"], &common[3..], &["-o", "grown"]].concat());
    assert_eq!(
        fewer,
        "error: grown was created with other settings (scenes differs); repeat that command, or choose another folder\n"
    );

    // One part of the data: of these three rooms, the second is held out.
    let summary = json(&run(&["-o", "held-out", "--split", "validation", "--json"]));
    assert_eq!((summary["shards_written"].as_u64(), summary["shards_there"].as_u64()), (Some(1), Some(1)));
    let [held_out, second] =
        ["held-out/rooms-000000.tar", "whole/rooms-000001.tar"].map(|shard| std::fs::read(at.join(shard)).unwrap());
    assert!(held_out == second, "the same room as among all");
    let none = refused(at, 2, &["synth", "--scenes", "1", "--seed", "4", "--split", "validation", "-o", "none"]);
    assert_eq!(none, "error: none of the 1 rooms is in the selected part; see --split\n");

    let found = json(&done(at, &["dataset", "inspect", "whole", "--json"]));
    assert_eq!((found["layout"].as_str(), found["samples_in_all"].as_u64()), (Some("shards"), Some(6)));
    assert_eq!((found["summary"]["scenes"].as_u64(), found["summary"]["samples"].as_u64()), (Some(3), Some(6)));
    let text = done(at, &["dataset", "inspect", "whole"]);
    assert!(text.contains("train") && text.contains("lamps switched on") && text.contains("depth, m"), "{text}");
    done(
        at,
        &["dataset", "preview", "whole", "--photos", "6", "--panoramas", "3", "--columns", "3", "-o", "sheet.png"],
    );
    let sheet = imaging::read_photo(at.join("sheet.png")).unwrap().photo;
    // Two rows of photos and one of panoramas.
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

    // A damaged file is named; all others are inspected.
    let whole = std::fs::read(at.join("maps/attic.hdr")).unwrap();
    std::fs::write(at.join("maps/attic.hdr"), &whole[..whole.len() / 2]).unwrap();
    let message = refused(at, 1, &["dataset", "inspect", "maps", "--layout", "panoramas", "--crops", "1"]);
    assert!(message.contains("attic.hdr") && message.contains("error: 1 of 2 samples cannot be read"), "{message}");
}

/// Writes six small panoramas of different brightness.
fn maps(folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    for i in 0..6 {
        let level = 1.2 + 0.3 * i as f32;
        let map = Image::from_fn(64, 32, |x, y| pixel_direction(x, y, 64, 32).to_array().map(|v| level + v));
        imaging::write_radiance(folder.join(format!("room{i}.hdr")), &map, &ExrOptions::default()).unwrap();
    }
}

/// Returns all finished shards of a folder: name, modification time, contents.
fn shards(folder: &Path) -> Vec<(String, SystemTime, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path());
    let mut found: Vec<_> = entries
        .filter(|path| path.extension().is_some_and(|extension| extension == "tar"))
        .map(|path| {
            let changed = std::fs::metadata(&path).unwrap().modified().unwrap();
            (path.file_name().unwrap().to_str().unwrap().to_owned(), changed, std::fs::read(&path).unwrap())
        })
        .collect();
    found.sort();
    found
}

#[test]
fn a_conversion_that_was_killed_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    maps(&at.join("maps"));
    let convert = ["dataset", "convert", "maps", "--crops", "10", "--samples-per-shard", "2", "-o"];
    let run = |to: &str, threads: &str| done(at, &[&convert[..], &[to, "--threads", threads]].concat());
    run("whole", "2");
    let whole = shards(&at.join("whole"));
    assert_eq!(whole.len(), 30);

    let mut killed = std::process::Command::new(assert_cmd::cargo::cargo_bin("lightoctree-lab"))
        .current_dir(at)
        .args(["--quiet", "--threads", "1"])
        .args(convert)
        .arg("parts")
        .spawn()
        .unwrap();
    while shards(&at.join("parts")).len() < 2 {
        assert!(killed.try_wait().unwrap().is_none(), "the conversion ended before two shards were written");
        std::thread::sleep(Duration::from_millis(1));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    let kept = shards(&at.join("parts"));
    assert!((2..30).contains(&kept.len()), "{} shards were finished", kept.len());
    // Also remove a finished shard, like a lost file.
    std::fs::remove_file(at.join("parts").join(&kept[0].0)).unwrap();

    run("parts", "3");
    let parts = shards(&at.join("parts"));
    assert!(parts.iter().map(|(name, _, bytes)| (name, bytes)).eq(whole.iter().map(|(name, _, bytes)| (name, bytes))));
    for (finished, now) in kept.iter().zip(&parts).skip(1) {
        assert_eq!(finished.1, now.1, "{} was written again", now.0);
    }

    // Another dataset is refused, or replaces the shards with --force.
    std::fs::remove_file(at.join("maps/room0.hdr")).unwrap();
    std::fs::copy(at.join("maps/room1.hdr"), at.join("maps/room9.hdr")).unwrap();
    let message = refused(at, 2, &[&convert[..], &["parts"]].concat());
    assert!(message.starts_with("error: parts was created with other settings (scene_ids_fnv1a differs)"), "{message}");
    done(at, &[&convert[..], &["parts", "--force"]].concat());
    assert!(shards(&at.join("parts")).iter().zip(&whole).all(|(new, old)| new.0 == old.0 && new.2 != old.2));
}

#[test]
fn what_cannot_be_done_is_said_with_the_right_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    refused(at, 2, &["synth", "-o", "rooms"]);
    refused(at, 2, &["synth", "--scenes", "1", "--shard", "3/2", "-o", "rooms"]);
    std::fs::write(at.join("bad.toml"), "shots = 0").unwrap();
    let message = refused(at, 2, &["synth", "--scenes", "1", "--config", "bad.toml", "-o", "rooms"]);
    assert_eq!(message, "error: bad.toml: shots is 0; it must be between 1 and 64\n");
    std::fs::write(at.join("bad.toml"), "octree_depth = 6\nshot = 1").unwrap();
    let message = refused(at, 2, &["synth", "--scenes", "1", "--config", "bad.toml", "-o", "rooms"]);
    assert!(message.starts_with("error: bad.toml: line 2 (shot = 1): unknown field `shot`"), "{message}");
    let config = done(at, &["synth", "--print-config", "--octree-depth", "8"]);
    assert!(["shots = 6", "octree_depth = 8"].iter().all(|line| config.lines().any(|l| l == *line)), "{config}");
    std::fs::write(at.join("all.toml"), &config).unwrap();
    assert_eq!(done(at, &["synth", "--print-config", "--config", "all.toml"]), config);

    let message = refused(at, 1, &["dataset", "inspect", "."]);
    assert!(message.contains("unknown dataset layout"), "{message}");
    std::fs::write(at.join("broken.tar"), [7; 2000]).unwrap();
    let message = refused(at, 1, &["dataset", "inspect", "broken.tar"]);
    assert!(message.starts_with("error: broken.tar: not a tar archive, or damaged"), "{message}");
    refused(at, 2, &["dataset", "preview", "broken.tar", "-o", "sheet.gif"]);
    std::fs::create_dir(at.join("full")).unwrap();
    std::fs::write(at.join("full/letter.txt"), "dear").unwrap();
    refused(at, 2, &["synth", "--scenes", "1", "-o", "full"]);
}
