use lo_cone::{Cone, ConeSample, ConeTracer};
use lo_geometry::{Camera, Quat, Vec2, Vec3};
use lo_imaging::{Image, RadianceImage};
use lo_octree::LightOctree;
use lo_scene::OctreeChange;
use rayon::prelude::*;

use crate::emitters::tracer;

/// Longer side of the image of changes, which are no finer than leaves.
const SIDE: usize = 480;

/// Least opacity of the octree where an image is changed.
const MIN_OPACITY: f32 = 0.5;

/// Applies a change of the octree's light to images of the room.
///
/// An image shows an emitter sharper than leaves do. The excess of a pixel over the octree without the emitter is the
/// emitter's light, and changes like that of its leaves.
pub struct ImageChange {
    base: ConeTracer,
    gain: ConeTracer,
}

/// PixelChange at one position of an image.
#[derive(Clone, Copy, Default)]
struct PixelChange {
    base: Vec3,
    /// Gain minus 1, so that zero means no change.
    gain: Vec3,
}

impl PixelChange {
    fn lerp(self, other: Self, share: f32) -> Self {
        Self { base: self.base.lerp(other.base, share), gain: self.gain.lerp(other.gain, share) }
    }
}

impl ImageChange {
    /// Prepares the change `change` of the rows of the octree `light`.
    pub fn new(light: &LightOctree, change: &OctreeChange) -> Self {
        let with = |rgba: &Vec<Vec<[f32; 4]>>| LightOctree { rgba: rgba.clone(), lobes: None, ..light.clone() };
        Self { base: tracer(&with(&change.base)), gain: tracer(&with(&change.gain)) }
    }

    /// Changes a photo's linear radiance. `camera` has the photo's resolution and is at the origin.
    pub fn photo(&self, radiance: &mut RadianceImage, camera: &Camera) {
        let (width, height) = (radiance.width(), radiance.height());
        let scale = (SIDE as f32 / width.max(height) as f32).min(1.0);
        let side = |pixels: usize| ((pixels as f32 * scale) as usize).max(1);
        let small = camera.resized(side(width) as u32, side(height) as u32);
        let tan_half_angle = (0.5 * small.pixel_angle_rad()).tan();
        let cone = |x: usize, y: usize| Cone {
            origin: Vec3::ZERO,
            direction: small.direction(x as f64 + 0.5, y as f64 + 0.5),
            tan_half_angle,
        };
        self.change(radiance, (side(width), side(height)), cone);
    }

    /// Changes an equirectangular panorama taken at `position_m`.
    pub fn panorama(&self, radiance: &mut RadianceImage, position_m: Vec3, world_from_panorama: Quat) {
        let columns = radiance.width().min(SIDE);
        let size = (columns, (columns / 2).max(1));
        let tan_half_angle = (std::f32::consts::PI / columns as f32).tan();
        let cone = |x: usize, y: usize| Cone {
            origin: position_m,
            direction: world_from_panorama * lo_geometry::pixel_direction(x, y, size.0, size.1),
            tan_half_angle,
        };
        self.change(radiance, size, cone);
    }

    /// Changes an image by a grid of `size` cones.
    fn change(&self, radiance: &mut RadianceImage, size: (usize, usize), cone: impl Fn(usize, usize) -> Cone) {
        let cones: Vec<Cone> = (0..size.0 * size.1).map(|i| cone(i % size.0, i / size.0)).collect();
        let (mut base, mut gain) = (vec![ConeSample::default(); cones.len()], vec![ConeSample::default(); cones.len()]);
        self.gain.trace_batch(&cones, &mut gain);
        self.base.trace_batch(&cones, &mut base);
        let changes = base.iter().zip(&gain).map(|(base, gain)| {
            if gain.opacity < MIN_OPACITY {
                return PixelChange::default();
            }
            let of = |sample: &ConeSample| Vec3::from(sample.radiance) / sample.opacity;
            let gain = of(gain) - 1.0;
            // Ignore rounding.
            let gain = if gain.abs().max_element() < 1e-4 { Vec3::ZERO } else { gain };
            PixelChange { base: of(base), gain }
        });
        let changes = Image::new(size.0, size.1, changes.collect());
        let (width, scale) = (radiance.width(), Vec2::new(size.0 as f32, size.1 as f32));
        let scale = scale / Vec2::new(width as f32, radiance.height() as f32);
        radiance.pixels_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                let at = (Vec2::new(x as f32, y as f32) + 0.5) * scale;
                let PixelChange { base, gain } = bilinear(&changes, at, PixelChange::lerp);
                if gain != Vec3::ZERO {
                    let own = Vec3::from(*pixel);
                    *pixel = (own + gain * (own - base).max(Vec3::ZERO)).to_array();
                }
            }
        });
    }
}

/// Interpolates between the four pixels around a position; pixel centres are at +0.5, and border pixels are repeated
/// outside.
pub(crate) fn bilinear<T: Copy>(image: &Image<T>, at: Vec2, mix: impl Fn(T, T, f32) -> T) -> T {
    let last = Vec2::new((image.width() - 1) as f32, (image.height() - 1) as f32);
    let at = (at - 0.5).clamp(Vec2::ZERO, last);
    let (x, y) = (at.x as usize, at.y as usize);
    let (x1, y1) = ((x + 1).min(image.width() - 1), (y + 1).min(image.height() - 1));
    let (fx, fy) = (at.x - x as f32, at.y - y as f32);
    mix(mix(image[(x, y)], image[(x1, y)], fx), mix(image[(x, y1)], image[(x1, y1)], fx), fy)
}
