//! Several photos of a room: a folder as exported by Record3D, and errors.

use std::path::Path;
use std::sync::Arc;

use lightoctree::{Document, Estimate};
use lo_cone::OctreeRenderer;
use lo_geometry::{Camera, Plane, Quat, Ray, RigidTransform, Vec3};
use lo_imaging as imaging;
use lo_imaging::{DepthMap, Image, srgb8_from_linear};
use tempfile::TempDir;

use crate::support::{done, json, refused};

/// Size of portrait photos, as Record3D stores them for a phone that is held upright.
const SIZE: (u32, u32) = (72, 96);

/// Half the edges of a box room around the origin, metres.
const HALF_M: Vec3 = Vec3::new(2.0, 1.3, 2.5);

/// Linear radiance of its six sides: −x, +x, floor, ceiling, −z, +z.
const LIGHT: [[f32; 3]; 6] =
    [[0.3, 0.1, 0.1], [0.1, 0.3, 0.1], [0.15, 0.1, 0.05], [0.4, 0.4, 0.4], [0.2, 0.2, 0.3], [0.3, 0.3, 0.1]];

fn camera() -> Camera {
    Camera::from_hfov_deg(60.0, SIZE.0, SIZE.1).unwrap()
}

/// Returns side and distance of the hit of a ray from inside the room.
fn hit(ray: &Ray) -> (usize, f32) {
    let planes = [
        (Vec3::X, HALF_M.x),
        (Vec3::NEG_X, HALF_M.x),
        (Vec3::Y, HALF_M.y),
        (Vec3::NEG_Y, HALF_M.y),
        (Vec3::Z, HALF_M.z),
        (Vec3::NEG_Z, HALF_M.z),
    ];
    let distance =
        |(normal, offset): (Vec3, f32)| Plane { normal, offset_m: -offset }.intersect(ray).unwrap_or(f32::INFINITY);
    let distances = planes.map(distance);
    let side = (0..6).min_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap();
    (side, distances[side])
}

/// Poses of level cameras at nearly the same position, each rotated by another 110°.
fn poses() -> [RigidTransform; 3] {
    [(0.0, Vec3::ZERO), (110.0, Vec3::new(0.2, 0.0, 0.1)), (220.0, Vec3::new(-0.1, 0.1, 0.2))].map(
        |(yaw_deg, translation_m): (f32, Vec3)| RigidTransform {
            rotation: Quat::from_rotation_y(yaw_deg.to_radians()),
            translation_m,
        },
    )
}

/// Renders photo and depth for a pose in a world whose origin is the first camera.
fn picture(pose: &RigidTransform, gain: f32) -> (Image<[u8; 3]>, DepthMap) {
    let camera = camera();
    let seen = |x: usize, y: usize| {
        let local = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        let (side, distance_m) = hit(&Ray { origin: pose.translation_m, direction: pose.direction(local) });
        (side, -distance_m * local.z)
    };
    let (width, height) = (SIZE.0 as usize, SIZE.1 as usize);
    let photo = Image::from_fn(width, height, |x, y| LIGHT[seen(x, y).0].map(|c| srgb8_from_linear(gain * c)));
    // The depth sensor's resolution is lower.
    let depth_m = DepthMap::from_fn(width / 2, height / 2, |x, y| seen(2 * x, 2 * y).1);
    (photo, depth_m)
}

