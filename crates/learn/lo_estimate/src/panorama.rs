//! A panorama of the room on what the photo does not show.

use lo_completion::{MIN_CONFIDENCE, PanoramaPrior, apply_panorama, match_panorama};
use lo_events::{OnEvent, Stage, Warning, stage, warn};
use lo_geometry::{Quat, Vec3};
use lo_scene::{Frame, PanoramaContribution, PanoramaImage};

use crate::EstimateError;
use crate::completed::Completed;

/// Finds out how the panorama lies in the completed room, and lays it.
pub(crate) fn laid(
    completed: &mut Completed,
    prior: &PanoramaPrior,
    working: &Frame,
    on_event: OnEvent<'_>,
) -> Result<PanoramaContribution, EstimateError> {
    prior.warnings().into_iter().try_for_each(|warning| warn(on_event, warning))?;
    let up = completed.room.as_ref().map_or(Vec3::Y, |room| room.up);
    let found = stage(on_event, Stage::PanoramaMatch, || match_panorama(prior, working, up))?;
    let source = found.source(prior);
    if !found.compared {
        warn(on_event, Warning::PanoramaNotCompared)?;
    } else if found.confidence < MIN_CONFIDENCE {
        let (confidence, yaw_deg) = (found.confidence, source.yaw_deg);
        warn(on_event, Warning::PanoramaMatch { confidence, least: MIN_CONFIDENCE, yaw_deg })?;
    }
    let laid = stage(on_event, Stage::PanoramaLaying, || {
        apply_panorama(&mut completed.light, completed.confidence.as_mut(), prior, &found, working)
    })??;
    let radiance = prior.radiance().map(|rgb| rgb.map(|c| c * found.exposure));
    let picture = PanoramaImage::new(&radiance, Quat::from_mat3(&found.world_from_panorama));
    Ok(PanoramaContribution { source, share: laid.share, image: Some(picture) })
}
