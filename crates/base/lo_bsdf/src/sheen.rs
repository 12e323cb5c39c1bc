//! Sheen of cloth (`KHR_materials_sheen`): the Charlie distribution (Estevez and Kulla 2017), Ashikhmin's visibility.

use std::f32::consts::{PI, TAU};
use std::sync::LazyLock;

use lo_geometry::{Vec3, cosine_hemisphere};

use crate::albedo::{SIZE, cosine_of, interpolated, view_of};

/// Smallest perceptual roughness: below it, the table is too coarse.
const MIN_ROUGHNESS: f32 = 0.15;

/// Directional albedo of a white sheen layer: the share of uniform light that it reflects to a view of the given
/// cosine.
#[inline]
pub fn sheen_albedo(roughness: f32, cosine: f32) -> f32 {
    let [albedo] = interpolated(&SHEEN, roughness.max(MIN_ROUGHNESS), cosine);
    albedo
}

/// The albedo by roughness and cosine.
static SHEEN: LazyLock<Vec<[f32; 1]>> = LazyLock::new(|| {
    let hemisphere = cosine_hemisphere(2048);
    let cell = |i: usize| {
        let roughness = ((i / SIZE) as f32 / (SIZE - 1) as f32).max(MIN_ROUGHNESS);
        let view = view_of(cosine_of(i % SIZE));
        let sum: f32 = hemisphere.iter().map(|&light| charlie(roughness, view, light) * PI).sum();
        [(sum / hemisphere.len() as f32).min(1.0)]
    };
    (0..SIZE * SIZE).map(cell).collect()
});

/// BRDF of white sheen per steradian, for local directions.
fn charlie(roughness: f32, view: Vec3, light: Vec3) -> f32 {
    let half = (view + light).normalize_or(Vec3::Z);
    let visibility = 1.0 / (4.0 * (light.z + view.z - light.z * view.z)).max(1e-4);
    density(roughness, (1.0 - half.z * half.z).max(0.0).sqrt()) * visibility
}

/// Density of microfacets per steradian at a sine of their tilt.
fn density(roughness: f32, sine: f32) -> f32 {
    let alpha = roughness * roughness;
    (2.0 + 1.0 / alpha) * sine.powf(1.0 / alpha) / TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distribution_is_normalised() {
        // ∫ D cos θ dω = 1 (Estevez and Kulla 2017), summed in f64 over the half vector's elevation.
        for roughness in [0.3, 0.5, 1.0] {
            let steps = 20_000;
            let sum: f64 = (0..steps)
                .map(|i| {
                    let theta = (i as f64 + 0.5) / steps as f64 * std::f64::consts::FRAC_PI_2;
                    let ring_sr = std::f64::consts::TAU * theta.sin();
                    f64::from(density(roughness, theta.sin() as f32)) * theta.cos() * ring_sr
                })
                .sum::<f64>()
                * std::f64::consts::FRAC_PI_2
                / steps as f64;
            assert!((sum - 1.0).abs() < 1e-4, "{roughness}: {sum}");
        }
    }

    #[test]
    fn sheen_is_strongest_at_grazing_views() {
        for roughness in [0.3, 0.6, 1.0] {
            let at = |cosine| sheen_albedo(roughness, cosine);
            assert!(at(1.0) < at(0.5) && at(0.5) < at(0.15), "{roughness}");
            assert!((0..=20).all(|i| (0.0..=1.0).contains(&at(i as f32 / 20.0))));
        }
        // Straight down on α = 1: D = 3 sin θh / 2π and V = 1 / 4, so the albedo is ¼ · 3 ∫ sin(θ / 2) cos θ sin θ dθ.
        let steps = 20_000;
        let integral: f64 = (0..steps)
            .map(|i| {
                let theta = (i as f64 + 0.5) / steps as f64 * std::f64::consts::FRAC_PI_2;
                (theta / 2.0).sin() * theta.cos() * theta.sin() * std::f64::consts::FRAC_PI_2 / steps as f64
            })
            .sum();
        assert!(
            (f64::from(sheen_albedo(1.0, 1.0)) - 0.75 * integral).abs() < 5e-3,
            "{} {integral}",
            sheen_albedo(1.0, 1.0)
        );
    }
}
