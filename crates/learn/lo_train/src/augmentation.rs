use lo_dataset::Sample;
use lo_geometry::{Camera, Cube, Vec3};
use lo_imaging::{DepthMap, Image, linear_from_srgb8, srgb8_from_linear};
use lo_nets::light::Rays;
use lo_octree::RadiancePoint;
use lo_random::{RngExt, Stream};
use serde::{Deserialize, Serialize};

use crate::error::{ConfigError, check_range};
use crate::style::StyleConfig;

/// Data augmentation. Every field has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AugmentationConfig {
    /// Share of samples that are mirrored left to right.
    pub mirror_share: f32,
    /// Largest brightening in stops. Photos are never darkened, so that clipped pixels stay white.
    pub brighter_ev: f32,
    /// Largest natural logarithm of the gain of red or blue relative to green.
    pub colour: f32,
    /// Largest natural logarithm of the error of the assumed focal length. Observed points and the true room become
    /// narrower or wider by that factor.
    pub focal: f32,
    /// Largest zoom factor: photos are cropped to as little as `1 / zoom` of their width, as by a longer lens.
    pub zoom: f32,
    /// Appearance augmentation of photos for the depth network.
    pub style: StyleConfig,
    /// Number of variants of a sample, for each of which the global feature is cached. 0: a new one in each epoch.
    pub variants: u64,
}

impl Default for AugmentationConfig {
    fn default() -> Self {
        Self {
            mirror_share: 0.5,
            brighter_ev: 0.6,
            colour: 0.08,
            focal: 0.1,
            zoom: 1.25,
            style: StyleConfig::default(),
            variants: 8,
        }
    }
}

impl AugmentationConfig {
    /// Checks the ranges of all fields.
    ///
    /// # Errors
    /// [`ConfigError::OutOfRange`].
    pub fn validate(&self) -> Result<(), ConfigError> {
        let ranges = [
            ("zoom", self.zoom, 1.0, 8.0),
            ("mirror_share", self.mirror_share, 0.0, 1.0),
            ("brighter_ev", self.brighter_ev, 0.0, 8.0),
            ("colour", self.colour, 0.0, 1.0),
            ("focal", self.focal, 0.0, 1.0),
            ("style.contrast", self.style.contrast, 0.0, 2.0),
            ("style.saturation", self.style.saturation, 0.0, 1.0),
            ("style.blur_px", self.style.blur_px, 0.0, 8.0),
            ("style.noise", self.style.noise, 0.0, 1.0),
        ];
        ranges.into_iter().try_for_each(|(field, value, min, max)| {
            check_range(&format!("augmentation.{field}"), value.into(), min, max)
        })
    }

    /// Returns the variation of a sample in an epoch, and the number of that variant.
    pub(crate) fn variation(&self, seed: u64, sample: &Sample, epoch: u64) -> (Variation, u64) {
        let variant = if self.variants == 0 { epoch } else { epoch % self.variants };
        (self.draw(&mut Variation::stream(seed, "augmentation", sample, variant)), variant)
    }

    /// Draws a random variation.
    fn draw(&self, stream: &mut Stream) -> Variation {
        let mut up_to = |most: f32| if most > 0.0 { stream.random_range(-most..=most) } else { 0.0 };
        let colour = [up_to(self.colour), 0.0, up_to(self.colour)];
        let focal = up_to(self.focal).exp();
        let least = colour.into_iter().fold(f32::INFINITY, f32::min);
        let brighter = stream.random::<f32>() * self.brighter_ev * std::f32::consts::LN_2;
        let mirrored = stream.random::<f32>() < self.mirror_share;
        let gains = colour.map(|gain| (gain - least + brighter).exp());
        Variation { mirrored, gains, focal, zoom: self.zoom.powf(stream.random::<f32>()) }
    }
}

/// An augmentation of one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Variation {
    /// Whether left and right are swapped.
    pub mirrored: bool,
    /// Gains of the photo and all light, at least 1.
    pub gains: [f32; 3],
    /// Assumed focal length over the true one.
    pub focal: f32,
    /// Size of the photo over that of the central crop, at least 1.
    pub zoom: f32,
}

impl Variation {
    /// The identity.
    pub const NONE: Self = Self { mirrored: false, gains: [1.0; 3], focal: 1.0, zoom: 1.0 };

