use std::borrow::Cow;

use lo_completion::LampFit;
use lo_geometry::Vec3;
use lo_lights::{Emitter, LightsError, ListedLight, emitters};
use lo_scene::{LightEdits, Scene};

use crate::fit_lamps;

/// A scene with lamps as bright as objects need them, to be lit by one set of edits after another: [`light_up`] without fitting each time.
#[derive(Clone, Debug)]
pub struct FittedLight {
    scene: Scene,
    found: Vec<Emitter>,
    report: LampFit,
}

impl FittedLight {
    /// Of a scene as it was read.
    pub fn new(mut scene: Scene) -> Self {
        let (found, report) = found(&mut scene, true);
        Self { scene, found, report }
    }

    /// What was fitted.
    pub fn report(&self) -> &LampFit {
        &self.report
    }

    /// The scene lit as edits say, as [`light_up`] would do with `lamp`.
    ///
    /// # Errors
    /// Where an edit is of an emitter that there is not.
    pub fn lit(&self, edits: &LightEdits) -> Result<Scene, LightsError> {
        let mut scene = Scene { light_edits: edits.clone(), ..self.scene.clone() };
        lo_lights::apply_edits(&mut scene, &self.found)?;
        Ok(scene)
    }

    /// What [`list_lights`] lists of the scene with these edits.
    pub fn list(&self, edits: &LightEdits) -> Vec<ListedLight> {
        lo_lights::list(&Scene { light_edits: edits.clone(), ..self.scene.clone() })
    }
}

/// Where a scene's light differs by direction, that which comes to a place becomes the light of all directions: objects are lit by what comes to
/// their middle. To be called before [`light_up`].
pub fn seen_from(scene: &mut Scene, at: Vec3) {
    if let Cow::Owned(seen) = scene.light.seen_from(at) {
        scene.light = seen;
    }
}

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
