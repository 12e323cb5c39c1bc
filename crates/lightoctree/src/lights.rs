use std::borrow::Cow;

use lo_completion::ObservedShading;
use lo_geometry::Vec3;
use lo_lights::{Emitter, LightsError, ListedLight, emitters};
use lo_octree::LightOctree;
use lo_scene::{GuessedLight, LightEdits, LightMode, LightTuning, Scene};

use crate::lamp::{NOTHING_WRONG, is_laid, laid, lay_light, lay_usual, seen_of, white_tint};
use crate::{LightReport, LightingError};

/// A scene to be lit by one choice of light and one set of edits after another: [`light_up`] without doing the same
/// each time.
#[derive(Clone, Debug)]
pub struct FittedLight {
    /// As it was read.
    scene: Scene,
    seen: ObservedShading,
    found: Vec<Emitter>,
    listed: Vec<ListedLight>,
    usual: LaidLight,
}

/// The octree of a scene in a choice of light, before edits of lights.
#[derive(Clone, Debug)]
pub struct LaidLight {
    guessed: GuessedLight,
    /// Gains by channel under which guessed light makes the pixel of `guessed` white.
    white: [f32; 3],
    light: LightOctree,
    report: LightReport,
}

impl LaidLight {
    /// Which light it is.
    pub fn guessed(&self) -> &GuessedLight {
        &self.guessed
    }

    /// What was made of what was guessed.
    pub fn report(&self) -> &LightReport {
        &self.report
    }
}

impl FittedLight {
    /// Of a scene as it was read.
    pub fn new(mut scene: Scene) -> Self {
        let seen = seen_of(&scene);
        let usual = laid_in(&scene, &seen, &GuessedLight::default(), None).expect(NOTHING_WRONG);
        let estimate = std::mem::replace(&mut scene.light, usual.light.clone());
        let found = emitters(&scene);
        scene.light = estimate;
        let listed = lo_lights::list_emitters(&found);
        Self { scene, seen, found, listed, usual }
    }

    /// Plausible light as estimated.
    pub fn usual(&self) -> &LaidLight {
        &self.usual
    }

    /// The emitters of [`FittedLight::usual`], without changes.
    pub fn listed(&self) -> &[ListedLight] {
        &self.listed
    }

    /// The scene's octree in a choice of light.
    ///
    /// # Errors
    /// Where what is said to be white has no colour.
    pub fn laid(&self, guessed: &GuessedLight) -> Result<LaidLight, LightingError> {
        let guessed = guessed.in_effect();
        if guessed == self.usual.guessed {
            return Ok(self.usual.clone());
        }
        laid_in(&self.scene, &self.seen, &guessed, None)
    }

    /// A preview of [`FittedLight::laid`] in less time: lamps are sized and fitted with less accuracy, and the colour
    /// that makes a pixel white is that of `like` where it is of the same pixel.
    ///
    /// # Errors
    /// As of [`FittedLight::laid`].
    pub fn drafted(&self, guessed: &GuessedLight, like: &LaidLight) -> Result<LaidLight, LightingError> {
        laid_in(&self.scene, &self.seen, &guessed.in_effect(), Some(like))
    }

    /// The scene lit as edits of lights say, as [`light_up`] would do; the edits' own choice of light does not count.
    ///
    /// # Errors
    /// Where an edit is of an emitter that there is not.
    pub fn lit(&self, laid: &LaidLight, edits: &LightEdits) -> Result<Scene, LightsError> {
        let mut scene = Scene { light: laid.light.clone(), light_edits: edits.clone(), ..self.scene.clone() };
        lo_lights::apply_edits(&mut scene, &self.found)?;
        Ok(scene)
    }
}

/// A preview where there is a light `like` it.
fn laid_in(
    scene: &Scene,
    seen: &ObservedShading,
    guessed: &GuessedLight,
    like: Option<&LaidLight>,
) -> Result<LaidLight, LightingError> {
    let guessed = *guessed;
    let white = match like {
        Some(like) if like.guessed.tuning.white == guessed.tuning.white => like.white,
        _ => white_tint(scene, seen, guessed.tuning.white)?,
    };
    if !is_laid(scene, &guessed) {
        return Ok(LaidLight { guessed, white, light: scene.light.clone(), report: LightReport::default() });
    }
    let (light, report) = laid(scene, seen, &guessed, white, like.is_some());
    Ok(LaidLight { guessed, white, light, report })
}

/// Where a scene's light differs by direction, that which comes to a place becomes the light of all directions: objects
/// are lit by what comes to their middle. To be called before [`light_up`].
pub fn seen_from(scene: &mut Scene, at: Vec3) {
    if let Cow::Owned(seen) = scene.light.seen_from(at) {
        scene.light = seen;
    }
}

/// Lights a scene: by the light of `mode`, then with the changed and added lights of its edits
/// ([`Scene::light_edits`]).
///
/// # Errors
/// Where an edit is of an emitter that there is not, and where what is said to be white has no colour.
pub fn light_up(scene: &mut Scene, mode: LightMode, tuning: &LightTuning) -> Result<LightReport, LightingError> {
    if !scene.light_edits.has_lights() {
        return lay_light(scene, mode, tuning);
    }
    let fitted = FittedLight::new(scene.clone());
    let laid = fitted.laid(&GuessedLight { light: mode, tuning: *tuning })?;
    *scene = fitted.lit(&laid, &scene.light_edits)?;
    Ok(laid.report)
}

/// Turns off everything that gives light in a scene as it was read: what is left is what surfaces reflect, for who
/// relights it by lights. What somebody changed or added does not count.
pub fn without_emitters(scene: &mut Scene) {
    let before = scene.light.clone();
    lay_usual(scene, LightMode::Plausible);
    let found = emitters(scene);
    scene.light = before;
    lo_lights::remove_emitters(scene, &found);
}

/// The lights of a scene as it was read, as bright as objects are lit by them in plausible light as estimated, and what
/// somebody added.
///
/// Emitters have the names of this list whichever light is chosen, and however it is tuned.
pub fn list_lights(scene: &Scene) -> Vec<ListedLight> {
    let mut lit = scene.clone();
    lay_usual(&mut lit, LightMode::Plausible);
    lo_lights::list(&lit)
}
