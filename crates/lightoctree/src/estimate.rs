use std::time::{Duration, Instant};

use completion::{Shell, ShellOptions, shell};
use geometry::Vec3;
use octree::{LightOctree, OctreeError, RadiancePoint};
use scene::{Completion, Frame, Scene, Side, place_cube};

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
    /// Asked for what this version cannot do.
    #[error("completion by a network needs trained weights, and this version ships none")]
    NoWeights,
}

/// What a long-running call says on its way; every front end consumes the same stream.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// A stage is done.
    Stage {
        /// What was done.
        name: &'static str,
        /// How long it took.
        took: Duration,
    },
    /// Something that the user should know.
    Note(String),
}

/// From a photo with depth to a self-contained scene (SPEC §2, §11).
///
/// # Errors
/// No usable depth, impossible octree depths, `Completion::Network`.
pub fn estimate(
    frame: Frame,
    options: &EstimateOptions,
    messages: &mut dyn FnMut(Message),
) -> Result<Scene, EstimateError> {
    let begun = Instant::now();
    let working = frame.working();
    messages(Message::Stage { name: "working resolution", took: begun.elapsed() });
    let begun = Instant::now();
    let (points, cube, room) = match options.completion {
        Completion::Network => return Err(EstimateError::NoWeights),
        Completion::None => {
            let surfels = working.surfels(&working.radiance());
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
    let begun = Instant::now();
    let (light, report) = LightOctree::from_points(&points, cube, options.octree_depth, options.full_depth)?;
    messages(Message::Stage { name: "octree", took: begun.elapsed() });
    if report.outside > 0 {
        messages(Message::Note(format!(
            "{} of {} points lie outside of the cube and were left out",
            report.outside,
            points.len()
        )));
    }
    Ok(Scene { light, frame, completion: options.completion, room, sources: options.sources.clone() })
}

/// What a user should know about a completion.
fn notes(shell: &Shell) -> Vec<String> {
    let report = &shell.report;
    let all = (report.seen + report.filled).max(1) as f64;
    let mut notes = Vec::new();
    if report.filled as f64 > 0.05 * all {
        let share = 100.0 * report.filled as f64 / all;
        notes.push(format!("{share:.0} % of the pixels have no usable depth; theirs was filled in"));
    }
    let assumed: Vec<&str> = [Side::Floor, Side::Ceiling]
        .into_iter()
        .filter(|side| shell.room.planes.iter().any(|plane| plane.side == *side && !plane.measured))
        .map(|side| if side == Side::Floor { "floor" } else { "ceiling" })
        .collect();
    let walls = shell.room.planes.iter().filter(|plane| plane.side == Side::Wall && !plane.measured).count();
    if !assumed.is_empty() || walls > 0 {
        let mut parts: Vec<String> = assumed.into_iter().map(str::to_owned).collect();
        if walls > 0 {
            parts.push(format!("{walls} of 4 walls"));
        }
        notes.push(format!("not seen, so their place is assumed: {}", parts.join(", ")));
    }
    notes
}
