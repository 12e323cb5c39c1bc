//! `train` as a user runs it, and as a machine that fails ends it.
#![allow(clippy::unwrap_used, missing_docs)]

mod support;

use std::path::Path;
use std::time::Duration;

use support::{done, json, refused};

/// Every stage, two steps each, on small rooms; a checkpoint after each step.
const SMALL: &str = "
checkpoint_minutes = 0.0
[data.generator]
shots = 1
panoramas = 1
panorama_height = 16
octree_depth = 5
[data.generator.room]
crop_size = [64, 48]
[network]
depth = 5
full_depth = 3
channels = 8
max_channels = 16
blocks = 1
bottleneck = 2
head_channels = 8
global_features = 8
[validation]
photos = 0
[[depth]]
steps = 2
batch_size = 1
photo_width = 32
[[light]]
steps = 2
octree_depth = 5
[[joint]]
steps = 2
octree_depth = 5
";

fn total_steps(folder: &Path) -> Option<u64> {
    let bytes = std::fs::read(folder.join("checkpoint.safetensors")).ok()?;
    let length = u64::from_le_bytes(bytes.get(..8)?.try_into().ok()?) as usize;
    let header: serde_json::Value = serde_json::from_slice(bytes.get(8..8 + length)?).ok()?;
    let state: serde_json::Value = serde_json::from_str(header["__metadata__"]["checkpoint"].as_str()?).ok()?;
    state["state"]["training"]["total_steps"].as_u64()
}

#[test]
fn a_killed_run_goes_on_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("small.toml"), SMALL).unwrap();
    let begin = ["train", "--config", "small.toml", "--seed", "3", "--threads", "1", "-o"];
    let summary = json(&done(at, &[&begin[..], &["whole", "--json"]].concat()));
    assert_eq!((summary["done"].as_bool(), summary["steps"].as_u64()), (Some(true), Some(6)));

    let mut killed = std::process::Command::new(assert_cmd::cargo::cargo_bin("lightoctree"))
        .current_dir(at)
        .args(["--quiet"])
        .args(begin)
        .arg("parts")
        .spawn()
        .unwrap();
    while total_steps(&at.join("parts")).is_none_or(|steps| steps < 3) {
        assert!(killed.try_wait().unwrap().is_none(), "it ended before three steps were made");
        std::thread::sleep(Duration::from_millis(2));
    }
    // SIGKILL
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(total_steps(&at.join("parts")).unwrap() < 6);
    let message = refused(at, 2, &[&begin[..], &["parts"]].concat());
    assert!(message.contains("parts holds a run: go on with --resume"), "{message}");
    done(at, &["train", "--resume", "--threads", "1", "-o", "parts"]);
    let read = |folder: &str, file: &str| std::fs::read(at.join(folder).join(file)).unwrap();
    for file in ["weights.safetensors", "config.toml"] {
        assert!(read("whole", file) == read("parts", file), "{file} differs");
    }
}

#[test]
fn configurations_are_printed_and_checked() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let config = done(at, &["train", "--print-config", "--data", "rooms"]);
    assert!(config.contains("[[light]]") && config.contains("folder = \"rooms\""), "{config}");
    std::fs::write(at.join("all.toml"), &config).unwrap();
    assert_eq!(done(at, &["train", "--print-config", "--config", "all.toml"]), config);
    std::fs::write(at.join("bad.toml"), "[[light]]\nsensor_share = 2.0").unwrap();
    let message = refused(at, 2, &["train", "--config", "bad.toml", "-o", "run"]);
    assert_eq!(message, "error: bad.toml: light: sensor_share is 2; it must lie in 0 to 1\n");
    let message = refused(at, 2, &["train", "--resume", "-o", "run"]);
    assert_eq!(message, "error: run holds no checkpoint.safetensors to go on from\n");
    let message = refused(at, 1, &["train", "--data", "nowhere", "-o", "run"]);
    assert!(message.contains("nowhere"), "{message}");
}
