use std::sync::Arc;

use lo_cone::{Cone, ConeSample, ConeTracer, Settings};
use lo_geometry::{Plane, Vec3};
use lo_octree::LightOctree;
use lo_scene::Scene;
use rayon::prelude::*;

use crate::PhotoLookup;
use crate::mirroring::Mirroring;
use crate::photo::PhotoPyramid;
use crate::ratio::ratio_pyramid;

/// Angle beside the photo over which its mirror image itself turns into detail around what the octree holds.
const BLEND_RAD: f32 = 0.2;

/// Angles beside the photo between which places on what the octree holds are replaced by those on the planes that close the room: the photo's border
/// lies where surfaces are, and lines on walls are to be straight.
const STRAIGHT_RAD: (f32, f32) = (0.02, 0.2);

/// Angle inside of the photo's border over which the detail ends.
const INSIDE_RAD: f32 = 0.07;

/// Cones that one task looks up; the result does not depend on it.
const CONES_PER_TASK: usize = 1024;

/// Detail of what was not seen.
pub struct Detail {
    mirroring: Mirroring,
    photo: Arc<PhotoPyramid>,
    ratio: PhotoPyramid,
    /// Planes that close the room, normals inwards.
    walls: Vec<Plane>,
    /// The octree with the share that photos saw as radiance, where there are several.
    seen: Option<ConeTracer>,
    blend: f32,
}

impl Detail {
    /// Prepares a scene's photo.
    pub fn new(scene: &Scene, lookup: &PhotoLookup) -> Option<Self> {
        if scene.panorama.is_some() {
            return None;
        }
        let photo = lookup.photo();
        let several = !scene.other_photos.is_empty();
        let seen = several.then(|| ConeTracer::new(&seen_shares(&scene.light), Settings::default()).ok()).flatten();
        let ratio = ratio_pyramid(&photo, &scene.frame.camera);
        let blend = std::env::var("D_BLEND").ok().map_or(BLEND_RAD, |v| v.parse().unwrap());
        let planes = scene.room.iter().flat_map(|room| &room.planes);
        let walls = planes.map(|side| side.plane).collect();
        Some(Self { walls, mirroring: Mirroring::new(scene.frame.camera, scene.up()), photo, ratio, seen, blend })
    }

    /// Adds detail to what cones of the scene's octree see.
    pub fn add(&self, cones: &[Cone], samples: &mut [ConeSample]) {
        assert_eq!(cones.len(), samples.len(), "one sample for each cone");
        let tasks = cones.par_chunks(CONES_PER_TASK).zip(samples.par_chunks_mut(CONES_PER_TASK));
        tasks.for_each(|(cones, samples)| {
            let mut seen = vec![ConeSample::default(); if self.seen.is_some() { cones.len() } else { 0 }];
            if let Some(tracer) = &self.seen {
                tracer.trace_batch(cones, &mut seen);
            }
            for (i, (cone, sample)) in cones.iter().zip(samples).enumerate() {
                let known = seen.get(i).map_or(0.0, |seen| seen.radiance[0] / seen.opacity.max(1e-6));
                if let Some(radiance) = self.find(cone, sample) {
                    sample.radiance = Vec3::from(sample.radiance).lerp(radiance, 1.0 - known.min(1.0)).to_array();
                }
            }
        });
    }

    fn find(&self, cone: &Cone, sample: &ConeSample) -> Option<Vec3> {
        let distance_m = sample.distance_m;
        let point = cone.origin + cone.direction * distance_m;
        let from_camera_m = point.length();
        if !(distance_m > 0.0 && from_camera_m > 1e-3 && from_camera_m.is_finite()) {
            return None;
        }
        let own = Vec3::from(sample.radiance);
        let half_angle = (distance_m * cone.tan_half_angle / from_camera_m).atan();
        let direction = point / from_camera_m;
        let direction = match self.on_wall(cone) {
            Some(on_wall) => {
                let outside = self.mirroring.place(direction, 0.0).outside_rad;
                let share = lo_geometry::smoothstep(STRAIGHT_RAD.0, STRAIGHT_RAD.1, outside);
                direction.lerp(on_wall, share).normalize_or(direction)
            }
            None => direction,
        };
        let place = self.mirroring.place(direction, half_angle);
        let inside = -place.outside_rad / INSIDE_RAD;
        if inside >= 1.0 {
            return None;
        }
        let look_up = |pyramid: &PhotoPyramid| {
            let scale = pyramid.size() / self.mirroring.size();
            pyramid.mean(place.at * scale, place.axes.map(|axis| axis * scale))
        };
        let share = 1.0 - lo_geometry::smoothstep(0.0, 1.0, inside);
        let itself = 1.0 - lo_geometry::smoothstep(0.0, self.blend, place.outside_rad);
        let around = if itself < 1.0 { own * look_up(&self.ratio) } else { own };
        let radiance = if itself > 0.0 { around.lerp(look_up(&self.photo), itself) } else { around };
        Some(own.lerp(radiance, share))
    }
}

impl Detail {
    /// Direction from the camera of where a cone's axis meets the planes that close the room.
    fn on_wall(&self, cone: &Cone) -> Option<Vec3> {
        let towards = |plane: &&Plane| plane.normal.dot(cone.direction) < 0.0;
        let distance_m = |plane: &Plane| -plane.signed_distance_m(cone.origin).max(0.0) / plane.normal.dot(cone.direction);
        let nearest_m = self.walls.iter().filter(towards).map(distance_m).reduce(f32::min)?;
        (cone.origin + cone.direction * nearest_m).try_normalize()
    }
}

/// The octree with the share of each node that photos saw, from 0 to 1, in place of its radiance.
fn seen_shares(light: &LightOctree) -> LightOctree {
    let mut shares = LightOctree { lobes: None, ..light.clone() };
    for (rows, seen) in shares.rgba.iter_mut().zip(&light.seen) {
        for (row, seen) in rows.iter_mut().zip(seen) {
            row[..3].fill(f32::from(*seen) / 255.0);
        }
    }
    shares
}
