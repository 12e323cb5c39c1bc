//! Models with published graphs against onnxruntime's outputs, and models of a plane against the plane.
//! `fixtures/README.md` describes the files.

use std::collections::HashMap;
use std::path::PathBuf;

use lo_depth_models::{DepthModel, Geometry, ModelConfig, ModelError, OutputKind, Prediction, affine};
use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, Image};
use safetensors::SafeTensors;

/// Largest difference of two runtimes, as a share of an output's range: sums of thousands of f32 products in another
/// order, through a dozen layers.
const SHARE: f32 = 1e-3;

fn file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

/// Shape and values by name.
type Tensors = HashMap<String, (Vec<usize>, Vec<f32>)>;

/// Tensors of f32, and the metadata.
fn tensors(name: &str) -> (Tensors, HashMap<String, String>) {
    let bytes = std::fs::read(file(name)).unwrap();
    let (_, metadata) = SafeTensors::read_metadata(&bytes).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let numbers = |view: safetensors::tensor::TensorView<'_>| {
        let values = view.data().chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
        (view.shape().to_vec(), values)
    };
    (
        tensors.tensors().into_iter().map(|(name, view)| (name, numbers(view))).collect(),
        metadata.metadata().clone().unwrap_or_default(),
    )
}

/// The test photo of 160 × 120 at any size by nearest pixels, in integer arithmetic as in the fixtures' script.
fn photo(width: usize, height: usize) -> Image<[u8; 3]> {
    let bytes = std::fs::read(file("photo.safetensors")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let view = tensors.tensor("photo").unwrap();
    assert_eq!(view.shape(), [120, 160, 3]);
    Image::from_fn(width, height, |x, y| {
        let index = 3 * ((y * 120 / height) * 160 + x * 160 / width);
        view.data()[index..index + 3].try_into().unwrap()
    })
}

/// Channels first, normalised.
fn input(width: usize, height: usize, scale: f32, mean: [f32; 3], deviation: [f32; 3]) -> Vec<f32> {
    let photo = photo(width, height);
    let channel = |index: usize| {
        photo.pixels().iter().map(move |pixel| (f32::from(pixel[index]) * scale - mean[index]) / deviation[index])
    };
    (0..3).flat_map(channel).collect()
}

fn imagenet(width: usize, height: usize) -> Vec<f32> {
    input(width, height, 1.0 / 255.0, [0.485, 0.456, 0.406], [0.229, 0.224, 0.225])
}

/// Runs a fixture and returns the largest difference from its reference, as a share of an output's range.
fn difference(model: &str, reference: &str, config: &str, (width, height): (usize, usize), values: &[f32]) -> f32 {
    let config = (!config.is_empty()).then(|| ModelConfig::parse(config).unwrap());
    let model = DepthModel::read(file(model), config.as_ref()).unwrap();
    let outputs = model.raw(&[1, 3, height, width], values).unwrap();
    let (expected, metadata) = tensors(&format!("{reference}.{height}x{width}.safetensors"));
    let steps: HashMap<String, usize> = serde_json::from_str(&metadata["steps"]).unwrap();
    assert_eq!(outputs.len(), expected.len(), "as many outputs as onnxruntime has");
    let mut largest = 0.0f32;
    for (name, dims, values) in outputs {
        let (shape, expected) = &expected[&name];
        let made = strided(&dims, &values, (width, height), steps[&name]);
        assert_eq!((made.len(), dims.len()), (expected.len(), shape.len()), "{name}: {dims:?} and {shape:?}");
        let (low, high) =
            expected.iter().fold((f32::MAX, f32::MIN), |(low, high), &value| (low.min(value), high.max(value)));
        // The range of a single number is its magnitude.
        let range = if high > low { high - low } else { high.abs() };
        let most = made
            .iter()
            .zip(expected)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0f32, |a, b| if b.is_nan() { f32::NAN } else { a.max(b) });
        println!("{reference} {width} × {height}, {name}: {:.1e} of the range {low} to {high}", most / range);
        largest = if most.is_nan() { f32::INFINITY } else { largest.max(most / range) };
    }
    largest
}

