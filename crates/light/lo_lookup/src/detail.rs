use std::sync::Arc;

use lo_cone::{Cone, ConeSample, ConeTracer, Settings};
use lo_geometry::{Plane, Vec3, smoothstep};
use lo_octree::LightOctree;
use lo_scene::LitScene;
use rayon::prelude::*;

use crate::PhotoLookup;
use crate::mirroring::Mirroring;
use crate::photo::PhotoPyramid;
use crate::ratio::ratio_pyramid;

/// Angle beside the photo over which its mirror image itself turns into detail around what the octree holds.
const BLEND_RAD: f32 = 0.2;

/// Angles beside the photo between which places on the octree's surfaces are replaced by places on the planes that close
/// the room. The photo's border lies where surfaces are, and lines on walls are to be straight.
const STRAIGHT_RAD: (f32, f32) = (0.02, 0.2);

/// Angle inside the photo's border over which the detail ends.
const INSIDE_RAD: f32 = 0.07;

/// Cones that one task looks up; the result does not depend on it.
const CONES_PER_TASK: usize = 1024;

/// The photo's texture, continued where nothing was seen: detail around the octree's smooth estimate.
///
/// It belongs to places in the room, so that it stays where it is as objects and viewers move. Its mean is 1 in any
/// neighbourhood. It is meant for the eye, not for irradiance. Samples get it before [`PhotoLookup`] replaces what the
/// photo shows.
pub struct Detail {
    mirroring: Mirroring,
    photo: Arc<PhotoPyramid>,
    /// The photo relative to its low frequencies.
    ratio: PhotoPyramid,
    /// Planes that close the room, with normals inwards.
    walls: Vec<Plane>,
    /// The octree with the share that photos saw as radiance, where there are several photos.
    seen: Option<ConeTracer>,
}

impl Detail {
    /// Prepares a scene's photo, as `lookup` has it. A scene with a panorama of the room needs no detail.
    pub fn new(scene: &LitScene, lookup: &PhotoLookup) -> Option<Self> {
        if scene.panorama.is_some() {
            return None;
        }
        let photo = lookup.photo();
        let several = !scene.other_photos.is_empty();
        let seen = several.then(|| ConeTracer::new(&seen_shares(&scene.light), Settings::default()).ok()).flatten();
        let planes = scene.room.iter().flat_map(|room| &room.planes);
        Some(Self {
            mirroring: Mirroring::new(scene.frame.camera, scene.up()),
            ratio: ratio_pyramid(&photo, &scene.frame.camera),
            photo,
            walls: planes.map(|side| side.plane).collect(),
            seen,
        })
    }

    /// Adds detail to the radiance of samples of cones of the scene's octree.
    ///
    /// # Panics
    /// Where there are not as many samples as cones.
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
                if known < 1.0
                    && let Some(detailed) = self.find(cone, sample)
                {
                    sample.radiance = Vec3::from(sample.radiance).lerp(detailed, 1.0 - known).to_array();
                }
            }
        });
    }

    /// Radiance of a sample with detail, where it gets any.
    fn find(&self, cone: &Cone, sample: &ConeSample) -> Option<Vec3> {
        let distance_m = sample.distance_m;
        let point = cone.origin + cone.direction * distance_m;
        let from_camera_m = point.length();
        if !(distance_m > 0.0 && from_camera_m > 1e-3 && from_camera_m.is_finite()) {
            return None;
        }
        let half_angle = (distance_m * cone.tan_half_angle / from_camera_m).atan();
        let direction = self.straightened(cone, point / from_camera_m);
        let place = self.mirroring.place(direction, half_angle);
        let inside = -place.outside_rad / INSIDE_RAD;
        if inside >= 1.0 {
            return None;
        }
        let look_up = |pyramid: &PhotoPyramid| {
            let scale = pyramid.size() / self.mirroring.size();
            pyramid.mean(place.at * scale, place.axes.map(|axis| axis * scale))
        };
        let own = Vec3::from(sample.radiance);
        let itself = 1.0 - smoothstep(0.0, BLEND_RAD, place.outside_rad);
        let around = if itself < 1.0 { own * look_up(&self.ratio) } else { own };
        let radiance = if itself > 0.0 { around.lerp(look_up(&self.photo) * sample.opacity, itself) } else { around };
        Some(own.lerp(radiance, 1.0 - smoothstep(0.0, 1.0, inside)))
    }

    /// Direction from the camera of what a cone meets: on the planes that close the room instead of the octree's uneven
    /// surfaces.
    fn straightened(&self, cone: &Cone, direction: Vec3) -> Vec3 {
        let share = smoothstep(STRAIGHT_RAD.0, STRAIGHT_RAD.1, self.mirroring.place(direction, 0.0).outside_rad);
        if share <= 0.0 {
            return direction;
        }
        let towards = self.walls.iter().filter(|plane| plane.normal.dot(cone.direction) < 0.0);
        // A place behind a plane is on it.
        let distance_m =
            |plane: &Plane| -plane.signed_distance_m(cone.origin).max(0.0) / plane.normal.dot(cone.direction);
        let Some(nearest_m) = towards.map(distance_m).reduce(f32::min) else { return direction };
        let on_wall = (cone.origin + cone.direction * nearest_m).normalize_or(direction);
        direction.lerp(on_wall, share).normalize_or(direction)
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
