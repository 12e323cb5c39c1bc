use std::path::Path;

use lightoctree::FittedLight;
use lightoctree::geometry::Vec3;
use lightoctree::insert::SeenSurfaces;
use lightoctree::lo_lights::ListedLight;
use lightoctree::scene::{LightEdits, Scene};

/// A scene, made ready for a session.
pub struct OpenScene {
    /// What the command line calls its file.
    pub file: String,
    /// As it was read or estimated.
    pub scene: Scene,
    /// With the lamps that objects need.
    pub fitted: FittedLight,
    /// Its lights, without changes.
    pub lights: Vec<ListedLight>,
    /// The surfaces that the photo sees.
    pub surfaces: SeenSurfaces,
    /// Depth of the farthest of them, metres.
    pub far_m: f32,
}

impl OpenScene {
    /// Makes a scene ready; takes some tenths of a second, most of it for the lamps.
    pub fn new(file: impl Into<String>, scene: Scene) -> Self {
        let fitted = FittedLight::new(scene.clone());
        let surfaces = SeenSurfaces::new(&scene);
        let far_m = surfaces.depth_m().pixels().iter().fold(0.0f32, |far, &z| far.max(z));
        Self { file: file.into(), lights: fitted.list(&LightEdits::default()), fitted, surfaces, far_m, scene }
    }

    /// Unit vector against gravity.
    pub fn up(&self) -> Vec3 {
        self.scene.room.as_ref().map_or(Vec3::Y, |room| room.up)
    }

    /// The file's name without folders, for what is taken away.
    pub fn file_name(&self) -> String {
        Path::new(&self.file).file_name().map_or_else(|| self.file.clone(), |name| name.to_string_lossy().into_owned())
    }
}