    /// Returns the factor of world positions.
    ///
    /// A wrong focal length moves all observed points linearly, so lines and planes are preserved.
    pub fn scale(&self) -> Vec3 {
        let across = 1.0 / self.focal;
        Vec3::new(if self.mirrored { -across } else { across }, across, 1.0)
    }

    /// Augments the photo.
    pub fn photo(&self, photo: &Image<[u8; 3]>) -> Image<[u8; 3]> {
        let photo = self.framed(photo);
        if self.gains == [1.0; 3] {
            return photo;
        }
        let table: Vec<[u8; 3]> =
            (0..=255).map(|v| self.gains.map(|gain| srgb8_from_linear(gain * linear_from_srgb8(v)))).collect();
        photo.map(|rgb| std::array::from_fn(|c| table[rgb[c] as usize][c]))
    }

    /// Augments a depth map of the photo.
    pub fn depth(&self, depth_m: &DepthMap) -> DepthMap {
        self.framed(depth_m)
    }

    /// Returns the assumed camera of the augmented photo.
    pub fn camera(&self, camera: &Camera) -> Camera {
        let focal = f64::from(self.focal);
        let cx = if self.mirrored { f64::from(camera.width) - camera.cx } else { camera.cx };
        let [left, top] = [camera.width, camera.height].map(|size| self.margin(size as usize) as u32);
        Camera {
            fx: camera.fx * focal,
            fy: camera.fy * focal,
            cx: cx - f64::from(left),
            cy: camera.cy - f64::from(top),
            width: camera.width - 2 * left,
            height: camera.height - 2 * top,
        }
    }

    /// Returns the augmented up vector, where known: the normal of a level floor in the scaled room.
    pub fn up(&self, sample: &Sample) -> Option<Vec3> {
        sample.up.map(|up| (up / self.scale()).normalize())
    }

    /// Augments surface points.
    pub fn points(&self, points: &[RadiancePoint]) -> Vec<RadiancePoint> {
        let scale = self.scale();
        let varied = |point: &RadiancePoint| RadiancePoint {
            position_m: point.position_m * scale,
            radiance: self.light(point.radiance),
            ..*point
        };
        points.iter().map(varied).collect()
    }

    /// Augments radiance.
    pub fn light(&self, radiance: [f32; 3]) -> [f32; 3] {
        std::array::from_fn(|c| radiance[c] * self.gains[c])
    }

    /// Crops and mirrors an image of the photo's field of view.
    pub fn framed<T: Copy>(&self, image: &Image<T>) -> Image<T> {
        let (width, height) = (image.width(), image.height());
        let [left, top] = [width, height].map(|size| self.margin(size));
        let column = |x: usize| if self.mirrored { width - 1 - left - x } else { left + x };
        Image::from_fn(width - 2 * left, height - 2 * top, |x, y| image[(column(x), top + y)])
    }

    /// Returns the pixels that are cropped at each end of a side of `size` pixels.
    fn margin(&self, size: usize) -> usize {
        (0.5 * size as f32 * (1.0 - 1.0 / self.zoom)) as usize
    }

    /// Returns a random stream for one sample and variant.
    pub fn stream(seed: u64, name: &str, sample: &Sample, variant: u64) -> Stream {
        lo_random::stream(seed ^ lo_random::hash(sample.id.as_bytes()), name, variant)
    }
}

/// Augments rays, then scales them by `scale`.
///
/// Rays that start outside of the cube are dropped; rays that leave it end at its boundary.
pub(crate) fn augmented_rays(rays: Rays, variation: &Variation, scale: f32, cube: Cube) -> Rays {
    let scale = variation.scale() * scale;
    let parts = rays.cones.iter().zip(&rays.radiance).zip(&rays.distance_m);
    parts
        .filter_map(|((cone, &radiance), &distance_m)| {
            let (origin, scaled) = (cone.origin * scale, cone.direction * scale);
            let stretch = scaled.length();
            let direction = scaled / stretch;
            let known = distance_m.is_finite() && distance_m > 0.0;
            let distance_m =
                if known { (distance_m * stretch).min(exit_distance_m(cube, origin, direction)) } else { 0.0 };
            let cone = lo_cone::Cone { origin, direction, ..*cone };
            cube.contains(origin).then(|| (cone, variation.light(radiance), distance_m))
        })
        .collect()
}

