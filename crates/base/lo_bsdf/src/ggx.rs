//! The isotropic GGX microfacet distribution (Trowbridge and Reitz 1975, Walter et al. 2007) with Smith masking.

use std::f32::consts::{PI, TAU};

use lo_geometry::{Vec2, Vec3};

/// Smallest α: visually a mirror, and still finite in f32.
const MIN_ALPHA: f32 = 1e-3;

/// Smallest cosine between normal and view. Keeps results finite where the shading normal faces away.
pub const MIN_COSINE: f32 = 1e-3;

/// An isotropic GGX microfacet distribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ggx {
    alpha: f32,
}

/// A direction drawn by [`Ggx::sample`].
#[derive(Clone, Copy, Debug)]
pub struct GgxSample {
    /// Local direction towards the light. It may point below the surface; its weight is then 0.
    pub light: Vec3,
    /// Cosine between view and half vector, for the Fresnel term.
    pub v_dot_h: f32,
    /// Sample weight: a Monte Carlo estimate is the mean of `fresnel · weight · radiance`. G₁ of the light's direction,
    /// 0 below the surface.
    pub weight: f32,
    /// Probability density of the direction, per steradian.
    pub pdf_per_sr: f32,
}

impl Ggx {
    /// Creates the distribution for a perceptual roughness in [0, 1].
    #[inline]
    pub fn from_roughness(roughness: f32) -> Self {
        Self { alpha: (roughness * roughness).max(MIN_ALPHA) }
    }

    /// Returns α, at least 0.001.
    #[inline]
    pub fn alpha(self) -> f32 {
        self.alpha
    }

    /// Density of microfacet normals D(h), per steradian and unit surface area.
    #[inline]
    pub fn density(self, n_dot_h: f32) -> f32 {
        // 1 + (α² − 1) cos², written to avoid cancellation for cos² near 1 and small α.
        let cos2 = (n_dot_h * n_dot_h).min(1.0);
        let alpha2 = self.alpha * self.alpha;
        let f = (1.0 - cos2) + alpha2 * cos2;
        alpha2 / (PI * f * f)
    }

    /// Smith's masking function G₁ for a direction's cosine from the normal. glTF's B.3.2 uses the product of two.
    #[inline]
    pub fn masking(self, cosine: f32) -> f32 {
        let alpha2 = self.alpha * self.alpha;
        2.0 * cosine / (cosine + (alpha2 + (1.0 - alpha2) * cosine * cosine).sqrt())
    }

    /// Returns the BRDF without Fresnel term times the light's cosine, per steradian, and the cosine between view and
    /// half vector for that term.
    ///
    /// Zero for a light below the surface. View cosines are clamped to [`MIN_COSINE`].
    #[inline]
    pub fn reflection_cos(self, normal: Vec3, view: Vec3, light: Vec3) -> (f32, f32) {
        let (n_dot_l, n_dot_v) = (normal.dot(light), normal.dot(view).max(MIN_COSINE));
        if n_dot_l <= 0.0 {
            return (0.0, 1.0);
        }
        let half = (view + light).normalize_or(normal);
        let shape = self.density(normal.dot(half)) * self.masking(n_dot_v) * self.masking(n_dot_l);
        (shape / (4.0 * n_dot_v), view.dot(half))
    }

    /// Samples the visible normals for `view` (local, z > 0) with `random` in [0, 1)² (spherical caps, Dupuy and
    /// Benyoub 2023).
    #[inline]
    pub fn sample(self, view: Vec3, random: Vec2) -> GgxSample {
        let alpha = self.alpha;
        let stretched = Vec3::new(view.x * alpha, view.y * alpha, view.z).normalize();
        let z = (1.0 - random.y) * (1.0 + stretched.z) - stretched.z;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = (TAU * random.x).sin_cos();
        let cap = Vec3::new(radius * cos, radius * sin, z) + stretched;
        let half = Vec3::new(cap.x * alpha, cap.y * alpha, cap.z.max(1e-7)).normalize();
        let v_dot_h = view.dot(half).max(0.0);
        let light = 2.0 * v_dot_h * half - view;
        let pdf_per_sr = self.masking(view.z) * self.density(half.z) / (4.0 * view.z);
        let weight = if light.z > 0.0 { self.masking(light.z) } else { 0.0 };
        GgxSample { light, v_dot_h, weight, pdf_per_sr }
    }