/// Creates `rgb/N.jpg`, `depth/N.exr` and `metadata.json` of five frames; frames 0, 2 and 4 have the cameras of
/// [`poses`].
///
/// The world's axes are the first camera's, as in Record3D, but its origin is moved.
fn record3d() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::create_dir_all(path("rgb")).unwrap();
    std::fs::create_dir_all(path("depth")).unwrap();
    let mut rows = Vec::new();
    for (index, pose) in poses().iter().flat_map(|pose| [pose; 2]).take(5).enumerate() {
        let (photo, depth_m) = picture(pose, [1.0, 1.0, 0.5, 0.5, 1.5][index]);
        imaging::write_srgb8(path(&format!("rgb/{index}.jpg")), &photo, 100, imaging::GENERATOR).unwrap();
        imaging::write_depth(path(&format!("depth/{index}.exr")), &depth_m, imaging::GENERATOR).unwrap();
        let (q, t) = (pose.rotation, pose.translation_m + Vec3::new(5.0, 0.0, -3.0));
        rows.push(format!("[{},{},{},{},{},{},{}]", q.x, q.y, q.z, q.w, t.x, t.y, t.z));
    }
    let Camera { fx, fy, cx, cy, .. } = camera();
    let metadata = format!(
        r#"{{"w":{},"h":{},"dw":{},"dh":{},"fps":60,"K":[{fx},0,0,0,{fy},0,{cx},{cy},1],"poses":[{}]}}"#,
        SIZE.0,
        SIZE.1,
        SIZE.0 / 2,
        SIZE.1 / 2,
        rows.join(",")
    );
    std::fs::write(path("metadata.json"), metadata).unwrap();
    folder
}

const PHOTOS: [&str; 3] = ["rgb/0.jpg", "rgb/2.jpg", "rgb/4.jpg"];
const DEPTHS: [&str; 3] = ["depth/0.exr", "depth/2.exr", "depth/4.exr"];

fn estimate(folder: &Path, rest: &[&str]) -> Arc<Estimate> {
    let args = [&["estimate"][..], &PHOTOS, &["--depth"], &DEPTHS, &["--poses", "metadata.json"], rest];
    done(folder, &[&args.concat()[..], &["-o", "room.scene", "--force"]].concat());
    Document::read(folder.join("room.scene")).unwrap().estimate
}

#[test]
fn a_record3d_folder_gives_a_scene_with_all_observed_light() {
    let folder = record3d();
    for completion in ["shell", "none"] {
        let scene = estimate(folder.path(), &["--exposures", "0,-1,0.585", "--completion", completion]);
        assert_eq!(scene.origin.sources, ["0.jpg", "2.jpg", "4.jpg", "0.exr", "2.exr", "4.exr", "metadata.json"]);
        assert_eq!(scene.other_photos.len(), 2);
        // From the middle of the room towards each photo: the radiance of the sides, whichever camera observed them.
        let viewers = OctreeRenderer::new(&scene.light);
        let place = Vec3::new(0.0, 0.05, 0.05);
        let panorama = viewers.at(place).panorama(place, 96, 48);
        for pose in poses() {
            for (u, v) in [(36.0, 48.0), (12.0, 40.0), (60.0, 60.0)] {
                let direction = pose.direction(camera().direction(u, v));
                let (side, distance_m) = hit(&Ray { origin: place, direction });
                // Next to an edge of the room, a pixel of the panorama shows both sides.
                let beside = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]
                    .map(|step| hit(&Ray { origin: place, direction: (direction + 0.08 * step).normalize() }).0);
                if beside.iter().any(|other| *other != side) {
                    continue;
                }
                let at = lo_geometry::uv_from_direction(direction);
                let pixel = ((at.x * 96.0) as usize, (at.y * 48.0) as usize);
                let found = panorama.radiance[pixel];
                // 8 bits and JPEG: a few hundredths; leaves are 6 cm, three pixels of this panorama some 40 cm at the
                // wall.
                let close = found.iter().zip(LIGHT[side]).all(|(a, b)| (a / b - 1.0).abs() < 0.12);
                assert!(close, "{completion} {direction}: {found:?}, side {side}");
                assert!((panorama.distance_m[pixel] / distance_m - 1.0).abs() < 0.15, "{}", panorama.distance_m[pixel]);
            }
        }
    }
    let inspected = json(&done(folder.path(), &["inspect", "room.scene", "--json"]));
    assert_eq!(inspected["other_photos"].as_array().unwrap().len(), 2);
    let text = done(folder.path(), &["inspect", "room.scene"]);
    assert!(text.contains("photo 2  at (0.20, 0.00, 0.10)") && text.contains("exposure -1.00 EV"), "{text}");
}

