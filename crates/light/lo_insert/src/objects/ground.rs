use std::borrow::Cow;

use lo_geometry::Vec3;
use lo_scene::{Estimate, LitScene};

use crate::surface::seen_surfaces::SurfaceMap;
use crate::{InsertError, SeenSurfaces, surface_at_pixel};

/// Real surfaces that carry objects. Without [`SeenSurfaces`], normals are fitted anew around each place, with the same
/// result.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// The estimate.
    pub estimate: &'a Estimate,
    surfaces: Option<&'a SeenSurfaces>,
}

impl<'a> From<&'a Estimate> for Ground<'a> {
    fn from(estimate: &'a Estimate) -> Self {
        Self { estimate, surfaces: None }
    }
}

impl<'a> From<&'a LitScene> for Ground<'a> {
    fn from(scene: &'a LitScene) -> Self {
        Self::from(&*scene.estimate)
    }
}

impl<'a> Ground<'a> {
    /// An estimate with its surfaces.
    pub fn new(estimate: &'a Estimate, surfaces: &'a SeenSurfaces) -> Self {
        Self { estimate, surfaces: Some(surfaces) }
    }

    /// [`surface_at_pixel`].
    pub(crate) fn surface_at_pixel(&self, u: f64, v: f64) -> Result<(Vec3, Vec3), InsertError> {
        match self.surfaces.and_then(|surfaces| surfaces.at_pixel(u, v)) {
            Some(surface) => Ok(surface),
            None => surface_at_pixel(self.estimate, u, v),
        }
    }

    /// The surfaces, where world points are seen and around them at least.
    pub(crate) fn around(&self, points: &[Vec3]) -> Cow<'a, SurfaceMap> {
        match self.surfaces {
            Some(surfaces) => Cow::Borrowed(surfaces.map()),
            None => Cow::Owned(SurfaceMap::around(&self.estimate.frame, points)),
        }
    }
}
