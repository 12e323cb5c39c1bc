use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::RadianceImage;

/// Radiance over the sphere as nine real spherical harmonics per channel.
///
/// Uses the convention of Ramamoorthi and Hanrahan, "An Efficient Representation for Irradiance Environment Maps"
/// (2001), eq. 3, without the Condon–Shortley sign. Their x, y, z are the axes of our world frame. Order: Y₀₀, Y₁₋₁
/// (y), Y₁₀ (z), Y₁₁ (x), Y₂₋₂ (xy), Y₂₋₁ (yz), Y₂₀ (3z² − 1), Y₂₁ (xz), Y₂₂ (x² − y²).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sh9 {
    /// `L_lm` as linear RGB, in the order above.
    pub coefficients: [[f32; 3]; 9],
}

/// Constants of eq. 3: 1 / (2√π), √(3 / 4π), √(15 / 4π), √(5 / 16π), √(15 / 16π).
const Y: [f32; 5] = [0.282_094_8, 0.488_602_5, 1.092_548_4, 0.315_391_57, 0.546_274_2];

/// Zonal coefficients of the clamped cosine (eq. 8): π, 2π/3, π/4.
const COSINE: [f32; 3] = [std::f32::consts::PI, 2.0 * std::f32::consts::PI / 3.0, std::f32::consts::FRAC_PI_4];

impl Sh9 {
    /// Projects an equirectangular map: `L_lm = ∫ L(ω) Y_lm(ω) dω`, weighted by each pixel's solid angle.
    pub fn project(map: &RadianceImage) -> Self {
        let (width, height) = (map.width(), map.height());
        let row_sum = |y: usize| {
            let mut sum = [[0.0f64; 3]; 9];
            for x in 0..width {
                let basis = basis(pixel_direction(x, y, width, height));
                let radiance = map[(x, y)];
                for (sum, basis) in sum.iter_mut().zip(basis) {
                    for c in 0..3 {
                        sum[c] += f64::from(basis * radiance[c]);
                    }
                }
            }
            let solid_angle = f64::from(pixel_solid_angle_sr(y, width, height));
            sum.map(|rgb| rgb.map(|v| v * solid_angle))
        };
        let rows: Vec<_> = (0..height).into_par_iter().map(row_sum).collect();
        let mut total = [[0.0f64; 3]; 9];
        for row in &rows {
            for (total, value) in total.iter_mut().flatten().zip(row.iter().flatten()) {
                *total += value;
            }
        }
        Self { coefficients: total.map(|rgb| rgb.map(|v| v as f32)) }
    }

    /// Returns the coefficients of light from one direction, of this irradiance on a surface that faces it.
    pub fn of_direction(direction: Vec3, irradiance: [f32; 3]) -> Self {
        Self { coefficients: basis(direction).map(|value| irradiance.map(|e| e * value)) }
    }

    /// Reconstructs the radiance from a unit direction, band-limited to nine coefficients; may be negative.
    pub fn radiance(&self, direction: Vec3) -> [f32; 3] {
        self.sum(basis(direction))
    }

    /// Irradiance on a surface with unit normal `normal`: `E = Σ A_l L_lm Y_lm(n)` (eq. 7), in radiance · sr.
    ///
    /// Accurate to about 3 % for natural light (their section 2). A diffuse surface of albedo ρ has radiance ρ E / π.
    pub fn irradiance(&self, normal: Vec3) -> [f32; 3] {
        let mut basis = basis(normal);
        for (lm, value) in basis.iter_mut().enumerate() {
            *value *= COSINE[match lm {
                0 => 0,
                1..=3 => 1,
                _ => 2,
            }];
        }
        self.sum(basis)
    }

    fn sum(&self, weights: [f32; 9]) -> [f32; 3] {
        let channel = |c: usize| self.coefficients.iter().zip(weights).map(|(rgb, weight)| rgb[c] * weight).sum();
        [channel(0), channel(1), channel(2)]
    }
}

fn basis(d: Vec3) -> [f32; 9] {
    [
        Y[0],
        Y[1] * d.y,
        Y[1] * d.z,
        Y[1] * d.x,
        Y[2] * d.x * d.y,
        Y[2] * d.y * d.z,
        Y[3] * (3.0 * d.z * d.z - 1.0),
        Y[2] * d.x * d.z,
        Y[4] * (d.x * d.x - d.y * d.y),
    ]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_geometry::fibonacci_sphere;
    use std::f32::consts::PI;

    fn map(radiance: impl Fn(Vec3) -> f32) -> RadianceImage {
        RadianceImage::from_fn(256, 128, |x, y| [radiance(pixel_direction(x, y, 256, 128)); 3])
    }

    #[test]
    fn the_basis_is_orthonormal() {
        let directions = fibonacci_sphere(20_000);
        for i in 0..9 {
            for j in 0..9 {
                let product = |d: &Vec3| f64::from(basis(*d)[i] * basis(*d)[j]);
                let integral = directions.iter().map(product).sum::<f64>() * 4.0 * std::f64::consts::PI / 20_000.0;
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((integral - expected).abs() < 1e-3, "{i} {j}: {integral}");
            }
        }
    }

    #[test]
    fn closed_forms() {
        // constant light: E = π L everywhere
        let sh = Sh9::project(&map(|_| 2.0));
        for normal in fibonacci_sphere(50) {
            assert!((sh.irradiance(normal)[0] - 2.0 * PI).abs() < 1e-3);
            assert!((sh.radiance(normal)[1] - 2.0).abs() < 1e-3);
        }
        // L = 1 + cos θ about an axis: the cosine's irradiance is 2π/3 cos θ, exact with nine coefficients
        let axis = Vec3::new(0.6, -0.64, 0.48);
        let sh = Sh9::project(&map(|d| 1.0 + d.dot(axis)));
        for normal in fibonacci_sphere(50) {
            let expected = PI + 2.0 * PI / 3.0 * normal.dot(axis);
            assert!((sh.irradiance(normal)[2] - expected).abs() < 2e-3, "{normal}");
        }
        // L = max(0, cos θ)², head on: E = 2π ∫ cos³ θ sin θ dθ = π/2; nine coefficients are within 4 % of it
        let sh = Sh9::project(&map(|d| d.y.max(0.0).powi(2)));
        let head_on = sh.irradiance(Vec3::Y)[0];
        assert!((head_on / (PI / 2.0) - 1.0).abs() < 0.04, "{head_on}");
    }

    #[test]
    fn survives_json() {
        let sh = Sh9::project(&map(|d| d.x + 2.0 * d.y * d.z));
        let json = serde_json::to_string(&sh).unwrap();
        assert_eq!(serde_json::from_str::<Sh9>(&json).unwrap(), sh);
        assert!(json.starts_with("{\"coefficients\":[["));
    }
}
