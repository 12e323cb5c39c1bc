//! The panorama's light on the leaves of the octree.

use lo_geometry::Cube;
use lo_octree::{Ancestor, LightOctree, MAX_DEPTH, OctreeError};
use lo_scene::Frame;

use super::leaves::Leaves;
use super::rays::Rays;
use super::{PanoramaMatch, PanoramaPrior};

/// Leaves may be split to so much more than the octree's depth, where the panorama shows detail.
const EXTRA_DEPTH: u32 = 1;

/// For each leaf that there was, at most so many may be added.
const MAX_ADDED: usize = 3;

/// Columns of the rays that give the light, and of those that tell where leaves are split.
const COLUMNS: usize = 1024;
const PLANNING_COLUMNS: usize = 512;

/// What was laid.
#[derive(Clone, Debug, PartialEq)]
pub struct LaidLight {
    /// `share[d][row]`: how much of a row's radiance the panorama gave, 0 to 255.
    pub share: Vec<Vec<u8>>,
    /// Leaves with light of the panorama.
    pub laid: usize,
    /// Leaves that were split, each into eight.
    pub split: usize,
    /// Leaves that were put at the cube's side.
    pub at_side: usize,
    /// Factor, by channel, for the leaves that neither photo nor panorama sees.
    pub hidden_factor: [f32; 3],
    /// Factor for the lamps, so that together they send the panorama's place what it shows of them.
    pub lamp_factor: f32,
}

/// Why nothing can be laid.
#[derive(Debug, thiserror::Error)]
pub enum LayError {
    /// The panorama was taken outside of the octree's cube.
    #[error(
        "the panorama's place ({x:.2}, {y:.2}, {z:.2}) lies outside of the room's cube, which reaches from ({:.1}, {:.1}, {:.1}) to ({:.1}, {:.1}, {:.1}) metres",
        cube.origin_m.x, cube.origin_m.y, cube.origin_m.z,
        cube.origin_m.x + cube.edge_m, cube.origin_m.y + cube.edge_m, cube.origin_m.z + cube.edge_m
    )]
    Outside {
        /// The place, metres.
        x: f32,
        /// The place, metres.
        y: f32,
        /// The place, metres.
        z: f32,
        /// The cube.
        cube: Cube,
    },
    /// The octree cannot be built.
    #[error(transparent)]
    Octree(#[from] OctreeError),
}

/// Lays a panorama onto a completed octree: leaves that the photo (`frame`, at [working resolution](Frame::working)) did not see get the light that the
/// panorama shows of them.
///
/// Rays from the panorama's place, one for each of its pixels (of 1024 columns at most, several for each pixel of smaller ones), give their radiance to the leaves that
/// they meet, in the measure in which each closes the ray; a leaf has the mean of what it is given. So the light that the place receives from the room is that of
/// the panorama. Leaves within which it differs are split, the strongest differences first, to one more than the octree's depth (lamps: two). What is a lamp's lies on the
/// leaf that closes the ray and close behind it alone. Where a
/// ray leaves the cube, a leaf is put at the cube's side. Leaves that neither photo nor panorama sees keep what completion gave them, times the median ratio of
/// both where both speak. Leaves that the photo saw stay as they are, but for those in which all that it saw was clipped. `confidence`, where there is one, gets the match's where the panorama gave light and the network was less
/// sure. Deterministic.
///
/// # Errors
/// A place outside of the cube.
pub fn lay_panorama(
    light: &mut LightOctree,
    confidence: Option<&mut Vec<Vec<u8>>>,
    prior: &PanoramaPrior,
    found: &PanoramaMatch,
    frame: &Frame,
) -> Result<LaidLight, LayError> {
    let place = prior.position_m;
    if !light.cube.contains(place) {
        let [x, y, z] = place.to_array();
        return Err(LayError::Outside { x, y, z, cube: light.cube });
    }
    let rays = Rays::new(prior, found, PLANNING_COLUMNS);
    let mut room = Leaves::new(light, confidence.as_deref(), frame);
    let mut budget = MAX_ADDED * room.leaves.len();
    let finest = (light.octree.depth() + EXTRA_DEPTH).min(MAX_DEPTH);
    let mut topology = light.clone();
    topology.lobes = None;
    let (mut split, mut at_side) = (0, 0);
    loop {
        let given = room.given(&topology, &rays, place);
        let sides = if at_side == 0 { given.sides.len() } else { 0 };
        at_side += sides;
        let chosen = room.to_split(&given, &rays, finest, budget);
        let closed = room.close_lamps(&given);
        if chosen.is_empty() && sides == 0 && !closed {
            break;
        }
        split += chosen.len();
        budget = budget.saturating_sub(7 * chosen.len() + sides);
        if sides > 0 {
            room.add_sides(&given.sides);
        }
        room.split(&chosen, &given);
        topology = room.octree(light, |_, _| Ancestor::Known([0.0; 4], 0))?;
    }
    let given = room.given(&topology, &Rays::new(prior, found, COLUMNS), place);
    room.take(&given);
    let lamp_factor = room.balance_lamps(light, &given, place)?;
    let laid = room.leaves.iter().filter(|leaf| leaf.light.is_some()).count();
    let hidden_factor = room.scale_hidden(&given);
    let share = room.finish(light, confidence, found.confidence)?;
    Ok(LaidLight { share, laid, split, at_side, hidden_factor, lamp_factor })
}
