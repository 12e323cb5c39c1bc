use std::sync::Arc;

use lo_cone::{Cone, ConeSample, ConeTracer};
use lo_geometry::{Vec3, orthonormal_basis};
use lo_lights::ImageChange;
use lo_scene::LitScene;
use rayon::prelude::*;

use crate::before::light_before;
use crate::fade::fade;
use crate::photo::PhotoPyramid;
use crate::surface::{DepthSurface, FollowResult, RaySegment, SurfaceHit};

/// Distance, in leaf edges, before and behind the octree's hit within which a ray is followed.
const REACH_EDGES: f32 = 3.0;

/// Greatest distance, in leaf edges, between a ray and the surface at a hit. Where the ray passes behind a depth edge,
/// it is the height of the edge.
const SLACK_EDGES: f32 = 0.75;

/// Cone widths at the hit, in leaf edges, over which the weight fades to the octree. The octree is as good there, and a
/// wide cone that is partly stopped earlier has no single position in the photo.
const WIDE_EDGES: (f32, f32) = (3.0, 6.0);

/// Displacements of the looked-up point due to the depths on both sides of a depth edge, in leaf edges, over which the
/// weight fades to the octree.
const MOVED_EDGES: (f32, f32) = (0.6, 1.2);

/// Differences between the octree's distance and the photo's, in leaf edges, over which the weight fades to the octree.
/// They apply where the photo does not show all of the path.
const APART_EDGES: (f32, f32) = (1.5, REACH_EDGES);

/// Number of cones per task; the result does not depend on it.
const CONES_PER_TASK: usize = 1024;

/// A scene's photo, prepared for lookup from any viewpoint.
///
/// The photo's weight fades smoothly to 0, in favour of the octree:
///
/// - where the cone is wide compared with a leaf,
/// - where the cone reaches beyond the photo,
/// - at depth edges, as far as the depth of the surface matters there (from the camera itself it does not),
/// - where octree and depth map disagree about what is hit.
///
/// Clipped pixels are as bright as the octree. Edits of emitters are applied to the photo too.
pub struct PhotoLookup {
    surface: DepthSurface,
    photo: Arc<PhotoPyramid>,
    leaf_edge_m: f32,
}

/// The photo's value for the surface that a cone hits.
#[derive(Clone, Copy, Debug)]
struct PhotoSample {
    radiance: Vec3,
    distance_m: f32,
    weight: f32,
}

impl PhotoLookup {
    /// Prepares the scene's first photo. `tracer` traces the scene's light as seen from that photo's camera. Takes some
    /// tenths of a second for large photos.
    pub fn new(scene: &LitScene, tracer: &ConeTracer) -> Self {
        let leaf_edge_m = scene.light.cube.node_edge_m(scene.light.octree.depth());
        let surface = DepthSurface::new(&scene.frame, tracer);
        let change = scene.edited.as_ref().and_then(|edited| edited.octree.as_ref());
        let before = change.map(|change| light_before(scene, change, Vec3::ZERO));
        let change = change.map(|change| ImageChange::new(&scene.light, change));
        let photo = PhotoPyramid::new(
            &scene.frame,
            before.as_ref().unwrap_or(tracer),
            leaf_edge_m,
            surface.median_depth_m(),
            change.as_ref(),
        );
        Self { surface, photo: Arc::new(photo), leaf_edge_m }
    }

    /// Returns the photo's radiance.
    pub(crate) fn photo(&self) -> Arc<PhotoPyramid> {
        Arc::clone(&self.photo)
    }

    /// Replaces radiance, distance and opacity of octree samples by the photo's values, by weight.
    ///
    /// # Panics
    /// If there are not as many samples as cones.
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

    /// Sharpens samples of cones that start at an offset from the intended `apexes`, because the octree's leaves block
    /// the way there.
    ///
    /// The photo is looked up from the apexes. Where its weight is at least half, the cone and its distance are moved
    /// to the apex.
    ///
    /// # Panics
    /// If there are not as many samples and apexes as cones.
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

    /// `lift_m` is the distance between the cone's apex and the origin of its sample.
    fn find(&self, cone: &Cone, sample: &ConeSample, lift_m: f32) -> Option<PhotoSample> {
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
        let segment = RaySegment { origin, direction, from_m, to_m: expected_m + reach_m, slack_m };
        let hit = match self.surface.follow(&segment) {
            FollowResult::Hit(hit) => hit,
            // The octree stops the cone where the photo shows free space: leaves are thicker than the surface in them.
            FollowResult::Free(before) => {
                let to_m = origin.length() + 2.0 * self.surface.farthest_m();
                let beyond = RaySegment { from_m: segment.to_m, to_m: to_m.max(segment.to_m), ..segment };
                match self.surface.follow(&beyond) {
                    FollowResult::Hit(hit) if hit.free > 0.0 => SurfaceHit { free: before.min(hit.free), ..hit },
                    _ => return None,
                }
            }
            FollowResult::Lost => return None,
        };
        let off = fade(hit.off_m / edge_m, (0.5 * SLACK_EDGES, SLACK_EDGES));
        let apart = fade((hit.distance_m - expected_m).abs() / edge_m, APART_EDGES).max(hit.free);
        let moved = fade(self.parallax_m(origin, direction, &hit) / edge_m, MOVED_EDGES);
        let narrow = fade(width_edges(hit.distance_m.max(expected_m)), WIDE_EDGES);
        let weight = off * apart * moved * narrow;
        if weight <= 0.0 {
            return None;
        }
        let basis = orthonormal_basis(direction);
        let turns = [basis.x_axis, basis.y_axis].map(|axis| axis * tan_half_angle);
        let scale = self.photo.size() / self.surface.size();
        let axes = self.surface.footprint(origin, &hit, direction, turns).map(|axis| axis * scale);
        let at = hit.at * scale;
        let inside = at.min(self.photo.size() - at);
        let reach = (axes[0] * axes[0] + axes[1] * axes[1]).map(f32::sqrt).max(lo_geometry::Vec2::ONE);
        let within = (inside / reach).min_element().clamp(0.0, 1.0);
        if within <= 0.0 {
            return None;
        }
        let radiance = self.photo.mean(at, axes);
        Some(PhotoSample { radiance, distance_m: hit.distance_m, weight: weight * within })
    }

    /// Returns whether any point up to `reach_m` around a point may be in the photo. It is a cheap test that rejects
    /// most others.
    fn may_show(&self, point: Vec3, reach_m: f32) -> bool {
        let depth_m = -point.z;
        let margin_px = self.surface.focal_px() * reach_m / depth_m.max(reach_m);
        depth_m > -reach_m && (depth_m <= reach_m || self.surface.shows(point, margin_px))
    }

    /// Returns the distance on the surface, in metres, between the points that are looked up with the depths of both
    /// sides of a depth edge.
    fn parallax_m(&self, origin: Vec3, direction: Vec3, hit: &SurfaceHit) -> f32 {
        let seen_along = (origin + direction * hit.distance_m).normalize_or(direction);
        let aside_m = (origin - seen_along * origin.dot(seen_along)).length();
        aside_m * self.surface.jump(hit.at) * hit.depth_m
    }
}

impl PhotoSample {
    fn blend(&self, sample: &mut ConeSample, distance_m: f32) {
        let mix = |from: f32, to: f32| from + self.weight * (to - from);
        sample.radiance = Vec3::from(sample.radiance).lerp(self.radiance, self.weight).to_array();
        sample.distance_m = mix(sample.distance_m, distance_m);
        sample.opacity = mix(sample.opacity, 1.0);
    }
}
