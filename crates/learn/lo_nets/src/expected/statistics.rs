//! Statistics of a photo's shading, brightness and colours, as input of the expected-light network.

use std::sync::OnceLock;

use lo_geometry::{Camera, Mat3, Quat, Vec3};
use lo_imaging::{DepthMap, RadianceImage, luminance, resize, resize_depth};

use super::directions::{mirrored, ring_directions};
use crate::depth::size_within;

/// Longer side, in pixels, of the photo that statistics are taken from.
const SIDE: usize = 48;

/// Rings of the directions in which statistics are binned, and total number of directions.
const RINGS: usize = 5;
const BINS: usize = 32;

/// Number of colour statistics, and of statistics of the photo as a whole.
const COLOURS: usize = 17;
const OVERALL: usize = 5;

/// Number of statistics of a photo.
pub const STATISTICS: usize = 4 * BINS + COLOURS + OVERALL;

/// Offsets before logarithms, of luminance and of channels.
const DARK: f32 = 0.02;
const DARK_CHANNEL: f32 = 0.01;

/// Luminance above which a pixel holds no shading, and channel value above which it counts as clipped.
const WHITE: f32 = 0.95;
const BRIGHT: f32 = 0.9;

/// WeightedMean and deviation of the statistics of the whole photo, over photos cropped from panoramas.
const OVERALL_SCALE: [(f32, f32); OVERALL] = [(-0.94, 0.3), (0.04, 0.23), (1.25, 0.19), (-2.1, 1.1), (0.64, 0.24)];

/// Statistics of a photo in the *level frame*: +Y is up, and the camera looks into the half plane of −Z.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoStatistics {
    /// [`STATISTICS`] numbers of about unit magnitude:
    ///
    /// - by surface normal, in 32 directions: mean log luminance less the overall mean, and root of the share of
    ///   pixels;
    /// - by viewing direction, in the same directions: the same mean, and root of the share of clipped pixels;
    /// - log R/G and B/G of all pixels, of the brightest tenth, of floors, ceilings, walls and greys, and the shares of
    ///   the last five;
    /// - log mean luminance, pitch, field of view, log share of clipped pixels, relative deviation of luminance.
    pub values: Vec<f32>,
    /// WeightedMean linear RGB of the photo, above 0.
    pub mean: [f32; 3],
    /// Rotation from the level frame to the camera's.
    pub camera_from_level: Quat,
}

fn bins() -> &'static [Vec3] {
    static BINS: OnceLock<Vec<Vec3>> = OnceLock::new();
    BINS.get_or_init(|| ring_directions(RINGS))
}

/// Returns the level frame of a camera that looks along −Z. `up` is the unit vector against gravity in its axes.
fn level_frame(up: Vec3) -> Quat {
    let back = Vec3::Z - up * up.z;
    // Looking straight up or down, the image's lower edge is taken as the front.
    let back = if back.length() > 1e-3 { back.normalize() } else { (-Vec3::Y - up * -up.y).normalize_or(Vec3::Z) };
    Quat::from_mat3(&Mat3::from_cols(up.cross(back), up, back)).normalize()
}

/// A weighted mean.
#[derive(Clone, Copy, Default)]
struct WeightedMean {
    sum: f32,
    weight: f32,
}

impl WeightedMean {
    fn add(&mut self, value: f32, weight: f32) {
        self.sum += weight * value;
        self.weight += weight;
    }

    fn value(self) -> f32 {
        self.sum / (self.weight + 1e-6)
    }
}

