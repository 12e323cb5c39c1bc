//! The panorama as rays from its place.

use lo_geometry::{Mat3, Vec2, Vec3, direction_from_uv, pixel_solid_angle_sr};
use lo_imaging::{Image, RadianceImage, luminance, resize_equirectangular};

use super::matching::weighted_median;
use super::{PanoramaMatch, PanoramaPrior};

/// Neighbouring pixels whose luminances differ by more than this factor are not blended: lamps keep their edges and peaks.
const HARD_EDGE: f32 = 4.0;

/// Of the median luminance: what a panorama shows beyond that is the light of lamps, windows and the sun, which comes from one surface alone.
const LAMP: f32 = 8.0;

/// A direction's share of the panorama.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayLight {
    /// Radiance in the photo's units, as far as it is no lamp's.
    pub radiance: [f32; 3],
    /// ln(1 + its luminance / median).
    pub log: f32,
    /// What a lamp has beyond that.
    pub lamp: [f32; 3],
    /// ln(1 + luminance / median) of both together.
    pub lamp_log: f32,
    /// Whether that is a lower bound.
    pub clipped: bool,
}

/// An equirectangular grid of directions with their radiance.
pub(super) struct Rays {
    lights: Image<RayLight>,
    world_from_panorama: Mat3,
    /// Rays along a side of one of the panorama's pixels.
    pub per_pixel: usize,
}

impl Rays {
    /// Of a panorama as it lies in the room, about so many columns of them. One of more columns becomes the mean over the solid angle of each ray.
    pub fn new(prior: &PanoramaPrior, found: &PanoramaMatch, columns: usize) -> Self {
        let fine = prior.radiance().width() > columns;
        let smaller = |image: &RadianceImage| resize_equirectangular(image, columns, columns / 2);
        let radiance = if fine { smaller(prior.radiance()) } else { prior.radiance().clone() };
        let clipped = prior.clipped().map(|mask| {
            let mask = mask.map(|&clipped| [f32::from(u8::from(clipped)); 3]);
            if fine { smaller(&mask) } else { mask }.map(|share| share[0] > 0.25)
        });
        let per_pixel = (columns / radiance.width()).max(1);
        let radiance = radiance.map(|rgb| rgb.map(|c| c * found.exposure));
        let (width, height) = (radiance.width(), radiance.height());
        let weights = (0..height).flat_map(|y| std::iter::repeat_n(pixel_solid_angle_sr(y, width, height), width));
        let median = weighted_median(radiance.pixels().iter().map(|&rgb| luminance(rgb)).zip(weights).collect());
        let median = median.unwrap_or(1.0).max(f32::MIN_POSITIVE);
        let lights = Image::from_fn(width * per_pixel, height * per_pixel, |x, y| {
            let radiance = blended(&radiance, x, y, per_pixel);
            let clipped = clipped.as_ref().is_some_and(|mask| mask[(x / per_pixel, y / per_pixel)]);
            let brightness = luminance(radiance) / median;
            let base = radiance.map(|c| c * (LAMP / brightness).min(1.0));
            RayLight {
                radiance: base,
                log: brightness.min(LAMP).ln_1p(),
                lamp: std::array::from_fn(|c| radiance[c] - base[c]),
                lamp_log: brightness.ln_1p(),
                clipped,
            }
        });
        Self { lights, world_from_panorama: found.world_from_panorama, per_pixel }
    }

    /// Rows of rays.
    pub fn rows(&self) -> usize {
        self.lights.height()
    }

    /// Solid angle of each ray of a row, sr.
    pub fn solid_angle_sr(&self, row: usize) -> f32 {
        pixel_solid_angle_sr(row, self.lights.width(), self.lights.height())
    }

    /// The directions of a row in the photo's frame.
    pub fn directions(&self, row: usize) -> impl Iterator<Item = Vec3> + '_ {
        let (width, height) = (self.lights.width() as f32, self.lights.height() as f32);
        (0..self.lights.width()).map(move |x| {
            let uv = Vec2::new((x as f32 + 0.5) / width, (row as f32 + 0.5) / height);
            self.world_from_panorama * direction_from_uv(uv)
        })
    }

    /// Light of a ray.
    pub fn light(&self, column: usize, row: usize) -> &RayLight {
        &self.lights[(column, row)]
    }
}

/// Radiance in the middle of the part `(x, y)` of a map whose pixels are divided into `parts`²: bilinear, which keeps the sum over the parts, but
/// the pixel's own at hard edges, which keeps it too.
fn blended(map: &RadianceImage, x: usize, y: usize, parts: usize) -> [f32; 3] {
    if parts == 1 {
        return map[(x, y)];
    }
    let axis = |i: usize| {
        let position = (i as f32 + 0.5) / parts as f32 - 0.5;
        (position.floor() as i64, position - position.floor())
    };
    let ((left, along), (top, down)) = (axis(x), axis(y));
    let (width, height) = (map.width() as i64, map.height() as i64);
    let pixel = |column: i64, row: i64| {
        // Beyond a pole lies the opposite meridian.
        let column = if row < 0 || row >= height { column + width / 2 } else { column };
        map[(column.rem_euclid(width) as usize, row.clamp(0, height - 1) as usize)]
    };
    let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| pixel(left + dx, top + dy));
    let luminances = corners.map(luminance);
    let (least, most) = luminances.iter().fold((f32::INFINITY, 0.0f32), |(l, m), &v| (l.min(v), m.max(v)));
    if most > HARD_EDGE * least {
        return map[(x / parts, y / parts)];
    }
    let mix = |a: [f32; 3], b: [f32; 3], t: f32| [0, 1, 2].map(|c| a[c] + (b[c] - a[c]) * t);
    mix(mix(corners[0], corners[1], along), mix(corners[2], corners[3], along), down)
}
