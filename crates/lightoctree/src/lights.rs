use std::borrow::Cow;

use lo_completion::LampFit;
use lo_geometry::Vec3;
use lo_lights::{Emitter, LightsError, ListedLight, emitters};
use lo_scene::{LightEdits, Scene};

use crate::lamp::{lay_light, lay_usual};
use crate::{LightMode, LightReport, LightTuning, LightingError};

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
        let report = lay_usual(&mut scene, LightMode::Plausible).fit;
        let found = emitters(&scene);
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

/// Lights a scene: by the light of `mode`, then with the changed and added lights of its edits ([`Scene::light_edits`]).
///
/// # Errors
/// Where an edit is of an emitter that there is not, and where what is said to be white has no colour.
pub fn light_up(scene: &mut Scene, mode: LightMode, tuning: &LightTuning) -> Result<LightReport, LightingError> {
    if scene.light_edits.is_empty() {
        return lay_light(scene, mode, tuning);
    }
    let (found, report) = found(scene, mode, tuning)?;
    lo_lights::apply_edits(scene, &found)?;
    Ok(report)
}

/// Turns off everything that gives light in a scene as it was read: what is left is what surfaces reflect, for who relights it by lights. What somebody
/// changed or added does not count.
pub fn without_emitters(scene: &mut Scene) {
    let before = scene.light.clone();
    lay_usual(scene, LightMode::Plausible);
    let found = emitters(scene);
    scene.light = before;
    lo_lights::remove_emitters(scene, &found);
}

/// The lights of a scene as it was read, as bright as objects are lit by them, and what somebody added.
pub fn list_lights(scene: &Scene) -> Vec<ListedLight> {
    let mut lit = scene.clone();
    lay_usual(&mut lit, LightMode::Plausible);
    lo_lights::list(&lit)
}

/// The emitters of plausible light, by the same names whatever the mode, in which the scene is lit then.
fn found(
    scene: &mut Scene,
    mode: LightMode,
    tuning: &LightTuning,
) -> Result<(Vec<Emitter>, LightReport), LightingError> {
    let before = (mode != LightMode::Plausible).then(|| scene.light.clone());
    let report = lay_light(scene, LightMode::Plausible, tuning)?;
    let found = emitters(scene);
    Ok(match before {
        Some(before) => {
            scene.light = before;
            (found, lay_light(scene, mode, tuning)?)
        }
        None => (found, report),
    })
}
