//! `estimate --depth-model` with models whose output is known, and with invalid models.
//! `crates/learn/lo_depth_models/tests/fixtures/README.md` describes the files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use lightoctree::{Document, Estimate};
use lo_imaging as imaging;
use lo_imaging::Image;
use tempfile::TempDir;

use crate::support::view::Viewer;
use crate::support::{done, json, refused};

fn fixture(name: &str) -> String {
    let path =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../crates/learn/lo_depth_models/tests/fixtures").join(name);
    path.to_string_lossy().into_owned()
}

/// Creates a folder with photo.png, 320 × 240, and two configs.
fn photo() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let photo = Image::from_fn(320, 240, |x, y| [(x / 2) as u8, (y / 2) as u8, 120]);
    imaging::write_srgb8(folder.path().join("photo.png"), &photo, 95, imaging::GENERATOR).unwrap();
    let size = "size = { rule = \"shorter-side\", pixels = 140, multiple = 14 }\n";
    std::fs::write(folder.path().join("metric.toml"), format!("kind = \"metric\"\n{size}")).unwrap();
    std::fs::write(folder.path().join("nhwc.toml"), format!("kind = \"metric\"\nlayout = \"nhwc\"\n{size}")).unwrap();
    folder
}

fn estimate<'a>(model: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["estimate", "photo.png", "--completion", "shell", "-o", "room.scene", "--force", "--depth-model", model], more]
        .concat()
}

/// Compares the scene's depth with `1 / inverse(u, v)`, where `u` and `v` range from 0 to 1 across the photo.
///
/// Over 95 % of the pixels must have a reading, and all readings must agree within a percent.
fn assert_plane(folder: &Path, inverse: impl Fn(f64, f64) -> f64) -> Arc<Estimate> {
    let scene = Document::read(folder.join("room.scene")).unwrap().estimate;
    let depth_m = &scene.frame.depth_m;
    let (width, height) = (depth_m.width(), depth_m.height());
    let mut read = 0;
    for (index, &z) in depth_m.pixels().iter().enumerate().filter(|(_, z)| **z > 0.0) {
        let (u, v) = (((index % width) as f64 + 0.5) / width as f64, ((index / width) as f64 + 0.5) / height as f64);
        let off = f64::from(z) * inverse(u, v) - 1.0;
        assert!(off.abs() < 0.01, "{off} at {u}, {v}");
        read += 1;
    }
    assert!(read as f64 > 0.95 * (width * height) as f64, "{read} of {width} × {height}");
    scene
}

/// Inverse depth of the plane in the fixtures.
fn plane(u: f64, v: f64) -> f64 {
    0.5 + 0.1 * u - 0.25 * v
}

#[test]
fn the_depth_of_a_model_is_in_the_scene() {
    let folder = photo();
    let folder = folder.path();
    for (model, more) in [
        ("plane_metric.onnx", &["--hfov-deg", "50", "--depth-model-config", "metric.toml"][..]),
        ("odd_nhwc.onnx", &["--hfov-deg", "50", "--depth-model-config", "nhwc.toml"]),
        ("odd_function.onnx", &["--hfov-deg", "50", "--depth-model-config", "metric.toml"]),
        ("plane_depth_anything_metric.onnx", &["--hfov-deg", "50"]),
    ] {
        done(folder, &estimate(&fixture(model), more));
        let scene = assert_plane(folder, plane);
        assert!((scene.frame.camera.hfov_deg() - 50.0).abs() < 1e-6);
        assert!(scene.origin.predicted_depth, "depth was predicted");
    }
    // Metric3D sees the photo in the middle of a wider image, and its depth scales with the focal length: 60° gives the
    // plane.
    done(folder, &estimate(&fixture("plane_metric3d.onnx"), &["--hfov-deg", "60"]));
    assert_plane(folder, |u, v| plane((121.0 + 821.0 * u) / 1064.0, v));
}

#[test]
fn a_model_sees_the_picture_between_black_bars() {
    const BAR: usize = 40;
    let folder = photo();
    let folder = folder.path();
    let picture = |x: usize, y: usize| [(x / 2) as u8 + 60, (y / 2) as u8 + 60, 120];
    let photo = Image::from_fn(320, 240 + 2 * BAR, |x, y| match y.checked_sub(BAR).filter(|y| *y < 240) {
        Some(y) => picture(x, y),
        None => [0; 3],
    });
    imaging::write_srgb8(folder.join("photo.png"), &photo, 95, imaging::GENERATOR).unwrap();
    for (model, more, hfov_deg) in [
        ("plane_metric.onnx", &["--hfov-deg", "50", "--depth-model-config", "metric.toml"][..], 50.0),
        ("plane_moge2.onnx", &[], 60.0),
    ] {
        done(folder, &estimate(&fixture(model), more));
        let scene = Document::read(folder.join("room.scene")).unwrap().estimate;
        // The camera is that of the whole photo, whose bars have no depth.
        let camera = scene.frame.camera;
        assert_eq!((camera.width, camera.height, camera.cy), (320, 320, 160.0), "{model}");
        assert!((camera.hfov_deg() - hfov_deg).abs() < 0.6, "{model}: {}", camera.hfov_deg());
        let depth_m = &scene.frame.depth_m;
        let (width, height) = (depth_m.width() as f64, depth_m.height() as f64);
        let mut read = 0;
        for y in 0..depth_m.height() {
            // Across the picture; in the bars it is outside 0 to 1.
            let v = ((y as f64 + 0.5) / height * 320.0 - BAR as f64) / 240.0;
            for x in 0..depth_m.width() {
                let z = f64::from(depth_m[(x, y)]);
                if z > 0.0 {
                    let off = z * plane((x as f64 + 0.5) / width, v) - 1.0;
                    assert!((0.0..1.0).contains(&v) && off.abs() < 0.01, "{model}: {z} at {x}, {y}");
                    read += 1;
                }
            }
        }
        assert!(f64::from(read) > 0.95 * 0.75 * width * height, "{model}: {read} of {width} × {height}");
    }
}

