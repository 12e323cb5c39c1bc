//! The metallic-roughness BRDF of glTF 2.0, appendix B.3: Lambert diffuse under a GGX specular layer.
//!
//! Local frames have the shading normal as +Z. `alpha` is the squared perceptual roughness.

use std::f32::consts::{PI, TAU};

use geometry::{Vec2, Vec3};

/// Reflectance of a dielectric at normal incidence (glTF: index of refraction 1.5).
const DIELECTRIC_F0: f32 = 0.04;

/// Smallest α: a mirror for every pixel, still finite in f32.
const MIN_ALPHA: f32 = 1e-3;

/// BRDF parameters of one surface point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Brdf {
    /// Diffuse albedo, linear RGB.
    pub diffuse: Vec3,
    /// Specular reflectance at normal incidence, linear RGB.
    pub f0: Vec3,
    /// GGX α.
    pub alpha: f32,
}

impl Brdf {
    /// From base colour, metalness and perceptual roughness, each in [0, 1].
    pub fn new(base_color: Vec3, metallic: f32, roughness: f32) -> Self {
        Self {
            diffuse: base_color * (1.0 - metallic),
            f0: Vec3::splat(DIELECTRIC_F0).lerp(base_color, metallic),
            alpha: (roughness * roughness).max(MIN_ALPHA),
        }
    }

    /// Schlick's Fresnel term for the cosine between view and half vector.
    pub fn fresnel(&self, v_dot_h: f32) -> Vec3 {
        self.f0 + (Vec3::ONE - self.f0) * (1.0 - v_dot_h).clamp(0.0, 1.0).powi(5)
    }

    /// Specular BRDF times the cosine of the light direction; unit vectors.
    pub fn specular_cos(&self, normal: Vec3, view: Vec3, light: Vec3) -> Vec3 {
        let (n_dot_l, n_dot_v) = (normal.dot(light), normal.dot(view).max(1e-4));
        if n_dot_l <= 0.0 {
            return Vec3::ZERO;
        }
        let half = (view + light).normalize_or(normal);
        let shape =
            ggx_density(normal.dot(half), self.alpha) * smith_g1(n_dot_v, self.alpha) * smith_g1(n_dot_l, self.alpha);
        self.fresnel(view.dot(half)) * (shape / (4.0 * n_dot_v))
    }
}

/// GGX distribution of half vectors D(h), per steradian.
pub(crate) fn ggx_density(n_dot_h: f32, alpha: f32) -> f32 {
    // 1 + (α² − 1) cos² written without cancellation where cos² is near 1 and α small
    let cos_squared = (n_dot_h * n_dot_h).min(1.0);
    let alpha_squared = alpha * alpha;
    let f = (1.0 - cos_squared) + alpha_squared * cos_squared;
    alpha_squared / (PI * f * f)
}

/// Smith's masking of one direction, G₁ (appendix B.3.2 uses the product of two).
pub(crate) fn smith_g1(n_dot_x: f32, alpha: f32) -> f32 {
    let cos_squared = n_dot_x * n_dot_x;
    2.0 * n_dot_x / (n_dot_x + (alpha * alpha + (1.0 - alpha * alpha) * cos_squared).sqrt())
}

/// One sampled direction of a specular lobe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LobeSample {
    /// Local direction towards the light; may point below the surface, where it carries nothing.
    pub direction: Vec3,
    /// Cosine between view and half vector, for the Fresnel term.
    pub v_dot_h: f32,
    /// What multiplies Fresnel and radiance in a plain mean: G₁ of the light direction.
    pub weight: f32,
    /// Density of the direction per steradian.
    pub pdf_per_sr: f32,
}

/// Samples the half vectors that `view` (local, z > 0) sees, `random` in [0, 1)² (spherical caps, Dupuy and Benyoub 2023).
pub(crate) fn sample_lobe(view: Vec3, alpha: f32, random: Vec2) -> LobeSample {
    let stretched = Vec3::new(view.x * alpha, view.y * alpha, view.z).normalize();
    let z = (1.0 - random.y) * (1.0 + stretched.z) - stretched.z;
    let (sin, cos) = (TAU * random.x).sin_cos();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let cap = Vec3::new(radius * cos, radius * sin, z) + stretched;
    let half = Vec3::new(cap.x * alpha, cap.y * alpha, cap.z.max(1e-7)).normalize();
    let v_dot_h = view.dot(half).max(0.0);
    let direction = 2.0 * v_dot_h * half - view;
    let pdf_per_sr = smith_g1(view.z, alpha) * ggx_density(half.z, alpha) / (4.0 * view.z);
    let weight = if direction.z > 0.0 { smith_g1(direction.z, alpha) } else { 0.0 };
    LobeSample { direction, v_dot_h, weight, pdf_per_sr }
}

