use completion::{Shell, ShellOptions, shell, up_from_predicted_depth};
use geometry::{Camera, Cube, Vec3};
use imaging::Photo;
use nets::light::LightError;
use nets::{GlobalLight, Networks};
use octree::{LightOctree, OctreeError, RadiancePoint, check_depths};
use scene::{Completion, Frame, FrameError, Room, Scene, Side, place_cube};

use crate::message::{Message, stage};
use crate::network;

/// Depth of the octree where none is asked for.
pub const DEFAULT_OCTREE_DEPTH: u32 = 7;

/// What an estimate starts from.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// A photo with measured depth.
    Frame(Frame),
    /// A photo alone, whose depth the depth network predicts.
    Photo {
        /// The photo, of at least 16 pixels.
        photo: Photo,
        /// The camera, in pixels of the photo.
        camera: Camera,
    },
}

/// Choices of [`estimate`].
#[derive(Clone, Debug, PartialEq)]
pub struct EstimateOptions {
    /// Depth of the octree: leaves have 1/2^depth of the cube's edge. 7 by default, or the network's own where that is more. Deeper than a
    /// network's own, what the photo shows is that fine, and what it does not is as coarse as the network makes it.
    pub octree_depth: Option<u32>,
    /// Depth down to which the octree is full where no network makes it. 4 by default.
    pub full_depth: u32,
    /// How the unseen part of the room is filled. The shell by default.
    pub completion: Completion,
    /// Unit vector against gravity. Where it is not given: from the surfaces, and if depth is predicted also from how cameras are held.
    pub up: Option<Vec3>,
    /// Seed of the places of the points that carry the global light into what the network has not seen.
    pub seed: u64,
    /// Names of the input files, kept in the scene.
    pub sources: Vec<String>,
}

impl Default for EstimateOptions {
    fn default() -> Self {
        Self {
            octree_depth: None,
            full_depth: 4,
            completion: Completion::Shell,
            up: None,
            seed: 0,
            sources: Vec::new(),
        }
    }
}

