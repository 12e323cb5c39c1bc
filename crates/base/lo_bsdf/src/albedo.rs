//! Directional albedos from a table computed once (the "split sum" of Karis 2013, integrated instead of fitted).

use std::sync::LazyLock;

use lo_geometry::{Vec2, Vec3, cosine_hemisphere, van_der_corput};

use crate::fresnel::{fresnel, schlick_weight};
use crate::ggx::Ggx;

/// Perceptual roughness below which a surface reflects as a perfect mirror.
pub const MIRROR_ROUGHNESS: f32 = 0.05;

/// Directional albedo of the specular layer: the share of light from a direction of the given cosine that it reflects.
///
/// Light that would bounce more than once between microfacets is lost, as in glTF's model.
#[inline]
pub fn specular_albedo(f0: Vec3, roughness: f32, cosine: f32) -> Vec3 {
    if roughness < MIRROR_ROUGHNESS {
        return fresnel(f0, cosine);
    }
    let [scale, bias] = SPECULAR.at(roughness, cosine);
    f0 * scale + Vec3::splat(bias)
}

/// Cosine-weighted mean of [`specular_albedo`] over all directions.
#[inline]
pub fn mean_specular_albedo(f0: Vec3, roughness: f32) -> Vec3 {
    const STEPS: usize = 8;
    let cosine = |i: usize| ((i as f32 + 0.5) / STEPS as f32).sqrt();
    (0..STEPS).map(|i| specular_albedo(f0, roughness, cosine(i))).sum::<Vec3>() / STEPS as f32
}

/// Share of uniform light that passes the specular layer into glTF's diffuse one, for a view of the given cosine.
///
/// It is the mean of 1 − F over the cosine-weighted hemisphere and does not depend on roughness.
#[inline]
pub fn specular_transmittance(f0: Vec3, cosine: f32) -> Vec3 {
    let (column, fx) = cell_of(cosine);
    let weight = MEAN_SCHLICK[column] + (MEAN_SCHLICK[column + 1] - MEAN_SCHLICK[column]) * fx;
    (Vec3::ONE - f0) * (1.0 - weight)
}

/// Number of rows and columns of the tables.
pub(crate) const SIZE: usize = 32;

static SPECULAR: LazyLock<SpecularTable> = LazyLock::new(SpecularTable::new);

/// Cosine-weighted mean of (1 − v·h)⁵ by the view's cosine.
static MEAN_SCHLICK: LazyLock<Vec<f32>> = LazyLock::new(|| {
    let hemisphere = cosine_hemisphere(1024);
    let mean = |column: usize| {
        let view = view_of(cosine_of(column));
        hemisphere.iter().map(|light| schlick_weight(view.dot((view + *light).normalize()))).sum::<f32>()
            / hemisphere.len() as f32
    };
    (0..SIZE).map(mean).collect()
});

/// Cosine of a table column. Columns span [0, 1] with both ends, but a cosine of exactly 0 has no projected area.
pub(crate) fn cosine_of(column: usize) -> f32 {
    (column as f32 / (SIZE - 1) as f32).max(1e-3)
}

/// Returns the table cell of a value in [0, 1] and the fraction within the cell.
fn cell_of(value: f32) -> (usize, f32) {
    let x = value.clamp(0.0, 1.0) * (SIZE - 1) as f32;
    let cell = (x as usize).min(SIZE - 2);
    (cell, x - cell as f32)
}

/// Local view direction at the given cosine from the normal.
pub(crate) fn view_of(cosine: f32) -> Vec3 {
    Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine)
}

/// Scale and bias of f0 by roughness and cosine.
struct SpecularTable {
    cells: Vec<[f32; 2]>,
}

impl SpecularTable {
    const SAMPLES: u32 = 1024;

    fn new() -> Self {
        let cell = |i: usize| {
            let roughness = (i / SIZE) as f32 / (SIZE - 1) as f32;
            Self::integrate(roughness.max(MIRROR_ROUGHNESS), cosine_of(i % SIZE))
        };
        Self { cells: (0..SIZE * SIZE).map(cell).collect() }
    }

    fn integrate(roughness: f32, cosine: f32) -> [f32; 2] {
        let (ggx, view) = (Ggx::from_roughness(roughness), view_of(cosine));
        let mut sums = [0.0; 2];
        for i in 0..Self::SAMPLES {
            let random = Vec2::new(van_der_corput(i), (i as f32 + 0.5) / Self::SAMPLES as f32);
            let sample = ggx.sample(view, random);
            // The albedo is linear in f0: `black` is its value at f0 = 0.
            let black = schlick_weight(sample.v_dot_h) * sample.weight;
            sums[0] += sample.weight - black;
            sums[1] += black;
        }
        sums.map(|sum| sum / Self::SAMPLES as f32)
    }

    fn at(&self, roughness: f32, cosine: f32) -> [f32; 2] {
        interpolated(&self.cells, roughness, cosine)
    }
}

