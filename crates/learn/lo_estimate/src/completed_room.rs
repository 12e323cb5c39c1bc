//! Completes the room's light by one of three methods.

use lo_completion::{ShellOptions, filled_warning, shell_of_photos};
use lo_events::{OnEvent, stage, warn};
use lo_geometry::{Cube, Vec3};
use lo_nets::{CompletedLight, Networks, ObservedRoom};
use lo_octree::{LightOctree, RadiancePoint};
use lo_scene::{ObservedPhoto, Room, Surfel, place_cube};

use crate::prepared_input::PreparedInput;
use crate::{EstimateError, EstimateOptions, EstimateWarning, ObservedFrame, stages};

/// The light of a room, with what an estimate stores beside it.
pub(crate) struct CompletedRoom {
    pub light: LightOctree,
    pub room: Option<Room>,
    pub confidence: Option<Vec<Vec<u8>>>,
}

/// Completes the room by the light network.
pub(crate) fn by_network(
    input: &PreparedInput,
    networks: &Networks,
    octree_depth: u32,
    options: &EstimateOptions,
    on_event: OnEvent<'_>,
) -> Result<CompletedRoom, EstimateError> {
    let global = match &input.global {
        Some(global) => global.clone(),
        None => stage(on_event, stages::GLOBAL_LIGHT, || networks.global_light(&input.working.photo.srgb8()))?,
    };
    let observed = ObservedFrame::from_photos(&input.working_frames(), input.observed(), options.up)
        .ok_or(EstimateError::NoUsableDepth)?;
    let filled = observed.points.len() - observed.surfels.len();
    filled_warning(observed.surfels.len(), filled).into_iter().try_for_each(|warning| warn(on_event, warning))?;
    let completed = stage(on_event, stages::LIGHT_NETWORK, || {
        let room = ObservedRoom {
            points: &observed.points,
            views: &observed.views,
            cube: observed.cube,
            up: observed.room.up,
        };
        networks.complete(&room, global, octree_depth, options.seed)
    })??;
    let CompletedLight { light, confidence, warnings } = completed;
    warnings.into_iter().try_for_each(|warning| warn(on_event, warning))?;
    let confidence = confidence.into_iter().map(|level| level.into_iter().map(|c| (255.0 * c).round() as u8).collect());
    Ok(CompletedRoom { light, room: Some(observed.room), confidence: Some(confidence.collect()) })
}

/// Keeps only what the photos observe.
pub(crate) fn observed_only(
    input: &PreparedInput,
    octree_depth: u32,
    options: &EstimateOptions,
    on_event: OnEvent<'_>,
) -> Result<CompletedRoom, EstimateError> {
    let (points, cube) = stage(on_event, stages::COMPLETION, || {
        let surfels: Vec<Surfel> = input.observed().iter().flat_map(ObservedPhoto::surfels).collect();
        let positions: Vec<Vec3> = surfels.iter().map(|surfel| surfel.position_m).collect();
        let points: Vec<RadiancePoint> = surfels.into_iter().map(RadiancePoint::from).collect();
        (points, place_cube(&positions))
    })?;
    let light = octree_from_points(&points, cube, octree_depth, options, on_event)?;
    Ok(CompletedRoom { light, room: None, confidence: None })
}

/// Closes the room by planes.
pub(crate) fn by_shell(
    input: &PreparedInput,
    octree_depth: u32,
    options: &EstimateOptions,
    on_event: OnEvent<'_>,
) -> Result<CompletedRoom, EstimateError> {
    let shell_options = ShellOptions { up: options.up, octree_depth, ..ShellOptions::default() };
    let shell = stage(on_event, stages::COMPLETION, || shell_of_photos(input.observed(), &shell_options))?;
    shell.warnings().into_iter().try_for_each(|warning| warn(on_event, warning))?;
    let light = octree_from_points(&shell.points(), shell.cube, octree_depth, options, on_event)?;
    Ok(CompletedRoom { light, room: Some(shell.room), confidence: None })
}

fn octree_from_points(
    points: &[RadiancePoint],
    cube: Cube,
    octree_depth: u32,
    options: &EstimateOptions,
    on_event: OnEvent<'_>,
) -> Result<LightOctree, EstimateError> {
    if points.is_empty() {
        return Err(EstimateError::NoUsableDepth);
    }
    let build = || LightOctree::from_points(points, cube, octree_depth, options.full_depth);
    let (light, report) = stage(on_event, stages::OCTREE, build)??;
    if report.outside > 0 {
        warn(on_event, EstimateWarning::OutsideCube { outside: report.outside, points: points.len() })?;
    }
    Ok(light)
}
