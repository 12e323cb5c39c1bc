//! Renders photos of a mirror ball by reflecting rays at a sphere, with several rays a pixel.

use lo_geometry::DVec3;
use lo_imaging::{Image, Photo, RadianceImage, sample_equirectangular, srgb8_from_linear};
use rayon::prelude::*;

/// A camera at the origin and a ball in front of it.
#[derive(Clone, Copy, Debug)]
pub struct BallScene {
    /// Width and height of the photo.
    pub size: [usize; 2],
    /// Centre of the outline in pixels; for a pinhole, the projection of the ball's centre.
    pub middle: [f64; 2],
    /// Radius in pixels of an orthographic view; for a pinhole, the tangent of the half-angle times the focal length.
    pub radius_px: f64,
    /// Focal length in pixels; `None` for an orthographic view.
    pub focal_px: Option<f64>,
}

impl BallScene {
    /// Renders linear radiance: `panorama` (by direction) in the ball, `background` (by ray and image position) around
    /// it.
    pub fn render(
        &self,
        panorama: &(impl Fn(DVec3) -> [f32; 3] + Sync),
        background: &(impl Fn(DVec3, [f64; 2]) -> [f32; 3] + Sync),
        samples: usize,
    ) -> RadianceImage {
        let [width, height] = self.size;
        let pixel = |index: usize| {
            let (x, y) = ((index % width) as f64, (index / width) as f64);
            // the rim compresses much of the room and needs more samples
            let offset = (x + 0.5 - self.middle[0]).hypot(y + 0.5 - self.middle[1]) / self.radius_px;
            let samples = if (0.9..1.1).contains(&offset) { 3 * samples } else { samples };
            let mut sum = [0.0f64; 3];
            for (i, j) in (0..samples).flat_map(|i| (0..samples).map(move |j| (i, j))) {
                let at = [x + (i as f64 + 0.5) / samples as f64, y + (j as f64 + 0.5) / samples as f64];
                let rgb = match self.mirrored(at) {
                    Ok(direction) => panorama(direction),
                    Err(ray) => background(ray, at),
                };
                (0..3).for_each(|c| sum[c] += f64::from(rgb[c]));
            }
            sum.map(|v| (v / (samples * samples) as f64) as f32)
        };
        RadianceImage::new(width, height, (0..width * height).into_par_iter().map(pixel).collect())
    }

    /// Returns the direction reflected at an image position, or the ray that misses the ball.
    fn mirrored(&self, [u, v]: [f64; 2]) -> Result<DVec3, DVec3> {
        let (dx, dy) = ((u - self.middle[0]) / self.radius_px, (self.middle[1] - v) / self.radius_px);
        let Some(focal_px) = self.focal_px else {
            let z2 = 1.0 - dx * dx - dy * dy;
            if z2 <= 0.0 {
                return Err(DVec3::NEG_Z);
            }
            let normal = DVec3::new(dx, dy, z2.sqrt());
            return Ok(DVec3::NEG_Z - 2.0 * DVec3::NEG_Z.dot(normal) * normal);
        };
        let ray_at = |[u, v]: [f64; 2]| {
            let [cx, cy] = self.size.map(|side| 0.5 * side as f64);
            DVec3::new((u - cx) / focal_px, (cy - v) / focal_px, -1.0).normalize()
        };
        let ray = ray_at([u, v]);
        let centre = ray_at(self.middle) / (self.radius_px / focal_px).atan().sin();
        let along = ray.dot(centre);
        let root = along * along - centre.length_squared() + 1.0;
        if root <= 0.0 {
            return Err(ray);
        }
        let normal = (along - root.sqrt()) * ray - centre;
        Ok(ray - 2.0 * ray.dot(normal) * normal)
    }
}

/// Radiance lookup in a map by direction.
pub fn map_radiance(map: &RadianceImage) -> impl Fn(DVec3) -> [f32; 3] + Sync {
    |direction| sample_equirectangular(map, direction.as_vec3())
}

/// Exposes an 8-bit photo by `stops`, with shot noise (`full_well` electrons at white) and read noise.
pub fn expose(light: &RadianceImage, stops: f32, full_well: f32, seed: u32) -> Photo {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        (state >> 8) as f32 / (1 << 24) as f32
    };
    // the sum of twelve uniform variables is nearly normal
    let mut normal = move || (0..12).map(|_| uniform()).sum::<f32>() - 6.0;
    let pixels = light
        .pixels()
        .iter()
        .map(|rgb| {
            rgb.map(|v| {
                let v = v * stops.exp2();
                srgb8_from_linear(v + normal() * (v.min(2.0) / full_well).sqrt() + normal() * 3.0 / full_well)
            })
        })
        .collect();
    Photo::Srgb8(Image::new(light.width(), light.height(), pixels))
}
