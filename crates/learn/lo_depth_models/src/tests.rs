//! The run time against onnxruntime's outputs (`tests/fixtures/README.md`).
#![allow(clippy::unwrap_used)]

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use lo_imaging::Image;
use safetensors::SafeTensors;

use crate::onnx::{Weights, read_model, simplify};
use crate::plan::{Given, plan};
use crate::runtime::{Array, Runtime};
use crate::shapes::Known;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn floats(tensors: &SafeTensors<'_>, name: &str) -> Array {
    let view = tensors.tensor(name).unwrap();
    let values = view.data().as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
    Array { dims: view.shape().to_vec(), values }
}

/// Runs all outputs of a file on arrays and integers.
fn run(path: &Path, input: (&str, Array), integers: &[(&str, i32)]) -> HashMap<String, Array> {
    let (mut model, file) = read_model(std::io::BufReader::new(std::fs::File::open(path).unwrap())).unwrap();
    simplify(&mut model).unwrap();
    let (opset, opsets) = (model.opset(), std::mem::take(&mut model.opsets));
    let weights = Weights::gather(&mut model.graph, file, path.parent()).unwrap();
    let runtime = Runtime::new(weights, opsets);
    let mut given = HashMap::from([(input.0.to_owned(), Given::Sized(input.1.dims.clone()))]);
    given.extend(
        integers.iter().map(|&(name, value)| (name.to_owned(), Given::Value(Vec::new(), Known::Ints(vec![value])))),
    );
    let wanted: Vec<String> = model.graph.outputs.iter().map(|info| info.name.clone()).collect();
    let evaluate = |node: &crate::onnx::Node, values: &[(String, Vec<usize>, Known)]| runtime.evaluate(node, values);
    let graph = plan(&model.graph, opset, &given, &wanted, runtime.weight_bytes(), &evaluate).unwrap();
    let loaded = runtime.load(&graph).unwrap();
    let arrays = loaded.run(input.0, &input.1, &wanted).unwrap();
    wanted.into_iter().zip(arrays).collect()
}

/// Of the largest value.
fn error(ours: &[f32], theirs: &[f32]) -> f32 {
    assert_eq!(ours.len(), theirs.len());
    let largest = theirs.iter().fold(1e-6f32, |largest, value| largest.max(value.abs()));
    ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / largest
}