/// Tangent of the half-angle of a cone of the given solid angle; never wider than 120° across.
pub(crate) fn cone_tangent(solid_angle_sr: f32) -> f32 {
    let cos = (1.0 - solid_angle_sr / TAU).max(0.5);
    ((1.0 - cos * cos).max(0.0)).sqrt() / cos
}

/// A tangent rounded to quarter octaves: cones of one tangent share their steps.
pub(crate) fn quantised(tangent: f32) -> f32 {
    ((4.0 * tangent.max(1e-4).log2()).round() / 4.0).exp2()
}

/// Directional albedos of the BRDF, tabulated once (the "split sum" of Karis 2013, exact instead of a fit).
#[derive(Debug)]
pub(crate) struct AlbedoTable {
    /// `[roughness][cosine]`: the factors of f0 and of 1.
    specular: Vec<[f32; 2]>,
    /// `[cosine]`: cosine-weighted mean of (1 − v·h)⁵.
    diffuse: Vec<f32>,
}

impl AlbedoTable {
    const SIZE: usize = 32;
    const SAMPLES: usize = 256;

    /// Integrates the BRDF for a grid of roughness and view angle.
    pub fn new() -> Self {
        let cosine = |i: usize| ((i as f32 + 0.5) / Self::SIZE as f32).max(1e-3);
        let mut specular = Vec::with_capacity(Self::SIZE * Self::SIZE);
        for row in 0..Self::SIZE {
            let roughness = row as f32 / (Self::SIZE - 1) as f32;
            let alpha = (roughness * roughness).max(MIN_ALPHA);
            specular.extend((0..Self::SIZE).map(|column| Self::specular_albedo(cosine(column), alpha)));
        }
        let hemisphere = geometry::cosine_hemisphere(1024);
        let diffuse = (0..Self::SIZE).map(|column| {
            let view = view_of_cosine(cosine(column));
            let power = |light: &Vec3| (1.0 - view.dot((view + *light).normalize())).max(0.0).powi(5);
            hemisphere.iter().map(power).sum::<f32>() / hemisphere.len() as f32
        });
        Self { specular, diffuse: diffuse.collect() }
    }

    fn specular_albedo(cosine: f32, alpha: f32) -> [f32; 2] {
        let view = view_of_cosine(cosine);
        let mut sums = [0.0f32; 2];
        for i in 0..Self::SAMPLES {
            let sample = sample_lobe(view, alpha, hammersley(i, Self::SAMPLES));
            let grazing = (1.0 - sample.v_dot_h).powi(5);
            sums[0] += sample.weight * (1.0 - grazing);
            sums[1] += sample.weight * grazing;
        }
        sums.map(|sum| sum / Self::SAMPLES as f32)
    }

    /// Share of a uniform environment's light that the specular layer reflects.
    pub fn specular(&self, f0: Vec3, n_dot_v: f32, alpha: f32) -> Vec3 {
        let row = (alpha.sqrt() * (Self::SIZE - 1) as f32).clamp(0.0, (Self::SIZE - 1) as f32);
        let y = (row as usize).min(Self::SIZE - 2);
        let fy = row - y as f32;
        let (x, fx) = Self::column(n_dot_v);
        let at = |dx: usize, dy: usize| Vec2::from(self.specular[(y + dy) * Self::SIZE + x + dx]);
        let value = at(0, 0).lerp(at(1, 0), fx).lerp(at(0, 1).lerp(at(1, 1), fx), fy);
        f0 * value.x + Vec3::splat(value.y)
    }

    /// Share of a uniform environment's light that passes the specular layer into the diffuse one: the mean of 1 − F.
    pub fn diffuse(&self, f0: Vec3, n_dot_v: f32) -> Vec3 {
        let (x, fx) = Self::column(n_dot_v);
        let grazing = self.diffuse[x] + (self.diffuse[x + 1] - self.diffuse[x]) * fx;
        (Vec3::ONE - f0) * (1.0 - grazing)
    }

