use std::borrow::Cow;

use lo_geometry::Vec3;
use lo_scene::Scene;

use crate::surface::seen_surfaces::SurfaceMap;
use crate::{InsertError, SeenSurfaces, surface_at_pixel};

/// A scene whose real surfaces carry objects. Made of the scene alone, it looks at the surfaces around each place anew; with [`SeenSurfaces`], which says
/// the same, it does not.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// The scene.
    pub scene: &'a Scene,
    surfaces: Option<&'a SeenSurfaces>,
}

impl<'a> From<&'a Scene> for Ground<'a> {
    fn from(scene: &'a Scene) -> Self {
        Self { scene, surfaces: None }
    }
}

impl<'a> Ground<'a> {
    /// A scene with its own surfaces.
    pub fn new(scene: &'a Scene, surfaces: &'a SeenSurfaces) -> Self {
        Self { scene, surfaces: Some(surfaces) }
    }

    /// [`surface_at_pixel`].
    pub(crate) fn surface_at_pixel(&self, u: f64, v: f64) -> Result<(Vec3, Vec3), InsertError> {
        match self.surfaces.and_then(|surfaces| surfaces.at_pixel(u, v)) {
            Some(surface) => Ok(surface),
            None => surface_at_pixel(self.scene, u, v),
        }
    }

    /// The surfaces, where world points are seen and around them at least.
    pub(crate) fn around(&self, points: &[Vec3]) -> Cow<'a, SurfaceMap> {
        match self.surfaces {
            Some(surfaces) => Cow::Borrowed(surfaces.map()),
            None => Cow::Owned(SurfaceMap::around(&self.scene.frame, points)),
        }
    }
}