/// Every `step`-th row and column of the two axes that are height and width.
fn strided(dims: &[usize], values: &[f32], (width, height): (usize, usize), step: usize) -> Vec<f32> {
    if step == 1 {
        return values.to_vec();
    }
    let row = dims.windows(2).position(|pair| pair == [height, width]).unwrap();
    let inner: usize = dims[row + 2..].iter().product();
    let kept = |index: &usize| {
        let (x, y) = (index / inner % width, index / inner / width % height);
        x % step == 0 && y % step == 0
    };
    (0..values.len()).filter(kept).map(|index| values[index]).collect()
}

#[test]
fn depth_anything_is_onnxruntimes_at_its_own_and_at_another_size() {
    for model in ["depth_anything_v2", "depth_anything_v2_metric"] {
        for (width, height) in [(518, 518), (322, 238)] {
            let most = difference(&format!("{model}.onnx"), model, "", (width, height), &imagenet(width, height));
            assert!(most < SHARE, "{model} {width} × {height}: {most}");
        }
    }
}

#[test]
fn depth_anything_of_other_exporters_and_storage_is_onnxruntimes() {
    let values = imagenet(154, 112);
    // Half precision: weights as stored, results in either. A result in half precision is exact to 1/2048, and layers
    // add up.
    let cases = [
        ("depth_anything_v2_small_grid", "depth_anything_v2_small_grid", SHARE),
        ("depth_anything_v2_external", "depth_anything_v2_small_grid", SHARE),
        ("depth_anything_v2_dynamo", "depth_anything_v2_dynamo", SHARE),
        ("depth_anything_v2_half", "depth_anything_v2_half", 5.0 * SHARE),
    ];
    for (model, reference, share) in cases {
        let most = difference(&format!("{model}.onnx"), reference, "", (154, 112), &values);
        assert!(most < share, "{model}: {most}");
    }
}

#[test]
fn eight_bits_are_about_onnxruntimes() {
    let most = difference("depth_anything_v2_8bit.onnx", "depth_anything_v2_8bit", "", (154, 112), &imagenet(154, 112));
    // A step of each layer's input is 1/255 of its range, and values between two steps may be rounded either way.
    assert!(most < 20.0 * SHARE, "{most}");
}

#[test]
fn integers_are_onnxruntimes() {
    let (expected, _) = tensors("integers.safetensors");
    let config = ModelConfig::parse("kind = \"metric\"\ninput = \"x\"\noutput = \"all\"").unwrap();
    let model = DepthModel::read(file("integers.onnx"), Some(&config)).unwrap();
    let (shape, values) = &expected["x"];
    // Integers below 2^24 are exact.
    assert_eq!(model.raw(shape, values).unwrap().remove(0).2, expected["all"].1);
}

#[test]
fn moge_is_onnxruntimes_at_its_own_and_at_another_size() {
    for model in ["moge2", "moge2_antialias"] {
        for (width, height, tokens) in [(518, 518, 1369), (320, 240, 300)] {
            let config = format!("[integers]\nnum_tokens = {tokens}");
            let values = input(width, height, 1.0 / 255.0, [0.0; 3], [1.0; 3]);
            let most = difference(&format!("{model}.onnx"), model, &config, (width, height), &values);
            assert!(most < SHARE, "{model} {width} × {height}: {most}");
        }
    }
}

#[test]
fn metric3d_is_onnxruntimes_at_its_own_and_at_another_size() {
    for (width, height) in [(1064, 616), (280, 168)] {
        let most = difference(
            "metric3d.onnx",
            "metric3d",
            "",
            (width, height),
            &input(width, height, 1.0, [0.0; 3], [1.0; 3]),
        );
        assert!(most < SHARE, "{width} × {height}: {most}");
    }
}

#[test]
fn resize_is_onnxruntimes_in_all_its_modes() {
    for group in ["nearest", "linear", "cubic", "antialias"] {
        let (expected, metadata) = tensors(&format!("resize_{group}.safetensors"));
        let config = ModelConfig::parse("kind = \"metric\"\ninput = \"x\"\noutput = \"all\"").unwrap();
        let model = DepthModel::read(file(&format!("resize_{group}.onnx")), Some(&config)).unwrap();
        let (shape, values) = &expected["x"];
        let made = model.raw(shape, values).unwrap().remove(0).2;
        assert_eq!(made.len(), expected["all"].1.len());
        let cases: Vec<(String, usize)> = serde_json::from_str(&metadata["cases"]).unwrap();
        let (mut start, mut wrong) = (0, Vec::new());
        for (case, size) in cases {
            let pairs = made[start..start + size].iter().zip(&expected["all"].1[start..start + size]);
            let most = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            // Precision of f32 for values of about 1.
            if most.is_nan() || most > 1e-5 {
                wrong.push(format!("{case}: {most}"));
            }
            start += size;
        }
        assert!(wrong.is_empty(), "{group}: {} cases differ: {wrong:#?}", wrong.len());
    }
}

