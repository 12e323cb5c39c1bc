use lo_imaging::DepthMap;
use lo_random::{RngExt, Stream};
use serde::{Deserialize, Serialize};

use crate::depth_view::{DepthView, NEAREST_M};
use crate::interval::Interval;
use crate::kinect::{structured_light, time_of_flight};
use crate::lidar::lidar;

/// Parameter ranges of depth sensors. [`DepthModel::draw`] chooses one sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DepthModel {
    /// Relative frequency of each kind.
    pub kinds: DepthShares,
    /// Range of structured light, in metres (Kinect v1: 5).
    pub structured_light_range_m: Interval,
    /// Range of a time-of-flight camera, in metres (Kinect v2: 4.5; Azure Kinect: 5.5).
    pub time_of_flight_range_m: Interval,
    /// Range of a phone's LiDAR, in metres (iPhone, iPad: 5).
    pub lidar_range_m: Interval,
    /// Factor on the published noise.
    pub noise: Interval,
    /// Minimum returned light for a reading, in units of a white wall seen perpendicularly at 1 m. Uniform in stops.
    pub least_return: Interval,
}

/// Relative frequencies of the [`DepthSettings`] kinds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DepthShares {
    /// [`DepthSettings::StructuredLight`].
    pub structured_light: f32,
    /// [`DepthSettings::TimeOfFlight`].
    pub time_of_flight: f32,
    /// [`DepthSettings::Lidar`].
    pub lidar: f32,
}

impl Default for DepthShares {
    fn default() -> Self {
        Self { structured_light: 0.3, time_of_flight: 0.3, lidar: 0.4 }
    }
}

impl Default for DepthModel {
    fn default() -> Self {
        Self {
            kinds: DepthShares::default(),
            structured_light_range_m: Interval::new(4.0, 8.0),
            time_of_flight_range_m: Interval::new(4.5, 8.0),
            lidar_range_m: Interval::new(4.5, 6.0),
            noise: Interval::new(0.5, 1.5),
            least_return: Interval::new(2e-4, 3e-3),
        }
    }
}

/// Settings of one depth sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum DepthSettings {
    /// Structured light (Kinect v1): a projected pattern seen from a short baseline. Shadows beside near objects,
    /// quantised disparity, noise that grows with the square of the depth.
    StructuredLight {
        /// Range in metres.
        range_m: f32,
        /// Factor on the published noise.
        noise: f32,
        /// Minimum returned light; see [`DepthModel::least_return`].
        least_return: f32,
    },
    /// Time of flight (Kinect v2, Azure Kinect): flying pixels at edges, noise that grows with the angle.
    TimeOfFlight {
        /// Range in metres.
        range_m: f32,
        /// Factor on the published noise.
        noise: f32,
        /// Minimum returned light; see [`DepthModel::least_return`].
        least_return: f32,
    },
    /// A phone's LiDAR dots, fused with its photo: 256 pixels wide, smooth, no holes. Glass, mirrors and surfaces out
    /// of range are filled in from their surroundings.
    Lidar {
        /// Range in metres.
        range_m: f32,
        /// Factor on the noise.
        noise: f32,
        /// Standard deviation of the smoothing, in pixels of the sensor.
        blur_px: f32,
    },
}

impl DepthModel {
    /// Chooses a sensor and its settings.
    pub fn draw(&self, stream: &mut Stream) -> DepthSettings {
        let noise = self.noise.within(0.0, 100.0).draw(stream);
        let least_return = self.least_return.within(0.0, 1.0).draw_log(stream);
        let blur_px = Interval::new(0.7, 1.8).draw(stream);
        let mut shares = [self.kinds.structured_light, self.kinds.time_of_flight, self.kinds.lidar].map(|s| s.max(0.0));
        if shares.iter().sum::<f32>() <= 0.0 {
            shares = [1.0; 3];
        }
        let chosen = stream.random::<f32>() * shares.iter().sum::<f32>();
        let mut draw = |interval: Interval| interval.within(NEAREST_M, 1000.0).draw(stream);
        if chosen < shares[0] {
            DepthSettings::StructuredLight { range_m: draw(self.structured_light_range_m), noise, least_return }
        } else if chosen < shares[0] + shares[1] {
            DepthSettings::TimeOfFlight { range_m: draw(self.time_of_flight_range_m), noise, least_return }
        } else {
            DepthSettings::Lidar { range_m: draw(self.lidar_range_m), noise, blur_px }
        }
    }
}