/// Why there is no scene.
#[derive(Debug, thiserror::Error)]
pub enum EstimateError {
    /// The octree's depths or cube are impossible.
    #[error(transparent)]
    Octree(#[from] OctreeError),
    /// No pixel has a depth that can be used.
    #[error("no depth reading is left after flying pixels at depth edges were dropped")]
    NothingSeen,
    /// Networks are needed for what was asked for, and none were given.
    #[error("{0} needs the weights of the networks")]
    NoNetworks(&'static str),
    /// The light network makes deeper octrees.
    #[error("the light network makes octrees of depth {own} at least, not {asked}")]
    OctreeDepth {
        /// What was asked for.
        asked: u32,
        /// The network's own depth.
        own: u32,
    },
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

impl From<Frame> for Input {
    fn from(frame: Frame) -> Self {
        Self::Frame(frame)
    }
}

/// From a photo, with measured depth or without, to a self-contained scene (SPEC §2, §11).
///
/// `networks` predict depth where there is none, and complete the room where the options say so. The same input, options and weights
/// give the same scene to the bit, on any number of threads. What the photo shows unclipped is in the scene as it was seen.
///
/// # Errors
/// No usable depth, impossible octree depths, networks that are needed and not given, networks whose output is not finite.
pub fn estimate(
    input: impl Into<Input>,
    networks: Option<&Networks>,
    options: &EstimateOptions,
    messages: &mut dyn FnMut(Message),
) -> Result<Scene, EstimateError> {
    let (how, octree_depth) = how(networks, options)?;
    let (view, predicted_depth) = match input.into() {
        Input::Frame(frame) => {
            let working = stage(messages, "working resolution", || frame.working());
            (View { frame, working, global: None }, false)
        }
        Input::Photo { photo, camera } => {
            let networks = networks.ok_or(EstimateError::NoNetworks("a photo without depth"))?;
            (network::predicted_view(photo, camera, networks, messages)?, true)
        }
    };
    // Predicted floors are wavy: how cameras are held counts too.
    let up = options.up.or_else(|| predicted_depth.then(|| up_from_predicted_depth(&view.frame)));
    let options = &EstimateOptions { up, ..options.clone() };
    let Completed { light, room, confidence } = match how {
        How::Network(networks) => network::complete(&view, networks, octree_depth, options, messages)?,
        How::Shell => closed(&view.working, octree_depth, options, messages)?,
        How::None => as_seen(&view.working, octree_depth, options, messages)?,
    };
    let (frame, completion, sources) = (view.frame, options.completion, options.sources.clone());
    Ok(Scene { light, frame, completion, room, sources, predicted_depth, confidence })
}

/// A photo with depth, at full and at working resolution.
pub(crate) struct View {
    pub frame: Frame,
    pub working: Frame,
    /// What the photo tells of the light outside of it, where that is known already.
    pub global: Option<GlobalLight>,
}

/// The light of the room, and what belongs to it in a scene.
pub(crate) struct Completed {
    pub light: LightOctree,
    pub room: Option<Room>,
    pub confidence: Option<Vec<Vec<u8>>>,
}

/// How the room is completed, with what that needs.
enum How<'a> {
    Network(&'a Networks),
    Shell,
    None,
}

/// How, and down to which depth: the options are checked before any work, since the shell's closing points grow with 4^depth.
fn how<'a>(networks: Option<&'a Networks>, options: &EstimateOptions) -> Result<(How<'a>, u32), EstimateError> {
    let mut octree_depth = options.octree_depth.unwrap_or(DEFAULT_OCTREE_DEPTH);
    let how = match options.completion {
        Completion::Network => {
            let networks = networks.ok_or(EstimateError::NoNetworks("completion by a network"))?;
            let own = networks.config.depth;
            if let Some(asked) = options.octree_depth.filter(|&asked| asked < own) {
                return Err(EstimateError::OctreeDepth { asked, own });
            }
            octree_depth = octree_depth.max(own);
            How::Network(networks)
        }
        Completion::Shell => How::Shell,
        Completion::None => How::None,
    };
    check_depths(octree_depth, options.full_depth)?;
    Ok((how, octree_depth))
}

/// What the photo saw, and nothing else.
fn as_seen(
    working: &Frame,
    octree_depth: u32,
    options: &EstimateOptions,
    messages: &mut dyn FnMut(Message),
) -> Result<Completed, EstimateError> {
    let (points, cube) = stage(messages, "completion", || {
        let clean = working.without_flying_pixels();
        let surfels = clean.surfels(&clean.radiance());
        let positions: Vec<Vec3> = surfels.iter().map(|surfel| surfel.position_m).collect();
        let points: Vec<RadiancePoint> = surfels.into_iter().map(RadiancePoint::from).collect();
        (points, place_cube(&positions))
    });
    let light = octree_of(&points, cube, octree_depth, options, messages)?;
    Ok(Completed { light, room: None, confidence: None })
}

/// The room closed by planes.
fn closed(
    working: &Frame,
    octree_depth: u32,
    options: &EstimateOptions,
    messages: &mut dyn FnMut(Message),
) -> Result<Completed, EstimateError> {
    let shell_options = ShellOptions { up: options.up, octree_depth, ..ShellOptions::default() };
    let shell = stage(messages, "completion", || shell(working, &shell_options));
    notes(&shell).into_iter().for_each(|note| messages(Message::Note(note)));
    let light = octree_of(&shell.points(), shell.cube, octree_depth, options, messages)?;
    Ok(Completed { light, room: Some(shell.room), confidence: None })
}

fn octree_of(
    points: &[RadiancePoint],
    cube: Cube,
    octree_depth: u32,
    options: &EstimateOptions,
    messages: &mut dyn FnMut(Message),
) -> Result<LightOctree, EstimateError> {
    if points.is_empty() {
        return Err(EstimateError::NothingSeen);
    }
    let build = || LightOctree::from_points(points, cube, octree_depth, options.full_depth);
    let (light, report) = stage(messages, "octree", build)?;
    if report.outside > 0 {
        messages(Message::Note(format!(
            "{} of {} points lie outside of the cube and were left out",
            report.outside,
            points.len()
        )));
    }
    Ok(light)
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
        let scene = estimate(wall(), None, &options, &mut |_| ()).unwrap();
        // 128 of 255 is 0.2158605 by IEC 61966-2-1
        for rgba in scene.light.rgba.last().unwrap() {
            assert!((rgba[0] - 0.215_860_5).abs() < 1e-6, "{rgba:?}");
        }
        assert!(scene.light.seen.last().unwrap().iter().all(|&share| share == 255));
        let edge_m = scene.light.cube.node_edge_m(7);
        let level = &scene.light.octree.levels()[7];
        for key in level.row_keys() {
            let z = scene.light.cube.origin_m.z + octree::xyz_from_key(key)[2] as f32 * edge_m;
            assert!((-2.0 - edge_m..=-2.0 + edge_m).contains(&z), "a leaf at {z} m");
        }
    }

    #[test]
    fn the_shell_adds_what_is_not_seen_and_says_so() {
        let mut messages = Vec::new();
        let scene = estimate(wall(), None, &EstimateOptions::default(), &mut |message| messages.push(message)).unwrap();
        assert!(scene.light.seen.last().unwrap().contains(&0));
        assert_eq!(scene.room.as_ref().unwrap().planes.len(), 6);
        let stages = messages.iter().filter(|message| matches!(message, Message::Stage { .. })).count();
        assert_eq!(stages, 3);
        assert!(messages.iter().any(|message| matches!(message, Message::Note(note) if note.contains("assumed"))));
    }

    #[test]
    fn what_cannot_be_done_is_an_error() {
        let network = EstimateOptions { completion: Completion::Network, ..EstimateOptions::default() };
        let error = |input: Input, options: &EstimateOptions| estimate(input, None, options, &mut |_| ()).unwrap_err();
        assert!(matches!(error(wall().into(), &network), EstimateError::NoNetworks("completion by a network")));
        let Frame { photo, camera, .. } = wall();
        let alone = error(Input::Photo { photo, camera }, &EstimateOptions::default());
        assert!(matches!(alone, EstimateError::NoNetworks("a photo without depth")));
        let deep = EstimateOptions { octree_depth: Some(40), ..EstimateOptions::default() };
        assert!(matches!(error(wall().into(), &deep), EstimateError::Octree(_)));
    }
}
