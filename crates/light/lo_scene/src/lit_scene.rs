use std::ops::Deref;
use std::sync::Arc;

use lo_octree::LightOctree;

use crate::derived::Derived;
use crate::{EditedLight, Estimate, Frame};

/// A document with its light applied for one purpose: the input of all rendering and export.
///
/// It dereferences to its [`Estimate`], but [`LitScene::light`] is the radiance to render.
#[derive(Clone, Debug, PartialEq)]
pub struct LitScene {
    /// The estimate.
    pub estimate: Arc<Estimate>,
    /// Radiance of the whole room, with light applied.
    pub light: LightOctree,
    /// Effect of the user's light edits, if any.
    pub edited: Option<Box<EditedLight>>,
}

impl LitScene {
    /// Creates a scene with the estimate's own even light, without edits.
    pub fn as_estimated(estimate: impl Into<Arc<Estimate>>) -> Self {
        let estimate = estimate.into();
        Self { light: estimate.light.clone(), estimate, edited: None }
    }

    /// Creates a scene with measured depth and observed radiance only ([`Estimate::observed_only`]).
    pub fn observed_only(light: LightOctree, frame: Frame) -> Self {
        Self::as_estimated(Estimate::observed_only(light, frame))
    }

    /// Returns the estimate for changes; the light stays unchanged.
    pub fn estimate_mut(&mut self) -> &mut Estimate {
        let estimate = Arc::make_mut(&mut self.estimate);
        // Cached values are outdated after a change.
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