impl DepthSettings {
    /// Returns the measured depth along the optical axis in metres, 0 without a reading. The map has the view's size,
    /// or is 256 pixels wide for a LiDAR. `stream` provides the noise.
    ///
    /// # Panics
    /// If an image's size differs from the camera's.
    pub fn measure(&self, view: &DepthView, stream: &mut Stream) -> DepthMap {
        let size = (view.camera.width as usize, view.camera.height as usize);
        for (width, height) in [
            (view.depth_m.width(), view.depth_m.height()),
            (view.normal.width(), view.normal.height()),
            (view.albedo.width(), view.albedo.height()),
            (view.specular.width(), view.specular.height()),
        ] {
            assert_eq!((width, height), size, "a depth view's images must have the camera's size");
        }
        match *self {
            Self::StructuredLight { range_m, noise, least_return } => {
                structured_light(view, range_m, noise, least_return, stream)
            }
            Self::TimeOfFlight { range_m, noise, least_return } => {
                time_of_flight(view, range_m, noise, least_return, stream)
            }
            Self::Lidar { range_m, noise, blur_px } => lidar(view, range_m, noise, blur_px, stream),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Camera;
    use lo_imaging::Image;

    use super::*;
    use crate::kinect::BASELINE_M;

    /// A single wall, and optional objects in front of it.
    struct Room {
        camera: Camera,
        depth_m: DepthMap,
        normal: Image<[f32; 3]>,
        albedo: Image<[f32; 3]>,
        specular: Image<bool>,
    }

    impl Room {
        fn wall(depth: impl Fn(usize, usize) -> f32) -> Self {
            let (width, height) = (240, 160);
            let count = width * height;
            Self {
                camera: Camera::from_hfov_deg(60.0, width as u32, height as u32).unwrap(),
                depth_m: DepthMap::from_fn(width, height, depth),
                normal: Image::new(width, height, vec![[0.0, 0.0, 1.0]; count]),
                albedo: Image::new(width, height, vec![[0.7; 3]; count]),
                specular: Image::new(width, height, vec![false; count]),
            }
        }

        fn measure(&self, settings: DepthSettings) -> DepthMap {
            let view = DepthView {
                camera: &self.camera,
                depth_m: &self.depth_m,
                normal: &self.normal,
                albedo: &self.albedo,
                specular: &self.specular,
            };
            settings.measure(&view, &mut lo_random::stream(5, "test", 0))
        }
    }

    const STRUCTURED: DepthSettings = DepthSettings::StructuredLight { range_m: 6.0, noise: 1.0, least_return: 3e-4 };
    const TOF: DepthSettings = DepthSettings::TimeOfFlight { range_m: 6.0, noise: 1.0, least_return: 3e-4 };
    const LIDAR: DepthSettings = DepthSettings::Lidar { range_m: 5.0, noise: 1.0, blur_px: 1.0 };

    fn holes(map: &DepthMap) -> f32 {
        map.pixels().iter().filter(|&&z| z == 0.0).count() as f32 / map.pixels().len() as f32
    }

    #[test]
    fn kinect_noise_and_steps_grow_with_the_square_of_the_depth() {
        for z in [1.0f64, 2.0, 4.0] {
            let map = Room::wall(|_, _| z as f32).measure(STRUCTURED);
            assert!(holes(&map) < 0.001);
            let values: Vec<f64> = map.pixels().iter().map(|&v| f64::from(v)).collect();
            let variance = values.iter().map(|v| (v - z).powi(2)).sum::<f64>() / values.len() as f64;
            // Random error and the uniform error of a quantisation step, each from the paper.
            let (sigma, step) = (1.425e-3 * z * z, 2.85e-3 * z * z);
            let expected = sigma * sigma + step * step / 12.0;
            assert!((variance / expected - 1.0).abs() < 0.15, "{z} m: {variance} instead of {expected}");
            let mut levels: Vec<u32> = map.pixels().iter().map(|v| v.to_bits()).collect();
            levels.sort_unstable();
            levels.dedup();
            let gap = f64::from(f32::from_bits(levels[1]) - f32::from_bits(levels[0]));
            assert!((gap / step - 1.0).abs() < 0.05, "{z} m: steps of {gap} instead of {step}");
        }
    }

    #[test]
    fn near_things_throw_a_shadow_of_the_disparity_difference() {
        // A post at 1 m in front of a wall at 3 m.
        let room = Room::wall(|x, _| if (150..170).contains(&x) { 1.0 } else { 3.0 });
        let map = room.measure(STRUCTURED);
        let focal_baseline = room.camera.fx as f32 * BASELINE_M;
        let expected = (focal_baseline * (1.0 - 1.0 / 3.0)).round() as usize;
        let shadow = (100..150).filter(|&x| (0..160).all(|y| map[(x, y)] == 0.0)).count();
        assert!(shadow.abs_diff(expected) <= 1, "{shadow} instead of {expected} pixels");
        assert!((171..200).all(|x| map[(x, 80)] > 2.9), "no shadow on the other side");
        // Time of flight has no baseline.
        let tof = room.measure(TOF);
        assert!((130..148).all(|x| tof[(x, 80)] > 2.9));
    }

    #[test]
    fn holes_gather_at_edges_mirrors_and_dark_or_grazing_surfaces() {
        for settings in [STRUCTURED, TOF] {
            let plain = holes(&Room::wall(|_, _| 2.0).measure(settings));
            let edges = holes(&Room::wall(|x, _| if x / 20 % 2 == 0 { 2.0 } else { 2.3 }).measure(settings));
            assert!(edges > plain + 0.02, "{settings:?}: {plain} {edges}");
            let mut mirror = Room::wall(|_, _| 2.0);
            mirror.specular = Image::from_fn(240, 160, |x, _| x < 120);
            assert!((holes(&mirror.measure(settings)) - 0.5).abs() < 0.01);
            let mut black = Room::wall(|_, _| 5.0);
            black.albedo = Image::new(240, 160, vec![[0.002; 3]; 240 * 160]);
            assert_eq!(holes(&black.measure(settings)), 1.0);
            let mut grazing = Room::wall(|_, _| 2.0);
            grazing.normal = Image::new(240, 160, vec![[1.0, 0.0, 0.01]; 240 * 160]);
            assert!(holes(&grazing.measure(settings)) > 0.3);
            assert_eq!(holes(&Room::wall(|_, _| 7.0).measure(settings)), 1.0, "out of range");
            assert_eq!(holes(&Room::wall(|_, _| 0.2).measure(settings)), 1.0, "too near");
        }
    }

    #[test]
    fn time_of_flight_has_flying_pixels_between_two_surfaces() {
        let room = Room::wall(|x, _| if x < 120 { 1.5 } else { 3.0 });
        let map = room.measure(TOF);
        let between = (0..160).filter(|&y| (119..=120).any(|x| (1.6..2.9).contains(&map[(x, y)]))).count();
        assert!(between > 20, "{between} of 160 rows");
        assert!((0..160).all(|y| (map[(60, y)] - 1.5).abs() < 0.02 && (map[(180, y)] - 3.0).abs() < 0.05));
    }

    #[test]
    fn lidar_is_small_smooth_and_without_holes() {
        let mut room = Room::wall(|x, _| if x < 120 { 2.0 } else { 3.0 });
        room.specular = Image::from_fn(240, 160, |x, y| (20..60).contains(&x) && (40..100).contains(&y));
        let map = room.measure(LIDAR);
        assert_eq!((map.width(), map.height()), (240, 160));
        assert_eq!(holes(&map), 0.0);
        // Scale error and waves together stay below 3 %.
        assert!((map[(40, 70)] - 2.0).abs() < 0.06 && (map[(200, 70)] - 3.0).abs() < 0.09);
        let step = (map[(181, 70)] - map[(180, 70)]).abs();
        assert!(step < 0.005, "neighbours differ by {step} m");
        let wide = Image::from_fn(480, 320, |_, _| 2.0f32);
        let camera = Camera::from_hfov_deg(60.0, 480, 320).unwrap();
        let (normal, albedo) =
            (Image::new(480, 320, vec![[0.0, 0.0, 1.0]; 153_600]), Image::new(480, 320, vec![[0.5; 3]; 153_600]));
        let specular = Image::new(480, 320, vec![false; 153_600]);
        let view = DepthView { camera: &camera, depth_m: &wide, normal: &normal, albedo: &albedo, specular: &specular };
        let map = LIDAR.measure(&view, &mut lo_random::stream(5, "test", 0));
        assert_eq!((map.width(), map.height()), (256, 171));
    }

    #[test]
    fn models_draw_every_kind_by_its_share() {
        let model = DepthModel::default();
        let mut counts = [0; 3];
        for i in 0..1000 {
            match model.draw(&mut lo_random::stream(2, "depth", i)) {
                DepthSettings::StructuredLight { .. } => counts[0] += 1,
                DepthSettings::TimeOfFlight { .. } => counts[1] += 1,
                DepthSettings::Lidar { .. } => counts[2] += 1,
            }
        }
        // Standard deviations of about 15.
        assert!((250..350).contains(&counts[0]) && (250..350).contains(&counts[1]), "{counts:?}");
        let drawn = model.draw(&mut lo_random::stream(2, "depth", 1));
        let text = serde_json::to_string(&drawn).unwrap();
        assert_eq!(serde_json::from_str::<DepthSettings>(&text).unwrap(), drawn);
    }
}
