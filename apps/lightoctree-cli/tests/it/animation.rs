//! Animations of glTF meshes in sequences.

use std::path::Path;

use lo_imaging as imaging;
use lo_imaging::{DepthMap, Image};
use tempfile::TempDir;

use crate::support::{done, json, refused};

const SIZE: (usize, usize) = (160, 120);
const FOCAL_PX: f32 = 120.0;
const DISTANCE_M: f32 = 2.0;
/// Rise of the square from one image of 24 per second to the next.
const RISE_M: f32 = 0.1;

/// Creates the scene of a grey wall, and a square of 20 cm with the animation `lift`.
fn scene() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let photo = Image::from_fn(SIZE.0, SIZE.1, |_, _| [150, 150, 150]);
    imaging::write_srgb8(path("photo.png"), &photo, 100, imaging::GENERATOR).unwrap();
    let depth_m = DepthMap::from_fn(SIZE.0, SIZE.1, |_, _| 3.0);
    imaging::write_depth(path("depth.exr"), &depth_m, imaging::GENERATOR).unwrap();
    let intrinsics = format!("{FOCAL_PX},{FOCAL_PX},{},{}", SIZE.0 / 2, SIZE.1 / 2);
    let estimate = ["estimate", "photo.png", "--depth", "depth.exr", "--intrinsics", &intrinsics];
    done(folder.path(), &[&estimate[..], &["--completion", "shell", "--up", "0,1,0", "-o", "room.scene"]].concat());

    let corners = [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.2, 0.0], [-0.1, 0.2, 0.0]];
    let times = [0.0, 2.0 / 24.0];
    let places = [[0.0, 0.0, 0.0], [0.0, 2.0 * RISE_M, 0.0]];
    let floats = corners.as_flattened().iter().chain(&times).chain(places.as_flattened());
    let mut bytes: Vec<u8> = floats.flat_map(|&value: &f32| value.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    std::fs::write(path("square.bin"), &bytes).unwrap();
    let gltf = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 3 }] }],
        "animations": [{
            "name": "lift",
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }],
            "samplers": [{ "input": 1, "output": 2, "interpolation": "LINEAR" }],
        }],
        "buffers": [{ "uri": "square.bin", "byteLength": bytes.len() }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 8 },
            { "buffer": 0, "byteOffset": 56, "byteLength": 24 },
            { "buffer": 0, "byteOffset": 80, "byteLength": 12 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
              "min": [-0.1, 0.0, 0.0], "max": [0.1, 0.2, 0.0] },
            { "bufferView": 1, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0.0], "max": [times[1]] },
            { "bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3" },
            { "bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR" },
        ],
    });
    std::fs::write(path("square.gltf"), gltf.to_string()).unwrap();
    folder
}

const SQUARE: [&str; 12] = [
    "insert",
    "room.scene",
    "--mesh",
    "square.gltf",
    "--at",
    "0,-0.3,-2",
    "--material",
    "matte-black",
    "--shadow-strength",
    "0",
    "--match-look",
    "off",
];

/// Returns the mean row of the pixels that are darker than the wall.
fn row(folder: &Path, name: &str) -> f32 {
    let image = imaging::read_photo(folder.join(name)).unwrap().photo.into_radiance();
    let dark = (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))).filter(|&at| image[at][1] < 0.15);
    let rows: Vec<f32> = dark.map(|(_, y)| y as f32 + 0.5).collect();
    assert!(rows.len() > 80, "{name}: {} pixels of the square", rows.len());
    rows.iter().sum::<f32>() / rows.len() as f32
}

#[test]
fn an_animation_plays_in_a_sequence() {
    let folder = scene();
    done(folder.path(), &[&SQUARE[..], &["-o", "rest.png"]].concat());
    let play = ["--animation", "lift", "--frames", "3", "--quality", "draft", "-o", "frame_%04d.png", "--json"];
    let summary = json(&done(folder.path(), &[&SQUARE[..], &play].concat()));
    let files = summary["files"].as_array().unwrap();
    assert_eq!(files.len(), 3);
    let rest = row(folder.path(), "rest.png");
    let expected = SIZE.1 as f32 / 2.0 + FOCAL_PX * 0.2 / DISTANCE_M;
    assert!((rest - expected).abs() < 1.0, "{rest} instead of {expected}");
    for (index, file) in files.iter().enumerate() {
        let found = rest - row(folder.path(), file.as_str().unwrap());
        let expected = index as f32 * FOCAL_PX * RISE_M / DISTANCE_M;
        assert!((found - expected).abs() < 1.0, "{file}: {found} pixels up instead of {expected}");
    }
}

#[test]
fn unknown_animations_are_refused_with_those_of_the_mesh() {
    let folder = scene();
    let unknown = ["--animation", "drop", "--frames", "2", "-o", "a_%04d.png"];
    let message = refused(folder.path(), 1, &[&SQUARE[..], &unknown].concat());
    assert!(message.contains("drop") && message.contains("lift"), "{message}");
    let still = ["--animation", "lift", "-o", "still.png"];
    let message = refused(folder.path(), 2, &[&SQUARE[..], &still].concat());
    assert!(message.contains("--frames"), "{message}");
}
