//! Applies a captured panorama of the room to its unobserved part.

use lo_completion::{MIN_CONFIDENCE, PanoramaPrior, apply_panorama, match_panorama};
use lo_events::{OnEvent, Stage, Warning, stage, warn};
use lo_geometry::{Quat, Vec3};
use lo_scene::{Frame, PanoramaContribution, PanoramaImage};

use crate::EstimateError;
use crate::completed_room::CompletedRoom;

/// Matches the panorama to the photo and applies its light to the completed room.
pub(crate) fn apply_prior(
    completed: &mut CompletedRoom,
    prior: &PanoramaPrior,
    working: &Frame,
    on_event: OnEvent<'_>,
) -> Result<PanoramaContribution, EstimateError> {
    prior.warnings().into_iter().try_for_each(|warning| warn(on_event, warning))?;
    let up = completed.room.as_ref().map_or(Vec3::Y, |room| room.up);
    let matched = stage(on_event, Stage::PanoramaMatch, || match_panorama(prior, working, up))?;
    let source = matched.source(prior);
    if !matched.compared {
        warn(on_event, Warning::PanoramaNotCompared)?;
    } else if matched.confidence < MIN_CONFIDENCE {
        let (confidence, yaw_deg) = (matched.confidence, source.yaw_deg);
        warn(on_event, Warning::PanoramaMatch { confidence, least: MIN_CONFIDENCE, yaw_deg })?;
    }
    let applied = stage(on_event, Stage::PanoramaLaying, || {
        apply_panorama(&mut completed.light, completed.confidence.as_mut(), prior, &matched, working)
    })??;
    let radiance = prior.radiance().map(|rgb| rgb.map(|c| c * matched.exposure));
    let picture = PanoramaImage::new(&radiance, Quat::from_mat3(&matched.world_from_panorama));
    Ok(PanoramaContribution { source, share: applied.share, image: Some(picture) })
}
