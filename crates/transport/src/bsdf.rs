//! The specular layer of glTF 2.0 materials (appendix B): GGX with Smith masking and Schlick's Fresnel term.
//!
//! Local frames have the normal as +Z; `alpha` is the squared perceptual roughness.

use std::f32::consts::{PI, TAU};
use std::sync::LazyLock;

use geometry::{Vec2, Vec3};

/// Reflectance of a dielectric at normal incidence (index of refraction 1.5).
pub(crate) const DIELECTRIC_F0: f32 = 0.04;

/// Below this perceptual roughness a surface is a perfect mirror.
pub(crate) const MIRROR_ROUGHNESS: f32 = 0.05;

/// Schlick's Fresnel term.
pub(crate) fn fresnel(f0: Vec3, cosine: f32) -> Vec3 {
    f0 + (Vec3::ONE - f0) * grazing(cosine)
}

fn grazing(cosine: f32) -> f32 {
    let x = (1.0 - cosine).clamp(0.0, 1.0);
    let squared = x * x;
    squared * squared * x
}

/// Share that a thin clear sheet reflects: the sum over all reflections between its two faces, 2F / (1 + F).
pub(crate) fn pane_reflectance(cosine: f32) -> f32 {
    let f = fresnel(Vec3::splat(DIELECTRIC_F0), cosine).x;
    2.0 * f / (1.0 + f)
}

/// GGX density of half vectors, per steradian.
fn ggx(n_dot_h: f32, alpha: f32) -> f32 {
    let cos2 = (n_dot_h * n_dot_h).min(1.0);
    let f = (1.0 - cos2) + alpha * alpha * cos2;
    alpha * alpha / (PI * f * f)
}

/// Smith's masking of one direction.
fn masking(cosine: f32, alpha: f32) -> f32 {
    let alpha2 = alpha * alpha;
    2.0 * cosine / (cosine + (alpha2 + (1.0 - alpha2) * cosine * cosine).sqrt())
}

/// Specular BRDF times the cosine of the light's direction; unit vectors, the cosine to the viewer is positive.
pub(crate) fn specular_cos(f0: Vec3, alpha: f32, normal: Vec3, view: Vec3, light: Vec3) -> Vec3 {
    let (n_dot_l, n_dot_v) = (normal.dot(light), normal.dot(view).max(1e-3));
    if n_dot_l <= 0.0 {
        return Vec3::ZERO;
    }
    let half = (view + light).normalize_or(normal);
    let shape = ggx(normal.dot(half), alpha) * masking(n_dot_v, alpha) * masking(n_dot_l, alpha);
    fresnel(f0, view.dot(half)) * (shape / (4.0 * n_dot_v))
}

/// Density per steradian with which [`sample_lobe`] chooses `light`.
pub(crate) fn lobe_density(alpha: f32, normal: Vec3, view: Vec3, light: Vec3) -> f32 {
    let n_dot_v = normal.dot(view).max(1e-3);
    let half = (view + light).normalize_or(normal);
    ggx(normal.dot(half), alpha) * masking(n_dot_v, alpha) / (4.0 * n_dot_v)
}

/// Direction towards the light from a half vector that `view` (local, z > 0) sees (Dupuy & Benyoub 2023), and what multiplies
/// its radiance in a plain mean. The direction may point below the surface, where the factor is 0.
pub(crate) fn sample_lobe(f0: Vec3, alpha: f32, view: Vec3, random: Vec2) -> (Vec3, Vec3) {
    let stretched = Vec3::new(view.x * alpha, view.y * alpha, view.z).normalize();
    let z = (1.0 - random.y) * (1.0 + stretched.z) - stretched.z;
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (TAU * random.x).sin_cos();
    let cap = Vec3::new(radius * cos, radius * sin, z) + stretched;
    let half = Vec3::new(cap.x * alpha, cap.y * alpha, cap.z.max(1e-7)).normalize();
    let v_dot_h = view.dot(half).max(0.0);
    let light = 2.0 * v_dot_h * half - view;
    let weight = if light.z > 0.0 { fresnel(f0, v_dot_h) * masking(light.z, alpha) } else { Vec3::ZERO };
    (light, weight)
}

/// Share of light from the direction of the given cosine that the specular layer reflects.
pub(crate) fn specular_albedo(f0: Vec3, roughness: f32, cosine: f32) -> Vec3 {
    if roughness < MIRROR_ROUGHNESS {
        return fresnel(f0, cosine);
    }
    let [scale, bias] = TABLE.at(roughness, cosine);
    f0 * scale + Vec3::splat(bias)
}

/// Mean of [`specular_albedo`] over all directions, weighted by the cosine.
pub(crate) fn mean_specular_albedo(f0: Vec3, roughness: f32) -> Vec3 {
    const STEPS: usize = 8;
    let cosine = |i: usize| ((i as f32 + 0.5) / STEPS as f32).sqrt();
    (0..STEPS).map(|i| specular_albedo(f0, roughness, cosine(i))).sum::<Vec3>() / STEPS as f32
}

/// Mean of [`pane_reflectance`] over all directions, weighted by the cosine.
pub(crate) fn mean_pane_reflectance() -> f32 {
    const STEPS: usize = 8;
    (0..STEPS).map(|i| pane_reflectance(((i as f32 + 0.5) / STEPS as f32).sqrt())).sum::<f32>() / STEPS as f32
}

static TABLE: LazyLock<AlbedoTable> = LazyLock::new(AlbedoTable::new);

