//! Averaging, merging, splitting, joining and inspecting weights files.

use std::path::{Path, PathBuf};

use lo_nets::checkpoint::{Checkpoint, Precision};
use lo_nets::depth::EncoderKind;
use lo_nets::expected::ExpectedLightNet;
use lo_nets::light::LightNetConfig;
use lo_nets::{Device, Networks};
use lo_train::weight_files::{average, inspect, join, merge, split};

fn config() -> LightNetConfig {
    let small =
        LightNetConfig { depth: 4, full_depth: 3, channels: 8, max_channels: 16, blocks: 1, ..Default::default() };
    LightNetConfig { bottleneck: 2, head_channels: 8, global_features: 8, ..small }
}

/// Writes a file of untrained networks.
fn networks(folder: &Path, seed: u64, config: &LightNetConfig) -> PathBuf {
    let path = folder.join(format!("{seed}.safetensors"));
    let mut networks = Networks::new(EncoderKind::default(), config, seed, &Device::flex()).unwrap();
    networks.expected = Some(ExpectedLightNet::new(seed, &Device::flex()));
    networks.write(&path, Precision::Half).unwrap();
    path
}

#[test]
fn the_average_is_the_mean_to_half_precision() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (networks(folder.path(), 1, &config()), networks(folder.path(), 2, &config()));
    let to = folder.path().join("mean.safetensors");
    average(&[a.clone(), a.clone()], &to).unwrap();
    assert!(std::fs::read(&to).unwrap() == std::fs::read(&a).unwrap(), "the average of a file with itself is the file");

    average(&[a.clone(), b.clone()], &to).unwrap();
    let [a, b, mean] = [&a, &b, &to].map(|path| Checkpoint::read(path).unwrap());
    let mut differ = 0;
    for (name, _) in a.shapes() {
        let [a, b, mean] = [&a, &b, &mean].map(|file| file.values(name).unwrap());
        for ((a, b), mean) in a.iter().zip(b).zip(mean) {
            let expected = (a + b) / 2.0;
            // Half precision has 11 bits of mantissa; below 2⁻¹⁴, the smallest step counts.
            assert!((mean - expected).abs() <= (expected.abs() / 2048.0).max(3e-8), "{name}: {a} {b} {mean}");
            differ += usize::from(a != b);
        }
    }
    assert!(differ > 1000, "{differ} weights differ");
}

#[test]
fn merging_takes_the_named_parts() {
    let folder = tempfile::tempdir().unwrap();
    let (a, b) = (networks(folder.path(), 1, &config()), networks(folder.path(), 2, &config()));
    let to = folder.path().join("merged.safetensors");
    merge(&a, &b, &to).unwrap();
    let [first, second, merged] = [&a, &b, &to].map(|path| Checkpoint::read(path).unwrap());
    for (name, _) in merged.shapes() {
        let from = if name.starts_with("depth_net.") { &first } else { &second };
        assert!(merged.values(name) == from.values(name), "{name}");
    }
    assert!(merged.shapes().eq(first.shapes()), "all tensors are there");
    assert!(merged.has("expected_light.output.weights"));
    assert_eq!(merged.state, second.state);

    // A light network without expected light keeps that of the file with the depth network.
    let older = folder.path().join("older.safetensors");
    Networks { expected: None, ..Networks::read(&b).unwrap() }.write(&older, Precision::Half).unwrap();
    merge(&a, &older, &to).unwrap();
    let merged = Checkpoint::read(&to).unwrap();
    assert!(merged.values("expected_light.output.weights") == first.values("expected_light.output.weights"));
}

#[test]
fn joined_parts_are_the_file_that_was_split() {
    let folder = tempfile::tempdir().unwrap();
    let whole = networks(folder.path(), 1, &config());
    let [encoder, heads, to] =
        ["encoder", "heads", "joined"].map(|name| folder.path().join(name).with_extension("safetensors"));
    split(&whole, &encoder, &heads).unwrap();
    let [first, second] = [&encoder, &heads].map(|path| Checkpoint::read(path).unwrap());
    assert!(first.shapes().all(|(name, _)| name.starts_with("depth_net.encoder.")));
    assert!(second.has("expected_light.output.weights") && second.values_of("depth_net.encoder") == 0);
    join(&[encoder.clone(), heads.clone()], &to).unwrap();
    assert!(std::fs::read(&to).unwrap() == std::fs::read(&whole).unwrap());

    let error = join(&[heads], &to).unwrap_err().to_string();
    assert!(error.contains("\"depth_net.encoder.") && error.contains("is missing"), "{error}");
    let error = join(&[whole, encoder], &to).unwrap_err().to_string();
    assert!(error.contains("two parts of the weights have the tensor \"depth_net.encoder."), "{error}");
}

#[test]
fn networks_that_differ_are_refused_by_the_tensors_name() {
    let folder = tempfile::tempdir().unwrap();
    let a = networks(folder.path(), 1, &config());
    let to = folder.path().join("to.safetensors");
    let wide = networks(folder.path(), 3, &LightNetConfig { global_features: 16, ..config() });
    let error = average(&[a.clone(), wide.clone()], &to).unwrap_err().to_string();
    assert!(error.starts_with("tensor \"depth_net.global."), "{error}");
    let error = merge(&a, &wide, &to).unwrap_err().to_string();
    assert!(error.contains("depth_net") && error.contains("global"), "{error}");
    let deep = networks(folder.path(), 4, &LightNetConfig { depth: 5, channels: 8, ..config() });
    let error = average(&[a, deep], &to).unwrap_err().to_string();
    assert!(error.contains("\"light_net."), "{error}");
    assert!(!to.exists());
}

#[test]
fn a_file_is_known_by_its_hash_and_its_networks() {
    let folder = tempfile::tempdir().unwrap();
    let path = networks(folder.path(), 1, &config());
    let found = inspect(&path).unwrap();
    assert_eq!((found.bytes, &found.light_net), (path.metadata().unwrap().len(), &config()));
    assert_eq!(found.light_net_values, config().weights());
    let other = inspect(&networks(folder.path(), 2, &config())).unwrap();
    assert!(found.sha256.len() == 64 && found.sha256 != other.sha256);
    std::fs::write(&path, b"abc").unwrap();
    assert!(inspect(&path).unwrap_err().to_string().contains("not a .safetensors file"));
}
