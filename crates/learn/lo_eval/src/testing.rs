//! Samples with known light, for tests.
#![allow(clippy::unwrap_used)]

use lo_dataset::{Metadata, NovelView, Sample};
use lo_geometry::{Camera, Quat, Vec3, pixel_direction};
use lo_imaging::{DepthMap, Image, RadianceImage, srgb8_from_linear};
use lo_octree::{Provenance, RadiancePoint};

/// Returns a grey photo of 96 × 64 pixels with a field of view of 65°, without other data.
pub(crate) fn sample() -> Sample {
    Sample {
        id: "room-0".to_owned(),
        scene_id: "room".to_owned(),
        photo: Image::new(96, 64, vec![[128; 3]; 96 * 64]),
        camera: Camera::from_hfov_deg(65.0, 96, 64).unwrap(),
        up: Some(Vec3::Y),
        radiance: None,
        depth_m: None,
        sensor_depth_m: None,
        normal: None,
        albedo: None,
        points: Vec::new(),
        point_area_m2: None,
        views: Vec::new(),
        metadata: Metadata::new(),
    }
}

/// Half the edge of the cubic room, metres.
const HALF_M: f32 = 2.0;

/// Returns the radiance of the room's walls: a colour for each pair of walls, brighter upwards.
fn wall(point: Vec3) -> [f32; 3] {
    let height = 0.5 + 0.2 * point.y;
    if point.x.abs() > 1.999 {
        [0.6 * height, 0.3 * height, 0.2 * height]
    } else if point.z.abs() > 1.999 {
        [0.2 * height, 0.5 * height, 0.3 * height]
    } else {
        [0.5 * height; 3]
    }
}

/// Returns the distance to the room's wall along a unit direction.
fn distance(origin: Vec3, direction: Vec3) -> f32 {
    let along = |o: f32, d: f32| if d == 0.0 { f32::INFINITY } else { (HALF_M.copysign(d) - o) / d };
    along(origin.x, direction.x).min(along(origin.y, direction.y)).min(along(origin.z, direction.z))
}

/// Returns a cubic room of 4 m with the camera at its centre.
///
/// It has true depth, surface points, and panoramas at the camera and in front of it.
pub(crate) fn box_room() -> Sample {
    let mut sample = sample();
    let camera = sample.camera;
    let ray = |x: usize, y: usize| camera.direction(x as f64 + 0.5, y as f64 + 0.5);
    let hit = |x, y| ray(x, y) * distance(Vec3::ZERO, ray(x, y));
    sample.depth_m = Some(DepthMap::from_fn(96, 64, |x, y| -hit(x, y).z));
    sample.sensor_depth_m = sample.depth_m.clone();
    sample.photo = Image::from_fn(96, 64, |x, y| wall(hit(x, y)).map(srgb8_from_linear));
    sample.views = [Vec3::new(0.4, -0.2, -0.8), Vec3::ZERO].map(view).into();
    let steps = 160;
    let at = |i: usize| HALF_M * ((2 * i + 1) as f32 / steps as f32 - 1.0);
    for (i, j) in (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))) {
        let (a, b) = (at(i), at(j));
        for side in [-HALF_M, HALF_M] {
            for position_m in [Vec3::new(side, a, b), Vec3::new(a, side, b), Vec3::new(a, b, side)] {
                sample.points.push(RadiancePoint {
                    position_m,
                    radiance: wall(position_m),
                    provenance: Provenance::Inferred,
                });
            }
        }
    }
    sample
}

fn view(position_m: Vec3) -> NovelView {
    let direction = |x, y| pixel_direction(x, y, 64, 32);
    NovelView {
        position_m,
        rotation: Quat::IDENTITY,
        radiance: RadianceImage::from_fn(64, 32, |x, y| {
            wall(position_m + direction(x, y) * distance(position_m, direction(x, y)))
        }),
        depth_m: Some(DepthMap::from_fn(64, 32, |x, y| distance(position_m, direction(x, y)))),
    }
}
