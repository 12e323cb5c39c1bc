use lo_completion::{LampFit, scale_guessed};
use lo_lights::{LightsError, ListedLight};
use lo_octree::LightOctree;
use lo_scene::Scene;

use crate::fit_lamps;

/// Lights a scene as its edits say: with the lamps that objects need where `lamp` is set ([`fit_lamps`]), then with what somebody changed and added
/// ([`Scene::light_edits`]). A scene without edits stays as it is but for the lamps.
///
/// # Errors
/// Where an edit is of an emitter that there is not.
pub fn light_up(scene: &mut Scene, lamp: bool) -> Result<LampFit, LightsError> {
    if scene.light_edits.is_empty() {
        return Ok(if lamp { fit_lamps(scene) } else { LampFit::default() });
    }
    let (estimate, report) = with_lamp(scene, lamp);
    lo_lights::apply_edits(scene, &estimate)?;
    Ok(report)
}

/// Turns off everything that gives light in a scene as it was read: what is left is what surfaces reflect, for who relights it by lights. What somebody
/// changed or added does not count.
pub fn without_emitters(scene: &mut Scene) {
    let estimate = scene.light.clone();
    lo_lights::remove_emitters(scene, &estimate);
}

/// The lights of a scene as it was read: emitters of the estimate, lamps that are assumed for objects, and what somebody added.
pub fn list_lights(scene: &Scene) -> Vec<ListedLight> {
    let mut lit = scene.clone();
    let (estimate, _) = with_lamp(&mut lit, true);
    lo_lights::list(&lit, &estimate)
}

/// The scene's light before lamps are added, with guessed light as bright on the whole as they were fitted for.
fn with_lamp(scene: &mut Scene, lamp: bool) -> (LightOctree, LampFit) {
    let mut before = scene.light.clone();
    let report = if lamp { fit_lamps(scene) } else { LampFit::default() };
    if report.scale != 1.0 {
        scale_guessed(&mut before, report.scale);
    }
    // What differs by direction was fixed to a place with the lamps, and the two cannot be told apart.
    let estimate = if before.lobes == scene.light.lobes { before } else { scene.light.clone() };
    (estimate, report)
}
