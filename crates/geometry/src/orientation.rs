use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

/// How other programs hold an equirectangular map.
///
/// A map in our frame has the centre column at −Z, +X to its right and row 0 at +Y. The presets turn the *content* of the
/// map, so that the other program, which reads it by its own convention, sees every light in the right world direction
/// when it shares our world frame (for Blender after the usual Y-up → Z-up import).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Orientation {
    /// Ours, skylibs: centre −Z, +X right, +Y up.
    #[default]
    Lightoctree,
    /// OpenEXR latitude-longitude, Mitsuba, USD dome light: centre +Z, +Y up.
    Openexr,
    /// three.js `EquirectangularReflectionMapping`: centre +X, +Y up.
    Threejs,
    /// Blender Cycles environment texture: centre +X in Blender's own Z-up frame.
    Blender,
}

impl Orientation {
    /// All presets, for listings.
    pub const ALL: [Self; 4] = [Self::Lightoctree, Self::Openexr, Self::Threejs, Self::Blender];
}
