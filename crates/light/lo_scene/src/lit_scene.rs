use std::ops::Deref;
use std::sync::Arc;

use lo_octree::LightOctree;

use crate::derived::Derived;
use crate::{EditedLight, Estimate, Frame};

/// An estimate in the light that renders it: what panoramas, composites and exports are made of.
///
/// It dereferences to its [`Estimate`], but [`LitScene::light`] is the radiance to render.
#[derive(Clone, Debug, PartialEq)]
pub struct LitScene {
    /// What it is the light of.
    pub estimate: Arc<Estimate>,
    /// Radiance of the whole room in this light.
    pub light: LightOctree,
    /// The effect of the user's light edits, where there are any.
    pub edited: Option<Box<EditedLight>>,
}

impl LitScene {
    /// An estimate in its own even light, without edits.
    pub fn as_estimated(estimate: impl Into<Arc<Estimate>>) -> Self {
        let estimate = estimate.into();
        Self { light: estimate.light.clone(), estimate, edited: None }
    }

    /// A frame with measured depth in this light ([`Estimate::as_seen`]).
    pub fn as_seen(light: LightOctree, frame: Frame) -> Self {
        Self::as_estimated(Estimate::as_seen(light, frame))
    }

    /// The estimate to change; the light stays as it is.
    pub fn estimate_mut(&mut self) -> &mut Estimate {
        let estimate = Arc::make_mut(&mut self.estimate);
        // What was computed before the change no longer holds.
        estimate.derived = Derived::default();
        estimate
    }
}

impl Deref for LitScene {
    type Target = Estimate;

    fn deref(&self) -> &Estimate {
        &self.estimate
    }
}
