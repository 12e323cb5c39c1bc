//! Objects in the plates of a moving camera.

use std::path::Path;

use lo_geometry::{Camera, Quat, RigidTransform, Vec3};
use lo_imaging as imaging;
use lo_imaging::{DepthMap, Image, srgb8_from_linear};
use tempfile::TempDir;

use crate::support::{done, json, refused};

const SIZE: (u32, u32) = (240, 160);
const LOW: Vec3 = Vec3::new(-2.0, -1.2, -3.5);
const HIGH: Vec3 = Vec3::new(2.0, 1.3, 1.5);

/// Number of the plate that the scene is estimated from, and of all.
const NUMBERS: std::ops::Range<u32> = 1001..1007;
const SCENE: u32 = 1003;

/// Metres per unit of the track.
const UNIT_M: f32 = 0.4;

fn camera() -> Camera {
    Camera::from_hfov_deg(65.0, SIZE.0, SIZE.1).unwrap()
}

/// Returns the pose of a plate's camera in the world of the room.
fn pose(number: u32) -> RigidTransform {
    let along = (number - NUMBERS.start) as f32 / 5.0;
    let rotation = Quat::from_rotation_y(-0.2 + 0.4 * along) * Quat::from_rotation_x(-0.15);
    RigidTransform { rotation, translation_m: Vec3::new(-0.4 + 0.9 * along, 0.1, 0.2 * along) }
}

/// Renders a plate; `gain` is its exposure.
fn plate(number: u32, gain: f32) -> (Image<[u8; 3]>, DepthMap) {
    let (pose, camera) = (pose(number), camera());
    let seen = |x: usize, y: usize| {
        let local = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        let direction = pose.direction(local);
        let (a, b) = ((LOW - pose.translation_m) / direction, (HIGH - pose.translation_m) / direction);
        let distance_m = a.max(b).min_element();
        let p = pose.translation_m + direction * distance_m;
        let wave = |frequency: f32| (frequency * p.dot(Vec3::new(1.0, 1.3, 0.8))).sin();
        let light = 0.3 + 0.1 * wave(4.0) + 0.08 * wave(11.0) + 0.05 * (23.0 * (p.x - 0.4 * p.z)).sin();
        ([light, 0.9 * light, 0.8 * light], -local.z * distance_m)
    };
    let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
    let photo = Image::from_fn(width, height, |x, y| seen(x, y).0.map(|c| srgb8_from_linear(gain * c)));
    (photo, DepthMap::from_fn(width, height, |x, y| seen(x, y).1))
}

/// Creates the plates, their track, and the scene of one of them.
fn shot() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut frames = Vec::new();
    for number in NUMBERS {
        let (photo, depth_m) = plate(number, if number == 1006 { 0.6 } else { 1.0 });
        imaging::write_srgb8(path(&format!("shot_{number}.png")), &photo, 100, imaging::GENERATOR).unwrap();
        if number == SCENE {
            imaging::write_depth(path("depth.exr"), &depth_m, imaging::GENERATOR).unwrap();
        }
        let RigidTransform { rotation, translation_m } = pose(number);
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| rotation * axis);
        let t = translation_m / UNIT_M;
        frames.push(serde_json::json!({
            "file_path": format!("shot_{number}.png"),
            "transform_matrix": [[x.x, y.x, z.x, t.x], [x.y, y.y, z.y, t.y], [x.z, y.z, z.z, t.z], [0, 0, 0, 1]],
        }));
    }
    let Camera { fx, fy, cx, cy, .. } = camera();
    let track = serde_json::json!({
        "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": SIZE.0, "h": SIZE.1, "frames": frames,
    });
    std::fs::write(path("transforms.json"), track.to_string()).unwrap();
    done(
        folder.path(),
        &[
            "estimate",
            "shot_1003.png",
            "--depth",
            "depth.exr",
            "--intrinsics",
            "transforms.json",
            "--completion",
            "shell",
            "-o",
            "room.scene",
        ],
    );
    folder
}

const OBJECT: [&str; 10] =
    ["insert", "room.scene", "--mesh", "builtin:sphere", "--height", "0.3", "--pixel", "120,140", "--quality", "draft"];

const TRACK: [&str; 4] = ["--plate", "shot_%04d.png", "--camera", "transforms.json"];

