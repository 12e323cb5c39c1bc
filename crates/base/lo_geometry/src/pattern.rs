//! Fixed sample patterns: the same points every time, so that rendered sequences do not flicker.

use std::f32::consts::TAU;

use glam::{Mat3, Vec3};

/// The golden angle, 2π / φ².
const GOLDEN_ANGLE_RAD: f32 = 2.399_963_2;

/// Returns `count` directions spread evenly over the sphere (spherical Fibonacci lattice, Keinert et al. 2015).
pub fn fibonacci_sphere(count: usize) -> Vec<Vec3> {
    (0..count)
        .map(|i| {
            let y = 1.0 - (2.0 * i as f32 + 1.0) / count as f32;
            let radius = (1.0 - y * y).max(0.0).sqrt();
            let (sin, cos) = (i as f32 * GOLDEN_ANGLE_RAD % TAU).sin_cos();
            Vec3::new(radius * cos, y, radius * sin)
        })
        .collect()
}

/// Returns `count` directions about +Z with density cos θ / π. Each carries an equal share of a diffuse surface's
/// irradiance.
pub fn cosine_hemisphere(count: usize) -> Vec<Vec3> {
    (0..count)
        .map(|i| {
            // Malley's method: a Vogel spiral on the disc lifted to the hemisphere.
            let radius_squared = (i as f32 + 0.5) / count as f32;
            let (sin, cos) = (i as f32 * GOLDEN_ANGLE_RAD % TAU).sin_cos();
            let radius = radius_squared.sqrt();
            Vec3::new(radius * cos, radius * sin, (1.0 - radius_squared).sqrt())
        })
        .collect()
}

/// The base-2 van der Corput sequence: the bits of `i` mirrored at the binary point, in [0, 1).
#[inline]
pub fn van_der_corput(i: u32) -> f32 {
    // f32 holds 24 bits below 1.
    (i.reverse_bits() >> 8) as f32 / (1 << 24) as f32
}

/// Returns a right-handed basis whose third column is the unit vector `normal` (Duff et al. 2017).
#[inline]
pub fn orthonormal_basis(normal: Vec3) -> Mat3 {
    let sign = 1.0f32.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    Mat3::from_cols(
        Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
        Vec3::new(b, sign + normal.y * normal.y * a, -normal.y),
        normal,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn patterns_integrate_low_orders() {
        let sphere = fibonacci_sphere(256);
        let mean: Vec3 = sphere.iter().sum::<Vec3>() / 256.0;
        assert!(mean.length() < 0.01, "{mean}");
        // ∫ cos θ · (cos θ / π) dω = 2/3, and the horizontal mean is zero
        let hemisphere = cosine_hemisphere(256);
        let mean = hemisphere.iter().sum::<Vec3>() / 256.0;
        assert!((mean.z - 2.0 / 3.0).abs() < 1e-3 && mean.truncate().length() < 0.01, "{mean}");
        assert!(hemisphere.iter().all(|d| (d.length() - 1.0).abs() < 1e-5 && d.z > 0.0));
    }

    #[test]
    fn van_der_corput_by_hand() {
        assert_eq!([0, 1, 2, 3, 4].map(van_der_corput), [0.0, 0.5, 0.25, 0.75, 0.125]);
    }

    proptest! {
        #[test]
        fn basis_is_orthonormal(x in -1.0..1.0f32, y in -1.0..1.0f32, z in -1.0..1.0f32) {
            let normal = Vec3::new(x, y, z);
            prop_assume!(normal.length() > 0.01);
            let basis = orthonormal_basis(normal.normalize());
            let error = basis.transpose() * basis - Mat3::IDENTITY;
            prop_assert!(error.to_cols_array().iter().all(|e| e.abs() < 1e-5));
            prop_assert!((basis.determinant() - 1.0).abs() < 1e-5);
        }
    }
}