#[test]
fn every_resize_is_the_standards() {
    let bytes = std::fs::read(fixture("resize.safetensors")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let outputs = run(&fixture("resize.onnx"), ("x", floats(&tensors, "x")), &[]);
    assert!(outputs.len() > 300);
    // The middle pixel of these falls on an old one to the bit, exactly so in ours; onnxruntime's rounding puts it beside.
    let between = ["nearest.half_pixel_symmetric.ceil.up.scales", "nearest.half_pixel_symmetric.floor.mixed.sizes"];
    let mut wrong = BTreeMap::new();
    for (name, ours) in outputs.iter().filter(|(name, _)| !between.contains(&name.as_str())) {
        let theirs = floats(&tensors, &format!("y.{name}"));
        assert_eq!(ours.dims, theirs.dims, "{name}");
        let error = error(&ours.values, &theirs.values);
        // Sums of at most 81 products in single precision.
        if error.is_nan() || error > 2e-6 {
            wrong.insert(name, error);
        }
    }
    assert!(wrong.is_empty(), "{} of {}: {wrong:#?}", wrong.len(), outputs.len());
}

/// The photo of the fixtures at any size, as `make_fixtures.py` makes it.
fn photo(height: usize, width: usize) -> Image<[u8; 3]> {
    let bytes = std::fs::read(fixture("photo.safetensors")).unwrap();
    let tensors = SafeTensors::deserialize(&bytes).unwrap();
    let view = tensors.tensor("photo").unwrap();
    let small: &[[u8; 3]] = view.data().as_chunks().0;
    Image::from_fn(width, height, |x, y| small[y * 120 / height * 160 + x * 160 / width])
}

fn nchw(height: usize, width: usize, scale: f32, mean: [f32; 3], deviation: [f32; 3]) -> Array {
    let photo = photo(height, width);
    let values =
        (0..3).flat_map(|c| photo.pixels().iter().map(move |p| (f32::from(p[c]) * scale - mean[c]) / deviation[c]));
    Array { dims: vec![1, 3, height, width], values: values.collect() }
}

#[test]
fn the_families_graphs_give_what_onnxruntime_gives() {
    use crate::depth_anything::{DEVIATION, MEAN};
    let mut said = Vec::new();
    let mut compare = |model: &str, reference: &str, (height, width): (usize, usize), tolerance: f32| {
        let (input, integers): (_, &[(&str, i32)]) = match model.split('_').next().unwrap() {
            "depth" => (("pixel_values", nchw(height, width, 1.0 / 255.0, MEAN, DEVIATION)), &[]),
            "metric3d" => (("pixel_values", nchw(height, width, 1.0, [0.0; 3], [1.0; 3])), &[]),
            _ if height == 240 => {
                (("image", nchw(height, width, 1.0 / 255.0, [0.0; 3], [1.0; 3])), &[("num_tokens", 300)])
            }
            _ => (("image", nchw(height, width, 1.0 / 255.0, [0.0; 3], [1.0; 3])), &[("num_tokens", 1369)]),
        };
        let outputs = run(&fixture(&format!("{model}.onnx")), input, integers);
        let bytes = std::fs::read(fixture(&format!("{reference}.{height}x{width}.safetensors"))).unwrap();
        let tensors = SafeTensors::deserialize(&bytes).unwrap();
        let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
        let steps: HashMap<String, usize> =
            serde_json::from_str(&header.metadata().as_ref().unwrap()["steps"]).unwrap();
        for (name, ours) in outputs {
            let theirs = floats(&tensors, &name);
            let ours = strided(&ours, height, width, steps[&name]);
            assert_eq!(ours.dims, theirs.dims, "{model} {name}");
            said.push((format!("{model} {height}x{width} {name}"), error(&ours.values, &theirs.values), tolerance));
        }
    };
    // Measured 1e-5 and less; ours sums in another order.
    compare("depth_anything_v2", "depth_anything_v2", (238, 322), 1e-4);
    compare("depth_anything_v2", "depth_anything_v2", (518, 518), 1e-4);
    compare("depth_anything_v2_metric", "depth_anything_v2_metric", (238, 322), 1e-4);
    compare("depth_anything_v2_small_grid", "depth_anything_v2_small_grid", (112, 154), 1e-4);
    compare("depth_anything_v2_external", "depth_anything_v2_small_grid", (112, 154), 1e-4);
    compare("depth_anything_v2_dynamo", "depth_anything_v2_dynamo", (112, 154), 1e-4);
    compare("depth_anything_v2_half", "depth_anything_v2_half", (112, 154), 1e-4);
    compare("depth_anything_v2_8bit", "depth_anything_v2_8bit", (112, 154), 1e-4);
    compare("metric3d", "metric3d", (168, 280), 1e-4);
    compare("moge2", "moge2", (240, 320), 1e-4);
    compare("moge2_antialias", "moge2_antialias", (240, 320), 1e-4);
    compare("moge2_antialias", "moge2_antialias", (518, 518), 1e-4);
    for (name, error, _) in &said {
        println!("{name}: {error:.1e}");
    }
    assert!(said.iter().all(|(_, error, tolerance)| error < tolerance), "{said:#?}");
}

fn strided(array: &Array, height: usize, width: usize, step: usize) -> Array {
    if step == 1 {
        return array.clone();
    }
    let axis = (0..array.dims.len() - 1).find(|&axis| array.dims[axis..].starts_with(&[height, width])).unwrap();
    let (outer, inner): (usize, usize) = (array.dims[..axis].iter().product(), array.dims[axis + 2..].iter().product());
    let mut values = Vec::new();
    for o in 0..outer {
        for y in (0..height).step_by(step) {
            for x in (0..width).step_by(step) {
                let start = ((o * height + y) * width + x) * inner;
                values.extend(&array.values[start..start + inner]);
            }
        }
    }
    let mut dims = array.dims.clone();
    (dims[axis], dims[axis + 1]) = (height.div_ceil(step), width.div_ceil(step));
    Array { dims, values }
}
