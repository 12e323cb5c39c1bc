//! A thin pane of clear glass: both faces are smooth, and refraction does not displace what is behind it.

use lo_geometry::Vec3;

use crate::fresnel::{DIELECTRIC_F0, fresnel};

/// Reflectance of a pane at the given cosine, 2F / (1 + F): the sum over all reflections between its two faces.
#[inline]
pub fn pane_reflectance(cosine: f32) -> f32 {
    let f = fresnel(Vec3::splat(DIELECTRIC_F0), cosine).x;
    2.0 * f / (1.0 + f)
}

/// Cosine-weighted mean of [`pane_reflectance`] over all directions.
#[inline]
pub fn mean_pane_reflectance() -> f32 {
    const STEPS: usize = 8;
    (0..STEPS).map(|i| pane_reflectance(((i as f32 + 0.5) / STEPS as f32).sqrt())).sum::<f32>() / STEPS as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panes_reflect_as_glass_does() {
        // Glass of index 1.5 at normal incidence: 4 % at each face, 7.7 % with all reflections between them.
        assert!((pane_reflectance(1.0) - 0.0769).abs() < 1e-3);
        assert!((pane_reflectance(0.0) - 1.0).abs() < 1e-6);
    }
}
