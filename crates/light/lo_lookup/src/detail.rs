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

/// Angle beside the photo over which its mirror image turns into detail modulating the octree.
const BLEND_RAD: f32 = 0.2;

/// Angles beside the photo over which positions on the octree's surfaces are replaced by positions on the room's
/// planes. At the photo's border the octree's surfaces are exact; further out, lines on walls should be straight.
const STRAIGHT_RAD: (f32, f32) = (0.02, 0.2);

/// Angle inside the photo's border over which the detail fades out.
const INSIDE_RAD: f32 = 0.07;

/// Number of cones per task; the result does not depend on it.
const CONES_PER_TASK: usize = 1024;

/// Texture of the photo, extended over unobserved surfaces as detail around the octree's smooth estimate.
///
/// It is fixed to positions in the room, so that it does not move with objects and viewpoints. Its mean is 1 in any
/// neighbourhood. It is for appearance, not for irradiance. Apply it to samples before [`PhotoLookup`] replaces what
/// the photo shows.
pub struct Detail {
    mirroring: Mirroring,
    photo: Arc<PhotoPyramid>,
    /// The photo relative to its low frequencies.
    ratio: PhotoPyramid,
    /// Planes of the room, with normals pointing inwards.
    walls: Vec<Plane>,
    /// The octree with the observed share as radiance; only where there are several photos.
    seen: Option<ConeTracer>,
}

impl Detail {
    /// Prepares a scene's photo, taken from `lookup`. Returns `None` for a scene with a panorama of the room, which
    /// needs no detail.
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
    /// If there are not as many samples as cones.
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

    /// Returns the radiance of a sample with detail, if it gets any.
    fn find(&self, cone: &Cone, sample: &ConeSample) -> Option<Vec3> {
        let distance_m = sample.distance_m;
        let point = cone.origin + cone.direction * distance_m;
        let from_camera_m = point.length();
        if !(distance_m > 0.0 && from_camera_m > 1e-3 && from_camera_m.is_finite()) {
            return None;
        }
        let half_angle = (distance_m * cone.tan_half_angle / from_camera_m).atan();
        let direction = self.straightened(cone, point / from_camera_m);
        let footprint = self.mirroring.footprint(direction, half_angle);
        let inside = -footprint.outside_rad / INSIDE_RAD;
        if inside >= 1.0 {
            return None;
        }
        let look_up = |pyramid: &PhotoPyramid| {
            let scale = pyramid.size() / self.mirroring.size();
            pyramid.mean(footprint.at * scale, footprint.axes.map(|axis| axis * scale))
        };
        let own = Vec3::from(sample.radiance);
        let itself = 1.0 - smoothstep(0.0, BLEND_RAD, footprint.outside_rad);
        let around = if itself < 1.0 { own * look_up(&self.ratio) } else { own };
        let radiance = if itself > 0.0 { around.lerp(look_up(&self.photo) * sample.opacity, itself) } else { around };
        Some(own.lerp(radiance, 1.0 - smoothstep(0.0, 1.0, inside)))
    }

    /// Returns the direction from the camera to the point that a cone hits, on the room's planes instead of the
    /// octree's uneven surfaces.
    fn straightened(&self, cone: &Cone, direction: Vec3) -> Vec3 {
        let share = smoothstep(STRAIGHT_RAD.0, STRAIGHT_RAD.1, self.mirroring.footprint(direction, 0.0).outside_rad);
        if share <= 0.0 {
            return direction;
        }
        let towards = self.walls.iter().filter(|plane| plane.normal.dot(cone.direction) < 0.0);
        // A position behind a plane is moved onto it.
        let distance_m =
            |plane: &Plane| -plane.signed_distance_m(cone.origin).max(0.0) / plane.normal.dot(cone.direction);
        let Some(nearest_m) = towards.map(distance_m).reduce(f32::min) else { return direction };
        let on_wall = (cone.origin + cone.direction * nearest_m).normalize_or(direction);
        direction.lerp(on_wall, share).normalize_or(direction)
    }
}

/// Returns the octree with the observed share of each node, from 0 to 1, as its radiance.
fn seen_shares(light: &LightOctree) -> LightOctree {
    let mut shares = LightOctree { lobes: None, ..light.clone() };
    for (rows, seen) in shares.rgba.iter_mut().zip(&light.seen) {
        for (row, seen) in rows.iter_mut().zip(seen) {
            row[..3].fill(f32::from(*seen) / 255.0);
        }
    }
    shares
}