/// Interpolates a table whose rows are roughnesses and whose columns are cosines.
pub(crate) fn interpolated<const N: usize>(cells: &[[f32; N]], roughness: f32, cosine: f32) -> [f32; N] {
    let ((column, fx), (row, fy)) = (cell_of(cosine), cell_of(roughness));
    let cell = |dx: usize, dy: usize| cells[(row + dy) * SIZE + column + dx];
    let (a, b, c, d) = (cell(0, 0), cell(1, 0), cell(0, 1), cell(1, 1));
    std::array::from_fn(|k| {
        let (top, bottom) = (a[k] + (b[k] - a[k]) * fx, c[k] + (d[k] - c[k]) * fx);
        top + (bottom - top) * fy
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metallic_roughness::specular_cos;

    /// Midpoint quadrature over the hemisphere of light directions in f64, a literal transcription of glTF's B.3.
    fn albedo_by_quadrature(cosine: f64, alpha: f64, f0: f64) -> (f64, f64) {
        let (rows, columns) = (800, 800);
        let v = [(1.0 - cosine * cosine).sqrt(), 0.0, cosine];
        let (mut specular, mut diffuse) = (0.0, 0.0);
        let tau = std::f64::consts::TAU;
        for row in 0..rows {
            let z = (row as f64 + 0.5) / rows as f64;
            for column in 0..columns {
                let phi = (column as f64 + 0.5) / columns as f64 * tau;
                let r = (1.0 - z * z).sqrt();
                let l = [r * phi.cos(), r * phi.sin(), z];
                let h = [v[0] + l[0], v[1] + l[1], v[2] + l[2]];
                let length = h.iter().map(|x| x * x).sum::<f64>().sqrt();
                let (nh, vh) = (h[2] / length, h.iter().zip(v).map(|(a, b)| a * b).sum::<f64>() / length);
                let a2 = alpha * alpha;
                let d = a2 / (std::f64::consts::PI * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
                let g = |x: f64| 2.0 * x / (x + (a2 + (1.0 - a2) * x * x).sqrt());
                let f = f0 + (1.0 - f0) * (1.0 - vh).powi(5);
                let solid_angle = tau / (rows * columns) as f64;
                specular += f * d * g(z) * g(cosine) / (4.0 * z * cosine) * z * solid_angle;
                diffuse += (1.0 - f) / std::f64::consts::PI * z * solid_angle;
            }
        }
        (specular, diffuse)
    }

    #[test]
    fn tabulated_albedos_equal_quadrature() {
        for (cosine, roughness, f0) in
            [(0.95, 0.5, 0.04), (0.6, 0.7, 0.8), (0.3, 1.0, 1.0), (0.8, 0.4, 0.5), (0.2, 0.9, 0.04), (0.07, 0.5, 1.0)]
        {
            let (specular, diffuse) = albedo_by_quadrature(cosine, roughness * roughness, f0);
            let at = Vec3::splat(f0 as f32);
            let found = f64::from(specular_albedo(at, roughness as f32, cosine as f32).x);
            // 1024 quasi-random samples and linear interpolation of a 32 × 32 table
            assert!((found - specular).abs() < 0.01, "{cosine} {roughness} {f0}: {found} for {specular}");
            let found = f64::from(specular_transmittance(at, cosine as f32).x);
            assert!((found - diffuse).abs() < 0.005, "{cosine} {f0}: {found} for {diffuse}");
        }
    }

    #[test]
    fn albedos_equal_the_sum_of_the_brdf_over_all_directions() {
        for (roughness, cosine, f0) in [(0.3, 0.9, 0.04), (0.6, 0.5, 0.7), (1.0, 0.2, 1.0), (0.5, 0.07, 1.0)] {
            let sphere = lo_geometry::fibonacci_sphere(400_000);
            let ggx = Ggx::from_roughness(roughness);
            let light = |&l: &Vec3| f64::from(specular_cos(Vec3::splat(f0), ggx, Vec3::Z, view_of(cosine), l).x);
            let sum = sphere.iter().map(light).sum::<f64>() * (4.0 * std::f64::consts::PI / 400_000.0);
            let found = specular_albedo(Vec3::splat(f0), roughness, cosine).x;
            assert!((f64::from(found) - sum).abs() < 0.01, "{roughness} {cosine} {f0}: {found} for {sum}");
        }
    }

    #[test]
    fn white_furnaces_gain_nothing() {
        for i in 0..=1000 {
            let (roughness, cosine) = ((i % 30) as f32 / 29.0, (i / 30) as f32 / 33.0);
            assert!(specular_albedo(Vec3::ONE, roughness, cosine).max_element() <= 1.0 + 1e-4);
            assert!(specular_transmittance(Vec3::ZERO, cosine).max_element() <= 1.0 + 1e-4);
        }
        for roughness in [0.0, 0.3, 0.7, 1.0] {
            assert!(mean_specular_albedo(Vec3::ONE, roughness).max_element() <= 1.0 + 1e-4);
        }
        // Smooth surfaces have single-bounce reflection only, so no light is lost.
        for (roughness, cosine) in [(0.0, 0.05), (0.0, 0.9), (0.05, 0.3), (0.05, 0.9)] {
            let white = specular_albedo(Vec3::ONE, roughness, cosine).x;
            assert!((white - 1.0).abs() < 0.01, "{roughness} {cosine}: {white}");
        }
    }

    #[test]
    fn samples_integrate_the_brdf() {
        // The mean of Fresnel · weight over samples of a linear test radiance equals the quadrature of specular_cos.
        let (f0, ggx, view) = (Vec3::new(0.9, 0.5, 0.1), Ggx::from_roughness(0.6), view_of(0.7));
        let radiance = |d: Vec3| 1.0 + 0.5 * d.x - 0.3 * d.z;
        let count = 4096;
        let sampled = (0..count)
            .map(|i| ggx.sample(view, Vec2::new(van_der_corput(i), (i as f32 + 0.5) / count as f32)))
            .map(|s| fresnel(f0, s.v_dot_h) * s.weight * radiance(s.light))
            .sum::<Vec3>()
            / count as f32;
        let sphere = lo_geometry::fibonacci_sphere(400_000);
        let exact: Vec3 = sphere.iter().map(|&l| specular_cos(f0, ggx, Vec3::Z, view, l) * radiance(l)).sum::<Vec3>()
            * (4.0 * std::f32::consts::PI / 400_000.0);
        assert!((sampled - exact).abs().max_element() < 0.01, "{sampled} for {exact}");
    }
}
