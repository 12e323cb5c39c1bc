use lo_completion::LampFit;
use lo_lights::{Emitter, LightsError, ListedLight, emitters};
use lo_scene::Scene;

use crate::fit_lamps;

/// Lights a scene as its edits say: with lamps as bright as objects need them where `lamp` is set ([`fit_lamps`]), then with what somebody changed and added
/// ([`Scene::light_edits`]). A scene without edits stays as it is but for the lamps.
///
/// # Errors
/// Where an edit is of an emitter that there is not.
pub fn light_up(scene: &mut Scene, lamp: bool) -> Result<LampFit, LightsError> {
    if scene.light_edits.is_empty() {
        return Ok(if lamp { fit_lamps(scene) } else { LampFit::default() });
    }
    let (found, report) = found(scene, lamp);
    lo_lights::apply_edits(scene, &found)?;
    Ok(report)
}

/// Turns off everything that gives light in a scene as it was read: what is left is what surfaces reflect, for who relights it by lights. What somebody
/// changed or added does not count.
pub fn without_emitters(scene: &mut Scene) {
    let (found, _) = found(scene, false);
    lo_lights::remove_emitters(scene, &found);
}

/// The lights of a scene as it was read, as bright as objects are lit by them, and what somebody added.
pub fn list_lights(scene: &Scene) -> Vec<ListedLight> {
    let mut lit = scene.clone();
    fit_lamps(&mut lit);
    lo_lights::list(&lit)
}

/// What gives light where lamps are as bright as objects need them: the same names whether `lamp` is set, with which the scene's light stays so.
fn found(scene: &mut Scene, lamp: bool) -> (Vec<Emitter>, LampFit) {
    let before = (!lamp).then(|| scene.light.clone());
    let report = fit_lamps(scene);
    let found = emitters(scene);
    match before {
        Some(before) => {
            scene.light = before;
            (found, LampFit::default())
        }
        None => (found, report),
    }
}
