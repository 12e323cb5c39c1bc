use std::sync::Arc;

use lo_cone::{Cone, ConeSample, ConeTracer};
use lo_geometry::{Vec3, orthonormal_basis};
use lo_lights::PictureChange;
use lo_scene::LitScene;
use rayon::prelude::*;

use crate::before::light_before;
use crate::fade::fade;
use crate::photo::PhotoPyramid;
use crate::surface::{Followed, Meeting, Stretch, Surface};

/// Leaf edges before the octree's distance at which a ray is followed from, and behind it up to which it is expected to meet something.
const REACH_EDGES: f32 = 3.0;

/// Leaf edges between a ray and the surface up to which it meets it: of a depth edge that it passes behind, the height of the edge.
const SLACK_EDGES: f32 = 0.75;

/// Widths of cones where they meet something, in leaf edges, from which on and up to which the octree takes over. It is as good there, and a
/// wide cone that is partly stopped before has no one place in the picture.
const WIDE_EDGES: (f32, f32) = (3.0, 6.0);

/// Leaf edges by which the depths of both sides of a depth edge move what is looked up, from which on and up to which the octree takes over.
const MOVED_EDGES: (f32, f32) = (0.6, 1.2);

/// Leaf edges between the octree's distance and the photo's, from which on and up to which the octree takes over, where the photo does not
/// see all of the way.
const APART_EDGES: (f32, f32) = (1.5, REACH_EDGES);

/// Cones that one task looks up; the result does not depend on it.
const CONES_PER_TASK: usize = 1024;

/// A scene's photo, made ready to be looked up from anywhere.
///
/// The photo answers with a weight that goes smoothly to 0, and the octree with the rest, where the cone is wide compared with a leaf, where it reaches
/// beyond the picture, at depth edges as far as it matters there how deep the surface is (seen from the camera itself it does not matter), and
/// where octree and depth map disagree about what is met. What is clipped in the photo is as bright as the octree has it. Emitters that were edited are
/// so in the photo, too.
pub struct PhotoLookup {
    surface: Surface,
    photo: Arc<PhotoPyramid>,
    leaf_edge_m: f32,
}

/// What the photo shows of what a cone meets.
#[derive(Clone, Copy, Debug)]
struct Found {
    radiance: Vec3,
    distance_m: f32,
    weight: f32,
}

impl PhotoLookup {
    /// Of the scene's first photo; `tracer` is of the scene's light as it is seen from that photo's camera. Takes some tenths of a second for large
    /// photos.
    pub fn new(scene: &LitScene, tracer: &ConeTracer) -> Self {
        let leaf_edge_m = scene.light.cube.node_edge_m(scene.light.octree.depth());
        let surface = Surface::new(&scene.frame, tracer);
        let change = scene.edited.as_ref().and_then(|edited| edited.octree.as_ref());
        let before = change.map(|change| light_before(scene, change, Vec3::ZERO));
        let change = change.map(|change| PictureChange::new(&scene.light, change));
        let photo = PhotoPyramid::new(
            &scene.frame,
            before.as_ref().unwrap_or(tracer),
            leaf_edge_m,
            surface.usual_depth_m(),
            change.as_ref(),
        );
        Self { surface, photo: Arc::new(photo), leaf_edge_m }
    }

    /// The photo's radiance.
    pub(crate) fn photo(&self) -> Arc<PhotoPyramid> {
        Arc::clone(&self.photo)
    }

    /// Puts what the photo shows into samples of cones of the scene's octree: radiance, and with it distance and opacity.
    ///
    /// # Panics
    /// Where there are not as many samples as cones.
    pub fn sharpen(&self, cones: &[Cone], samples: &mut [ConeSample]) {
        assert_eq!(cones.len(), samples.len(), "one sample for each cone");
        let tasks = cones.par_chunks(CONES_PER_TASK).zip(samples.par_chunks_mut(CONES_PER_TASK));
        tasks.for_each(|(cones, samples)| {
            for (cone, sample) in cones.iter().zip(samples) {
                if let Some(found) = self.find(cone, sample, 0.0) {
                    found.blend(sample, found.distance_m);
                }
            }
        });
    }

