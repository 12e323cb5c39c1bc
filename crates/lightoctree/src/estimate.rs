use std::time::Instant;

use completion::{Shell, ShellOptions, shell};
use geometry::Vec3;
use nets::light::LightError;
use octree::{LightOctree, OctreeError, RadiancePoint, check_depths};
use scene::{Completion, Frame, FrameError, Scene, Side, place_cube};

use crate::message::{Message, stage};

/// Choices of [`estimate`].
#[derive(Clone, Debug, PartialEq)]
pub struct EstimateOptions {
    /// Depth of the octree: leaves have 1/2^depth of the cube's edge. 7 by default.
    pub octree_depth: u32,
    /// Depth down to which the octree is full. 4 by default.
    pub full_depth: u32,
    /// How the unseen part of the room is filled. The shell by default.
    pub completion: Completion,
    /// Unit vector against gravity; from the floor where it is not given.
    pub up: Option<Vec3>,
    /// Names of the input files, kept in the scene.
    pub sources: Vec<String>,
}

impl Default for EstimateOptions {
    fn default() -> Self {
        Self { octree_depth: 7, full_depth: 4, completion: Completion::Shell, up: None, sources: Vec::new() }
    }
}

/// Why a frame gave no scene.
#[derive(Debug, thiserror::Error)]
pub enum EstimateError {
    /// The octree's depths or cube are impossible.
    #[error(transparent)]
    Octree(#[from] OctreeError),
    /// No pixel has a depth that can be used.
    #[error("no depth reading is left after flying pixels at depth edges were dropped")]
    NothingSeen,
    /// Asked for networks without giving any.
    #[error("completion by networks needs their weights: call `estimate_with_networks` or `estimate_from_photo`")]
    NoNetworks,
    /// The depth network's output is no number: its weights are damaged.
    #[error("the depth network's output is not finite: its weights are damaged")]
    PredictedDepth,
    /// Photo and predicted depth do not make a frame.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The light network failed.
    #[error(transparent)]
    Light(#[from] LightError),
}

/// From a photo with depth to a self-contained scene (SPEC §2, §11).
///
/// # Errors
/// No usable depth, impossible octree depths, `Completion::Network` (which needs [`Networks`](crate::Networks)).
pub fn estimate(
    frame: Frame,
    options: &EstimateOptions,
    messages: &mut dyn FnMut(Message),
) -> Result<Scene, EstimateError> {
    // Before any work: the shell's closing points grow with 4^depth.
    check_depths(options.octree_depth, options.full_depth)?;
    let working = stage(messages, "working resolution", || frame.working());
    let begun = Instant::now();
    let (points, cube, room) = match options.completion {
        Completion::Network => return Err(EstimateError::NoNetworks),
        Completion::None => {
            let clean = working.without_flying_pixels();
            let surfels = clean.surfels(&clean.radiance());
            let positions: Vec<Vec3> = surfels.iter().map(|surfel| surfel.position_m).collect();
            let points: Vec<RadiancePoint> = surfels.into_iter().map(RadiancePoint::from).collect();
            (points, place_cube(&positions), None)
        }
        Completion::Shell => {
            let shell_options =
                ShellOptions { up: options.up, octree_depth: options.octree_depth, ..ShellOptions::default() };
            let shell = shell(&working, &shell_options);
            notes(&shell).into_iter().for_each(|note| messages(Message::Note(note)));
            (shell.points(), shell.cube, Some(shell.room))
        }
    };
    if points.is_empty() {
        return Err(EstimateError::NothingSeen);
    }
    messages(Message::Stage { name: "completion", took: begun.elapsed() });
    let build = || LightOctree::from_points(&points, cube, options.octree_depth, options.full_depth);
    let (light, report) = stage(messages, "octree", build)?;
    if report.outside > 0 {
        messages(Message::Note(format!(
            "{} of {} points lie outside of the cube and were left out",
            report.outside,
            points.len()
        )));
    }
    let sources = options.sources.clone();
    Ok(Scene { light, frame, completion: options.completion, room, sources, prediction: None })
}

/// What a user should know about a completion.
fn notes(shell: &Shell) -> Vec<String> {
    let not_seen = |side: Side| shell.room.planes.iter().filter(|plane| plane.side == side && !plane.measured).count();
    let mut assumed = Vec::new();
    if not_seen(Side::Floor) > 0 {
        assumed.push("the floor".to_owned());
    }
    if not_seen(Side::Ceiling) > 0 {
        assumed.push("the ceiling".to_owned());
    }
    if not_seen(Side::Wall) > 0 {
        assumed.push(format!("{} of 4 walls", not_seen(Side::Wall)));
    }
    let mut notes = shell.report.notes();
    if !assumed.is_empty() {
        notes.push(format!("not seen, so their place is assumed: {}", assumed.join(", ")));
    }
    notes
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use geometry::Camera;
    use imaging::{DepthMap, Image, Photo};

    /// A wall two metres away, grey, 96 × 64 pixels.
    fn wall() -> Frame {
        let photo = Photo::Srgb8(Image::new(96, 64, vec![[128; 3]; 96 * 64]));
        let depth_m = DepthMap::new(96, 64, vec![2.0; 96 * 64]);
        Frame::new(photo, depth_m, Camera::from_hfov_deg(65.0, 96, 64).unwrap(), 1.0).unwrap()
    }

    #[test]
    fn without_completion_only_the_seen_is_there() {
        let options = EstimateOptions { completion: Completion::None, ..EstimateOptions::default() };
        let scene = estimate(wall(), &options, &mut |_| ()).unwrap();
        // 128 of 255 is 0.2158605 by IEC 61966-2-1
        for rgba in scene.light.rgba.last().unwrap() {
            assert!((rgba[0] - 0.215_860_5).abs() < 1e-6, "{rgba:?}");
        }
        assert!(scene.light.seen.last().unwrap().iter().all(|&share| share == 255));
        let edge_m = scene.light.cube.node_edge_m(7);
        let level = &scene.light.octree.levels()[7];
        for (&key, _) in level.keys.iter().zip(&level.rows).filter(|(_, row)| **row >= 0) {
            let z = scene.light.cube.origin_m.z + octree::xyz_from_key(key)[2] as f32 * edge_m;
            assert!((-2.0 - edge_m..=-2.0 + edge_m).contains(&z), "a leaf at {z} m");
        }
    }

    #[test]
    fn the_shell_adds_what_is_not_seen_and_says_so() {
        let mut messages = Vec::new();
        let scene = estimate(wall(), &EstimateOptions::default(), &mut |message| messages.push(message)).unwrap();
        assert!(scene.light.seen.last().unwrap().contains(&0));
        assert_eq!(scene.room.as_ref().unwrap().planes.len(), 6);
        let stages = messages.iter().filter(|message| matches!(message, Message::Stage { .. })).count();
        assert_eq!(stages, 3);
        assert!(messages.iter().any(|message| matches!(message, Message::Note(note) if note.contains("assumed"))));
    }

    #[test]
    fn what_cannot_be_done_is_an_error() {
        let network = EstimateOptions { completion: Completion::Network, ..EstimateOptions::default() };
        assert!(matches!(estimate(wall(), &network, &mut |_| ()), Err(EstimateError::NoNetworks)));
        let deep = EstimateOptions { octree_depth: 40, ..EstimateOptions::default() };
        assert!(matches!(estimate(wall(), &deep, &mut |_| ()), Err(EstimateError::Octree(_))));
    }
}
