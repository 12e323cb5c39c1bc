//! The light of the whole room, in each of the ways to complete it.

use lo_completion::{ShellOptions, filled_warning, shell_of_photos};
use lo_events::{OnEvent, Stage, Warning, stage, warn};
use lo_geometry::{Cube, Vec3};
use lo_nets::{CompletedLight, Networks, ObservedRoom};
use lo_octree::{LightOctree, RadiancePoint};
use lo_scene::{ObservedPhoto, Room, Surfel, place_cube};

use crate::view::{View, srgb8};
use crate::{EstimateError, EstimateOptions, SeenFrame};

/// The light of the room, and what belongs to it in a scene.
pub(crate) struct Completed {
    pub light: LightOctree,
    pub room: Option<Room>,
    pub confidence: Option<Vec<Vec<u8>>>,
}

/// The room by the light network.
pub(crate) fn by_network(
    view: &View,
    networks: &Networks,
    octree_depth: u32,
    options: &EstimateOptions,
    on_event: OnEvent<'_>,
) -> Result<Completed, EstimateError> {
    let global = match &view.global {
        Some(global) => global.clone(),
        None => stage(on_event, Stage::GlobalLight, || networks.global_light(&srgb8(&view.working.photo)))?,
    };
    let seen =
        SeenFrame::of_photos(&view.photos(), options.up, view.normals.as_ref()).ok_or(EstimateError::NothingSeen)?;
    let filled = seen.points.len() - seen.surfels.len();
    filled_warning(seen.surfels.len(), filled).into_iter().try_for_each(|warning| warn(on_event, warning))?;
    let completed = stage(on_event, Stage::LightNetwork, || {
        let room = ObservedRoom { points: &seen.points, views: &seen.views, cube: seen.cube, up: seen.room.up };
        networks.complete(&room, global, octree_depth, options.seed)
    })??;
    let CompletedLight { light, confidence, warnings } = completed;
    warnings.into_iter().try_for_each(|warning| warn(on_event, warning))?;
    let confidence = confidence.into_iter().map(|level| level.into_iter().map(|c| (255.0 * c).round() as u8).collect());
    Ok(Completed { light, room: Some(seen.room), confidence: Some(confidence.collect()) })
}

/// What the photo saw, and nothing else.
pub(crate) fn observed_only(
    view: &View,
    octree_depth: u32,
    options: &EstimateOptions,
    on_event: OnEvent<'_>,
) -> Result<Completed, EstimateError> {
    let (points, cube) = stage(on_event, Stage::Completion, || {
        let surfels: Vec<Surfel> = view.seen_photos().iter().flat_map(ObservedPhoto::surfels).collect();
        let positions: Vec<Vec3> = surfels.iter().map(|surfel| surfel.position_m).collect();
        let points: Vec<RadiancePoint> = surfels.into_iter().map(RadiancePoint::from).collect();
        (points, place_cube(&positions))
    })?;
    let light = octree_of(&points, cube, octree_depth, options, on_event)?;
    Ok(Completed { light, room: None, confidence: None })
}

/// The room closed by planes.
pub(crate) fn closed(
    view: &View,
    octree_depth: u32,
    options: &EstimateOptions,
    on_event: OnEvent<'_>,
) -> Result<Completed, EstimateError> {
    let shell_options = ShellOptions { up: options.up, octree_depth, ..ShellOptions::default() };
    let shell = stage(on_event, Stage::Completion, || shell_of_photos(&view.seen_photos(), &shell_options))?;
    shell.warnings().into_iter().try_for_each(|warning| warn(on_event, warning))?;
    let light = octree_of(&shell.points(), shell.cube, octree_depth, options, on_event)?;
    Ok(Completed { light, room: Some(shell.room), confidence: None })
}

fn octree_of(
    points: &[RadiancePoint],
    cube: Cube,
    octree_depth: u32,
    options: &EstimateOptions,
    on_event: OnEvent<'_>,
) -> Result<LightOctree, EstimateError> {
    if points.is_empty() {
        return Err(EstimateError::NothingSeen);
    }
    let build = || LightOctree::from_points(points, cube, octree_depth, options.full_depth);
    let (light, report) = stage(on_event, Stage::Octree, build)??;
    if report.outside > 0 {
        warn(on_event, Warning::OutsideCube { outside: report.outside, points: points.len() })?;
    }
    Ok(light)
}
