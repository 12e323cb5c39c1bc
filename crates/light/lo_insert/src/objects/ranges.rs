//! Ranges of the numbers in layouts and paths.

use std::ops::RangeInclusive;

use lo_geometry::MAX_COORDINATE_M;

/// Name of a number in JSON, its valid values and its unit.
pub(crate) struct Range {
    field: &'static str,
    values: RangeInclusive<f64>,
    unit: &'static str,
}

const fn within(field: &'static str, limit: f64, unit: &'static str) -> Range {
    Range { field, values: -limit..=limit, unit }
}

/// Coordinates of an object's base.
pub(crate) const POSITION_M: Range = within("position_m", MAX_COORDINATE_M as f64, "m");

/// Photo positions; those outside the photo are refused when the object is placed.
pub(crate) const PIXEL: Range = within("pixel", 1e6, "pixels");

/// Rotations; keyframes may rotate by many turns.
pub(crate) const YAW_DEG: Range = within("yaw_deg", 1e6, "degrees");

/// Times of keyframes: more than 11 days.
pub(crate) const TIME_S: Range = within("time_s", 1e6, "seconds");

/// Metres per unit of a model.
pub(crate) const SCALE: Range = Range { field: "scale", values: 1e-6..=1e6, unit: "m per unit of the mesh" };

/// Heights of objects.
pub(crate) const HEIGHT_M: Range = Range { field: "height_m", values: 1e-6..=MAX_COORDINATE_M as f64, unit: "m" };

impl Range {
    /// Describes the first value out of range.
    pub(crate) fn check<'a>(&self, values: impl IntoIterator<Item = &'a f64>) -> Result<(), String> {
        // Also finds NaN.
        match values.into_iter().find(|value| !self.values.contains(value)) {
            Some(found) => {
                let Self { field, values, unit } = self;
                Err(format!("\"{field}\" must be from {} to {} {unit}, got {found:?}", values.start(), values.end()))
            }
            None => Ok(()),
        }
    }
}
