//! Light at a point in the layouts of AR frameworks and game engines.

use lo_geometry::Vec3;
use lo_imaging::{MainLight, RadianceImage, Sh9, luminance, split_main_light};
use serde::Serialize;

use crate::color_temperature_k;

/// ARKit's value of neutral light, and of its brightness in lumens.
const ARKIT_NEUTRAL: f32 = 1000.0;

/// Colour temperature that ARKit calls pure white, in kelvin.
const ARKIT_WHITE_K: f32 = 6500.0;

/// A layout of the light at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightLayout {
    /// [`WebXrLightEstimate`].
    WebXr,
    /// [`ArKitLightEstimate`].
    ArKit,
    /// [`UnityLightEstimate`].
    Unity,
}

impl LightLayout {
    /// All layouts and their names.
    pub const ALL: [(&'static str, Self); 3] = [("webxr", Self::WebXr), ("arkit", Self::ArKit), ("unity", Self::Unity)];
}

/// The light at a point in one of the layouts.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
#[allow(missing_docs)]
pub enum EngineLight {
    WebXr(WebXrLightEstimate),
    ArKit(ArKitLightEstimate),
    Unity(UnityLightEstimate),
}

/// The light at a point: its main light, and nine spherical harmonics of the rest and of the whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightEstimate {
    main: Option<MainLight>,
    rest: Sh9,
    whole: Sh9,
}

/// `XRLightEstimate` of the WebXR Lighting Estimation API (<https://www.w3.org/TR/webxr-lighting-estimation-1/>), in
/// WebXR's axes, which are ours.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct WebXrLightEstimate {
    /// Radiance without the main light, 9 coefficients of 3 channels each, without Condon–Shortley sign, as three.js
    /// reads them.
    pub spherical_harmonics_coefficients: Vec<f32>,
    /// Unit direction towards the main light, w = 0.
    pub primary_light_direction: Point,
    /// Irradiance of a surface that faces the main light, w = 1.
    pub primary_light_intensity: Point,
}

/// Fields of a `DOMPointReadOnly`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[allow(missing_docs)]
pub struct Point {
    pub x: f32,
    pub y: f32,
    pub z: f32,
    pub w: f32,
}

/// `ARDirectionalLightEstimate` of ARKit, in ARKit's axes, which are ours. 1000 is light under which something white is
/// as bright as the photo's white.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct ArKitLightEstimate {
    /// Radiance of the whole light: 9 coefficients of red, then of green, then of blue.
    pub spherical_harmonics_coefficients: Vec<f32>,
    /// Unit direction in which the main light travels.
    pub primary_light_direction: [f32; 3],
    /// Brightness of the main light.
    pub primary_light_intensity: f32,
    /// Mean brightness of all light.
    pub ambient_intensity: f32,
    /// Colour temperature of all light in kelvin; 6500 if it is not that of a black body.
    pub ambient_color_temperature: f32,
}

/// `SphericalHarmonicsL2` and a directional light of Unity, in Unity's axes: +X right, +Y up, +Z ahead, left-handed.
///
/// Unity's materials lack the factor 1/π. A white matte surface has the radiance that the coefficients evaluate to,
/// plus the light's colour times the cosine.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct UnityLightEstimate {
    /// `sh[channel][coefficient]` without the main light.
    pub ambient_probe: [[f32; 9]; 3],
    /// Unit direction in which the main light travels: the light's forward axis.
    pub direction: [f32; 3],
    /// Linear colour times intensity.
    pub color: [f32; 3],
}

impl LightEstimate {
    /// Computes the light of an equirectangular map.
    pub fn of(map: &RadianceImage) -> Self {
        let (main, rest) = split_main_light(map);
        Self { main, rest, whole: Sh9::project(map) }
    }

    /// Returns the light in a layout.
    pub fn in_layout(&self, layout: LightLayout) -> EngineLight {
        match layout {
            LightLayout::WebXr => EngineLight::WebXr(self.webxr()),
            LightLayout::ArKit => EngineLight::ArKit(self.arkit()),
            LightLayout::Unity => EngineLight::Unity(self.unity()),
        }
    }

    /// Direction towards the main light, and its irradiance; from above and none if nothing stands out.
    fn main(&self) -> (Vec3, Vec3) {
        self.main.map_or((Vec3::Y, Vec3::ZERO), |light| (light.direction.into(), light.power.into()))
    }

