//! Equirectangular images at every scale.

use std::f32::consts::PI;

use lo_geometry::{Vec2, Vec3};
use lo_imaging::{Image, RadianceImage};

/// Half-angle tangent below which a single tap is enough.
const SINGLE_TAP_TANGENT: f32 = 0.05;

/// An equirectangular image at infinity with coarser levels, for cone lookups.
pub struct RadianceMap {
    /// Finest first, each half as wide and high as the previous, weighted by solid angle.
    levels: Vec<RadianceImage>,
}

impl RadianceMap {
    /// Wraps an equirectangular image in this program's orientation.
    pub fn new(map: RadianceImage) -> Self {
        let mut levels = vec![map];
        while let Some(coarser) = levels.last().filter(|level| level.height() >= 4).map(halved) {
            levels.push(coarser);
        }
        Self { levels }
    }

    /// Returns the mean radiance in a cone.
    ///
    /// A wide cone takes five taps, each half as wide: near the poles the texels of a coarse level are sectors, not
    /// discs.
    pub fn cone(&self, direction: Vec3, tan_half_angle: f32) -> Vec3 {
        if tan_half_angle < SINGLE_TAP_TANGENT {
            return self.look_up(direction, 2.0 * tan_half_angle);
        }
        let half_angle = tan_half_angle.atan();
        let basis = lo_geometry::orthonormal_basis(direction);
        let offset = (0.6 * half_angle).tan();
        let taps = [Vec3::ZERO, basis.x_axis, -basis.x_axis, basis.y_axis, -basis.y_axis];
        taps.iter().map(|&tap| self.look_up((direction + tap * offset).normalize(), half_angle)).sum::<Vec3>() / 5.0
    }

    /// Looks up trilinearly over about `width_rad`.
    fn look_up(&self, direction: Vec3, width_rad: f32) -> Vec3 {
        let pitch = PI / self.levels[0].height() as f32;
        let level = (width_rad / pitch).max(1.0).log2().min((self.levels.len() - 1) as f32);
        let below = level as usize;
        let fine = sample(&self.levels[below], direction);
        match self.levels.get(below + 1) {
            Some(coarser) if level > below as f32 => fine.lerp(sample(coarser, direction), level - below as f32),
            _ => fine,
        }
    }
}

/// Looks up bilinearly; the image wraps around horizontally.
fn sample(map: &RadianceImage, direction: Vec3) -> Vec3 {
    let uv = lo_geometry::uv_from_direction(direction) * Vec2::new(map.width() as f32, map.height() as f32) - 0.5;
    let x = uv.x.floor();
    let (x0, fx) = ((x as isize).rem_euclid(map.width() as isize) as usize, uv.x - x);
    let x1 = (x0 + 1) % map.width();
    let mut sum = Vec3::ZERO;
    let below = uv.y.clamp(0.0, (map.height() - 1) as f32);
    let (y0, fy) = (below as usize, below.fract());
    for (y, weight) in [(y0, 1.0 - fy), ((y0 + 1).min(map.height() - 1), fy)] {
        sum += (Vec3::from(map[(x0, y)]) * (1.0 - fx) + Vec3::from(map[(x1, y)]) * fx) * weight;
    }
    sum
}

/// Halves width and height, rounded down; each pixel is the mean over its part of the sphere.
fn halved(map: &RadianceImage) -> RadianceImage {
    let (width, height) = ((map.width() / 2).max(1), (map.height() / 2).max(1));
    Image::from_fn(width, height, |x, y| {
        let mut sum = (Vec3::ZERO, 0.0);
        for row in y * map.height() / height..(y + 1) * map.height() / height {
            let weight = lo_geometry::pixel_solid_angle_sr(row, map.width(), map.height());
            for column in x * map.width() / width..(x + 1) * map.width() / width {
                sum.0 += Vec3::from(map[(column, row)]) * weight;
                sum.1 += weight;
            }
        }
        (sum.0 / sum.1).to_array()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cones_of_a_gradient_are_its_mean() {
        // radiance 1 + y is linear on the sphere: the mean over a cone of half-angle θ about d is 1 + d.y (1 + cos θ)/2
        let map = Image::from_fn(256, 128, |x, y| [1.0 + lo_geometry::pixel_direction(x, y, 256, 128).y; 3]);
        let map = RadianceMap::new(map);
        for (direction, tan) in
            [(Vec3::Y, 0.3f32), (Vec3::new(0.6, 0.8, 0.0), 0.1), (Vec3::NEG_Z, 0.5), (Vec3::new(0.0, -0.8, 0.6), 0.01)]
        {
            let expected = 1.0 + direction.y * (1.0 + tan.atan().cos()) / 2.0;
            let found = map.cone(direction, tan).x;
            assert!((found - expected).abs() < 0.03, "{direction} {tan}: {found} for {expected}");
        }
    }
}
