//! Application of a panorama's light to the leaves of the octree.

use lo_geometry::Cube;
use lo_octree::{Ancestor, LightOctree, MAX_DEPTH, OctreeError};
use lo_scene::ObservedPhoto;

use super::leaves::LeafSet;
use super::rays::Rays;
use super::{PanoramaMatch, PanoramaPrior};

/// Levels beyond the octree's depth to which leaves may be split where the panorama has detail.
const EXTRA_DEPTH: u32 = 1;

/// Greatest number of added leaves per existing leaf.
const MAX_ADDED: usize = 3;

/// Columns of the rays that deposit light, and of those that decide on splits.
const COLUMNS: usize = 1024;
const PLANNING_COLUMNS: usize = 512;

/// Result of applying a panorama.
#[derive(Clone, Debug, PartialEq)]
pub struct PanoramaReport {
    /// `share[d][row]`: the panorama's share in a row's radiance, 0 to 255.
    pub share: Vec<Vec<u8>>,
    /// Number of leaves with light of the panorama.
    pub leaves: usize,
    /// Number of leaves that were split, each into eight.
    pub split: usize,
    /// Number of leaves added at the cube's sides.
    pub added: usize,
    /// Factor per channel on the leaves that neither photo nor panorama shows.
    pub unobserved_factor: [f32; 3],
    /// Factor on the lamps so that, at the panorama's position, they are as bright as in the panorama.
    pub lamp_factor: f32,
}

/// Reasons why a panorama cannot be applied.
#[derive(Debug, thiserror::Error)]
pub enum ApplyPanoramaError {
    /// The panorama was taken outside the octree's cube.
    #[error(
        "the panorama's position ({x:.2}, {y:.2}, {z:.2}) is outside the room's cube, which extends from ({:.1}, {:.1}, {:.1}) to ({:.1}, {:.1}, {:.1}) metres",
        cube.origin_m.x, cube.origin_m.y, cube.origin_m.z,
        cube.origin_m.x + cube.edge_m, cube.origin_m.y + cube.edge_m, cube.origin_m.z + cube.edge_m
    )]
    Outside {
        /// X coordinate of the position, in metres.
        x: f32,
        /// Y coordinate of the position, in metres.
        y: f32,
        /// Z coordinate of the position, in metres.
        z: f32,
        /// The octree's cube.
        cube: Cube,
    },
    /// The octree cannot be built.
    #[error(transparent)]
    Octree(#[from] OctreeError),
}

/// Applies a panorama to a completed octree: leaves that the photo (at [working resolution](lo_scene::Frame::working))
/// did not observe get the light that the panorama shows of them.
///
/// - Rays from the panorama's position deposit their radiance on the leaves that they hit, weighted by each leaf's
///   share in stopping the ray. There is one ray per pixel for up to 1024 columns, several per pixel for smaller
///   panoramas. A leaf gets the mean of its deposits, so that the position receives the panorama's light from the room.
/// - Leaves with large differences inside are split, largest differences first, to at most one level beyond the
///   octree's depth (two for lamps).
/// - A lamp's light is deposited only on the leaf that closes the ray and closely behind it.
/// - Where a ray leaves the cube, a leaf is added at the cube's side.
/// - Leaves that neither photo nor panorama shows keep their completed radiance, times the median ratio of panorama to
///   completion where both are known.
/// - Leaves that the photo observed are unchanged, except those whose observed pixels are all clipped.
///
/// `confidence`, if given, gets the match's confidence where the panorama contributed light and the network was less
/// confident. Deterministic.
///
/// # Errors
/// A position outside the cube; leaves that do not form an octree.
pub fn apply_panorama(
    light: &mut LightOctree,
    confidence: Option<&mut Vec<Vec<u8>>>,
    prior: &PanoramaPrior,
    found: &PanoramaMatch,
    photo: &ObservedPhoto,
) -> Result<PanoramaReport, ApplyPanoramaError> {
    let position_m = prior.position_m;
    if !light.cube.contains(position_m) {
        let [x, y, z] = position_m.to_array();
        return Err(ApplyPanoramaError::Outside { x, y, z, cube: light.cube });
    }
    let rays = Rays::new(prior, found, PLANNING_COLUMNS);
    let mut room = LeafSet::new(light, confidence.as_deref(), photo);
    let mut budget = MAX_ADDED * room.leaves.len();
    let finest = (light.octree.depth() + EXTRA_DEPTH).min(MAX_DEPTH);
    let mut topology = light.clone();
    topology.lobes = None;
    let (mut split, mut added) = (0, 0);
    loop {
        let deposits = room.cast_rays(&topology, &rays, position_m);
        let sides = if added == 0 { deposits.sides.len() } else { 0 };
        added += sides;
        let chosen = room.to_split(&deposits, &rays, finest, budget);
        let closed = room.close_lamps(&deposits);
        if chosen.is_empty() && sides == 0 && !closed {
            break;
        }
        split += chosen.len();
        budget = budget.saturating_sub(7 * chosen.len() + sides);
        if sides > 0 {
            room.add_sides(&deposits.sides);
        }
        room.split(&chosen, &deposits);
        topology = room.octree(light, |_, _| Ancestor::Known([0.0; 4], 0))?;
    }
    let deposits = room.cast_rays(&topology, &Rays::new(prior, found, COLUMNS), position_m);
    room.assign_light(&deposits);
    let lamp_factor = room.balance_lamps(light, &deposits, position_m)?;
    let leaves = room.leaves.iter().filter(|leaf| leaf.light.is_some()).count();
    let unobserved_factor = room.scale_hidden(&deposits);
    let share = room.finish(light, confidence, found.confidence)?;
    Ok(PanoramaReport { share, leaves, split, added, unobserved_factor, lamp_factor })
}
