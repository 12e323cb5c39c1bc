use std::f32::consts::PI;

use lo_geometry::{Vec3, smoothstep};

use crate::photometry::{UNIT_CD_M2, from_xyz};
use crate::texture::{Noise, mix};

/// Radiance model of the sky without the sun's disc.
#[derive(Clone, Debug)]
pub(crate) enum Sky {
    /// Clear sky (Preetham, Shirley & Smits 1999, "A practical analytic model for daylight") with a cloud layer.
    Clear { perez: [[f32; 5]; 3], zenith: [f32; 3], sun: Vec3, clouds: Clouds },
    /// CIE overcast sky (CIE S 011:2003, type 1 in its Moon–Spencer form).
    ///
    /// The zenith is three times as bright as the horizon.
    Overcast { zenith: f32, clouds: Clouds },
    /// Night sky with the glow of a town.
    Night { glow: [f32; 3] },
}

/// A cloud layer: coverage in [0, 1] and radiance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clouds {
    pub noise: Noise,
    pub cover: f32,
    pub radiance: [f32; 3],
}

/// Luminance of the sun's disc outside the atmosphere, cd/m²: 133 klx within 6.8e-5 sr.
const SUN_CD_M2: f32 = 1.96e9;

impl Sky {
    /// Clear sky of a turbidity (2 clean … 10 hazy) with the sun above the horizon.
    pub(crate) fn clear(sun: Vec3, turbidity: f32, clouds: Clouds) -> Self {
        let t = turbidity;
        let perez = [
            [
                0.1787 * t - 1.4630,
                -0.3554 * t + 0.4275,
                -0.0227 * t + 5.3251,
                0.1206 * t - 2.5771,
                -0.0670 * t + 0.3703,
            ],
            [
                -0.0193 * t - 0.2592,
                -0.0665 * t + 0.0008,
                -0.0004 * t + 0.2125,
                -0.0641 * t - 0.8989,
                -0.0033 * t + 0.0452,
            ],
            [
                -0.0167 * t - 0.2608,
                -0.0950 * t + 0.0092,
                -0.0079 * t + 0.2102,
                -0.0441 * t - 1.6537,
                -0.0109 * t + 0.0529,
            ],
        ];
        let angle = sun.y.clamp(-1.0, 1.0).acos();
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * angle);
        let luminance = ((4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192).max(0.15);
        let powers = [angle.powi(3), angle * angle, angle, 1.0];
        let chromaticity = |m: [[f32; 4]; 3]| -> f32 {
            let row = |k: usize| (0..4).map(|c| m[k][c] * powers[c]).sum::<f32>();
            t * t * row(0) + t * row(1) + row(2)
        };
        let x = chromaticity([
            [0.001_66, -0.003_75, 0.002_09, 0.0],
            [-0.029_03, 0.063_77, -0.032_02, 0.003_94],
            [0.116_93, -0.211_96, 0.060_52, 0.258_86],
        ]);
        let y = chromaticity([
            [0.002_75, -0.006_10, 0.003_17, 0.0],
            [-0.042_14, 0.089_70, -0.041_53, 0.005_16],
            [0.153_46, -0.267_56, 0.066_70, 0.266_88],
        ]);
        Self::Clear { perez, zenith: [luminance * 1000.0, x, y], sun, clouds }
    }

    /// Overcast sky that gives a horizontal illuminance of `illuminance_lx`.
    pub(crate) fn overcast(illuminance_lx: f32, noise: Noise) -> Self {
        let zenith = 9.0 / (7.0 * PI) * illuminance_lx / UNIT_CD_M2;
        Self::Overcast { zenith, clouds: Clouds { noise, cover: 1.0, radiance: [1.0; 3] } }
    }

    /// Radiance from a direction at or above the horizon.
    pub(crate) fn radiance(&self, direction: Vec3) -> [f32; 3] {
        match self {
            Self::Clear { perez, zenith, sun, clouds } => {
                let cos_theta = direction.y.max(0.01);
                let gamma = direction.dot(*sun).clamp(-1.0, 1.0).acos();
                let shape = |[a, b, c, d, e]: [f32; 5], cos_theta: f32, gamma: f32| {
                    let cos_gamma = gamma.cos();
                    (1.0 + a * (b / cos_theta).exp()) * (1.0 + c * (d * gamma).exp() + e * cos_gamma * cos_gamma)
                };
                let sun_angle = sun.y.clamp(-1.0, 1.0).acos();
                let value = |k: usize| zenith[k] * shape(perez[k], cos_theta, gamma) / shape(perez[k], 1.0, sun_angle);
                let (luminance, x, y) = (f64::from(value(0)), f64::from(value(1)), f64::from(value(2)));
                let y = y.max(0.05);
                let sky = from_xyz([luminance * x / y, luminance, luminance * (1.0 - x - y) / y]);
                let sky = sky.map(|c| (c / UNIT_CD_M2).max(0.0));
                mix(sky, clouds.radiance, 0.85 * clouds.density(direction))
            }
            Self::Overcast { zenith, clouds } => {
                let luminance = zenith * (1.0 + 2.0 * direction.y.max(0.0)) / 3.0;
                let patch = 0.85 + 0.3 * clouds.texture(direction);
                [0.97, 1.0, 1.06].map(|c| c * luminance * patch)
            }
            Self::Night { glow } => {
                let low = 1.0 - direction.y.max(0.0);
                glow.map(|c| c * (0.25 + 0.75 * low * low * low))
            }
        }
    }

