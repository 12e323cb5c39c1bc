use std::sync::Arc;

use lo_completion::ObservedShading;
use lo_geometry::Vec3;
use lo_lights::{Emitter, LightsError, ListedLight, emitters};
use lo_octree::LightOctree;
use lo_scene::{Estimate, InferredLight, LightEdits, LitScene};

use crate::lighting::{NO_WHITE_PIXEL, apply_choice, differs_from_even, for_viewpoint, observed_shading};
use crate::white::white_tint;
use crate::{LightReport, LightingError};

/// An estimate prepared to be lit repeatedly, by different choices of light and edits.
///
/// It caches the shading and the emitters, which do not depend on either. To light an estimate once, use
/// [`apply_light`](crate::apply_light) or `Document::lit` of the crate `lightoctree`.
#[derive(Clone, Debug)]
pub struct FittedLight {
    estimate: Arc<Estimate>,
    shading: ObservedShading,
    emitters: Vec<Emitter>,
    lights: Vec<ListedLight>,
    default_light: AppliedLight,
}

/// An octree in one choice of light, before edits of lights.
#[derive(Clone, Debug)]
pub struct AppliedLight {
    choice: InferredLight,
    /// Gains of red, green and blue that make the white pixel of `choice` white.
    white: [f32; 3],
    light: LightOctree,
    report: LightReport,
}

impl AppliedLight {
    /// Returns the choice of light.
    pub fn choice(&self) -> &InferredLight {
        &self.choice
    }

    /// Returns how inferred light was changed.
    pub fn report(&self) -> &LightReport {
        &self.report
    }
}

impl FittedLight {
    /// Fits plausible light and finds its emitters.
    pub fn new(estimate: impl Into<Arc<Estimate>>) -> Self {
        let estimate = estimate.into();
        let shading = observed_shading(&estimate);
        let default_light = applied_light(&estimate, &shading, &InferredLight::default(), None).expect(NO_WHITE_PIXEL);
        let lit = LitScene { light: default_light.light.clone(), ..LitScene::as_estimated(estimate.clone()) };
        let emitters = emitters(&lit);
        let lights = lo_lights::list_emitters(&emitters);
        Self { estimate, shading, emitters, lights, default_light }
    }

    /// Like [`FittedLight::new`], for the radiance that nodes send towards `at_m`, in metres, where it is directional.
    pub fn for_viewpoint(estimate: &Arc<Estimate>, at_m: Vec3) -> Self {
        Self::new(for_viewpoint(estimate, at_m))
    }

    /// Returns plausible light without tuning, the default of inserted objects.
    pub fn default_light(&self) -> &AppliedLight {
        &self.default_light
    }

    /// Returns the emitters of [`FittedLight::default_light`], without edits.
    pub fn lights(&self) -> &[ListedLight] {
        &self.lights
    }

    /// Applies a choice of light.
    ///
    /// # Errors
    /// If the white pixel shows no surface, or is clipped or black.
    pub fn apply(&self, choice: &InferredLight) -> Result<AppliedLight, LightingError> {
        let choice = choice.in_effect();
        if choice == self.default_light.choice {
            return Ok(self.default_light.clone());
        }
        applied_light(&self.estimate, &self.shading, &choice, None)
    }

    /// Applies a choice of light in less time and with less accuracy than [`FittedLight::apply`].
    ///
    /// Lamps are sized and fitted coarsely. The white balance is taken from `similar` if it has the same white pixel.
    ///
    /// # Errors
    /// The errors of [`FittedLight::apply`].
    pub fn preview(&self, choice: &InferredLight, similar: &AppliedLight) -> Result<AppliedLight, LightingError> {
        applied_light(&self.estimate, &self.shading, &choice.in_effect(), Some(similar))
    }

    /// Returns the estimate in the applied light, with edits of lights.
    ///
    /// The choice of light in `edits` is ignored.
    ///
    /// # Errors
    /// If an edit refers to an emitter that does not exist.
    pub fn lit(&self, light: &AppliedLight, edits: &LightEdits) -> Result<LitScene, LightsError> {
        let mut scene = LitScene { estimate: self.estimate.clone(), light: light.light.clone(), edited: None };
        lo_lights::apply_edits(&mut scene, edits, &self.emitters)?;
        Ok(scene)
    }
}

/// Applies a choice of light, as a preview if `similar` is given.
fn applied_light(
    estimate: &Estimate,
    shading: &ObservedShading,
    choice: &InferredLight,
    similar: Option<&AppliedLight>,
) -> Result<AppliedLight, LightingError> {
    let choice = *choice;
    let white = match similar {
        Some(similar) if similar.choice.tuning.white == choice.tuning.white => similar.white,
        _ => white_tint(estimate, shading, choice.tuning.white)?,
    };
    if !differs_from_even(estimate, &choice) {
        return Ok(AppliedLight { choice, white, light: estimate.light.clone(), report: LightReport::default() });
    }
    let (light, report) = apply_choice(estimate, shading, &choice, white, similar.is_some());
    Ok(AppliedLight { choice, white, light, report })
}
