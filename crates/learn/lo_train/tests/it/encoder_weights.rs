//! Runs that start from published encoder weights.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use burn::tensor::{Tensor, TensorData};
use lo_events::Event;
use lo_nets::checkpoint::{Checkpoint, Precision};
use lo_nets::depth::{Encoder, EncoderKind};
use lo_nets::{Device, Networks};
use lo_train::{
    CHECKPOINT_FILE, EncoderOrigin, InitialWeights, TrainConfig, TrainError, TrainRequest, TrainingWarning,
    read_encoder, train,
};
use safetensors::SafeTensors;

use crate::run::config;

/// Output of `make_efficientnet.py` of `lo_nets`: names and shapes of the published weights, and their features of a
/// real photo.
const GOLDEN: &[u8] = include_bytes!("../../../lo_nets/tests/it/golden/efficientnet.safetensors");

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/golden").join(name)
}

#[test]
fn every_kind_of_file_is_read() {
    for (name, sha256) in [
        ("zip.pth", "e773150688a4dbb269df075bc80a08695baa4641dd6e2daf7b1847395a2b879d"),
        ("legacy.pth", "9719b2dc0355078cef3dd8c1a1cb91642b2f521dd9ade3fdf601f90c8da63c37"),
    ] {
        let (weights, origin) = read_encoder(&golden(name), EncoderKind::EfficientNetLite0).unwrap();
        assert_eq!(origin, EncoderOrigin { file: name.to_owned(), sha256: sha256.to_owned() });
        assert!(!origin.is_published(EncoderKind::EfficientNetLite0));
        let shapes: Vec<(&str, &[usize])> = weights.shapes().collect();
        assert_eq!(shapes, [("conv.weight", &[2, 3][..]), ("norm.bias", &[2]), ("turned.weight", &[3, 2])]);
        assert_eq!(weights.values("conv.weight").unwrap(), [0.0, 0.25, 0.5, 0.75, 1.0, 1.25]);
        assert_eq!(weights.values("norm.bias").unwrap(), [-1.5, 2.0]);
        assert_eq!(weights.values("turned.weight").unwrap(), [0.0, 3.0, 1.0, 4.0, 2.0, 5.0]);
    }
}

#[test]
fn what_is_no_encoder_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let named = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let message = |path: &Path| match read_encoder(path, EncoderKind::EfficientNetLite0) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("{} was read", path.display()),
    };
    assert!(message(&folder.path().join("none.pth")).contains("none.pth: No such file"));
    assert!(message(&named("text.pth", b"weights")).contains("text.pth: "));
    assert!(message(&named("text.safetensors", b"weights")).contains("shorter than eight bytes"));
    let whole = std::fs::read(golden("zip.pth")).unwrap();
    let cut = message(&named("cut.pth", &whole[..whole.len() / 2]));
    assert!(cut.contains("cut.pth: "), "{cut}");
    assert!(message(&golden("half.pth")).contains("tensor \"conv.weight\": its data type is F16"));
    let published = message(&named("efficientnet-lite0-57934424.pth", &whole));
    assert!(published.contains("not the published file: its SHA-256 is") && published.contains("57934424"));
}

/// Returns weights with the names and shapes of EfficientNet-Lite0; each tensor is filled with its own number.
fn numbered() -> Checkpoint {
    let (_, header) = SafeTensors::read_metadata(GOLDEN).unwrap();
    let shapes: BTreeMap<String, BTreeMap<String, Vec<usize>>> =
        serde_json::from_str(&header.metadata().as_ref().unwrap()["shapes"]).unwrap();
    let mut weights = Checkpoint::default();
    for (i, (name, shape)) in shapes["efficientnet-lite0"].iter().enumerate() {
        weights.insert(name, shape, vec![i as f32; shape.iter().product()]);
    }
    weights
}