    /// Returns the light in WebXR's layout.
    pub fn webxr(&self) -> WebXrLightEstimate {
        let (towards, irradiance) = self.main();
        let point = |v: Vec3, w: f32| Point { x: v.x, y: v.y, z: v.z, w };
        WebXrLightEstimate {
            spherical_harmonics_coefficients: self.rest.coefficients.as_flattened().to_vec(),
            primary_light_direction: point(towards, 0.0),
            primary_light_intensity: point(irradiance, 1.0),
        }
    }

    /// Returns the light in ARKit's layout.
    pub fn arkit(&self) -> ArKitLightEstimate {
        let (towards, irradiance) = self.main();
        // Something white has the radiance E / π.
        let brightness = |irradiance: [f32; 3]| ARKIT_NEUTRAL * luminance(irradiance) / std::f32::consts::PI;
        // The mean of the irradiance over all normals is a quarter of ∫ L dω, Y₀₀ of which is a constant.
        let mean = self.whole.coefficients[0].map(|value| value * (4.0 * std::f32::consts::PI).sqrt() / 4.0);
        ArKitLightEstimate {
            spherical_harmonics_coefficients: (0..3)
                .flat_map(|channel| self.whole.coefficients.iter().map(move |rgb| rgb[channel]))
                .collect(),
            primary_light_direction: (-towards).to_array(),
            primary_light_intensity: brightness(irradiance.to_array()),
            ambient_intensity: brightness(mean),
            ambient_color_temperature: color_temperature_k(mean).unwrap_or(ARKIT_WHITE_K),
        }
    }

    /// Returns the light in Unity's layout.
    pub fn unity(&self) -> UnityLightEstimate {
        let (towards, irradiance) = self.main();
        let mirrored = Vec3::new(1.0, 1.0, -1.0);
        let factors = unity_factors();
        UnityLightEstimate {
            ambient_probe: std::array::from_fn(|channel| {
                std::array::from_fn(|index| self.rest.coefficients[index][channel] * factors[index])
            }),
            direction: (-towards * mirrored).to_array(),
            color: (irradiance / std::f32::consts::PI).to_array(),
        }
    }
}

