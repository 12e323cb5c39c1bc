//! Directional light: one spherical Gaussian lobe per node (`docs/method.md` §5.8, variant "SG").

use std::borrow::Cow;

use lo_geometry::Vec3;

use crate::LightOctree;

/// Least sharpness of a lobe, so that sharpness has a gradient everywhere. Such a lobe differs by 2 % between front and
/// back.
pub const MIN_SHARPNESS: f32 = 0.01;

/// Ratio of the radiance of a node with `lobe` towards the unit direction `towards` to its mean over all directions.
///
/// The lobe's direction is its axis, its length λ the sharpness: `e^(v·ω − λ) · 2λ / (1 − e^(−2λ))`, whose mean over
/// the sphere is 1. A zero lobe gives 1 in all directions.
pub fn lobe_gain(lobe: Vec3, towards: Vec3) -> f32 {
    let (lobe, towards) = (lobe.as_dvec3(), towards.as_dvec3());
    let sharpness = (lobe.length_squared() + f64::from(MIN_SHARPNESS).powi(2)).sqrt();
    let norm = 2.0 * sharpness / -(-2.0 * sharpness).exp_m1();
    (norm * (lobe.dot(towards) - sharpness).exp()) as f32
}

impl LightOctree {
    /// Returns the octree as seen from `viewer_m`: each row's radiance times its lobe's gain towards the viewer,
    /// without lobes.
    pub fn seen_from(&self, viewer_m: Vec3) -> Cow<'_, Self> {
        let Some(lobes) = &self.lobes else { return Cow::Borrowed(self) };
        let shown = |depth: usize| {
            let rows = self.octree.levels()[depth].row_keys().zip(&self.rgba[depth]).zip(&lobes[depth]);
            rows.map(|((key, &[r, g, b, alpha]), &lobe)| {
                let towards = (viewer_m - self.node_middle_m(depth as u32, key)).normalize_or_zero();
                let gain = lobe_gain(Vec3::from_array(lobe), towards);
                [r * gain, g * gain, b * gain, alpha]
            })
            .collect()
        };
        let Self { octree, cube, seen, .. } = self;
        let (octree, seen) = (octree.clone(), seen.clone());
        Cow::Owned(Self { octree, cube: *cube, rgba: (0..lobes.len()).map(shown).collect(), seen, lobes: None })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use lo_geometry::{Cube, fibonacci_sphere};

    use super::*;
    use crate::{Provenance, RadiancePoint, key_from_xyz};

    #[test]
    fn lobes_have_mean_one_and_gaussian_falloff() {
        for lobe in [Vec3::ZERO, Vec3::new(0.3, -0.1, 0.2), Vec3::new(-2.0, 3.0, 4.0), Vec3::Y * 20.0] {
            let directions = fibonacci_sphere(20_000);
            let mean = directions.iter().map(|&d| f64::from(lobe_gain(lobe, d))).sum::<f64>() / 20_000.0;
            assert!((mean - 1.0).abs() < 2e-3, "{lobe}: {mean}");
            if let Some(axis) = lobe.try_normalize() {
                // from the peak to the side: e^−λ
                let side = lobe_gain(lobe, axis.any_orthonormal_vector()) / lobe_gain(lobe, axis);
                assert!((side.ln() / -lobe.length() - 1.0).abs() < 1e-3, "{side}");
            }
        }
        assert!((lobe_gain(Vec3::ZERO, Vec3::X) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn each_node_shows_its_lobe_towards_the_viewer() {
        let cube = Cube { origin_m: Vec3::splat(-1.0), edge_m: 2.0 };
        let position_m = Vec3::new(0.6, -0.4, 0.1);
        let point = RadiancePoint { position_m, radiance: [1.0, 2.0, 3.0], provenance: Provenance::Observed };
        let mut light = LightOctree::from_points(&[point], cube, 3, 1).unwrap().0;
        assert_eq!(*light.seen_from(Vec3::ONE), light);
        light.lobes = Some(light.rgba.iter().map(|rows| vec![[0.0, 2.0, 0.0]; rows.len()]).collect());
        let middle = Vec3::new(0.625, -0.375, 0.125);
        let key = key_from_xyz([6, 2, 4]);
        assert_eq!((light.row(3, key), light.node_middle_m(3, key)), (Some(0), middle));
        assert_eq!(light.row(3, key + 1), None);
        for (viewer, towards) in [(middle + Vec3::Y, Vec3::Y), (middle - 3.0 * Vec3::X, Vec3::NEG_X)] {
            let gain = lobe_gain(Vec3::Y * 2.0, towards);
            let [r, g, b, alpha] = light.seen_from(viewer).rgba[3][0];
            let expected = [gain, 2.0 * gain, 3.0 * gain, light.rgba[3][0][3]];
            assert!(
                [r, g, b, alpha].iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5),
                "{r} {g} {b} {expected:?}"
            );
        }
    }
}
