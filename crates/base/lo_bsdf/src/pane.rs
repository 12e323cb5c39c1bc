//! A thin clear sheet of glass: both faces smooth, no shift of what is seen through it.

use lo_geometry::Vec3;

use crate::fresnel::{DIELECTRIC_F0, fresnel};

/// Share that a pane reflects of light from the given cosine: the sum over all reflections between its two faces, 2F / (1 + F).
#[inline]
pub fn pane_reflectance(cosine: f32) -> f32 {
    let f = fresnel(Vec3::splat(DIELECTRIC_F0), cosine).x;
    2.0 * f / (1.0 + f)
}

/// Mean of [`pane_reflectance`] over all directions, weighted by the cosine.
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
        // 1.5 glass at normal incidence: 4 % at each face, 7.7 % with all reflections between them.
        assert!((pane_reflectance(1.0) - 0.0769).abs() < 1e-3);
        assert!((pane_reflectance(0.0) - 1.0).abs() < 1e-6);
    }
}