    /// [`PhotoLookup::sharpen`] for cones that begin a little off the places in `apexes` that they are meant for, because the octree's leaves are in
    /// the way there. The photo is looked up from the apexes; cones of which it gives at least half begin there after, and their distances too.
    ///
    /// # Panics
    /// Where there are not as many samples and apexes as cones.
    pub fn sharpen_from(&self, apexes: &[Vec3], cones: &mut [Cone], samples: &mut [ConeSample]) {
        assert_eq!(cones.len(), samples.len(), "one sample for each cone");
        assert_eq!(cones.len(), apexes.len(), "one apex for each cone");
        let tasks = cones.par_chunks_mut(CONES_PER_TASK).zip(samples.par_chunks_mut(CONES_PER_TASK));
        tasks.zip(apexes.par_chunks(CONES_PER_TASK)).for_each(|((cones, samples), apexes)| {
            for ((cone, sample), &apex) in cones.iter_mut().zip(samples).zip(apexes) {
                let lowered = Cone { origin: apex, ..*cone };
                let Some(found) = self.find(&lowered, sample, (cone.origin - apex).length()) else { continue };
                let expected_m = sample.distance_m;
                found.blend(sample, 0.0);
                (sample.distance_m, *cone) =
                    if found.weight < 0.5 { (expected_m, *cone) } else { (found.distance_m, lowered) };
            }
        });
    }

    /// `lift_m`: how far from the cone's apex its sample was taken.
    fn find(&self, cone: &Cone, sample: &ConeSample, lift_m: f32) -> Option<Found> {
        let edge_m = self.leaf_edge_m;
        let reach_m = REACH_EDGES * edge_m + lift_m;
        let Cone { origin, direction, tan_half_angle } = *cone;
        let expected_m = sample.distance_m;
        let width_edges = |distance_m: f32| 2.0 * distance_m * tan_half_angle / edge_m;
        let near = origin + direction * expected_m;
        if expected_m <= 0.0 || width_edges(expected_m) >= WIDE_EDGES.1 || !self.may_show(near, reach_m) {
            return None;
        }
        let from_m = (expected_m - reach_m).max(0.0);
        let slack_m = SLACK_EDGES * edge_m;
        let stretch = Stretch { origin, direction, from_m, to_m: expected_m + reach_m, slack_m };
        let met = match self.surface.follow(&stretch) {
            Followed::Met(met) => met,
            // The octree stops the cone where the photo sees through: leaves are thicker than what fills them.
            Followed::Free(before) => {
                let to_m = origin.length() + 2.0 * self.surface.farthest_m();
                let beyond = Stretch { from_m: stretch.to_m, to_m: to_m.max(stretch.to_m), ..stretch };
                match self.surface.follow(&beyond) {
                    Followed::Met(met) if met.free > 0.0 => Meeting { free: before.min(met.free), ..met },
                    _ => return None,
                }
            }
            Followed::Lost => return None,
        };
        let off = fade(met.off_m / edge_m, (0.5 * SLACK_EDGES, SLACK_EDGES));
        let apart = fade((met.distance_m - expected_m).abs() / edge_m, APART_EDGES).max(met.free);
        let moved = fade(self.moved_m(origin, direction, &met) / edge_m, MOVED_EDGES);
        let narrow = fade(width_edges(met.distance_m.max(expected_m)), WIDE_EDGES);
        let weight = off * apart * moved * narrow;
        if weight <= 0.0 {
            return None;
        }
        let basis = orthonormal_basis(direction);
        let turns = [basis.x_axis, basis.y_axis].map(|axis| axis * tan_half_angle);
        let scale = self.photo.size() / self.surface.size();
        let axes = self.surface.footprint(origin, &met, direction, turns).map(|axis| axis * scale);
        let at = met.at * scale;
        let inside = at.min(self.photo.size() - at);
        let reach = (axes[0] * axes[0] + axes[1] * axes[1]).map(f32::sqrt).max(lo_geometry::Vec2::ONE);
        let within = (inside / reach).min_element().clamp(0.0, 1.0);
        if within <= 0.0 {
            return None;
        }
        let radiance = self.photo.mean(at, axes);
        Some(Found { radiance, distance_m: met.distance_m, weight: weight * within })
    }

    /// Whether any place up to `reach_m` around a point may be in the picture; of nearly all that are not it is known at once.
    fn may_show(&self, point: Vec3, reach_m: f32) -> bool {
        let depth_m = -point.z;
        let margin_px = self.surface.focal_px() * reach_m / depth_m.max(reach_m);
        depth_m > -reach_m && (depth_m <= reach_m || self.surface.shows(point, margin_px))
    }

    /// How far apart the places are, on the surface in metres, that are looked up with the depths of both sides of a depth edge.
    fn moved_m(&self, origin: Vec3, direction: Vec3, met: &Meeting) -> f32 {
        let seen_along = (origin + direction * met.distance_m).normalize_or(direction);
        let aside_m = (origin - seen_along * origin.dot(seen_along)).length();
        aside_m * self.surface.jump(met.at) * met.depth_m
    }
}

impl Found {
    fn blend(&self, sample: &mut ConeSample, distance_m: f32) {
        let mix = |from: f32, to: f32| from + self.weight * (to - from);
        sample.radiance = Vec3::from(sample.radiance).lerp(self.radiance, self.weight).to_array();
        sample.distance_m = mix(sample.distance_m, distance_m);
        sample.opacity = mix(sample.opacity, 1.0);
    }
}
