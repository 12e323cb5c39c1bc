//! Steps between surfaces in a sensor's depth map, and their position in the photo.
//!
//! Sensors smear a step over some of their pixels, or mix both surfaces in one. They average inverse depth, so that
//! the step is where inverse depth is half-way between both sides, also between the pixels of a coarse map.

use lo_geometry::Camera;
use lo_imaging::{DepthMap, Image};

/// Slope tangent, against the line of sight, from which neighbouring readings belong to two surfaces: 80°.
const STEEP: f32 = 6.0;

/// Smallest relative difference in inverse depth of two surfaces, however fine the depth map's pixels are.
const MIN_STEP: f32 = 0.025;

/// Largest number of readings on each side of a smeared step.
const MAX_RAMP: usize = 6;

/// The two surfaces at each pixel of a step.
pub(crate) struct DepthSteps {
    inverse_m: Image<f32>,
    /// Inverse depths of the near and the far surface.
    sides: Image<Option<(f32, f32)>>,
    has_holes: bool,
}

impl DepthSteps {
    /// Detects the steps of a depth map at its own resolution; `camera` is in its pixels.
    pub fn new(depth_m: &DepthMap, camera: &Camera) -> Self {
        let inverse_m = depth_m.map(|&z| if z > 0.0 { 1.0 / z } else { 0.0 });
        let pitch = (1.0 / camera.fx).max(1.0 / camera.fy) as f32;
        let sides = Image::from_fn(depth_m.width(), depth_m.height(), |x, y| sides(&inverse_m, (x, y), STEEP * pitch));
        Self { has_holes: inverse_m.pixels().contains(&0.0), inverse_m, sides }
    }

    /// Returns width and height.
    pub fn size(&self) -> (usize, usize) {
        (self.sides.width(), self.sides.height())
    }

    /// Returns whether any pixel has no reading.
    pub fn has_holes(&self) -> bool {
        self.has_holes
    }

    /// Returns whether a surface nearer than `depth_m` ends at a pixel: at a step there, or at the rim of a hole.
    pub fn ends_before(&self, x: usize, y: usize, depth_m: f32) -> bool {
        let nearer = |inverse: f32| inverse * depth_m > 1.0;
        if self.inverse_m[(x, y)] > 0.0 {
            return self.sides[(x, y)].is_some_and(|(near, _)| nearer(near));
        }
        let (columns, rows) = (x.saturating_sub(1)..(x + 2), y.saturating_sub(1)..(y + 2));
        let (width, height) = self.size();
        rows.filter(|&y| y < height)
            .flat_map(|y| columns.clone().map(move |x| (x, y)))
            .any(|(x, y)| x < width && nearer(self.inverse_m[(x, y)]))
    }

    /// Sharpens the steps of `depth_m`, which is the same map at another resolution.
    pub fn sharpened(&self, depth_m: &DepthMap) -> DepthMap {
        let (width, height) = (self.sides.width(), self.sides.height());
        let (sx, sy) = (width as f32 / depth_m.width() as f32, height as f32 / depth_m.height() as f32);
        if sx > 1.0 || sy > 1.0 {
            return depth_m.clone();
        }
        Image::from_fn(depth_m.width(), depth_m.height(), |x, y| {
            let (u, v) = ((x as f32 + 0.5) * sx, (y as f32 + 0.5) * sy);
            let own = ((u as usize).min(width - 1), (v as usize).min(height - 1));
            let Some((near, far)) = self.sides[own] else { return depth_m[(x, y)] };
            let mut sum = (0.0, 0.0);
            for (px, py, weight) in crate::surface::observed_surfaces::bilinear(u - 0.5, v - 0.5, width, height) {
                // Where three surfaces meet, the third one is assigned to the near or the far one.
                let inverse = self.inverse_m[(px, py)];
                if inverse > 0.0 {
                    sum.0 += weight * inverse.clamp(far, near);
                    sum.1 += weight;
                }
            }
            1.0 / if sum.0 > 0.5 * (near + far) * sum.1 { near } else { far }
        })
    }
}

