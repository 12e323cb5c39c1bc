use std::ops::RangeInclusive;

use lightoctree::Estimate;
use lo_geometry::Vec3;
use lo_lights::{rgb_from_color, sun_direction};
use lo_scene::{AnalyticLight, LightColor, LightShape};
use serde::{Deserialize, Serialize};

use crate::SessionError;

/// Accepted azimuths of a sun, degrees: ten turns in either direction.
const AZIMUTHS_DEG: RangeInclusive<f32> = -3600.0..=3600.0;

/// A light to add, in user-facing units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum NewLight {
    /// A distant disc.
    Sun {
        /// Degrees to the right of the camera's axis, about the vertical.
        azimuth_deg: f32,
        /// Degrees above the horizon.
        elevation_deg: f32,
        /// Luminance of the irradiance on a surface facing the sun.
        strength: f32,
        /// Angular diameter, degrees.
        angle_deg: f32,
        /// Colour temperature, kelvin.
        kelvin: f32,
    },
    /// A sphere that emits in all directions.
    Sphere {
        /// Centre, metres.
        at_m: [f32; 3],
        /// Radius, metres.
        radius_m: f32,
        /// Luminance of the radiance; 1 is the photo's white.
        radiance: f32,
        /// Colour temperature, kelvin.
        kelvin: f32,
    },
}

impl NewLight {
    /// Converts to an analytic light in the scene's frame.
    ///
    /// # Errors
    /// If a number is out of range.
    pub fn analytic(self, estimate: &Estimate) -> Result<AnalyticLight, SessionError> {
        let color = |kelvin: f32| {
            let known = (lo_scene::MIN_KELVIN..=lo_scene::MAX_KELVIN).contains(&kelvin);
            if known {
                Ok(rgb_from_color(LightColor::Kelvin(kelvin)))
            } else {
                Err(SessionError::OutOfRange("the colour"))
            }
        };
        let (shape, white, color) = match self {
            Self::Sun { azimuth_deg, elevation_deg, strength, angle_deg, kelvin } => {
                let direction = sun_direction_of(estimate, azimuth_deg, elevation_deg)?;
                let shape = LightShape::Sun { direction, angular_radius_deg: 0.5 * angle_deg, of_photo: false };
                let extent = AnalyticLight { shape, radiance: [0.0; 3] }.extent();
                (shape, strength / extent, color(kelvin)?)
            }
            Self::Sphere { at_m, radius_m, radiance, kelvin } => {
                (LightShape::Sphere { centre_m: Vec3::from(at_m), radius_m }, radiance, color(kelvin)?)
            }
        };
        let light = AnalyticLight { shape, radiance: (color * white).to_array() };
        light.invalid_field().map_or(Ok(light), |what| Err(SessionError::OutOfRange(what)))
    }
}

/// Returns the unit direction towards a sun, as [`sun_direction`] does.
///
/// # Errors
/// If an angle is out of range.
pub(crate) fn sun_direction_of(
    estimate: &Estimate,
    azimuth_deg: f32,
    elevation_deg: f32,
) -> Result<Vec3, SessionError> {
    if !(AZIMUTHS_DEG.contains(&azimuth_deg) && (-90.0..=90.0).contains(&elevation_deg)) {
        return Err(SessionError::OutOfRange("the direction"));
    }
    Ok(sun_direction(estimate, azimuth_deg.into(), elevation_deg.into()))
}