#[test]
fn bad_sets_of_photos_end_in_a_clear_line() {
    let folder = record3d();
    let path = folder.path();
    let refused = |code: i32, args: &[&str], expected: &str| {
        let message = refused(path, code, &[&["estimate"], args, &["--completion", "none", "-o", "x.scene"]].concat());
        assert!(message.contains(expected), "{args:?}: {message}");
    };
    let with = |rest: &[&'static str]| [&PHOTOS[..], &["--depth"], &DEPTHS, rest].concat();
    refused(2, &PHOTOS, "3 photos without depth");
    refused(2, &with(&[]), "3 photos need --poses");
    refused(
        2,
        &[&PHOTOS[..], &["--depth", "depth/0.exr", "--poses", "metadata.json"]].concat(),
        "1 file of --depth for 3 photos",
    );
    refused(2, &with(&["--poses", "metadata.json", "--depth-is", "predicted"]), "no common scale");
    refused(2, &with(&["--poses", "metadata.json", "--exposures", "0,1"]), "2 exposures for 3 photos");
    refused(
        2,
        &["rgb/0.jpg", "--depth", "depth/0.exr", "--poses", "metadata.json"],
        "--poses applies to several photos",
    );
    refused(2, &["rgb/0.jpg", "--exposures", "1"], "--exposures applies to several photos");
    refused(1, &with(&["--poses", "nowhere.json"]), "nowhere.json");
    let metadata = std::fs::read_to_string(path.join("metadata.json")).unwrap();
    let write = |name: &str, text: String| std::fs::write(path.join(name), text).unwrap();
    write("far.json", metadata.replacen("[0,0,0,1,5,", "[0,0,0,1,500,", 1));
    refused(1, &with(&["--poses", "far.json"]), "m apart, more than the largest room");
    write("turned.json", metadata.replace(r#""w":72,"h":96"#, r#""w":96,"h":72"#));
    refused(1, &with(&["--poses", "turned.json"]), "was the photo rotated or cropped");
    // The second photo with the first one's pose, and depth that is too large: the same surfaces at other depths.
    let rows = metadata.split_once("[[").unwrap().1;
    let rows: Vec<&str> = rows.trim_end_matches("]]}").split("],[").collect();
    let same = format!(
        "{}[[{}]]}}",
        metadata.split_once("[[").unwrap().0,
        [rows[0], rows[0], rows[0], rows[0], rows[4]].join("],[")
    );
    write("same.json", same);
    let farther = picture(&poses()[0], 1.0).1.map(|z| 1.6 * z);
    imaging::write_depth(path.join("depth/farther.exr"), &farther, imaging::GENERATOR).unwrap();
    let depths = ["--depth", "depth/0.exr", "depth/farther.exr", "depth/4.exr", "--poses", "same.json"];
    refused(1, &[&PHOTOS[..], &depths].concat(), "look at the same places");
    // A cropped photo.
    let (photo, _) = picture(&poses()[2], 1.0);
    let cut = Image::from_fn(72, 72, |x, y| photo[(x, y)]);
    imaging::write_srgb8(path.join("rgb/4.jpg"), &cut, 95, imaging::GENERATOR).unwrap();
    refused(1, &with(&["--poses", "metadata.json"]), "rgb/4.jpg has 72 × 72");
    refused(
        1,
        &with(&["--poses", "metadata.json", "--hfov-deg", "60"]),
        "rgb/4.jpg and depth/4.exr cannot be used together",
    );
}

#[test]
fn options_may_precede_the_photos() {
    let folder = record3d();
    let args = [&["estimate", "--depth"][..], &DEPTHS, &PHOTOS, &["--poses", "metadata.json", "--completion", "none"]]
        .concat();
    done(folder.path(), &[&args[..], &["-o", "before.scene"]].concat());
    estimate(folder.path(), &["--completion", "none"]);
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(read("before.scene"), read("room.scene"));
    let one = ["estimate", "--depth", "depth/0.exr", "rgb/0.jpg", "--completion", "none", "-o", "one.scene"];
    done(folder.path(), &one);
    assert_eq!(Document::read(folder.path().join("one.scene")).unwrap().estimate.origin.sources, ["0.jpg", "0.exr"]);
}
