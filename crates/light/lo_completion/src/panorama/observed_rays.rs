//! Observed radiance by direction from the panorama's position.

use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr, uv_from_direction};
use lo_imaging::luminance;
use lo_scene::ObservedPhoto;

/// Distance in metres from the camera below which a panorama sees the photo's pixels in the same directions, whatever
/// the depth.
const AT_CAMERA_M: f32 = 0.03;

/// Columns of the depth image that removes occluded points.
const DEPTH_COLUMNS: usize = 128;

/// Distance behind the nearest point of a direction beyond which a point is occluded: this share plus these metres.
const BEHIND_SHARE: f32 = 0.1;
const BEHIND_M: f32 = 0.1;

/// Radiance by direction.
pub(crate) struct ObservedRays(Vec<(Vec3, [f32; 3])>);

/// Mean radiance of a direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObservedTexel {
    /// Unit direction from the panorama's position, in the photo's frame.
    pub direction: Vec3,
    /// Mean linear radiance that the photo shows there.
    pub radiance: [f32; 3],
    /// Solid angle in sr.
    pub weight: f32,
}

impl ObservedRays {
    /// Collects the unclipped pixels of a photo at working resolution.
    pub fn new(photo: &ObservedPhoto, from_m: Vec3) -> Self {
        let ObservedPhoto { clean, normals, radiance, .. } = photo;
        let clipped = clean.clipped();
        let pixels = (0..radiance.height()).flat_map(|y| (0..radiance.width()).map(move |x| (x, y)));
        let pixels = pixels.filter(|&at| !clipped[at]);
        if from_m.length() < AT_CAMERA_M {
            let direction = |(x, y): (usize, usize)| clean.camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            return Self(pixels.map(|at| (direction(at), radiance[at])).collect());
        }
        let camera = clean.depth_camera();
        let seen = pixels.filter_map(|at| {
            let (z, normal) = (clean.depth_m[at], normals[at]?);
            let point = camera.unproject(at.0 as f64 + 0.5, at.1 as f64 + 0.5, f64::from(z));
            let towards = point - from_m;
            // A back-facing surface shows the panorama a side that the photo does not show.
            (z > 0.0 && normal.dot(towards) < 0.0).then_some((towards, radiance[at]))
        });
        let mut seen: Vec<(Vec3, [f32; 3])> = seen.collect();
        let rows = DEPTH_COLUMNS / 2;
        let mut nearest_m = vec![f32::INFINITY; DEPTH_COLUMNS * rows];
        let texel = |towards: Vec3| texel(towards, DEPTH_COLUMNS);
        for (towards, _) in &seen {
            let nearest_m = &mut nearest_m[texel(*towards)];
            *nearest_m = nearest_m.min(towards.length());
        }
        seen.retain(|(towards, _)| towards.length() <= (1.0 + BEHIND_SHARE) * nearest_m[texel(*towards)] + BEHIND_M);
        seen.iter_mut().for_each(|(towards, _)| *towards = towards.normalize_or_zero());
        Self(seen)
    }

    /// Averages over the pixels of an equirectangular grid with this many columns; returns the observed ones.
    pub fn texels(&self, columns: usize) -> Vec<ObservedTexel> {
        let rows = columns / 2;
        let mut sums = vec![([0.0f32; 3], 0u32); columns * rows];
        for &(direction, radiance) in &self.0 {
            let (sum, count) = &mut sums[texel(direction, columns)];
            (0..3).for_each(|c| sum[c] += radiance[c]);
            *count += 1;
        }
        let seen = sums.iter().enumerate().filter(|(_, (_, count))| *count > 0);
        seen.map(|(index, (sum, count))| {
            let (x, y) = (index % columns, index / columns);
            ObservedTexel {
                direction: pixel_direction(x, y, columns, rows),
                radiance: sum.map(|c| c / *count as f32),
                weight: pixel_solid_angle_sr(y, columns, rows),
            }
        })
        .collect()
    }

    /// Returns whether everything is black, so that nothing can be compared.
    pub fn is_dark(&self) -> bool {
        self.0.iter().all(|(_, radiance)| luminance(*radiance) <= 0.0)
    }
}

fn texel(direction: Vec3, columns: usize) -> usize {
    let (uv, rows) = (uv_from_direction(direction), columns / 2);
    let at = |t: f32, count: usize| ((t * count as f32) as usize).min(count - 1);
    at(uv.y, rows) * columns + at(uv.x, columns)
}