/// Directional albedo by roughness and cosine: factors of f0 and of 1 (the "split sum" of Karis 2013).
struct AlbedoTable {
    cells: Vec<[f32; 2]>,
}

impl AlbedoTable {
    const SIZE: usize = 32;
    const SAMPLES: u32 = 1024;

    fn new() -> Self {
        let cell = |i: usize| {
            let roughness = (i / Self::SIZE) as f32 / (Self::SIZE - 1) as f32;
            // Rows and columns lie on the ends of the range, but nothing is seen at a cosine of exactly 0.
            let cosine = ((i % Self::SIZE) as f32 / (Self::SIZE - 1) as f32).max(1e-3);
            Self::integrate(roughness.max(MIRROR_ROUGHNESS), cosine)
        };
        Self { cells: (0..Self::SIZE * Self::SIZE).map(cell).collect() }
    }

    fn integrate(roughness: f32, cosine: f32) -> [f32; 2] {
        let view = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
        let mut sums = [0.0; 2];
        for i in 0..Self::SAMPLES {
            let random = Vec2::new(crate::pattern::van_der_corput(i), (i as f32 + 0.5) / Self::SAMPLES as f32);
            // The factor is linear in f0: two of its values give both parts.
            let black = sample_lobe(Vec3::ZERO, roughness * roughness, view, random).1.x;
            let white = sample_lobe(Vec3::ONE, roughness * roughness, view, random).1.x;
            sums[0] += white - black;
            sums[1] += black;
        }
        sums.map(|sum| sum / Self::SAMPLES as f32)
    }

    fn at(&self, roughness: f32, cosine: f32) -> [f32; 2] {
        let last = (Self::SIZE - 1) as f32;
        let (x, y) = (cosine.clamp(0.0, 1.0) * last, roughness.clamp(0.0, 1.0) * last);
        let (column, row) = ((x as usize).min(Self::SIZE - 2), (y as usize).min(Self::SIZE - 2));
        let (fx, fy) = (x - column as f32, y - row as f32);
        let cell = |dx: usize, dy: usize| self.cells[(row + dy) * Self::SIZE + column + dx];
        let (a, b, c, d) = (cell(0, 0), cell(1, 0), cell(0, 1), cell(1, 1));
        std::array::from_fn(|k| {
            let (top, bottom) = (a[k] + (b[k] - a[k]) * fx, c[k] + (d[k] - c[k]) * fx);
            top + (bottom - top) * fy
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn view(cosine: f32) -> Vec3 {
        Vec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine)
    }

    #[test]
    fn albedo_equals_quadrature_and_never_exceeds_one() {
        for (roughness, cosine, f0) in [(0.3, 0.9, 0.04), (0.6, 0.5, 0.7), (1.0, 0.2, 1.0), (0.5, 0.07, 1.0)] {
            // Midpoint rule over cosine and azimuth of the light in f64.
            let mut sum = 0.0;
            let (rows, columns) = (600, 600);
            for i in 0..rows * columns {
                let z = (f64::from(i / columns) + 0.5) / f64::from(rows);
                let phi = (f64::from(i % columns) + 0.5) / f64::from(columns) * std::f64::consts::TAU;
                let radius = (1.0 - z * z).sqrt();
                let light = Vec3::new((radius * phi.cos()) as f32, (radius * phi.sin()) as f32, z as f32);
                let f = specular_cos(Vec3::splat(f0), roughness * roughness, Vec3::Z, view(cosine), light).x;
                sum += f64::from(f) * std::f64::consts::TAU / f64::from(rows * columns);
            }
            let found = specular_albedo(Vec3::splat(f0), roughness, cosine).x;
            // 1024 quasi-random samples, linear in between.
            assert!((f64::from(found) - sum).abs() < 0.01, "{roughness} {cosine} {f0}: {found} for {sum}");
        }
        for i in 0..=1000 {
            let (roughness, cosine) = ((i % 30) as f32 / 29.0, (i / 30) as f32 / 33.0);
            assert!(specular_albedo(Vec3::ONE, roughness, cosine).max_element() <= 1.0 + 1e-4);
        }
    }

    #[test]
    fn samples_follow_their_density() {
        // Share of samples in a cap about a direction against the integral of the density over that cap.
        let (alpha, view) = (0.2, view(0.6));
        let centre = Vec3::new(-0.7, 0.1, 0.7).normalize();
        let inside = |d: Vec3| d.dot(centre) > 0.95;
        let count = 1 << 16;
        let random = |i: u32| Vec2::new(crate::pattern::van_der_corput(i), (i as f32 + 0.5) / count as f32);
        let found = (0..count).filter(|&i| inside(sample_lobe(Vec3::ONE, alpha, view, random(i)).0)).count();
        let sphere = geometry::fibonacci_sphere(400_000);
        let expected: f32 =
            sphere.iter().filter(|d| inside(**d)).map(|&d| lobe_density(alpha, Vec3::Z, view, d)).sum::<f32>()
                * (2.0 * TAU / 400_000.0);
        assert!((found as f32 / count as f32 - expected).abs() < 0.005, "{found} of {count} for {expected}");
    }

    #[test]
    fn panes_reflect_as_glass_does() {
        // 1.5 glass at normal incidence: 4 % at each face, 7.7 % with all reflections between them.
        assert!((pane_reflectance(1.0) - 0.0769).abs() < 1e-3);
        assert!((pane_reflectance(0.0) - 1.0).abs() < 1e-6);
    }
}
