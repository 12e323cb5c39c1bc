use lo_cone::{Cone, ConeSample, ConeTracer, Settings};
use lo_geometry::{Quat, Vec2, Vec3};
use lo_imaging::Image;
use lo_lights::ImageChange;
use lo_octree::LightOctree;
use lo_scene::{LitScene, PanoramaContribution};
use rayon::prelude::*;

use crate::fade::fade;
use crate::map::RadianceMap;

/// Columns of the distance map of the panorama.
const COLUMNS: usize = 1024;

/// Edge, in leaf edges, of the leaves of unobserved surfaces, which are stored one depth coarser than observed ones.
const UNSEEN_EDGES: f32 = 2.0;

/// Distances between the octree's hit and the panorama's, in edges of unobserved leaves, over which the weight fades to
/// the octree.
const APART_EDGES: (f32, f32) = (1.0, 2.0);

/// Cone widths at the hit, in the same unit, over which the weight fades to the octree.
const WIDE_EDGES: (f32, f32) = (3.0, 6.0);

/// Shares of the panorama in the radiance of a hit over which the weight fades in; the rest is from the photo.
const SHARE: (f32, f32) = (0.2, 0.8);

/// Iterations of the search for a ray's intersection with the panorama's surface.
const STEPS: usize = 6;

/// Number of cones per task; the result does not depend on it.
const CONES_PER_TASK: usize = 1024;

/// A panorama of the room given by the user, prepared for lookup from any viewpoint, where its light was baked into the
/// octree.
///
/// The distance of a panorama direction is that of the octree. The panorama's weight fades smoothly to 0, in favour of
/// the octree: where the panorama contributed less of the light, where the cone is wide compared with a leaf, and where
/// the panorama does not see the hit.
pub struct PanoramaLookup {
    map: RadianceMap,
    panorama_from_world: Quat,
    position_m: Vec3,
    /// Distance of the surface in each direction, in metres, in the photo's axes.
    distance_m: Image<f32>,
    /// The octree with the panorama's share as radiance.
    share: ConeTracer,
    edge_m: f32,
    /// Whether the panorama is clipped, so that its lights are at least as bright as the octree's.
    clipped: bool,
}

impl PanoramaLookup {
    /// Prepares the scene's panorama, if there is one. `tracer` traces the scene's light as seen from that panorama's
    /// position.
    pub fn new(scene: &LitScene, tracer: &ConeTracer) -> Option<Self> {
        let laid = scene.panorama.as_ref()?;
        let picture = laid.image.as_ref()?;
        let position_m = laid.source.position_m;
        let share = ConeTracer::new(&shares(&scene.light, laid), Settings::default()).ok()?;
        let mut radiance = picture.radiance.clone();
        if let Some(change) = scene.edited.as_ref().and_then(|edited| edited.octree.as_ref()) {
            ImageChange::new(&scene.light, change).panorama(&mut radiance, position_m, picture.world_from_panorama);
        }
        Some(Self {
            map: RadianceMap::new(radiance),
            panorama_from_world: picture.world_from_panorama.inverse(),
            position_m,
            distance_m: tracer.panorama(position_m, COLUMNS, COLUMNS / 2).distance_m,
            share,
            edge_m: UNSEEN_EDGES * scene.light.cube.node_edge_m(scene.light.octree.depth()),
            clipped: laid.source.clipped,
        })
    }

    /// Replaces the radiance of octree samples by the panorama's, by weight.
    ///
    /// # Panics
    /// If there are not as many samples as cones.
    pub fn sharpen(&self, cones: &[Cone], samples: &mut [ConeSample]) {
        assert_eq!(cones.len(), samples.len(), "one sample for each cone");
        let tasks = cones.par_chunks(CONES_PER_TASK).zip(samples.par_chunks_mut(CONES_PER_TASK));
        tasks.for_each(|(cones, samples)| {
            let (mut asked, mut found) = (Vec::new(), Vec::new());
            for (i, (cone, sample)) in cones.iter().zip(samples.iter()).enumerate() {
                if let Some((radiance, weight)) = self.find(cone, sample) {
                    asked.push(*cone);
                    found.push((i, radiance, weight));
                }
            }
            let mut shares = vec![ConeSample::default(); asked.len()];
            self.share.trace_batch(&asked, &mut shares);
            for ((i, radiance, weight), share) in found.into_iter().zip(&shares) {
                let given = share.radiance[0] / share.opacity.max(1e-6);
                let weight = weight * (1.0 - fade(given, SHARE));
                let own = Vec3::from(samples[i].radiance);
                let radiance = if self.clipped { radiance.max(own) } else { radiance };
                samples[i].radiance = own.lerp(radiance, weight).to_array();
            }
        });
    }

    /// Returns the radiance of the surface that a cone's axis hits, and its weight.
    fn find(&self, cone: &Cone, sample: &ConeSample) -> Option<(Vec3, f32)> {
        let Cone { origin, direction, tan_half_angle } = *cone;
        let expected_m = sample.distance_m;
        if !(expected_m > 0.0 && expected_m.is_finite()) {
            return None;
        }
        let narrow = fade(2.0 * expected_m * tan_half_angle / self.edge_m, WIDE_EDGES);
        if narrow <= 0.0 {
            return None;
        }
        let offset = origin - self.position_m;
        let along_m = offset.dot(direction);
        let beside_squared = (offset.length_squared() - along_m * along_m).max(0.0);
        // The ray hits the room where its distance from the panorama's position equals the room's distance in that
        // direction.
        let mut met_m = expected_m;
        let mut apart_m = f32::INFINITY;
        for _ in 0..STEPS {
            let towards = offset + direction * met_m;
            let seen_m = self.seen_m(towards);
            apart_m = (towards.length() - seen_m).abs();
            if apart_m < 0.01 * self.edge_m {
                break;
            }
            met_m = (seen_m * seen_m - beside_squared).max(0.0).sqrt() - along_m;
        }
        let towards = offset + direction * met_m;
        let seen_m = towards.length();
        let apart =
            fade((met_m - expected_m).abs() / self.edge_m, APART_EDGES) * fade(apart_m / self.edge_m, APART_EDGES);
        if apart <= 0.0 || met_m <= 0.0 || seen_m <= 1e-3 {
            return None;
        }
        let direction = self.panorama_from_world * (towards / seen_m);
        Some((self.map.cone(direction, tan_half_angle * met_m / seen_m), narrow * apart))
    }

    /// Returns the distance of the surface that the panorama shows in a direction.
    fn seen_m(&self, direction: Vec3) -> f32 {
        let size = Vec2::new(self.distance_m.width() as f32, self.distance_m.height() as f32);
        let at = lo_geometry::uv_from_direction(direction.normalize_or(Vec3::NEG_Z)) * size;
        self.distance_m[(at.x as usize % self.distance_m.width(), (at.y as usize).min(self.distance_m.height() - 1))]
    }
}

/// Returns the octree with the panorama's share of each node's light, from 0 to 1, as its radiance.
fn shares(light: &LightOctree, laid: &PanoramaContribution) -> LightOctree {
    let mut shares = LightOctree { lobes: None, ..light.clone() };
    for (rows, given) in shares.rgba.iter_mut().zip(&laid.share) {
        for (row, given) in rows.iter_mut().zip(given) {
            row[..3].fill(f32::from(*given) / 255.0);
        }
    }
    shares
}
