//! Applies a captured panorama of the room to its unobserved part.

use lo_completion::{PanoramaPrior, apply_panorama, match_panorama};
use lo_events::{OnEvent, stage, warn};
use lo_geometry::{Quat, Vec3};
use lo_scene::{ObservedPhoto, PanoramaContribution, PanoramaImage};

use crate::completed_room::CompletedRoom;
use crate::{EstimateError, stages};

/// Matches the panorama to the photo and applies its light to the completed room.
pub(crate) fn apply_prior(
    completed: &mut CompletedRoom,
    prior: &PanoramaPrior,
    photo: &ObservedPhoto,
    on_event: OnEvent<'_>,
) -> Result<PanoramaContribution, EstimateError> {
    prior.warnings().into_iter().try_for_each(|warning| warn(on_event, warning))?;
    let up = completed.room.as_ref().map_or(Vec3::Y, |room| room.up);
    let matched = stage(on_event, stages::PANORAMA_MATCH, || match_panorama(prior, photo, up))?;
    matched.warning().into_iter().try_for_each(|warning| warn(on_event, warning))?;
    let applied = stage(on_event, stages::PANORAMA_PROJECTION, || {
        apply_panorama(&mut completed.light, completed.confidence.as_mut(), prior, &matched, photo)
    })??;
    let radiance = prior.radiance().map(|rgb| rgb.map(|c| c * matched.exposure));
    let picture = PanoramaImage::new(&radiance, Quat::from_mat3(&matched.world_from_panorama));
    Ok(PanoramaContribution { source: matched.source(prior), share: applied.share, image: Some(picture) })
}
