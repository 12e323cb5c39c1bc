use lo_cone::{Cone, ConeSample, ConeTracer, Settings};
use lo_geometry::{Quat, Vec2, Vec3};
use lo_imaging::Image;
use lo_lights::PictureChange;
use lo_octree::LightOctree;
use lo_scene::{LaidPanorama, LitScene};
use rayon::prelude::*;

use crate::fade::fade;
use crate::map::RadianceMap;

/// Columns of the map of how far the panorama sees.
const COLUMNS: usize = 1024;

/// Edges of the leaves of unseen surfaces, which are guessed one depth coarser than what is seen is stored.
const UNSEEN_EDGES: f32 = 2.0;

/// Distances between where a cone is stopped and where its axis meets what the panorama sees, in edges of unseen leaves, from which on and up to
/// which the octree takes over.
const APART_EDGES: (f32, f32) = (1.0, 2.0);

/// Widths of cones where they meet something, in the same unit, from which on and up to which the octree takes over.
const WIDE_EDGES: (f32, f32) = (3.0, 6.0);

/// Share of what a cone meets that the panorama gave, below which and up to which it is not looked up: beside what the photo saw.
const SHARE: (f32, f32) = (0.2, 0.8);

/// Steps of the search for where a ray meets what the panorama sees.
const STEPS: usize = 6;

/// Cones that one task looks up; the result does not depend on it.
const CONES_PER_TASK: usize = 1024;

/// A panorama of the room that somebody gave, made ready to be looked up from anywhere where its light lies on the octree.
///
/// What it sees in a direction lies as far away as the octree has it. It answers with a weight that goes smoothly to 0, and the octree with the rest,
/// where the panorama gave less of the light, where the cone is wide compared with a leaf, and where it does not see what the cone meets.
pub struct PanoramaLookup {
    map: RadianceMap,
    panorama_from_world: Quat,
    place_m: Vec3,
    /// How far it sees, in metres, in the photo's axes.
    distance_m: Image<f32>,
    /// The octree with the panorama's share as radiance.
    share: ConeTracer,
    edge_m: f32,
    /// Whether its lights are as bright as the octree has them, or brighter, because it is clipped.
    clipped: bool,
}

impl PanoramaLookup {
    /// Of the scene's panorama, if it has one; `tracer` is of the scene's light as it is seen from that panorama's place.
    pub fn new(scene: &LitScene, tracer: &ConeTracer) -> Option<Self> {
        let laid = scene.panorama.as_ref()?;
        let picture = laid.picture.as_ref()?;
        let place_m = laid.source.position_m;
        let share = ConeTracer::new(&shares(&scene.light, laid), Settings::default()).ok()?;
        let mut radiance = picture.radiance.clone();
        if let Some(change) = scene.edited.as_ref().and_then(|edited| edited.octree.as_ref()) {
            PictureChange::new(&scene.light, change).panorama(&mut radiance, place_m, picture.world_from_panorama);
        }
        Some(Self {
            map: RadianceMap::new(radiance),
            panorama_from_world: picture.world_from_panorama.inverse(),
            place_m,
            distance_m: tracer.panorama(place_m, COLUMNS, COLUMNS / 2).distance_m,
            share,
            edge_m: UNSEEN_EDGES * scene.light.cube.node_edge_m(scene.light.octree.depth()),
            clipped: laid.source.clipped,
        })
    }

    /// Puts what the panorama shows into the radiance of samples of cones of the scene's octree.
    ///
    /// # Panics
    /// Where there are not as many samples as cones.
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

    /// Radiance of what the axis of a cone meets, and how far it is to be believed.
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
        let offset = origin - self.place_m;
        let along_m = offset.dot(direction);
        let beside_squared = (offset.length_squared() - along_m * along_m).max(0.0);
        // The ray meets the room where it is as far from the panorama's place as the room is in that direction.
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

    /// How far the panorama sees in a direction.
    fn seen_m(&self, direction: Vec3) -> f32 {
        let size = Vec2::new(self.distance_m.width() as f32, self.distance_m.height() as f32);
        let at = lo_geometry::uv_from_direction(direction.normalize_or(Vec3::NEG_Z)) * size;
        self.distance_m[(at.x as usize % self.distance_m.width(), (at.y as usize).min(self.distance_m.height() - 1))]
    }
}

/// The octree with how much of each node's light the panorama gave, from 0 to 1, in place of its radiance.
fn shares(light: &LightOctree, laid: &LaidPanorama) -> LightOctree {
    let mut shares = LightOctree { lobes: None, ..light.clone() };
    for (rows, given) in shares.rgba.iter_mut().zip(&laid.share) {
        for (row, given) in rows.iter_mut().zip(given) {
            row[..3].fill(f32::from(*given) / 255.0);
        }
    }
    shares
}