#[test]
fn an_output_that_is_not_an_image_is_an_error() {
    let config = ModelConfig::parse(&format!("kind = \"metric\"{SIZE}")).unwrap();
    let model = DepthModel::read(file("odd_rank_of_output.onnx"), Some(&config)).unwrap();
    let prediction = model.predict(&photo(640, 480), None, &mut |_| std::ops::ControlFlow::Continue(()));
    assert!(matches!(prediction, Err(ModelError::Output { .. })));
}

/// `1 / z` of the fixtures' plane, with `u` and `v` from 0 to 1 across the image.
fn plane(u: f64, v: f64) -> f64 {
    0.5 + 0.1 * u - 0.25 * v
}

/// A 4:3 photo and the camera of 60 degrees for the planes of Metric3D and MoGe-2.
fn four_to_three() -> (Image<[u8; 3]>, Camera) {
    (photo(640, 480), Camera::from_hfov_deg(60.0, 640, 480).unwrap())
}

fn predicted(model: &str, config: &str, camera: Option<&Camera>) -> Prediction {
    let config = (!config.is_empty()).then(|| ModelConfig::parse(config).unwrap());
    let model = DepthModel::read(file(model), config.as_ref()).unwrap();
    model.predict(&four_to_three().0, camera, &mut |_| std::ops::ControlFlow::Continue(())).unwrap()
}