#[test]
fn a_run_begins_with_them_and_says_whose_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("converted.safetensors");
    let weights = numbered();
    weights.write(&file, Precision::Full).unwrap();
    let config = TrainConfig { encoder: EncoderKind::EfficientNetLite0, ..config() };
    let request = TrainRequest { folder: folder.path(), resume: false, seed: 5, start: InitialWeights::Encoder(&file) };
    let mut warnings = Vec::new();
    let ended = train(&config, &request, &mut |event: Event| {
        warnings.extend(event.warning().cloned());
        ControlFlow::Break(())
    });
    assert!(matches!(ended, Err(TrainError::Cancelled(_))));
    let [TrainingWarning::UnpublishedEncoder { file: named, sha256 }] = &warnings[..] else { panic!("{warnings:?}") };
    let checkpoint = Checkpoint::read(folder.path().join(CHECKPOINT_FILE)).unwrap();
    let origin = &checkpoint.state["training"]["encoder_origin"];
    assert_eq!((&origin["file"], &origin["sha256"]), (&named.as_str().into(), &sha256.as_str().into()));
    for (ours, theirs) in [
        ("stem.norm.running_var", "_bn0.running_var"),
        ("first.depthwise.conv.weight", "_blocks.0._depthwise_conv.weight"),
        ("blocks.14.reduce.project.norm.gamma", "_blocks.15._bn2.weight"),
    ] {
        let theirs = weights.values(theirs);
        assert_eq!(checkpoint.values(&format!("depth_net.encoder.{ours}")), theirs);
        assert_eq!(checkpoint.values(&format!("training.depth_net.encoder.{ours}")), theirs);
    }
    let networks = Networks::from_checkpoint(checkpoint, &Device::flex()).unwrap();
    assert_eq!(networks.depth.encoder_kind(), EncoderKind::EfficientNetLite0);

    // Weights of a different encoder than configured.
    let other = TrainConfig { encoder: EncoderKind::EfficientNetLite2, ..config.clone() };
    let error = train(&other, &request, &mut |_| ControlFlow::Break(())).unwrap_err().to_string();
    assert!(error.contains("the weights of \"EfficientNet-Lite\" do not match the network: "), "{error}");
    let other = TrainConfig { encoder: EncoderKind::DenseNet121, ..config };
    let error = train(&other, &request, &mut |_| ControlFlow::Break(())).unwrap_err().to_string();
    assert!(error.contains("\"DenseNet-121\"") && error.contains("\"features.conv0.weight\" is missing"), "{error}");
}

#[test]
#[ignore = "needs the published files: LIGHTOCTREE_ENCODERS=… cargo test -p lo_train --test it -- --ignored published_features"]
fn published_features_of_a_real_photo_are_the_packages() {
    let folder =
        std::env::var_os("LIGHTOCTREE_ENCODERS").expect("LIGHTOCTREE_ENCODERS names the folder with the files");
    let golden = SafeTensors::deserialize(GOLDEN).unwrap();
    let photo = golden.tensor("photo").unwrap();
    let [1, 3, height, width] = *photo.shape() else { panic!("a photo") };
    for encoder in [EncoderKind::EfficientNetLite0, EncoderKind::EfficientNetLite2] {
        let path = Path::new(&folder).join(lo_train::published(encoder).0);
        let (weights, origin) = read_encoder(&path, encoder).unwrap();
        assert!(origin.is_published(encoder));
        let net: Encoder = encoder.init(&mut lo_random::stream(1, "test", 0), &Device::flex());
        let [[mean, ..], [deviation, ..]] = encoder.normalisation();
        let values = photo.data().iter().map(|&v| (f32::from(v) / 255.0 - mean) / deviation).collect();
        let x = Tensor::from_data(TensorData::new::<f32, _>(values, [3, 1, height, width]), &Device::flex());
        for (i, got) in net.load_published(&weights).unwrap().forward(x).into_iter().enumerate() {
            let expected = golden.tensor(&format!("{encoder}.photo.{i}")).unwrap();
            let expected = expected.data().as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b));
            let got: Vec<f32> = got.into_data().iter().collect();
            let stride = (got.len() / 1000).max(1);
            assert_eq!(got.len().div_ceil(stride), expected.len());
            let largest = expected.clone().fold(0.0f32, |a, b| a.max(b.abs()));
            let error = got.iter().step_by(stride).zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            println!("{encoder}, features at 1/{}: {error:.1e} of {largest:.1}", 2 << i);
            assert!(error <= 1e-4 * largest);
        }
    }
}
