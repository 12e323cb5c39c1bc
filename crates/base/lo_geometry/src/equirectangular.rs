//! The equirectangular projection: row 0 is +Y, the centre column is −Z, and +X is at u = 3/4.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

/// Returns the unit direction of map coordinates `uv` in `[0, 1]²` (u to the right, v downwards).
#[inline]
pub fn direction_from_uv(uv: Vec2) -> Vec3 {
    let (sin_longitude, cos_longitude) = ((uv.x - 0.5) * TAU).sin_cos();
    let (sin_latitude, cos_latitude) = ((0.5 - uv.y) * PI).sin_cos();
    Vec3::new(cos_latitude * sin_longitude, sin_latitude, -cos_latitude * cos_longitude)
}

/// Returns the map coordinates in `[0, 1]²` of a direction (of any length).
#[inline]
pub fn uv_from_direction(direction: Vec3) -> Vec2 {
    let longitude = direction.x.atan2(-direction.z);
    let latitude = direction.y.atan2(direction.x.hypot(direction.z));
    Vec2::new(longitude / TAU + 0.5, 0.5 - latitude / PI)
}

/// Returns the unit direction of the centre of pixel `(x, y)` in a map of `width` × `height`.
#[inline]
pub fn pixel_direction(x: usize, y: usize, width: usize, height: usize) -> Vec3 {
    direction_from_uv(Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32))
}

/// Returns the exact solid angle of a pixel of row `y` in a map of `width` × `height`, in steradians; all sum to 4π.
#[inline]
pub fn pixel_solid_angle_sr(y: usize, width: usize, height: usize) -> f32 {
    let edge = |row: usize| ((0.5 - row as f64 / height as f64) * std::f64::consts::PI).sin();
    (std::f64::consts::TAU / width as f64 * (edge(y) - edge(y + 1))) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn axes_lie_where_the_specification_puts_them() {
        let at = |u, v| direction_from_uv(Vec2::new(u, v));
        assert!((at(0.5, 0.5) - Vec3::NEG_Z).length() < 1e-6);
        assert!((at(0.75, 0.5) - Vec3::X).length() < 1e-6);
        assert!((at(0.5, 0.0) - Vec3::Y).length() < 1e-6);
        assert!((at(0.25, 0.5) - Vec3::NEG_X).length() < 1e-6);
    }

    #[test]
    fn solid_angles_cover_the_sphere() {
        let total: f64 = (0..64).map(|y| 128.0 * f64::from(pixel_solid_angle_sr(y, 128, 64))).sum();
        assert!((total - 4.0 * std::f64::consts::PI).abs() < 1e-5);
    }

    proptest! {
        #[test]
        fn uv_inverts_direction(u in 0.001..0.999f32, v in 0.01..0.99f32) {
            let back = uv_from_direction(direction_from_uv(Vec2::new(u, v)));
            prop_assert!((back - Vec2::new(u, v)).length() < 1e-5);
        }
    }
}