/// The largest relative error against the plane's depth among pixels with a reading, and their share.
fn off(depth: &DepthMap, inverse: impl Fn(f64, f64) -> f64) -> (f64, f64) {
    let (width, height) = (depth.width(), depth.height());
    let (mut most, mut readings) = (0.0f64, 0);
    for (index, &z) in depth.pixels().iter().enumerate().filter(|(_, z)| **z > 0.0) {
        let (u, v) = ((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
        most = most.max((f64::from(z) * inverse(u / width as f64, v / height as f64) - 1.0).abs());
        readings += 1;
    }
    (most, f64::from(readings) / depth.pixels().len() as f64)
}

const SIZE: &str = "\nsize = { rule = \"shorter-side\", pixels = 140, multiple = 14 }";

#[test]
fn metres_are_those_of_the_plane() {
    for (model, config) in [("plane_metric.onnx", "kind = \"metric\""), ("plane_depth_anything_metric.onnx", "")] {
        let config = if config.is_empty() { String::new() } else { format!("{config}{SIZE}") };
        let Geometry::Metric(depth) = predicted(model, &config, None).geometry else { panic!("{model} gives metres") };
        let (most, share) = off(&depth, plane);
        assert!(most < 1e-4 && share == 1.0, "{model}: {most}, {share}");
    }
}

#[test]
fn relative_depth_becomes_the_planes_metres() {
    // Coarse depth of another size, a quarter of it wrong.
    let rough = DepthMap::from_fn(40, 30, |x, y| {
        let z = plane((x as f64 + 0.5) / 40.0, (y as f64 + 0.5) / 30.0).recip() as f32;
        if (x * 7 + y * 11) % 4 == 0 { 0.6 * z } else { z }
    });
    for (model, config) in
        [("plane_inverse_affine.onnx", "kind = \"inverse-affine\""), ("plane_depth_anything.onnx", "")]
    {
        let config = if config.is_empty() { String::new() } else { format!("{config}{SIZE}") };
        let Geometry::AffineInverse(inverse) = predicted(model, &config, None).geometry else {
            panic!("{model} is relative")
        };
        let fit = affine::fit_inverse(&inverse, &rough).unwrap();
        let (most, share) = off(&affine::metres_of_inverse(&inverse, &fit), plane);
        // The coarse depth is at most half a pixel off, 0.1 / 40 of 0.25 per metre.
        assert!(most < 0.01 && share == 1.0, "{model}: {most}, {share}, {fit:?}");
    }
    let Geometry::Log(log) = predicted("plane_log.onnx", &format!("kind = \"log\"{SIZE}"), None).geometry else {
        panic!("logarithms")
    };
    let fit = affine::fit_log(&log, &rough).unwrap();
    let (most, share) = off(&affine::metres_of_log(&log, &fit), plane);
    assert!(most < 0.01 && share == 1.0, "{most}, {share}, {fit:?}");
}

#[test]
fn moge_predicts_lens_metres_and_normals() {
    for model in ["plane_moge2.onnx", "plane_moge2_scale.onnx"] {
        let prediction = predicted(model, "", None);
        let angles = prediction.field_of_view.unwrap();
        assert!((angles.horizontal_deg - 60.0).abs() < 0.06, "{angles:?}");
        // 2 atan(tan 30° · 3/4)
        assert!((angles.vertical_deg - 46.826).abs() < 0.06, "{angles:?}");
        let Geometry::Metric(depth) = prediction.geometry else { panic!("metres") };
        let (most, share) = off(&depth, plane);
        // A tenth of either side is masked.
        assert!(most < 0.01 && (share - 0.99).abs() < 0.002, "{most}, {share}");
        assert_eq!(depth.pixels()[0], 0.0);
        let normals = prediction.normals.unwrap();
        assert_eq!((normals.pixels()[0], normals.pixels().last()), (Vec3::ZERO, Some(&Vec3::Z)));
        // With a known lens, the shift alone is solved for.
        let prediction = predicted(model, "", Some(&four_to_three().1));
        let Geometry::Metric(depth) = prediction.geometry else { panic!("metres") };
        assert!(off(&depth, plane).0 < 0.01 && prediction.field_of_view.is_none());
    }
    // Without a scale, points are metres up to a factor.
    let Geometry::Log(log) = predicted("plane_points.onnx", &format!("kind = \"points\"{SIZE}"), None).geometry else {
        panic!("points have no scale")
    };
    let fit = affine::fit_log(
        &log,
        &DepthMap::from_fn(64, 48, |x, y| plane((x as f64 + 0.5) / 64.0, (y as f64 + 0.5) / 48.0).recip() as f32),
    )
    .unwrap();
    let (most, share) = off(&affine::metres_of_log(&log, &fit), plane);
    assert!(most < 0.01 && share == 1.0, "{most}, {share}");
}

#[test]
fn metric3d_is_scaled_by_the_lens_and_cropped() {
    let (_, camera) = four_to_three();
    let prediction = predicted("plane_metric3d.onnx", "", Some(&camera));
    let Geometry::Metric(depth) = prediction.geometry else { panic!("metres") };
    // 640 × 480 becomes 821 × 616 in 1064 × 616, from column 121 on.
    let (most, share) = off(&depth, |u, v| plane((121.0 + 821.0 * u) / 1064.0, v));
    assert!(most < 1e-3 && share == 1.0, "{most}, {share}");
    assert!(prediction.normals.unwrap().pixels().iter().all(|normal| *normal == Vec3::Z));
    // Twice the focal length doubles the depth.
    let tele = Camera::new(2.0 * camera.fx, 2.0 * camera.fy, camera.cx, camera.cy, 640, 480).unwrap();
    let Geometry::Metric(far) = predicted("plane_metric3d.onnx", "", Some(&tele)).geometry else { panic!("metres") };
    assert!((far.pixels()[0] / depth.pixels()[0] - 2.0).abs() < 1e-5);
}

#[test]
fn metric3d_is_normalised_once() {
    let (_, camera) = four_to_three();
    let depth = |model: &str| match predicted(model, "", Some(&camera)).geometry {
        Geometry::Metric(depth) => depth,
        other => panic!("{other:?}"),
    };
    let (inside, outside) = (depth("odd_metric3d_normalises.onnx"), depth("odd_metric3d_as_given.onnx"));
    let canonical = camera.fx * 821.0 / 640.0 / 1000.0;
    for (a, b) in inside.pixels().iter().zip(outside.pixels()) {
        assert!((a / b - 1.0).abs() < 1e-5);
        // 100 + (red − 123.675) / 58.395 for red from 0 to 255.
        assert!((97.88..102.25).contains(&(f64::from(*a) / canonical)));
    }
}

#[test]
fn odd_files_are_read() {
    let metric = |model: &str, config: &str| match predicted(model, config, None).geometry {
        Geometry::Metric(depth) => depth,
        other => panic!("{other:?}"),
    };
    for (model, config, share) in [
        ("odd_function.onnx", format!("kind = \"metric\"{SIZE}"), 1.0),
        ("odd_half.onnx", format!("kind = \"metric\"{SIZE}"), 1.0),
        ("odd_nhwc.onnx", format!("kind = \"metric\"\nlayout = \"nhwc\"{SIZE}"), 1.0),
        ("odd_nan.onnx", format!("kind = \"metric\"{SIZE}"), 0.5),
    ] {
        let (most, readings) = off(&metric(model, &config), plane);
        // Half precision has eleven bits.
        assert!(most < 1e-3 && (readings - share).abs() < 0.01, "{model}: {most}, {readings}");
    }
    let fixed = metric("odd_fixed_size.onnx", "kind = \"metric\"\nmean = [0.0, 0.0, 0.0]");
    assert_eq!((fixed.width(), fixed.height()), (98, 70));
}

#[test]
fn files_that_are_no_depth_model_are_errors() {
    let error = |model: &str, config: &str| {
        let config = (!config.is_empty()).then(|| ModelConfig::parse(config).unwrap());
        DepthModel::read(file(model), config.as_ref())
            .and_then(|model| model.predict(&photo(640, 480), None, &mut |_| std::ops::ControlFlow::Continue(())))
            .unwrap_err()
    };
    let ModelError::Unknown { signature, config } = error("odd_unknown.onnx", "") else {
        panic!("a classifier is unknown")
    };
    assert!(
        signature.contains("input") && signature.contains("[1, 3, 224, 224]") && signature.contains("logits"),
        "{signature}"
    );
    // The suggested config is valid.
    assert!(ModelConfig::parse(&config).is_ok(), "{config}");
    assert!(matches!(error("odd_all_nan.onnx", &format!("kind = \"metric\"{SIZE}")), ModelError::Output { .. }));
    for model in ["odd_rank_of_input.onnx", "odd_operator.onnx", "odd_lost_data.onnx"] {
        let error = error(model, &format!("kind = \"metric\"{SIZE}"));
        assert!(!error.to_string().is_empty(), "{model}");
        println!("{model}: {error}");
    }
    assert!(matches!(error("odd_lost_data.onnx", &format!("kind = \"metric\"{SIZE}")), ModelError::External { .. }));
    // Untrained networks give nonsense, which results in depth or an error, never in a panic.
    println!("moge2.onnx: {:?}", error("moge2.onnx", ""));
}

#[test]
fn configs_of_the_documents_can_be_read() {
    let page = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../docs/depth-models.md");
    let page = std::fs::read_to_string(page).unwrap();
    let configs: Vec<_> = page.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert!(configs.len() >= 5, "at least one for each kind");
    let kinds: Vec<_> = configs.iter().map(|config| ModelConfig::parse(config).unwrap().kind.unwrap()).collect();
    for kind in [OutputKind::Metric, OutputKind::InverseAffine, OutputKind::Log, OutputKind::Points] {
        assert!(kinds.contains(&kind), "{kind:?}");
    }
}

#[test]
#[ignore = "5 minutes, graphs of the projects' own code: python publishers.py OUT CHECKOUTS, then LIGHTOCTREE_GRAPHS=OUT cargo test -p lo_depth_models --test it publishers -- --ignored --nocapture"]
fn publishers_graphs_are_onnxruntimes() {
    let folder = PathBuf::from(std::env::var("LIGHTOCTREE_GRAPHS").unwrap());
    let plain = |size: (usize, usize), scale: f32| input(size.0, size.1, scale, [0.0; 3], [1.0; 3]);
    for (model, (width, height), values) in [
        ("moge2_publisher", (518, 518), plain((518, 518), 1.0 / 255.0)),
        ("moge2_publisher", (720, 480), plain((720, 480), 1.0 / 255.0)),
        ("depth_anything_v2_publisher", (518, 518), imagenet(518, 518)),
        ("depth_anything_v2_metric_publisher", (518, 518), imagenet(518, 518)),
        ("metric3d_publisher", (1064, 616), plain((1064, 616), 1.0)),
    ] {
        let path = folder.join(model).to_string_lossy().into_owned();
        let most = difference(&format!("{path}.onnx"), &path, "", (width, height), &values);
        assert!(most < SHARE, "{model} {width} × {height}: {most}");
    }
}