/// Factors from our coefficients to Unity's: the constants of the basis times the clamped cosine's (π, 2π/3, π/4) over
/// π, negative where the basis is odd in z.
///
/// Unity's shaders evaluate s₀ − s₆ + s₃x + s₁y + s₂z + s₄xy + s₅yz + 3s₆z² + s₇xz + s₈(x² − y²) (Sloan, "Stupid
/// Spherical Harmonics Tricks", 2008, appendix A10).
fn unity_factors() -> [f32; 9] {
    use std::f32::consts::PI;
    let [y0, y1, y2, y20, y22] = [1.0 / PI, 3.0 / PI, 15.0 / PI, 5.0 / PI, 15.0 / PI].map(f32::sqrt);
    let (y0, y1, y2, y20, y22) = (0.5 * y0, 0.5 * y1, 0.5 * y2, 0.25 * y20, 0.25 * y22);
    let (one, two) = (2.0 / 3.0, 0.25);
    [y0, one * y1, -one * y1, one * y1, two * y2, -two * y2, two * y20, -two * y2, two * y22]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::f32::consts::PI;

    use lo_geometry::{fibonacci_sphere, pixel_direction};

    use super::*;

    /// Light that differs on all axes, with a lamp in the upper right ahead.
    fn map() -> RadianceImage {
        let lamp = Vec3::new(0.5, 0.6, -0.7).normalize();
        RadianceImage::from_fn(256, 128, |x, y| {
            let d = pixel_direction(x, y, 256, 128);
            let room = [1.0 + 0.5 * d.x + 0.2 * d.z, 1.0 + 0.6 * d.y, 1.0 - 0.4 * d.z + 0.3 * d.x * d.y];
            if d.dot(lamp) > 0.995 { [180.0, 150.0, 120.0] } else { room }
        })
    }

    /// Irradiance by summing over the pixels.
    fn irradiance(map: &RadianceImage, normal: Vec3) -> [f32; 3] {
        let mut sum = [0.0; 3];
        for (x, y) in (0..128).flat_map(|y| (0..256).map(move |x| (x, y))) {
            let weight =
                pixel_direction(x, y, 256, 128).dot(normal).max(0.0) * lo_geometry::pixel_solid_angle_sr(y, 256, 128);
            (0..3).for_each(|c| sum[c] += weight * map[(x, y)][c]);
        }
        sum
    }

    #[test]
    fn each_layout_lights_a_surface_as_the_map_does() {
        let map = map();
        let estimate = LightEstimate::of(&map);
        let (webxr, arkit, unity) = (estimate.webxr(), estimate.arkit(), estimate.unity());
        let brightest = fibonacci_sphere(100).iter().map(|&n| irradiance(&map, n)[0]).fold(0.0, f32::max);
        for normal in fibonacci_sphere(100) {
            let expected = irradiance(&map, normal);
            // three.js: LightProbe and DirectionalLight, from its shader chunks.
            let sh = |lm: usize, c: usize| webxr.spherical_harmonics_coefficients[3 * lm + c];
            let (x, y, z) = normal.into();
            let towards = webxr.primary_light_direction;
            let cosine = (towards.x * x + towards.y * y + towards.z * z).max(0.0);
            let intensity =
                [webxr.primary_light_intensity.x, webxr.primary_light_intensity.y, webxr.primary_light_intensity.z];
            for c in 0..3 {
                let three = 0.886_227 * sh(0, c)
                    + 2.0 * 0.511_664 * (sh(1, c) * y + sh(2, c) * z + sh(3, c) * x)
                    + 2.0 * 0.429_043 * (sh(4, c) * x * y + sh(5, c) * y * z + sh(7, c) * x * z)
                    + sh(6, c) * (0.743_125 * z * z - 0.247_708)
                    + 0.429_043 * sh(8, c) * (x * x - y * y)
                    + intensity[c] * cosine;
                assert!(
                    (three - expected[c]).abs() < 0.03 * brightest,
                    "three.js at {normal}: {three} {}",
                    expected[c]
                );
                // Unity: the radiance of something white, in its axes.
                let (z, s) = (-z, unity.ambient_probe[c]);
                let cosine = -(unity.direction[0] * x + unity.direction[1] * y + unity.direction[2] * z);
                let radiance = s[0] - s[6]
                    + s[3] * x
                    + s[1] * y
                    + s[2] * z
                    + s[4] * x * y
                    + s[5] * y * z
                    + 3.0 * s[6] * z * z
                    + s[7] * x * z
                    + s[8] * (x * x - y * y)
                    + unity.color[c] * cosine.max(0.0);
                assert!((PI * radiance - expected[c]).abs() < 0.03 * brightest, "Unity at {normal}: {radiance}");
            }
        }
        // ARKit: one channel after the other, all of the light.
        let whole = Sh9::project(&map).coefficients;
        assert_eq!(arkit.spherical_harmonics_coefficients[9..12], [whole[0][1], whole[1][1], whole[2][1]]);
        let lamp = Vec3::new(0.5, 0.6, -0.7).normalize();
        assert!(Vec3::from(arkit.primary_light_direction).dot(-lamp) > 0.999);
        assert!(Vec3::from(unity.direction).dot(Vec3::new(-lamp.x, -lamp.y, lamp.z)) > 0.999);
    }

    #[test]
    fn light_like_the_photos_white_is_neutral() {
        let estimate = LightEstimate::of(&RadianceImage::from_fn(128, 64, |_, _| [1.0; 3]));
        let arkit = estimate.arkit();
        assert!((arkit.ambient_intensity - 1000.0).abs() < 1.0, "{}", arkit.ambient_intensity);
        assert!((arkit.ambient_color_temperature - 6500.0).abs() < 60.0, "{}", arkit.ambient_color_temperature);
        // Nothing stands out: the values that WebXR prescribes then.
        assert_eq!(arkit.primary_light_intensity, 0.0);
        let webxr = serde_json::to_value(estimate.webxr()).unwrap();
        assert_eq!(webxr["primaryLightDirection"], serde_json::json!({ "x": 0.0, "y": 1.0, "z": 0.0, "w": 0.0 }));
        assert_eq!(webxr["primaryLightIntensity"], serde_json::json!({ "x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0 }));
        assert_eq!(webxr["sphericalHarmonicsCoefficients"].as_array().unwrap().len(), 27);
        // A lamp of irradiance π is as bright as that.
        let lamp = LightEstimate {
            main: Some(MainLight {
                direction: [0.0, 1.0, 0.0],
                solid_angle_sr: 0.01,
                radiance: [100.0 * PI; 3],
                power: [PI; 3],
                share: 0.5,
            }),
            ..estimate
        };
        assert!((lamp.arkit().primary_light_intensity - 1000.0).abs() < 1.0);
        assert!(lamp.unity().color.iter().all(|value| (value - 1.0).abs() < 1e-6));
    }
}