    fn column(n_dot_v: f32) -> (usize, f32) {
        let column = (n_dot_v * Self::SIZE as f32 - 0.5).clamp(0.0, (Self::SIZE - 1) as f32);
        let x = (column as usize).min(Self::SIZE - 2);
        (x, column - x as f32)
    }
}

/// The local view direction at an angle of the given cosine from the normal.
fn view_of_cosine(cosine: f32) -> Vec3 {
    Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine)
}

/// Point `i` of the Hammersley set of `count` points in [0, 1)².
pub(crate) fn hammersley(i: usize, count: usize) -> Vec2 {
    let radical_inverse = (i as u32).reverse_bits() as f32 / 4_294_967_808.0;
    Vec2::new(radical_inverse, (i as f32 + 0.5) / count as f32)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Plain midpoint quadrature over the hemisphere of light directions in f64, from appendix B.3 word by word.
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
                let h: Vec<f64> = v.iter().zip(l).map(|(a, b)| a + b).collect();
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
        let table = AlbedoTable::new();
        for (cosine, roughness, f0) in [(0.95, 0.5, 0.04), (0.6, 0.7, 0.8), (0.3, 1.0, 1.0), (0.8, 0.4, 0.5)] {
            let (specular, diffuse) = albedo_by_quadrature(cosine, roughness * roughness, f0);
            let alpha = (roughness * roughness) as f32;
            let found = f64::from(table.specular(Vec3::splat(f0 as f32), cosine as f32, alpha).x);
            // 256 quasi-random samples and linear interpolation of a 32 × 32 table
            assert!((found - specular).abs() < 0.01, "{cosine} {roughness} {f0}: {found} for {specular}");
            let found = f64::from(table.diffuse(Vec3::splat(f0 as f32), cosine as f32).x);
            assert!((found - diffuse).abs() < 0.005, "{cosine} {f0}: {found} for {diffuse}");
        }
    }

    #[test]
    fn lobe_samples_integrate_the_brdf() {
        // mean(F · weight) over samples of a linear test radiance equals the quadrature of specular_cos
        let brdf = Brdf::new(Vec3::new(0.9, 0.5, 0.1), 1.0, 0.6);
        let view = view_of_cosine(0.7);
        let radiance = |d: Vec3| 1.0 + 0.5 * d.x - 0.3 * d.z;
        let count = 4096;
        let sampled: Vec3 = (0..count)
            .map(|i| sample_lobe(view, brdf.alpha, hammersley(i, count)))
            .map(|s| brdf.fresnel(s.v_dot_h) * s.weight * radiance(s.direction))
            .sum::<Vec3>()
            / count as f32;
        let uniform = geometry::fibonacci_sphere(400_000);
        let exact: Vec3 = uniform.iter().map(|&l| brdf.specular_cos(Vec3::Z, view, l) * radiance(l)).sum::<Vec3>()
            * (4.0 * PI / 400_000.0);
        assert!((sampled - exact).abs().max_element() < 0.01, "{sampled} for {exact}");
    }

    #[test]
    fn lobe_density_integrates_to_one_at_most() {
        // ∫ pdf over directions above and below the surface is 1: half vectors are a density
        let view = view_of_cosine(0.5);
        let samples: Vec<_> = (0..4096).map(|i| sample_lobe(view, 0.3, hammersley(i, 4096))).collect();
        let area: f32 = samples.iter().map(|s| 1.0 / s.pdf_per_sr).sum::<f32>() / 4096.0;
        // E[1/pdf] is the solid angle of the directions that can be reached: at most the whole sphere
        assert!(area > 0.5 * TAU && area < 1.05 * 2.0 * TAU, "{area}");
        assert!(samples.iter().all(|s| (s.direction.length() - 1.0).abs() < 1e-4));
    }

    #[test]
    fn white_mirror_reflects_everything() {
        let table = AlbedoTable::new();
        for cosine in [0.05, 0.3, 0.9] {
            assert!((table.specular(Vec3::ONE, cosine, MIN_ALPHA).x - 1.0).abs() < 0.01);
        }
    }
}
