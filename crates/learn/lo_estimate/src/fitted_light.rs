use std::sync::Arc;

use lo_completion::ObservedShading;
use lo_geometry::Vec3;
use lo_lights::{Emitter, LightsError, ListedLight, emitters};
use lo_octree::LightOctree;
use lo_scene::{Estimate, GuessedLight, LightEdits, LitScene};

use crate::lighting::{NO_WHITE_PIXEL, is_laid, laid, seen_from, shading_of};
use crate::white::white_tint;
use crate::{LightReport, LightingError};

/// An estimate to be lit by one choice of light and one set of edits after another, without repeating what they have
/// in common.
#[derive(Clone, Debug)]
pub struct FittedLight {
    estimate: Arc<Estimate>,
    seen: ObservedShading,
    found: Vec<Emitter>,
    listed: Vec<ListedLight>,
    usual: LaidLight,
}

/// The octree in a choice of light, before edits of lights.
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

    /// How inferred light was changed.
    pub fn report(&self) -> &LightReport {
        &self.report
    }
}

impl FittedLight {
    /// Fits plausible light, and finds the emitters in it.
    pub fn new(estimate: impl Into<Arc<Estimate>>) -> Self {
        let estimate = estimate.into();
        let seen = shading_of(&estimate);
        let usual = laid_in(&estimate, &seen, &GuessedLight::default(), None).expect(NO_WHITE_PIXEL);
        let lit = LitScene { light: usual.light.clone(), ..LitScene::as_estimated(estimate.clone()) };
        let found = emitters(&lit);
        let listed = lo_lights::list_emitters(&found);
        Self { estimate, seen, found, listed, usual }
    }

    /// [`FittedLight::new`] of the radiance that nodes send to a point, where it differs by direction.
    pub fn seen_from(estimate: &Arc<Estimate>, at_m: Vec3) -> Self {
        Self::new(seen_from(estimate, at_m))
    }

    /// Plausible light as estimated.
    pub fn usual(&self) -> &LaidLight {
        &self.usual
    }

    /// The emitters of [`FittedLight::usual`], without changes.
    pub fn listed(&self) -> &[ListedLight] {
        &self.listed
    }

    /// The octree in a choice of light.
    ///
    /// # Errors
    /// Where what is said to be white has no colour.
    pub fn laid(&self, guessed: &GuessedLight) -> Result<LaidLight, LightingError> {
        let guessed = guessed.in_effect();
        if guessed == self.usual.guessed {
            return Ok(self.usual.clone());
        }
        laid_in(&self.estimate, &self.seen, &guessed, None)
    }

    /// A preview of [`FittedLight::laid`] in less time: lamps are sized and fitted with less accuracy, and the colour
    /// that makes a pixel white is that of `like` where it is of the same pixel.
    ///
    /// # Errors
    /// As of [`FittedLight::laid`].
    pub fn drafted(&self, guessed: &GuessedLight, like: &LaidLight) -> Result<LaidLight, LightingError> {
        laid_in(&self.estimate, &self.seen, &guessed.in_effect(), Some(like))
    }

    /// The estimate in a choice of light with edits of lights; the edits' own choice of light does not count.
    ///
    /// # Errors
    /// Where an edit is of an emitter that there is not.
    pub fn lit(&self, laid: &LaidLight, edits: &LightEdits) -> Result<LitScene, LightsError> {
        let mut scene = LitScene { estimate: self.estimate.clone(), light: laid.light.clone(), edited: None };
        lo_lights::apply_edits(&mut scene, edits, &self.found)?;
        Ok(scene)
    }
}

/// A preview where there is a light `like` it.
fn laid_in(
    estimate: &Estimate,
    seen: &ObservedShading,
    guessed: &GuessedLight,
    like: Option<&LaidLight>,
) -> Result<LaidLight, LightingError> {
    let guessed = *guessed;
    let white = match like {
        Some(like) if like.guessed.tuning.white == guessed.tuning.white => like.white,
        _ => white_tint(estimate, seen, guessed.tuning.white)?,
    };
    if !is_laid(estimate, &guessed) {
        return Ok(LaidLight { guessed, white, light: estimate.light.clone(), report: LightReport::default() });
    }
    let (light, report) = laid(estimate, seen, &guessed, white, like.is_some());
    Ok(LaidLight { guessed, white, light, report })
}