/// Returns where the object is in an image: the centre of the pixels that differ from the plate.
fn found(folder: &Path, number: u32) -> (f64, f64) {
    let read = |name: String| imaging::read_photo(folder.join(name)).unwrap().photo.into_radiance();
    let (before, after) = (read(format!("shot_{number}.png")), read(format!("comp_{number}.png")));
    let (mut sum, mut count) = ((0.0, 0.0), 0.0);
    for y in 0..before.height() {
        for x in 0..before.width() {
            // The sphere is black and casts no shadow.
            let change = (after[(x, y)][1] - before[(x, y)][1]).abs();
            if change > 0.05 {
                sum = (sum.0 + x as f64 + 0.5, sum.1 + y as f64 + 0.5);
                count += 1.0;
            }
        }
    }
    assert!(count > 50.0, "{number}: nothing is inserted");
    (sum.0 / count, sum.1 / count)
}

#[test]
fn an_object_stays_where_it_is_while_the_camera_moves() {
    let folder = shot();
    let args = [
        &OBJECT[..],
        &TRACK,
        &["--material", "matte-black", "--shadow-strength", "0", "-o", "comp_%04d.png", "--json"],
    ]
    .concat();
    let summary = json(&done(folder.path(), &args));
    assert_eq!(summary["files"].as_array().unwrap().len(), 6);
    let position = &summary["objects"][0]["positions_m"][0];
    let position = Vec3::from([0, 1, 2].map(|axis| position[axis].as_f64().unwrap() as f32));
    let centre = pose(SCENE).point(position) + Vec3::Y * 0.15;
    for number in NUMBERS {
        let (u, v, _) = camera().project(pose(number).inverse().point(centre)).unwrap();
        let (x, y) = found(folder.path(), number);
        assert!((x - u).abs() < 4.0 && (y - v).abs() < 4.0, "{number}: {x:.1},{y:.1} instead of {u:.1},{v:.1}");
    }
    // What is not changed is the plate's own.
    let read = |name: &str| imaging::read_photo(folder.path().join(name)).unwrap().photo;
    let (before, after) = (read("shot_1006.png"), read("comp_1006.png"));
    let (before, after) = (before.into_radiance(), after.into_radiance());
    assert_eq!(before[(3, 3)], after[(3, 3)]);
}

#[test]
fn a_range_of_plates_becomes_numbered_layers() {
    let folder = shot();
    let args = [
        &OBJECT[..],
        &TRACK,
        &[
            "--plate-range",
            "1002-1003",
            "--track-scale",
            "0.4",
            "-o",
            "c/comp_%04d.png",
            "--layers",
            "c/layers_%04d.exr",
        ],
    ];
    std::fs::create_dir(folder.path().join("c")).unwrap();
    done(folder.path(), &args.concat());
    let mut names: Vec<String> = std::fs::read_dir(folder.path().join("c"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["comp_1002.png", "comp_1003.png", "layers_1002.exr", "layers_1003.exr"]);
}

#[test]
fn wrong_shots_are_refused() {
    let folder = shot();
    let refused = |code: i32, rest: &[&str], text: &str| {
        let message = refused(folder.path(), code, &[&OBJECT[..], rest, &["-o", "x_%04d.png"]].concat());
        assert!(message.contains(text), "{message}");
    };
    refused(2, &["--plate", "shot_%04d.png"], "--camera");
    refused(2, &["--plate", "shot.png", "--camera", "transforms.json"], "one %d or %04d");
    refused(2, &["--plate", "none_%04d.png", "--camera", "transforms.json"], "no such file");
    refused(2, &[&TRACK[..], &["--plate-range", "1007-1009"]].concat(), "no file within --plate-range");
    refused(2, &[&TRACK[..], &["--plate-range", "9-1"]].concat(), "9 is after 1");
    refused(2, &[&TRACK[..], &["--scene-plate", "7"]].concat(), "shot_0007.png");
    refused(2, &[&TRACK[..], &["--frames", "7"]].concat(), "--frames");
    // The scene's photo is not among the plates.
    std::fs::remove_file(folder.path().join("shot_1003.png")).unwrap();
    refused(2, &TRACK, "no plate is the scene's photo");
}
