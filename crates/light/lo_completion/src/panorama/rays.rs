//! The panorama as rays from its position.

use lo_geometry::{Mat3, Vec2, Vec3, direction_from_uv, pixel_solid_angle_sr};
use lo_imaging::{Image, RadianceImage, luminance, resize_equirectangular};

use super::matching::weighted_median;
use super::prior::shares;
use super::{PanoramaMatch, PanoramaPrior};

/// Luminance ratio of adjacent pixels above which they are not blended, so that lamps keep their edges and peaks.
const HARD_EDGE: f32 = 4.0;

/// Multiple of the median luminance above which light is from lamps, windows or the sun. Such light comes from a single
/// surface.
const LAMP: f32 = 8.0;

/// Light of a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayLight {
    /// Radiance in the photo's units, without the part of a lamp.
    pub radiance: [f32; 3],
    /// ln(1 + its luminance / median).
    pub log: f32,
    /// The lamp's radiance above that.
    pub lamp: [f32; 3],
    /// ln(1 + luminance / median) of the sum of both.
    pub lamp_log: f32,
    /// Whether the light is a lower bound.
    pub clipped: bool,
    /// Whether the panorama does not show the ray.
    pub missing: bool,
}

/// An equirectangular grid of directions with their radiance.
pub(super) struct Rays {
    lights: Image<RayLight>,
    world_from_panorama: Mat3,
    /// Rays along a side of one of the panorama's pixels.
    pub per_pixel: usize,
}

impl Rays {
    /// Creates about `columns` columns of rays for an aligned panorama. A panorama with more columns is averaged over
    /// the solid angle of each ray.
    pub fn new(prior: &PanoramaPrior, found: &PanoramaMatch, columns: usize) -> Self {
        let fine = prior.radiance().width() > columns;
        let smaller = |image: &RadianceImage| resize_equirectangular(image, columns, columns / 2);
        let radiance = if fine { smaller(prior.radiance()) } else { prior.radiance().clone() };
        let clipped = prior.clipped().map(|mask| {
            let mask = shares(mask);
            if fine { smaller(&mask) } else { mask }.map(|share| share[0] > 0.25)
        });
        let missing = prior.covered().map(|mask| {
            let mask = shares(&mask.map(|covered| !covered));
            if fine { smaller(&mask) } else { mask }.map(|share| share[0] > 0.0)
        });
        let is_missing = |x: usize, y: usize| missing.as_ref().is_some_and(|mask| mask[(x, y)]);
        let per_pixel = (columns / radiance.width()).max(1);
        let radiance = radiance.map(|rgb| rgb.map(|c| c * found.exposure));
        let (width, height) = (radiance.width(), radiance.height());
        let at = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let weights = at.map(|(x, y)| if is_missing(x, y) { 0.0 } else { pixel_solid_angle_sr(y, width, height) });
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
                missing: is_missing(x / per_pixel, y / per_pixel),
            }
        });
        Self { lights, world_from_panorama: found.world_from_panorama, per_pixel }
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.lights.height()
    }

    /// Returns the solid angle in sr of each ray of a row.
    pub fn solid_angle_sr(&self, row: usize) -> f32 {
        pixel_solid_angle_sr(row, self.lights.width(), self.lights.height())
    }

    /// Returns the directions of a row in the photo's frame.
    pub fn directions(&self, row: usize) -> impl Iterator<Item = Vec3> + '_ {
        let (width, height) = (self.lights.width() as f32, self.lights.height() as f32);
        (0..self.lights.width()).map(move |x| {
            let uv = Vec2::new((x as f32 + 0.5) / width, (row as f32 + 0.5) / height);
            self.world_from_panorama * direction_from_uv(uv)
        })
    }

    /// Returns the light of a ray.
    pub fn light(&self, column: usize, row: usize) -> &RayLight {
        &self.lights[(column, row)]
    }
}

/// Returns the radiance at the centre of the sub-pixel `(x, y)` of an image whose pixels are divided into `parts`².
/// Bilinear, or the pixel's own value at hard edges; both preserve the sum over the parts.
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
        // Beyond a pole is the opposite meridian.
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