impl PhotoStatistics {
    /// Computes the statistics of a linear photo (1 is white).
    ///
    /// `depth_m` is along the optical axis, 0 without a reading. `up` is the unit vector against gravity in the
    /// camera's axes. Photo and depth may have any resolution.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn new(photo: &RadianceImage, depth_m: &DepthMap, camera: &Camera, up: Vec3) -> Self {
        let [width, height] = size_within([photo.width(), photo.height()], SIDE);
        let photo = resize(photo, width, height);
        let depth_m = resize_depth(depth_m, width, height);
        let camera = camera.resized(width as u32, height as u32);
        let camera_from_level = level_frame(up);
        let level = |direction: Vec3| camera_from_level.conjugate() * direction;
        let point = |x: usize, y: usize| {
            let z = depth_m[(x, y)];
            (z > 0.0).then(|| camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(z)))
        };
        let normal = |x: usize, y: usize| {
            if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
                return None;
            }
            let across = point(x + 1, y)? - point(x - 1, y)?;
            let down = point(x, y + 1)? - point(x, y - 1)?;
            Some(level(down.cross(across).try_normalize()?))
        };
        let pixels = (width * height) as f32;
        let luminances: Vec<f32> = photo.pixels().iter().map(|&rgb| luminance(rgb)).collect();
        let bright = {
            let mut sorted = luminances.clone();
            sorted.sort_unstable_by(f32::total_cmp);
            sorted[(0.9 * (pixels - 1.0)) as usize]
        };
        // Normalises weights to 1,536 pixels.
        let share = 1536.0 / pixels;
        let (mut by_normal, mut by_view, mut clipped) =
            (vec![WeightedMean::default(); BINS], vec![WeightedMean::default(); BINS], 0.0);
        let (mut clipped_by_view, mut clipped_all) = (vec![0.0f32; BINS], 0.0);
        let mut colours = [[WeightedMean::default(); 2]; 6];
        let mut shares = [0.0f32; 5];
        let mut all = WeightedMean::default();
        for (i, (&rgb, &light)) in photo.pixels().iter().zip(&luminances).enumerate() {
            let (x, y) = (i % width, i / width);
            let log = (light + DARK).ln();
            all.add(log, 1.0);
            let is_clipped = rgb.iter().any(|&c| c > BRIGHT);
            clipped += f32::from(is_clipped) / pixels;
            let ray = level(camera.direction(x as f64 + 0.5, y as f64 + 0.5));
            for ((bin, mean), clipped_by_view) in bins().iter().zip(&mut by_view).zip(&mut clipped_by_view) {
                let weight = ray.dot(*bin).max(0.0).powi(10);
                mean.add(log, share * weight);
                *clipped_by_view += if is_clipped { weight } else { 0.0 };
                clipped_all += weight;
            }
            let normal = normal(x, y);
            let shaded = light < WHITE;
            if let Some(normal) = normal.filter(|_| shaded) {
                for (bin, mean) in bins().iter().zip(&mut by_normal) {
                    mean.add(log, share * normal.dot(*bin).max(0.0).powi(8));
                }
            }
            let [r, g, b] = rgb.map(|c| (c + DARK_CHANNEL).ln());
            let tints = [r - g, b - g];
            let saturation = tints[0].abs() + tints[1].abs();
            let is = |condition: bool| f32::from(condition && shaded);
            let faces = |condition: &dyn Fn(f32) -> bool| is(normal.is_some_and(|normal| condition(normal.y)));
            let grey = is(true) * (-saturation / 0.1).exp();
            let kinds =
                [is(light >= bright), faces(&|y| y > 0.8), faces(&|y| y < -0.8), faces(&|y| y.abs() < 0.3), grey];
            shares.iter_mut().zip(kinds).for_each(|(sum, weight)| *sum += weight / pixels);
            let [top, floor, ceiling, wall, grey] = kinds;
            let weights = [is(true), top, floor, ceiling, wall, grey * light];
            for (means, weight) in colours.iter_mut().zip(weights) {
                means.iter_mut().zip(tints).for_each(|(mean, tint)| mean.add(tint, weight));
            }
        }
        let total = by_normal.iter().fold(WeightedMean::default(), |total, bin| WeightedMean {
            sum: total.sum + bin.sum,
            weight: total.weight + bin.weight,
        });
        let mut values = Vec::with_capacity(STATISTICS);
        values.extend(by_normal.iter().map(|bin| (bin.value() - total.value()) * (bin.weight / 8.0).tanh()));
        values.extend(by_normal.iter().map(|bin| (bin.weight / (total.weight + 1e-6)).sqrt()));
        values.extend(by_view.iter().map(|bin| (bin.value() - all.value()) * (bin.weight / 20.0).tanh()));
        values.extend(clipped_by_view.iter().map(|sum| (sum / (clipped_all + 1e-6)).sqrt()));
        values.extend(colours.iter().flatten().map(|mean| mean.value()));
        values.extend(shares);
        let mean: [f32; 3] =
            std::array::from_fn(|c| (photo.pixels().iter().map(|rgb| rgb[c]).sum::<f32>() / pixels).max(1e-3));
        let level = luminance(mean);
        let deviation = (luminances.iter().map(|l| (l - level).powi(2)).sum::<f32>() / pixels).sqrt();
        let hfov_rad = camera.hfov_deg().to_radians() as f32;
        let overall = [level.ln(), up.z.clamp(-1.0, 1.0).asin(), hfov_rad, (clipped + 0.01).ln(), deviation / level];
        values.extend(overall.iter().zip(OVERALL_SCALE).map(|(value, (mean, deviation))| (value - mean) / deviation));
        Self { values, mean, camera_from_level }
    }

    /// Returns the statistics of the photo's mirror image, in the mirror image of the level frame.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        static IMAGES: OnceLock<Vec<usize>> = OnceLock::new();
        let images = IMAGES.get_or_init(|| mirrored(bins()));
        let mut values = self.values.clone();
        for block in 0..4 {
            for (bin, &image) in images.iter().enumerate() {
                values[block * BINS + bin] = self.values[block * BINS + image];
            }
        }
        Self { values, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A room's corner: a bright wall to the left, a dark one to the right, a grey floor.
    fn corner(width: usize, height: usize) -> (RadianceImage, DepthMap, Camera) {
        let camera = Camera::from_hfov_deg(80.0, width as u32, height as u32).unwrap();
        let hit = |x: usize, y: usize| {
            let ray = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            // The walls z = −3 ± x are perpendicular; the floor is at −1.4 m.
            let wall = 3.0 / (-ray.z + ray.x.abs());
            let floor = if ray.y < 0.0 { 1.4 / -ray.y } else { f32::INFINITY };
            let t = wall.min(floor);
            let radiance = if floor < wall {
                [0.3, 0.3, 0.3]
            } else if ray.x < 0.0 {
                [0.6, 0.55, 0.5]
            } else {
                [0.1, 0.1, 0.1]
            };
            (radiance, -t * ray.z)
        };
        let photo = RadianceImage::from_fn(width, height, |x, y| hit(x, y).0);
        let depth_m = DepthMap::from_fn(width, height, |x, y| hit(x, y).1);
        (photo, depth_m, camera)
    }

    #[test]
    fn luminance_is_binned_by_surface_normal() {
        let (photo, depth_m, camera) = corner(48, 32);
        let statistics = PhotoStatistics::new(&photo, &depth_m, &camera, Vec3::Y);
        assert_eq!(statistics.values.len(), STATISTICS);
        let facing = |direction: Vec3| {
            let nearest = |&a: &usize, &b: &usize| bins()[a].dot(direction).total_cmp(&bins()[b].dot(direction));
            statistics.values[(0..BINS).max_by(nearest).unwrap()]
        };
        // The left wall faces right and towards the camera.
        let [left, right] = [Vec3::new(1.0, 0.0, 1.0), Vec3::new(-1.0, 0.0, 1.0)].map(facing);
        assert!(left > 0.3 && right < -0.5, "{left} {right}");
        assert!(statistics.values.iter().all(|value| value.is_finite()));
    }

    #[test]
    fn a_mirrored_photo_has_mirrored_statistics() {
        let (photo, depth_m, camera) = corner(480, 320);
        let flipped = |x: usize| 479 - x;
        let mirror = RadianceImage::from_fn(480, 320, |x, y| photo[(flipped(x), y)]);
        let mirror_m = DepthMap::from_fn(480, 320, |x, y| depth_m[(flipped(x), y)]);
        let up = Vec3::new(0.1, 0.9, 0.3).normalize();
        let own = PhotoStatistics::new(&photo, &depth_m, &camera, up).mirrored();
        let other = PhotoStatistics::new(&mirror, &mirror_m, &camera, Vec3::new(-up.x, up.y, up.z));
        for (i, (a, b)) in own.values.iter().zip(&other.values).enumerate() {
            assert!((a - b).abs() < 2e-3, "{i}: {a} {b}");
        }
    }

    #[test]
    fn photos_without_depth_have_finite_statistics() {
        let (photo, depth_m, camera) = corner(60, 40);
        let none = depth_m.map(|_| 0.0);
        let statistics = PhotoStatistics::new(&photo, &none, &camera, Vec3::Y);
        assert!(statistics.values[..BINS].iter().all(|&value| value == 0.0));
        let black = photo.map(|_| [0.0; 3]);
        let dark = PhotoStatistics::new(&black, &none, &camera, Vec3::Z);
        assert!(dark.values.iter().chain(&dark.mean).all(|value| value.is_finite()));
    }
}