    /// Probability density, per steradian, with which [`Ggx::sample`] draws `light`. It integrates to 1 over the
    /// sphere.
    #[inline]
    pub fn pdf_per_sr(self, normal: Vec3, view: Vec3, light: Vec3) -> f32 {
        let n_dot_v = normal.dot(view).max(MIN_COSINE);
        let n_dot_h = normal.dot((view + light).normalize_or(normal));
        if n_dot_h <= 0.0 {
            return 0.0;
        }
        self.density(n_dot_h) * self.masking(n_dot_v) / (4.0 * n_dot_v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lo_random::RngExt;

    fn ggx(alpha: f32) -> Ggx {
        Ggx { alpha }
    }

    /// Direction at the given cosine from the normal and azimuth about it.
    fn direction(cosine: f32, azimuth: f32) -> Vec3 {
        let radius = (1.0 - cosine * cosine).sqrt();
        Vec3::new(radius * azimuth.cos(), radius * azimuth.sin(), cosine)
    }

    /// Trowbridge and Reitz's density in its tangent form, in f64 (pbrt-v4, equation 9.16).
    fn density_f64(n_h: f64, alpha: f64) -> f64 {
        let tangent2 = 1.0 / (n_h * n_h) - 1.0;
        1.0 / (std::f64::consts::PI * alpha * alpha * n_h.powi(4) * (1.0 + tangent2 / (alpha * alpha)).powi(2))
    }

    /// Smith's masking from Λ, in f64 (pbrt-v4, equations 9.20 and 9.22).
    fn masking_f64(cosine: f64, alpha: f64) -> f64 {
        let tangent2 = 1.0 / (cosine * cosine) - 1.0;
        1.0 / (1.0 + ((1.0 + alpha * alpha * tangent2).sqrt() - 1.0) / 2.0)
    }

    #[test]
    fn samples_pass_a_chi_squared_test_against_their_density() {
        // As in pbrt-v4's bsdfs_test: sample counts on a grid over the sphere against the pdf's integrals over the
        // cells. Cells with fewer than 5 expected samples are pooled.
        const ROWS: usize = 40;
        const COLUMNS: usize = 80;
        const INNER: usize = 8;
        const SAMPLES: usize = 1_000_000;
        for (case, (alpha, cosine)) in
            [(0.09, 0.9), (0.25, 0.5), (0.25, 0.1), (0.5, 0.7), (1.0, 0.3)].into_iter().enumerate()
        {
            let (ggx, view) = (ggx(alpha), direction(cosine, 0.0));
            let mut stream = lo_random::stream(1, "chi squared", case as u64);
            let mut counts = vec![0u32; ROWS * COLUMNS];
            for _ in 0..SAMPLES {
                let light = ggx.sample(view, Vec2::new(stream.random(), stream.random())).light.normalize();
                let row = ((light.z + 1.0) / 2.0 * ROWS as f32) as usize;
                let column = (light.y.atan2(light.x) / TAU + 0.5) * COLUMNS as f32;
                counts[row.min(ROWS - 1) * COLUMNS + (column as usize).min(COLUMNS - 1)] += 1;
            }
            // Rows and columns of equal solid angle; the midpoint rule within each cell.
            let step_sr = 4.0 * std::f64::consts::PI / (ROWS * COLUMNS * INNER * INNER) as f64;
            let expected: Vec<f64> = (0..ROWS * COLUMNS)
                .map(|cell| {
                    let at = |k: usize, cells: usize| (k as f32 + 0.5) / (cells * INNER) as f32;
                    let inner = |i: usize| {
                        let z = 2.0 * at(cell / COLUMNS * INNER + i / INNER, ROWS) - 1.0;
                        let azimuth = (at(cell % COLUMNS * INNER + i % INNER, COLUMNS) - 0.5) * TAU;
                        f64::from(ggx.pdf_per_sr(Vec3::Z, view, direction(z, azimuth)))
                    };
                    (0..INNER * INNER).map(inner).sum::<f64>() * step_sr * SAMPLES as f64
                })
                .collect();
            let total = expected.iter().sum::<f64>() / SAMPLES as f64;
            assert!((total - 1.0).abs() < 2e-3, "α {alpha}, cosine {cosine}: the density integrates to {total}");
            let (mut chi2, mut cells, mut pooled) = (0.0, 0u32, (0.0, 0.0));
            let mut count = |found: f64, expected: f64| {
                chi2 += (found - expected).powi(2) / expected;
                cells += 1;
            };
            for (&found, &expected) in counts.iter().zip(&expected) {
                if expected < 5.0 {
                    pooled = (pooled.0 + f64::from(found), pooled.1 + expected);
                } else {
                    count(f64::from(found), expected);
                }
            }
            if pooled.1 > 5.0 {
                count(pooled.0, pooled.1);
            }
            // Wilson and Hilferty (1931): the cube root is nearly normal. 3.5 standard deviations: one chance in 4,000.
            let freedom = f64::from(cells - 1);
            let variance = 2.0 / (9.0 * freedom);
            let deviations = ((chi2 / freedom).cbrt() - (1.0 - variance)) / variance.sqrt();
            assert!(
                deviations < 3.5,
                "α {alpha}, cosine {cosine}: χ² {chi2:.0} of {freedom}, {deviations:.1} deviations"
            );
        }
    }

    #[test]
    fn a_samples_pdf_and_weight_match_the_brdf() {
        for (alpha, cosine) in [(0.05, 0.8), (0.3, 0.4), (1.0, 0.15)] {
            let (ggx, view) = (ggx(alpha), direction(cosine, 0.0));
            let mut stream = lo_random::stream(2, "ggx samples", 0);
            for _ in 0..1000 {
                let sample = ggx.sample(view, Vec2::new(stream.random(), stream.random()));
                assert!((sample.light.length() - 1.0).abs() < 1e-4);
                if sample.light.z < 1e-3 {
                    continue;
                }
                let density = ggx.pdf_per_sr(Vec3::Z, view, sample.light);
                assert!((sample.pdf_per_sr / density - 1.0).abs() < 0.01, "{} for {density}", sample.pdf_per_sr);
                // The weight is the BRDF over the pdf.
                let weight = ggx.reflection_cos(Vec3::Z, view, sample.light).0 / density;
                assert!((sample.weight - weight).abs() < 1e-3, "{} for {weight}", sample.weight);
            }
        }
    }

    #[test]
    fn reflection_equals_its_f64_twin_and_is_reciprocal() {
        for alpha in [1e-3f32, 0.0025, 0.04, 0.3, 1.0] {
            for i in 0..400 {
                let place = |k: usize, shift: f32| (k as f32 * 0.618_034 + shift).fract();
                let (cosines, turn) =
                    ([0.02 + 0.97 * place(i, 0.1), 0.02 + 0.97 * place(3 * i, 0.7)], TAU * place(7 * i, 0.0));
                let (view, light) = (direction(cosines[0], 0.0), direction(cosines[1], turn));
                let (found, v_dot_h) = ggx(alpha).reflection_cos(Vec3::Z, view, light);
                let (v, l) = (view.as_dvec3(), light.as_dvec3());
                let half = (v + l).normalize();
                let alpha64 = f64::from(alpha);
                let expected =
                    density_f64(half.z, alpha64) * masking_f64(v.z, alpha64) * masking_f64(l.z, alpha64) / (4.0 * v.z);
                // n·h has a rounding error of 2⁻²⁴, amplified by 1 / α² where h is near the normal.
                let close = 1e-4 + 2e-7 / f64::from((alpha * alpha).max(1.0 - half.z as f32 * half.z as f32));
                assert!(
                    (f64::from(found) / expected - 1.0).abs() < close,
                    "{alpha} {view} {light}: {found} for {expected}"
                );
                assert!((f64::from(v_dot_h) - v.dot(half)).abs() < 1e-6);
                // Helmholtz: f(v, l) = f(l, v), and reflection_cos is f times the light's cosine.
                let back = ggx(alpha).reflection_cos(Vec3::Z, light, view).0;
                assert!((found * view.z / (back * light.z) - 1.0).abs() < 1e-4, "{alpha} {view} {light}");
            }
        }
    }

    #[test]
    fn nothing_comes_from_below_and_views_from_below_stay_finite() {
        let below = Vec3::new(0.6, 0.0, -0.8);
        for alpha in [1e-3, 0.2, 1.0] {
            assert_eq!(ggx(alpha).reflection_cos(Vec3::Z, Vec3::Z, below).0, 0.0);
            let (seen, _) = ggx(alpha).reflection_cos(Vec3::Z, below, direction(0.9, 1.0));
            assert!(seen.is_finite() && seen >= 0.0);
        }
        assert_eq!(Ggx::from_roughness(0.0).alpha(), 1e-3);
    }
}
