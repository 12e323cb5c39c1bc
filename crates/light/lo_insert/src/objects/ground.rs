use std::borrow::Cow;
use std::sync::Arc;

use lo_geometry::Vec3;
use lo_scene::{Estimate, LitScene};

use crate::surface::observed_surfaces::SurfaceMap;
use crate::{InsertError, ObservedSurfaces, surface_at_pixel};

/// Real surfaces that support objects. Without [`ObservedSurfaces`], normals are fitted anew around each position,
/// with equal results.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// The estimate.
    pub estimate: &'a Estimate,
    surfaces: Option<&'a ObservedSurfaces>,
}

impl<'a> From<&'a Estimate> for Ground<'a> {
    fn from(estimate: &'a Estimate) -> Self {
        Self { estimate, surfaces: None }
    }
}

impl<'a> From<&'a Arc<Estimate>> for Ground<'a> {
    fn from(estimate: &'a Arc<Estimate>) -> Self {
        Self::from(&**estimate)
    }
}

impl<'a> From<&'a LitScene> for Ground<'a> {
    fn from(scene: &'a LitScene) -> Self {
        Self::from(&*scene.estimate)
    }
}

impl<'a> Ground<'a> {
    /// Combines an estimate and its surfaces.
    pub fn new(estimate: &'a Estimate, surfaces: &'a ObservedSurfaces) -> Self {
        Self { estimate, surfaces: Some(surfaces) }
    }

    /// Returns the surface as [`surface_at_pixel`].
    pub(crate) fn surface_at_pixel(&self, u: f64, v: f64) -> Result<(Vec3, Vec3), InsertError> {
        match self.surfaces.and_then(|surfaces| surfaces.at_pixel(u, v)) {
            Some(surface) => Ok(surface),
            None => surface_at_pixel(self.estimate, u, v),
        }
    }

    /// Returns the surfaces at least around the image positions of world points.
    pub(crate) fn around(&self, points: &[Vec3]) -> Cow<'a, SurfaceMap> {
        match self.surfaces {
            Some(surfaces) => Cow::Borrowed(surfaces.map()),
            None => Cow::Owned(SurfaceMap::around(&self.estimate.frame, points)),
        }
    }
}
