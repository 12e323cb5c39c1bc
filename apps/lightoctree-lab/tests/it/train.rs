//! `train` on the command line, including a killed process.

use std::path::Path;
use std::time::Duration;

use crate::support::{done, json, refused};

/// Three stages of two steps each on small rooms, with a checkpoint after each step.
const SMALL: &str = r#"
checkpoint_minutes = 0.0
encoder = "efficientnet-lite0"
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
"#;

const ROOMS: &str = "
shots = 1
panoramas = 1
panorama_height = 16
octree_depth = 5
[room]
crop_size = [64, 48]
[light]
spacing_m = 0.5
gather_rays = 16
light_rays = 4
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
    std::fs::write(at.join("rooms.toml"), ROOMS).unwrap();
    done(at, &["synth", "--scenes", "2", "--split", "train", "--config", "rooms.toml", "-o", "rooms"]);
    let begin = ["train", "--config", "small.toml", "--data", "rooms", "--seed", "3", "--threads", "1", "-o"];
    let summary = json(&done(at, &[&begin[..], &["whole", "--json"]].concat()));
    assert_eq!((summary["done"].as_bool(), summary["steps"].as_u64()), (Some(true), Some(6)));

    let mut killed = std::process::Command::new(assert_cmd::cargo::cargo_bin("lightoctree-lab"))
        .current_dir(at)
        .args(["--quiet"])
        .args(begin)
        .arg("parts")
        .spawn()
        .unwrap();
    while total_steps(&at.join("parts")).is_none_or(|steps| steps < 3) {
        assert!(killed.try_wait().unwrap().is_none(), "training ended before three steps were done");
        std::thread::sleep(Duration::from_millis(2));
    }
    // SIGKILL
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(total_steps(&at.join("parts")).unwrap() < 6);
    let message = refused(at, 2, &[&begin[..], &["parts"]].concat());
    assert!(message.contains("parts contains a run: continue it with --resume"), "{message}");
    done(at, &["train", "--resume", "--threads", "1", "-o", "parts"]);
    let read = |folder: &str, file: &str| std::fs::read(at.join(folder).join(file)).unwrap();
    for file in ["weights.safetensors", "config.toml"] {
        assert!(read("whole", file) == read("parts", file), "{file} differs");
    }
}

/// Validation in training reports the same figures as `eval` for the exported weights.
#[test]
fn training_validates_what_evaluation_reports() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Of the two rooms, the second is held out.
    std::fs::write(at.join("rooms.toml"), ROOMS).unwrap();
    done(at, &["synth", "--scenes", "2", "--config", "rooms.toml", "--seed", "4", "-o", "rooms"]);
    std::fs::write(at.join("small.toml"), SMALL.replace("photos = 0", "photos = 1")).unwrap();
    let trained = json(&done(at, &["train", "--config", "small.toml", "--data", "rooms", "-o", "run", "--json"]));
    let methods = ["--weights", "run/weights.safetensors", "--methods", "shell-true,network-true,network"];
    let evaluated = json(&done(at, &[&["eval", "rooms", "--json", "-o", "report"][..], &methods].concat()));
    let pairs = [
        ("shell_psnr_db", 0, "psnr_db"),
        ("psnr_db", 1, "psnr_db"),
        ("photo_alone_psnr_db", 2, "psnr_db"),
        ("depth_abs_rel", 2, "depth_abs_rel"),
        ("depth_delta1", 2, "depth_delta1"),
    ];
    for (validation, method, evaluation) in pairs {
        let validated = trained["validation"][validation].as_f64().unwrap();
        let reported = evaluated["methods"][method]["figures"][evaluation]["mean"].as_f64().unwrap();
        assert!((validated - reported).abs() < 1e-3, "{validation}: {validated} in training, {reported} in evaluation");
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
    let set = done(at, &["train", "--print-config", "--config", "all.toml", "--set", "light.0.steps=7"]);
    assert!(set.contains("steps = 7\n") && !config.contains("steps = 7\n"), "{set}");
    let message = refused(at, 2, &["train", "--print-config", "--set", "light.0.stops=7"]);
    assert!(message.starts_with("error: --set light.0.stops=7: unknown field `stops`"), "{message}");
    std::fs::write(at.join("bad.toml"), "[[light]]\nsensor_share = 2.0").unwrap();
    let message = refused(at, 2, &["train", "--config", "bad.toml", "-o", "run"]);
    assert_eq!(message, "error: bad.toml: light: sensor_share is 2; it must be between 0 and 1\n");
    let message = refused(at, 2, &["train", "--resume", "-o", "run"]);
    assert_eq!(message, "error: run has no checkpoint.safetensors to resume from\n");
    let message = refused(at, 1, &["train", "--data", "nowhere", "-o", "run"]);
    assert!(message.contains("nowhere"), "{message}");
}

#[test]
fn weights_are_averaged_merged_split_joined_and_inspected() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    crate::support::weights::write_weights(at);
    let of = |file: &str| json(&done(at, &["weights", "inspect", file, "--json"]));
    let first = of("weights.safetensors");
    assert_eq!(first["light_net"]["depth"], 6);
    done(at, &["weights", "average", "weights.safetensors", "weights.safetensors", "-o", "mean.safetensors"]);
    let both = ["--depth", "mean.safetensors", "--light", "weights.safetensors"];
    done(at, &[&["weights", "merge"], &both[..], &["-o", "merged.safetensors"]].concat());
    let parts = ["encoder.safetensors", "heads.safetensors"];
    let split = ["weights", "split", "merged.safetensors", "--encoder", parts[0], "--heads", parts[1]];
    done(at, &split);
    assert!(refused(at, 2, &split).contains("overwrite it with --force"));
    done(at, &["weights", "join", parts[0], parts[1], "-o", "joined.safetensors"]);
    for file in ["mean.safetensors", "merged.safetensors", "joined.safetensors"] {
        assert_eq!(of(file)["sha256"], first["sha256"], "{file}");
    }
    let text = done(at, &["weights", "inspect", "merged.safetensors"]);
    assert!(text.contains(first["sha256"].as_str().unwrap()) && text.contains("depth = 6"), "{text}");
    let message =
        refused(at, 2, &["weights", "average", "weights.safetensors", "mean.safetensors", "-o", "mean.safetensors"]);
    assert!(message.contains("overwrite it with --force"), "{message}");
}