#[test]
fn the_lens_of_a_model_is_used_unless_one_is_given() {
    let folder = photo();
    let folder = folder.path();
    let model = fixture("plane_moge2.onnx");
    done(folder, &estimate(&model, &[]));
    let scene = assert_plane(folder, plane);
    // The fixture's field of view is 60°.
    assert!((scene.frame.camera.hfov_deg() - 60.0).abs() < 0.6, "{}", scene.frame.camera.hfov_deg());
    let summary = done(folder, &["inspect", "room.scene"]);
    assert!(summary.contains("MoGe-2 (plane_moge2.onnx)"), "{summary}");
    assert!(json(&done(folder, &["inspect", "room.scene", "--json"])).to_string().contains("plane_moge2.onnx"));
    done(folder, &estimate(&model, &["--hfov-deg", "60"]));
    assert!((assert_plane(folder, plane).frame.camera.hfov_deg() - 60.0).abs() < 1e-6);
}

#[test]
fn invalid_models_end_in_a_clear_error() {
    let folder = photo();
    let folder = folder.path();
    let metric = ["--depth-model-config", "metric.toml"];
    let unknown = refused(folder, 2, &estimate(&fixture("odd_unknown.onnx"), &[]));
    // Inputs and outputs with shapes, and a template of the config.
    for part in ["[1, 3, 224, 224]", "logits", "kind = \"metric\"", "--depth-model-config"] {
        assert!(unknown.contains(part), "{part} in {unknown}");
    }
    for (model, more, parts) in [
        ("odd_all_nan.onnx", &metric[..], &["depth", "not finite"][..]),
        ("odd_lost_data.onnx", &[], &["odd_lost_data.bin"]),
        ("odd_operator.onnx", &metric, &["Imagine"]),
        ("odd_rank_of_output.onnx", &metric, &["predicted_depth"]),
        ("moge2.onnx", &[], &["points"]),
        ("photo.safetensors", &[], &["photo.safetensors"]),
        ("no_such.onnx", &[], &["no_such.onnx"]),
    ] {
        let output = crate::support::run::program(folder).args(estimate(&fixture(model), more)).output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && !message.contains("panicked"), "{model}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{model}: {message}");
        println!("{model}: {message}");
    }
    std::fs::write(folder.join("typo.toml"), "kind = \"metres\"").unwrap();
    let typo = refused(folder, 1, &estimate(&fixture("plane_metric.onnx"), &["--depth-model-config", "typo.toml"]));
    assert!(typo.contains("typo.toml") && typo.contains("metres"), "{typo}");
}

#[test]
fn the_viewer_takes_depth_models() {
    let folder = photo();
    let folder = folder.path();
    let model = fixture("plane_moge2.onnx");
    assert!(refused(folder, 2, &["view", "--depth-model", &model]).contains("--depth-model"));
    let viewer = Viewer::start(folder, &[]);
    let mut page = viewer.page();
    let (hello, _) = page.receive("the greeting", |message| message["type"] == "hello");
    if hello["can_estimate"] != true {
        eprintln!("SKIPPED: photos in the viewer need the feature `weights`");
        return;
    }
    let read = |path: &str| std::fs::read(path).unwrap();
    let photo = std::fs::read(folder.join("photo.png")).unwrap();
    let open = |model: &str, config: Option<&str>| {
        assert_eq!(viewer.upload("depth-model", "model.onnx", &read(&fixture(model))).0, 204);
        if let Some(config) = config {
            assert_eq!(
                viewer.upload("depth-model-config", config, &std::fs::read(folder.join(config)).unwrap()).0,
                204
            );
        }
        assert_eq!(viewer.upload("photo", "photo.png", &photo).0, 204);
    };
    // An unknown model: the page shows a template of the config.
    open("odd_unknown.onnx", None);
    let (failed, _) = page.receive("why not", |message| message["type"] == "empty" && message["error"].is_string());
    let why = failed["error"].as_str().unwrap();
    assert!(["model.onnx", "logits", "kind = \"metric\"", "TOML"].iter().all(|part| why.contains(part)), "{why}");
    for (model, config, source) in
        [("plane_metric.onnx", Some("metric.toml"), "model.onnx"), ("plane_moge2.onnx", None, "model.onnx")]
    {
        open(model, config);
        let (scene, _) = page.receive("the scene", |message| message["type"] == "scene");
        assert_eq!(scene["predicted_depth"], true);
        let (status, bytes) = viewer.get("download/room.scene");
        assert_eq!(status, 200);
        std::fs::write(folder.join("room.scene"), bytes).unwrap();
        let scene = assert_plane(folder, plane);
        assert!(scene.origin.sources.contains(&source.to_owned()), "{:?}", scene.origin.sources);
    }
    let viewer = Viewer::start(folder, &["photo.png", "--depth-model", &model]);
    let (scene, _) = viewer.page().receive("the scene", |message| message["type"] == "scene");
    let across = scene["camera"]["width"].as_f64().unwrap() / (2.0 * scene["camera"]["fx"].as_f64().unwrap());
    // The fixture's field of view is 60°.
    assert!((2.0 * across.atan().to_degrees() - 60.0).abs() < 0.6, "{scene}");
}
