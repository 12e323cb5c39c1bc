//! A record for tests: of this crate's modules and, included by path, of `tests/it/shards.rs`.
#![allow(clippy::unwrap_used)]

use lo_geometry::{Camera, Quat, Vec3};
use lo_imaging::Image;
use lo_octree::{Provenance, RadiancePoint};

use super::{Metadata, NovelView, Record, Shot};

/// Returns a room with two photos of 12 × 8 pixels and every field set.
pub(crate) fn record(key: &str) -> Record {
    let shot = |number: usize| Shot {
        position_m: Vec3::new(0.5, 1.5, number as f32),
        rotation: Quat::from_rotation_y(0.3 + number as f32),
        gains: [0.5, 0.25, 2.0],
        camera: Camera::from_hfov_deg(70.0, 12, 8).unwrap(),
        photo: Image::from_fn(12, 8, |x, y| [(20 * x) as u8, (30 * y) as u8, 90 * number as u8]),
        jpeg: None,
        radiance: Some(Image::from_fn(12, 8, |x, y| [x as f32 / 7.0, y as f32, 1e6])),
        depth_m: Some(Image::from_fn(12, 8, |x, y| if x == 0 { 0.0 } else { 1.0 + 0.1234 * (x + y) as f32 })),
        sensor_depth_m: Some(Image::from_fn(6, 4, |x, _| x as f32 * 0.5)),
        normal: Some(Image::from_fn(12, 8, |x, _| if x == 0 { [0.0; 3] } else { [0.6, 0.0, 0.8] })),
        albedo: Some(Image::from_fn(12, 8, |x, _| [if x < 6 { 0.5 } else { 0.03 }; 3])),
        views: vec![number],
        metadata: Metadata::from_iter([("iso".to_owned(), (100 + number).into())]),
    };
    let view = |number: usize| NovelView {
        position_m: Vec3::new(1.0, 1.0 + number as f32, -2.0),
        rotation: Quat::from_rotation_y(number as f32),
        radiance: Image::from_fn(16, 8, |x, y| [x as f32 * 0.3, y as f32 * 8.1, 3e5]),
        depth_m: Some(Image::from_fn(16, 8, |x, _| x as f32 * 0.25)),
    };
    let point = |i: u32| RadiancePoint {
        position_m: Vec3::new(i as f32 * 0.1, 2.0 - i as f32 * 0.05, 0.3),
        radiance: [i as f32, 0.5, 7e4],
        provenance: Provenance::Inferred,
    };
    Record {
        key: key.to_owned(),
        scene_id: format!("room of {key}"),
        up: Some(Vec3::Y),
        points: (0..20).map(point).collect(),
        point_area_m2: Some(0.25),
        views: (0..2).map(view).collect(),
        shots: (0..2).map(shot).collect(),
        metadata: Metadata::from_iter([("lights".to_owned(), 3.into())]),
    }
}
