//! A smooth boundary between two dielectrics: Snell's law and Fresnel's equations for unpolarised light.

use lo_geometry::Vec3;

/// Index of refraction of glass and of most plastics, glTF's default.
pub const GLASS_IOR: f32 = 1.5;

/// Returns the reflectance at normal incidence of a dielectric in air; 4 % for an index of 1.5.
#[inline]
pub fn dielectric_f0(ior: f32) -> f32 {
    let ratio = (ior - 1.0) / (ior + 1.0);
    ratio * ratio
}

/// Returns the reflectance of a boundary (Fresnel; pbrt-v4, equation 9.9), in [0, 1].
///
/// `cosine` is that between the normal and the direction that the light comes from, and `eta` the index of refraction
/// beyond the boundary divided by that before it. From the angle of total reflection on, it is 1.
#[inline]
pub fn dielectric_reflectance(cosine: f32, eta: f32) -> f32 {
    let cosine = cosine.clamp(0.0, 1.0);
    let sin2_beyond = (1.0 - cosine * cosine) / (eta * eta);
    if sin2_beyond >= 1.0 {
        return 1.0;
    }
    let beyond = (1.0 - sin2_beyond).sqrt();
    let parallel = (eta * cosine - beyond) / (eta * cosine + beyond);
    let perpendicular = (cosine - eta * beyond) / (cosine + eta * beyond);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Returns the unit direction of a ray beyond a boundary (Snell; pbrt-v4, section 9.3.1); `None` under total
/// reflection.
///
/// `direction` is the ray's before it, `normal` faces against it, and `eta` is as for [`dielectric_reflectance`].
#[inline]
pub fn refracted(direction: Vec3, normal: Vec3, eta: f32) -> Option<Vec3> {
    let cosine = -normal.dot(direction);
    let sin2_beyond = (1.0 - cosine * cosine).max(0.0) / (eta * eta);
    if sin2_beyond >= 1.0 {
        return None;
    }
    Some((direction / eta + normal * (cosine / eta - (1.0 - sin2_beyond).sqrt())).normalize_or(direction))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn reflectance_has_the_known_values() {
        for (ior, f0) in [(1.5, 0.04), (1.333, 0.020_372), (2.417, 0.171_965)] {
            assert!((dielectric_f0(ior) - f0).abs() < 1e-5, "{ior}");
            assert!((dielectric_reflectance(1.0, ior) - f0).abs() < 1e-5, "{ior}");
            assert!((dielectric_reflectance(1.0, ior.recip()) - f0).abs() < 1e-5, "from inside, {ior}");
        }
        // Hecht, Optics, table 4: glass of index 1.5 reflects 8.9 % at 60° and 38.8 % at 80°.
        for (degrees, expected) in [(60f32, 0.0892), (80.0, 0.3876)] {
            assert!((dielectric_reflectance(degrees.to_radians().cos(), 1.5) - expected).abs() < 5e-4, "{degrees}");
        }
        // At Brewster's angle only one polarisation is reflected: ½ ((n² − 1) / (n² + 1))².
        let brewster = 1.5f32.atan().cos();
        assert!((dielectric_reflectance(brewster, 1.5) - 0.5 * (1.25f32 / 3.25).powi(2)).abs() < 1e-5);
        assert_eq!(dielectric_reflectance(0.0, 1.5), 1.0);
        // Total reflection begins at asin(1 / 1.5) = 41.81°.
        assert!(dielectric_reflectance(41.7f32.to_radians().cos(), 1.0 / 1.5) < 1.0);
        assert_eq!(dielectric_reflectance(41.9f32.to_radians().cos(), 1.0 / 1.5), 1.0);
        assert!(dielectric_reflectance(0.4, 1.0) < 1e-9, "no boundary");
    }

    #[test]
    fn rays_bend_by_snells_law_and_back() {
        let normal = Vec3::new(0.48, 0.6, 0.64);
        for direction in lo_geometry::fibonacci_sphere(200) {
            if normal.dot(direction) > -1e-3 {
                continue;
            }
            let bent = refracted(direction, normal, 1.5).unwrap();
            assert!((bent.length() - 1.0).abs() < 1e-5);
            let sine = |d: Vec3| d.cross(normal).length();
            assert!((sine(direction) - 1.5 * sine(bent)).abs() < 1e-5);
            assert!(bent.dot(normal) < 0.0);
            assert!(direction.cross(normal).dot(bent).abs() < 1e-5, "it stays in the plane of incidence");
            let back = refracted(-bent, -normal, 1.0 / 1.5).unwrap();
            assert!((back + direction).length() < 1e-4, "reversible");
            // As much of the light is reflected in both directions.
            let outside = dielectric_reflectance(-normal.dot(direction), 1.5);
            let inside = dielectric_reflectance(-normal.dot(bent), 1.0 / 1.5);
            assert!((outside - inside).abs() < 2e-4, "{outside} {inside}");
        }
        let flat = Vec3::new(0.8, 0.0, -0.6);
        assert_eq!(refracted(flat, Vec3::Z, 1.0 / 1.5), None);
        assert_eq!(dielectric_reflectance(0.6, 1.0 / 1.5), 1.0);
    }
}