    /// Cosine-weighted mean radiance: horizontal irradiance / π, without the sun's disc.
    pub(crate) fn mean_radiance(&self) -> [f32; 3] {
        let directions = lo_geometry::cosine_hemisphere(256);
        let mut sum = [0.0; 3];
        for direction in &directions {
            // `cosine_hemisphere` is centred on +Z.
            let radiance = self.radiance(Vec3::new(direction.y, direction.z, direction.x));
            for c in 0..3 {
                sum[c] += radiance[c] / directions.len() as f32;
            }
        }
        sum
    }
}

impl Clouds {
    fn texture(&self, direction: Vec3) -> f32 {
        let scale = 0.04 / (direction.y.max(0.0) + 0.08);
        self.noise.octaves(direction.x * scale + 0.5, direction.z * scale + 0.5, [32, 32], 5)
    }

    /// Cloud density: 0 in blue sky, 1 in dense cloud.
    fn density(&self, direction: Vec3) -> f32 {
        if self.cover <= 0.0 {
            return 0.0;
        }
        let edge = 0.72 - 0.4 * self.cover;
        smoothstep(edge, edge + 0.16, self.texture(direction))
    }
}

/// Radiance of the sun's disc after atmospheric extinction.
///
/// Rayleigh and aerosol extinction at 610, 550 and 465 nm (Preetham et al. 1999, appendix A.1).
pub(crate) fn sun_radiance(elevation_rad: f32, turbidity: f32) -> [f32; 3] {
    let degrees = elevation_rad.to_degrees().max(0.0);
    // Relative optical mass (Kasten & Young 1965).
    let mass = 1.0 / (elevation_rad.max(0.0).sin() + 0.15 * (degrees + 3.885).powf(-1.253));
    let beta = 0.046_083_66 * turbidity - 0.045_860_26;
    [0.61f32, 0.55, 0.465].map(|wavelength| {
        let rayleigh = (-0.008_735 * wavelength.powf(-4.08) * mass).exp();
        let aerosol = (-beta * wavelength.powf(-1.3) * mass).exp();
        SUN_CD_M2 / UNIT_CD_M2 * rayleigh * aerosol
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still() -> Clouds {
        Clouds { noise: Noise::new(0), cover: 0.0, radiance: [0.0; 3] }
    }

    #[test]
    fn the_overcast_sky_gives_its_illuminance() {
        let mean = Sky::overcast(10_000.0, Noise::new(3)).mean_radiance();
        // E / π in units of radiance; the cloud pattern has a mean near one.
        let expected = 10_000.0 / PI / UNIT_CD_M2;
        assert!((lo_imaging::luminance(mean) / expected - 1.0).abs() < 0.08, "{mean:?}");
    }

    #[test]
    fn the_clear_sky_is_as_bright_as_measured_ones() {
        let sun = Vec3::new(0.0, 45.0_f32.to_radians().sin(), 45.0_f32.to_radians().cos());
        let sky = Sky::clear(sun, 3.0, still());
        // Measured clear skies give 8 to 20 klx at 45° sun (CIE 108). Preetham's model is up to 50 % too bright near
        // the sun (Zotti, Wilkie & Purgathofer 2007).
        let lux = lo_imaging::luminance(sky.mean_radiance()) * PI * UNIT_CD_M2;
        assert!((8_000.0..30_000.0).contains(&lux), "{lux}");
        let (above, opposite) = (sky.radiance(Vec3::Y), sky.radiance(Vec3::new(0.0, 0.5, -0.87).normalize()));
        assert!(above[2] > 1.5 * above[0] && opposite[2] > opposite[0], "blue: {above:?} {opposite:?}");
        assert!(sky.radiance(Vec3::new(0.0, 0.72, 0.69).normalize())[1] > 3.0 * above[1], "bright about the sun");
    }

    #[test]
    fn the_sun_lights_the_ground_as_it_does() {
        // Direct normal illuminance of a high sun in clear air: 90 to 105 klx (Perez et al. 1990).
        let solid_angle = PI * 0.004_65f32.powi(2);
        let lux = |elevation: f32| lo_imaging::luminance(sun_radiance(elevation, 2.5)) * UNIT_CD_M2 * solid_angle;
        assert!((80_000.0..115_000.0).contains(&lux(1.2)), "{}", lux(1.2));
        let low = sun_radiance(0.06, 3.0);
        assert!(low[0] > 3.0 * low[2], "red at sunset: {low:?}");
    }
}
