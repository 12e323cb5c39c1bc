//! Footprints for objects: visible points on level surfaces with enough free space for every object.

use lo_geometry::Vec3;
use lo_mesh::PreparedModel;
use lo_random::RngExt;
use lo_synth::{CameraPose, Interior};

use super::level_surfaces::LevelSurfaces;
use super::objects::TestObject;

/// Largest number of footprints per photo.
pub(crate) const MAX_FOOTPRINTS: usize = 3;

/// Number of random pixels to try.
const TRIES: usize = 600;

/// Apparent radius of the spheres as a share of the photo's width.
const RADIUS_SHARE: f32 = 0.042;

/// Smallest distance between footprints, radii.
const MIN_DISTANCE_RADII: f32 = 8.0;

/// Position of an object in the room's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Footprint {
    /// Pixel at which the centre of the base appears.
    pub pixel: [f64; 2],
    /// Centre of the base.
    pub base_m: Vec3,
    /// Radius of the spheres.
    pub radius_m: f32,
}

impl Footprint {
    /// Returns the distance, in radii, from the base to the point of its level plane that appears at a pixel.
    ///
    /// Infinite above the horizon.
    pub fn radii_from_base(&self, view: &CameraPose, [u, v]: [f64; 2]) -> f32 {
        let direction = view.pose.rotation * view.camera.direction(u, v);
        let along = (self.base_m.y - view.pose.position.y) / direction.y;
        let point = view.pose.position + direction * along;
        if along > 0.0 { (point - self.base_m).length() / self.radius_m } else { f32::INFINITY }
    }
}

/// Finds up to three footprints in a photo; none if it shows no free level surface.
///
/// `model` is the interior's model.
pub(crate) fn footprints(interior: &Interior, model: &PreparedModel, view: &CameraPose, seed: u64) -> Vec<Footprint> {
    let mut random = lo_random::stream(seed, "places of objects", lo_random::hash(interior.id.as_bytes()));
    let (width, height) = (f64::from(view.camera.width), f64::from(view.camera.height));
    let surfaces = LevelSurfaces { interior, model, view };
    let mut found: Vec<Footprint> = Vec::new();
    for _ in 0..TRIES {
        let pixel = [random.random_range(0.1..0.9) * width, random.random_range(0.2..0.92) * height];
        let Some(footprint) = footprint_at(&surfaces, pixel) else { continue };
        let is_apart = |other: &Footprint| {
            (other.base_m - footprint.base_m).length() > MIN_DISTANCE_RADII * other.radius_m.max(footprint.radius_m)
        };
        if found.iter().all(is_apart) {
            found.push(footprint);
            if found.len() == MAX_FOOTPRINTS {
                break;
            }
        }
    }
    found
}

/// Returns the footprint at a pixel, if all objects fit there on a level surface and are entirely visible.
fn footprint_at(surfaces: &LevelSurfaces, pixel: [f64; 2]) -> Option<Footprint> {
    let (camera, pose) = (&surfaces.view.camera, &surfaces.view.pose);
    let (base_m, axis_m) = surfaces.at_pixel(pixel)?;
    let radius_m = RADIUS_SHARE * camera.width as f32 / camera.fx as f32 * axis_m;
    let is_free =
        |height: f32, margin: f32| surfaces.interior.is_free(base_m + Vec3::Y * (height * radius_m), margin * radius_m);
    let has_room =
        || is_free(1.0, 0.95) && [1.0, 2.0, 3.0, 4.0, TestObject::Pole.height()].iter().all(|&h| is_free(h, 0.4));
    // The sphere's outline and the pole must be visible.
    let right = pose.rotation * Vec3::X;
    let outline =
        [Vec3::Y, Vec3::new(0.0, 2.0, 0.0), Vec3::Y + right, Vec3::Y - right, Vec3::Y * TestObject::Pole.height()];
    let shown = || outline.into_iter().all(|offset| surfaces.shows(base_m + offset * radius_m, 0.01 * radius_m));
    (surfaces.carries(base_m, radius_m) && has_room() && shown()).then_some(Footprint { pixel, base_m, radius_m })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_synth::SynthConfig;

    use super::*;

    #[test]
    fn objects_stand_freely_where_the_photo_shows_it() {
        let mut found = 0;
        for index in 0..4 {
            let interior = Interior::generate(5, index, &SynthConfig::default()).unwrap();
            let view = interior.camera_poses(1)[0];
            let model = PreparedModel::new(interior.world.model.clone());
            let all = footprints(&interior, &model, &view, 1);
            assert_eq!(all, footprints(&interior, &model, &view, 1));
            for footprint in &all {
                let local = view.pose.rotation.inverse() * (footprint.base_m - view.pose.position);
                let (u, v, axis_m) = view.camera.project(local).unwrap();
                assert!((u - footprint.pixel[0]).abs() < 0.1 && (v - footprint.pixel[1]).abs() < 0.1, "{footprint:?}");
                assert!((0.9..4.5).contains(&axis_m));
                assert!(footprint.radii_from_base(&view, footprint.pixel) < 0.05, "{footprint:?}");
                let beside_m = footprint.base_m + 1.5 * footprint.radius_m * Vec3::new(0.6, 0.0, 0.8);
                let beside = view.camera.project(view.pose.rotation.inverse() * (beside_m - view.pose.position));
                let (u, v, _) = beside.unwrap();
                assert!((footprint.radii_from_base(&view, [u, v]) - 1.5).abs() < 0.01, "{footprint:?}");
                assert!(interior.is_free(footprint.base_m + Vec3::Y * footprint.radius_m, 0.9 * footprint.radius_m));
            }
            for (i, a) in all.iter().enumerate() {
                let apart = |b: &Footprint| (a.base_m - b.base_m).length() > 4.0 * a.radius_m;
                assert!(all[..i].iter().all(apart));
            }
            found += all.len();
        }
        assert!(found >= 4, "{found}");
    }
}
