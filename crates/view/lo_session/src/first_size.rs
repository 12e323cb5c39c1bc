//! First sizes of new objects.

use lo_geometry::{Camera, Vec3};
use lo_insert::Unit;

use crate::{Mesh, ObjectSize};

/// Longest side of a new object of unknown size, metres.
const DEFAULT_SIDE_M: f64 = 0.3;

/// Plausible longest sides of meshes whose files state metres, and of those whose unit is inferred.
const STATED_SIDES_M: std::ops::RangeInclusive<f64> = 0.005..=5.0;
const GUESSED_SIDES_M: std::ops::RangeInclusive<f64> = 0.05..=1.0;

/// Units that files without one may have, most frequent first.
const UNITS: [Unit; 4] = [Unit::Metre, Unit::Centimetre, Unit::Millimetre, Unit::Inch];

/// Largest share of the photo's width or height that a new object takes, and the share that larger ones get.
const MAX_SHARE: f64 = 0.6;
const FITTED_SHARE: f64 = 0.35;

/// Unit of a mesh's coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MeshUnit {
    pub unit: Unit,
    /// Whether the file's format defines it.
    pub is_stated: bool,
}

impl MeshUnit {
    /// Returns metres for formats that define them, or else the unit in which the mesh is as large as furnishings are.
    pub fn of(mesh: &Mesh) -> Self {
        let name = mesh.name().to_lowercase();
        let is_stated = mesh.is_builtin() || name.ends_with(".glb") || name.ends_with(".gltf");
        if is_stated {
            return Self { unit: Unit::Metre, is_stated };
        }
        let longest = f64::from(mesh.size().max_element());
        let unit = UNITS.into_iter().find(|unit| GUESSED_SIDES_M.contains(&(longest * unit.metres())));
        Self { unit: unit.unwrap_or_default(), is_stated }
    }
}

/// Returns the size of a new object: by its unit if that is plausible, or else a usual one.
pub(crate) fn first_size(mesh: &Mesh) -> ObjectSize {
    let MeshUnit { unit, is_stated } = MeshUnit::of(mesh);
    let longest = f64::from(mesh.size().max_element());
    let plausible = if is_stated { STATED_SIDES_M } else { GUESSED_SIDES_M };
    // Suzanne has no real size.
    if plausible.contains(&(longest * unit.metres())) && mesh.name() != "builtin:suzanne" {
        ObjectSize::Scale(unit.metres())
    } else {
        scaled(mesh, DEFAULT_SIDE_M / longest)
    }
}

/// Returns the smaller size of an object that would fill the photo at a position; `None` if it fits.
pub(crate) fn fitted(mesh: &Mesh, scale: f32, position_m: Vec3, camera: &Camera) -> Option<ObjectSize> {
    let (scale, depth_m) = (f64::from(scale), f64::from(-position_m.z).max(1e-3));
    let size = mesh.size().as_dvec3() * scale;
    let wide = camera.fx * size.x.max(size.z) / depth_m / f64::from(camera.width);
    let high = camera.fy * size.y / depth_m / f64::from(camera.height);
    let share = wide.max(high);
    (share > MAX_SHARE).then(|| self::scaled(mesh, scale * FITTED_SHARE / share))
}

/// Returns a scale as a height of two digits, or as it is for flat meshes.
fn scaled(mesh: &Mesh, scale: f64) -> ObjectSize {
    let height_m = f64::from(mesh.size().y) * scale;
    if height_m < 1e-3 {
        return ObjectSize::Scale(scale);
    }
    let digit = 10f64.powf(height_m.log10().floor() - 1.0);
    ObjectSize::Height(((height_m / digit).round() * digit * 1e6).round() / 1e6)
}
