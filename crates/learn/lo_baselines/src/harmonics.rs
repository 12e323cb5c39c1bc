//! Light as real spherical harmonics of order 5.

use std::f32::consts::PI;

use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr};
use lo_imaging::RadianceImage;

/// Highest order.
const ORDER: usize = 5;

/// Number of coefficients of each channel.
pub const COEFFICIENTS: usize = (ORDER + 1) * (ORDER + 1);

/// Radiance over the sphere as 36 coefficients for each channel, in the convention of [`lo_imaging::Sh9`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonics {
    /// `L_lm` as linear RGB, by l, then by m from −l to l.
    pub coefficients: [[f32; 3]; COEFFICIENTS],
}

impl Harmonics {
    /// Projects an equirectangular map.
    pub fn project(map: &RadianceImage) -> Self {
        let matrix = projection([map.width(), map.height()]);
        let row = |lm: usize| {
            let weights = matrix[lm..].iter().step_by(COEFFICIENTS);
            let mut sum = [0.0f64; 3];
            for (&weight, rgb) in weights.zip(map.pixels()) {
                (0..3).for_each(|c| sum[c] += f64::from(weight * rgb[c]));
            }
            sum.map(|v| v as f32)
        };
        Self { coefficients: std::array::from_fn(row) }
    }

    /// Returns the radiance from a unit direction, cut at 0: the sum of few harmonics may be negative.
    pub fn radiance(&self, direction: Vec3) -> [f32; 3] {
        let basis = basis(direction);
        let channel = |c: usize| self.coefficients.iter().zip(&basis).map(|(rgb, basis)| rgb[c] * basis).sum::<f32>();
        [0, 1, 2].map(|c| channel(c).max(0.0))
    }
}

/// Returns the matrix `[pixels, COEFFICIENTS]` that projects an equirectangular map of this size.
pub(crate) fn projection([width, height]: [usize; 2]) -> Vec<f32> {
    let pixel = |i: usize| {
        let solid_angle_sr = pixel_solid_angle_sr(i / width, width, height);
        basis(pixel_direction(i % width, i / width, width, height)).map(|value| value * solid_angle_sr)
    };
    (0..width * height).flat_map(pixel).collect()
}

/// Returns the harmonics of a unit direction, with polar axis z and without the Condon–Shortley sign.
pub(crate) fn basis(d: Vec3) -> [f32; COEFFICIENTS] {
    // Legendre functions over sinᵐ θ: P[m][m] = (2m − 1)!!, (l − m) P[l] = (2l − 1) z P[l−1] − (l + m − 1) P[l−2].
    // sinᵐ θ · (cos m φ, sin m φ) = (x + i y)ᵐ.
    let mut values = [0.0; COEFFICIENTS];
    let (mut cosine, mut sine) = (1.0f32, 0.0f32);
    let mut diagonal = 1.0f32;
    for m in 0..=ORDER {
        let (mut before, mut legendre) = (0.0f32, diagonal);
        for l in m..=ORDER {
            if l > m {
                let next = ((2 * l - 1) as f32 * d.z * legendre - (l + m - 1) as f32 * before) / (l - m) as f32;
                (before, legendre) = (legendre, next);
            }
            let scale = normalisation(l, m) * legendre;
            values[l * l + l + m] = scale * cosine;
            if m > 0 {
                values[l * l + l - m] = scale * sine;
            }
        }
        (cosine, sine) = (cosine * d.x - sine * d.y, cosine * d.y + sine * d.x);
        diagonal *= (2 * m + 1) as f32;
    }
    values
}

/// Returns √((2l + 1) / 4π · (l − m)! / (l + m)!), times √2 for m above 0.
fn normalisation(l: usize, m: usize) -> f32 {
    let ratio: f32 = (l - m + 1..=l + m).map(|k| k as f32).product();
    let both = if m > 0 { 2.0 } else { 1.0 };
    (both * (2 * l + 1) as f32 / (4.0 * PI) / ratio).sqrt()
}

#[cfg(test)]
mod tests {
    use lo_geometry::fibonacci_sphere;
    use lo_imaging::Sh9;

    use super::*;

    #[test]
    fn the_basis_is_orthonormal_and_begins_with_nine_known_ones() {
        let directions = fibonacci_sphere(20_000);
        let bases: Vec<_> = directions.iter().map(|&d| basis(d)).collect();
        for i in 0..COEFFICIENTS {
            for j in 0..=i {
                let sum: f64 = bases.iter().map(|basis| f64::from(basis[i] * basis[j])).sum();
                let integral = sum * 4.0 * std::f64::consts::PI / 20_000.0;
                assert!((integral - f64::from(u8::from(i == j))).abs() < 2e-3, "{i} {j}: {integral}");
            }
        }
        let map = RadianceImage::from_fn(128, 64, |x, y| {
            let d = pixel_direction(x, y, 128, 64);
            [1.0 + d.x, (3.0 * d.y).exp(), d.x * d.y * d.z + d.z.abs()]
        });
        let (nine, all) = (Sh9::project(&map), Harmonics::project(&map));
        for (a, b) in nine.coefficients.iter().flatten().zip(all.coefficients.iter().flatten()) {
            assert!((a - b).abs() < 2e-4, "{a} {b}");
        }
    }

    /// The coefficients of a zonal function f about an axis are λ_l Y_lm(axis), with λ_l = 2π ∫ f(t) P_l(t) dt.
    #[test]
    fn a_lobes_coefficients_are_the_closed_form() {
        let axis = Vec3::new(0.48, -0.64, 0.6);
        // f = max(cos, 0): λ = π, 2π/3, π/4, 0, −π/24, 0 (Ramamoorthi & Hanrahan 2001).
        let cosine = RadianceImage::from_fn(256, 128, |x, y| [pixel_direction(x, y, 256, 128).dot(axis).max(0.0); 3]);
        let got = Harmonics::project(&cosine);
        let zonal = [PI, 2.0 * PI / 3.0, PI / 4.0, 0.0, -PI / 24.0, 0.0];
        let at_axis = basis(axis);
        for (lm, (rgb, at_axis)) in got.coefficients.iter().zip(at_axis).enumerate() {
            let expected = zonal[lm.isqrt()] * at_axis;
            assert!((rgb[0] - expected).abs() < 2e-3, "{lm}: {} {expected}", rgb[0]);
        }
        // A function of order 5 is reconstructed: f = 2 + t⁵.
        let power =
            RadianceImage::from_fn(256, 128, |x, y| [2.0 + pixel_direction(x, y, 256, 128).dot(axis).powi(5); 3]);
        let got = Harmonics::project(&power);
        for direction in fibonacci_sphere(60) {
            let expected = 2.0 + direction.dot(axis).powi(5);
            assert!((got.radiance(direction)[1] - expected).abs() < 3e-3);
        }
    }
}