/// Returns the distance at which a ray from inside leaves the cube.
fn exit_distance_m(cube: Cube, origin: Vec3, direction: Vec3) -> f32 {
    let far = |axis: usize| {
        let side = if direction[axis] > 0.0 { cube.origin_m[axis] + cube.edge_m } else { cube.origin_m[axis] };
        if direction[axis] == 0.0 { f32::INFINITY } else { (side - origin[axis]) / direction[axis] }
    };
    far(0).min(far(1)).min(far(2))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_dataset::NovelView;
    use lo_geometry::Quat;

    use super::*;
    use crate::rays::panorama_rays;

    fn variation() -> Variation {
        Variation { mirrored: true, gains: [1.5, 1.2, 1.0], focal: 1.1, zoom: 1.2 }
    }

    #[test]
    fn what_the_camera_sees_moves_with_the_room() {
        let camera = Camera::new(300.0, 310.0, 231.0, 158.0, 480, 320).unwrap();
        let assumed = variation().camera(&camera);
        for (u, v, z) in [(10.5, 20.5, 3.0), (400.5, 300.5, 1.5)] {
            let point = camera.unproject(u, v, z) * variation().scale();
            let seen = assumed.unproject(480.0 - 40.0 - u, v - 26.0, z);
            assert!((point - seen).length() < 1e-5, "{point} {seen}");
        }
        assert_eq!((assumed.width, assumed.height), (400, 268));
        let depth = DepthMap::from_fn(480, 320, |x, y| (x + 1000 * y) as f32);
        let framed = variation().depth(&depth);
        assert_eq!((framed.width(), framed.height()), (400, 268));
        assert_eq!((framed[(0, 0)], framed[(399, 1)]), (26_439.0, 27_040.0));
    }

    #[test]
    fn rays_meet_the_same_places_in_the_varied_room() {
        let cube = Cube::centred(Vec3::ZERO, 20.0);
        let view = NovelView {
            position_m: Vec3::new(0.5, -0.2, -1.0),
            rotation: Quat::from_rotation_y(0.7),
            radiance: Image::from_fn(16, 8, |x, y| [x as f32, y as f32, 1.0]),
            depth_m: Some(DepthMap::from_fn(16, 8, |x, y| 1.0 + 0.1 * (x + y) as f32)),
        };
        let plain = panorama_rays(&view);
        let varied = augmented_rays(plain.clone(), &variation(), 1.3, cube);
        for i in 0..plain.len() {
            let end = |rays: &Rays| rays.cones[i].origin + rays.cones[i].direction * rays.distance_m[i];
            assert!((end(&plain) * variation().scale() * 1.3 - end(&varied)).length() < 1e-4);
            assert_eq!(varied.radiance[i], [plain.radiance[i][0] * 1.5, plain.radiance[i][1] * 1.2, 1.0]);
        }
        let small = augmented_rays(plain, &Variation::NONE, 1.0, Cube::centred(Vec3::ZERO, 2.5));
        let ends = (0..small.len()).map(|i| small.cones[i].origin + small.cones[i].direction * small.distance_m[i]);
        assert!(ends.into_iter().all(|end| end.abs().max_element() < 1.2501));
        assert!(small.distance_m.iter().any(|d| *d < 0.3), "the side at z = −1.25 is near");
    }

    #[test]
    fn photos_only_become_brighter_and_white_stays_white() {
        let config = AugmentationConfig::default();
        let photo = Image::from_fn(16, 16, |x, y| [(x + 16 * y) as u8; 3]);
        for index in 0..50 {
            let variation = config.draw(&mut lo_random::stream(1, "test", index));
            assert!(variation.gains.iter().all(|gain| (1.0..1.8).contains(gain)), "{variation:?}");
            assert!((1.0..=1.25).contains(&variation.zoom), "{variation:?}");
            let varied = Variation { mirrored: false, zoom: 1.0, ..variation }.photo(&photo);
            assert!(varied.pixels().iter().zip(photo.pixels()).all(|(a, b)| a >= b));
            assert_eq!(varied[(15, 15)], [255; 3]);
        }
        let none = AugmentationConfig {
            mirror_share: 0.0,
            brighter_ev: 0.0,
            colour: 0.0,
            focal: 0.0,
            zoom: 1.0,
            variants: 0,
            ..AugmentationConfig::default()
        };
        assert_eq!(none.draw(&mut lo_random::stream(1, "test", 0)), Variation::NONE);
    }
}