/// Returns the near and far inverse depth of a pixel's step, along the axis on which it is steeper.
fn sides(inverse_m: &Image<f32>, (x, y): (usize, usize), steep: f32) -> Option<(f32, f32)> {
    let own = inverse_m[(x, y)];
    if own <= 0.0 {
        return None;
    }
    let along = |dx: isize, dy: isize, steps: usize| {
        let x = x.checked_add_signed(dx * steps as isize).filter(|&x| x < inverse_m.width())?;
        let y = y.checked_add_signed(dy * steps as isize).filter(|&y| y < inverse_m.height())?;
        Some(inverse_m[(x, y)]).filter(|&inverse| inverse > 0.0)
    };
    let threshold = steep.max(MIN_STEP);
    // End of the ramp in a direction along which inverse depth changes with `sign`.
    let end = |dx: isize, dy: isize, sign: f32| {
        let mut last = own;
        for steps in 1..=MAX_RAMP {
            match along(dx, dy, steps) {
                Some(next) if sign * (next - last) > 0.4 * threshold * last => last = next,
                _ => return Some(last),
            }
        }
        None
    };
    let step = |(dx, dy): (isize, isize)| {
        let change = |side: isize| along(side * dx, side * dy, 1).map_or(0.0, |other| other - own);
        let (before, after) = (change(-1), change(1));
        let steepest = if before.abs() > after.abs() { -before } else { after };
        if steepest.abs() <= threshold * own {
            return None;
        }
        let sign = steepest.signum();
        let (a, b) = (end(dx, dy, sign)?, end(-dx, -dy, -sign)?);
        Some((a.max(b), a.min(b)))
    };
    let gap = |sides: &Option<(f32, f32)>| sides.map_or(0.0, |(near, far)| near - far);
    [step((1, 0)), step((0, 1))].into_iter().max_by(|a, b| gap(a).total_cmp(&gap(b))).flatten()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Plane, Ray, Vec3};

    use super::*;

    /// A step from 1.5 to 3 m at column `edge` of the photo, smeared by a coarse sensor over some of its pixels.
    fn smeared(edge: f32, spread: f32) -> DepthMap {
        Image::from_fn(64, 48, |x, _| {
            let along = (x as f32 + 0.5) * 8.0 - edge;
            let near = 1.0 / (1.0 + (along / spread).exp());
            1.0 / (near / 1.5 + (1.0 - near) / 3.0)
        })
    }

    #[test]
    fn a_smeared_step_becomes_sharp_between_the_sensors_pixels() {
        let camera = Camera::from_hfov_deg(65.0, 64, 48).unwrap();
        for (edge, spread) in [(260.0, 4.0), (263.0, 5.0), (257.5, 3.0)] {
            let coarse = smeared(edge, spread);
            let steps = DepthSteps::new(&coarse, &camera);
            let sharp = steps.sharpened(&lo_imaging::resize_depth(&coarse, 512, 384));
            let first_far = (0..512).find(|&x| sharp[(x, 200)] > 2.5).unwrap();
            // Half a photo pixel plus the effect of bilinear interpolation on the smear.
            assert!((first_far as f32 - edge).abs() < 1.5, "{edge}: {first_far}");
            assert!((200..320).all(|x| sharp[(x, 200)] < 1.6 || sharp[(x, 200)] > 2.8), "nothing hangs in the air");
            assert!(
                steps.ends_before(32, 20, 2.0) && !steps.ends_before(32, 20, 1.4) && !steps.ends_before(10, 20, 2.0)
            );
        }
    }

    #[test]
    fn floors_are_no_steps_and_holes_have_rims() {
        let camera = Camera::from_hfov_deg(65.0, 256, 192).unwrap();
        let floor = Plane { normal: Vec3::Y, offset_m: -1.4 };
        let mut depth_m = DepthMap::from_fn(256, 192, |x, y| {
            let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let distance = floor.intersect(&Ray { origin: Vec3::ZERO, direction }).unwrap_or(f32::INFINITY);
            (-distance * direction.z).min(6.0)
        });
        depth_m[(30, 170)] = 0.0;
        let steps = DepthSteps::new(&depth_m, &camera);
        assert!((100..192).all(|y| (0..256).all(|x| steps.sides[(x, y)].is_none())));
        assert!(steps.has_holes() && steps.ends_before(30, 170, 10.0) && !steps.ends_before(30, 170, 1.0));
        assert_eq!(steps.sharpened(&depth_m), depth_m);
    }
}
