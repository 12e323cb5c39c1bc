use std::ops::RangeInclusive;

use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, Image, Photo, RadianceImage};

use crate::FrameError;
use crate::resample;

/// Largest difference in aspect ratio between photo and depth: 256 × 192 of 1920 × 1440 is exact, 640 × 360 of 640 ×
/// 480 is rejected.
const ASPECT_TOLERANCE: f64 = 0.02;

/// Fewest readings that a frame needs.
const MIN_READINGS: usize = 16;

/// Largest valid depth in metres: no room is larger, and sensors write such values for "no reading".
const MAX_DEPTH_M: f32 = 200.0;

/// Smallest valid median depth in metres; a smaller one means a wrong depth scale.
const MIN_MEDIAN_DEPTH_M: f32 = 0.05;

/// Largest radiance of a photo's pixel, its linear value times the exposure: 600 times the sun's luminance in cd/m².
pub(crate) const MAX_PHOTO_RADIANCE: f32 = 1e12;

/// Valid exposures, within ± 40 stops.
pub(crate) const EXPOSURES: RangeInclusive<f32> = 1.0 / (1u64 << 40) as f32..=(1u64 << 40) as f32;

/// A photo with depth and camera.
///
/// Photo and depth show the same field of view. Their resolutions may differ until [`Frame::at_resolution`] makes
/// them equal.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Pinhole camera, in pixels of the photo.
    pub camera: Camera,
    /// The photo.
    pub photo: Photo,
    /// Depth along the optical axis in metres; 0 where there is no reading.
    pub depth_m: DepthMap,
    /// Factor from linear photo values to radiance; 1 unless the user sets another.
    pub exposure: f32,
}

impl Frame {
    /// Validates the parts and combines them.
    ///
    /// Zero, negative, NaN and infinite depths and those beyond 200 m become 0, "no reading". In a linear photo, NaN
    /// and −∞ become 0, and +∞ the photo's largest finite value.
    ///
    /// # Errors
    /// If the camera does not have the photo's size, the exposure is beyond ± 40 stops, the photo has no finite value
    /// or radiance above 10¹², the aspect ratios of photo and depth differ by more than 2 %, or the depth has too few
    /// or implausible readings.
    pub fn new(mut photo: Photo, mut depth_m: DepthMap, camera: Camera, exposure: f32) -> Result<Self, FrameError> {
        let photo_size = (photo.width(), photo.height());
        let depth_size = (depth_m.width(), depth_m.height());
        if (camera.width as usize, camera.height as usize) != photo_size {
            return Err(FrameError::CameraSize { camera: (camera.width, camera.height), photo: photo_size });
        }
        Camera::new(camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)?;
        if !EXPOSURES.contains(&exposure) {
            return Err(FrameError::Exposure(exposure));
        }
        if let Photo::Linear(image) = &mut photo {
            make_finite(image, exposure)?;
        }
        if depth_size.0 == 0 || depth_size.1 == 0 {
            return Err(FrameError::NoReadings { depth: depth_size });
        }
        // One pixel of rounding in the shorter side is accepted: a 3 × 2 depth map of a 640 × 480 photo cannot be
        // closer.
        let aspect = |(width, height): (usize, usize)| width as f64 / height as f64;
        let rounding = 1.0 / depth_size.0.min(depth_size.1).min(photo_size.0).min(photo_size.1) as f64;
        if (aspect(depth_size) / aspect(photo_size)).ln().abs() > ASPECT_TOLERANCE.max(rounding) {
            return Err(FrameError::AspectRatio { depth: depth_size, photo: photo_size });
        }
        let given: Vec<f32> = depth_m.pixels().iter().copied().filter(|z| z.is_finite() && *z > 0.0).collect();
        if given.is_empty() {
            return Err(FrameError::NoReadings { depth: depth_size });
        }
        // Check the readings that are kept: a frame that passes must pass again when it is read back.
        let kept: Vec<f32> = given.iter().copied().filter(|z| *z <= MAX_DEPTH_M).collect();
        let (found, median_m) = (kept.len(), median(given));
        if median_m > MAX_DEPTH_M {
            return Err(FrameError::DepthScale { median_m });
        }
        if found < MIN_READINGS {
            return Err(FrameError::TooFewReadings { found, needed: MIN_READINGS });
        }
        let median_m = median(kept);
        if median_m < MIN_MEDIAN_DEPTH_M {
            return Err(FrameError::DepthScale { median_m });
        }
        for z in depth_m.pixels_mut() {
            // NaN fails the comparison and becomes 0, too.
            if !(*z > 0.0 && *z <= MAX_DEPTH_M) {
                *z = 0.0;
            }
        }
        Ok(Self { camera, photo, depth_m, exposure })
    }

    /// Returns the world point at the centre of depth pixel `(x, y)`; `None` where there is no reading.
    pub fn point(&self, x: usize, y: usize) -> Option<Vec3> {
        let depth_m = self.depth_m[(x, y)];
        let camera = self.depth_camera();
        (depth_m > 0.0).then(|| camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(depth_m)))
    }

    /// Returns the camera in pixels of the depth map.
    pub fn depth_camera(&self) -> Camera {
        self.camera.resized(self.depth_m.width() as u32, self.depth_m.height() as u32)
    }

    /// Resamples photo, depth and camera to `width` × `height`, with the same field of view.
    ///
    /// The photo is averaged in linear light over each new pixel's footprint and becomes [`Photo::Linear`]; it is
    /// kept as it is if it has that size already. Depth is resampled without mixing surfaces
    /// ([`lo_imaging::resize_depth`]).
    ///
    /// # Panics
    /// If photo or depth has no pixels, which [`Frame::new`] rejects.
    pub fn at_resolution(&self, width: usize, height: usize) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        let photo = resample::resized_photo(&self.photo, width, height);
        let depth_m = lo_imaging::resize_depth(&self.depth_m, width, height);
        Self { camera: self.camera.resized(width as u32, height as u32), photo, depth_m, exposure: self.exposure }
    }

    /// Returns the frame at the working resolution of estimation: at most 480 pixels on the long side and 153,600 in
    /// all, never larger than the photo.
    pub fn working(&self) -> Self {
        let (width, height) = resample::working_size(&self.photo);
        self.at_resolution(width, height)
    }

    /// Returns the linear radiance of each photo pixel: linear value × exposure. Clipped highlights are not restored.
    pub fn radiance(&self) -> RadianceImage {
        let exposure = self.exposure;
        match &self.photo {
            Photo::Srgb8(image) => image.map(|p| p.map(|c| lo_imaging::linear_from_srgb8(c) * exposure)),
            Photo::Encoded8(photo) => {
                let mut radiance = photo.radiance();
                radiance.pixels_mut().iter_mut().for_each(|p| *p = p.map(|c| c * exposure));
                radiance
            }
            Photo::Linear(image) => image.map(|p| p.map(|c| if c.is_finite() { c.max(0.0) * exposure } else { 0.0 })),
        }
    }

    /// Returns which photo pixels the sensor clipped: those with a channel at or above 250 of 255 (sRGB).
    ///
    /// A photo with values above 1, by its linear values or its gain map, is HDR and counts as unclipped.
    pub fn clipped(&self) -> Image<bool> {
        /// 250 / 255 in linear light.
        const CLIP_LEVEL: f32 = 0.956;
        let above = |image: &RadianceImage| {
            let hdr = image.pixels().iter().flatten().any(|&c| c > 1.0 + 1e-3);
            image.map(|p| !hdr && p.iter().any(|&c| c >= CLIP_LEVEL))
        };
        match &self.photo {
            Photo::Srgb8(image) => image.map(|p| p.iter().any(|&c| c >= 250)),
            Photo::Encoded8(photo) if photo.encoding.gain_map.is_some() => above(&photo.radiance()),
            Photo::Encoded8(photo) => photo.image.map(|p| p.iter().any(|&c| c >= 250)),
            Photo::Linear(image) => above(image),
        }
    }
}

/// Replaces values that are not finite, and checks the range of radiance.
fn make_finite(image: &mut RadianceImage, exposure: f32) -> Result<(), FrameError> {
    let values = image.pixels().as_flattened();
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let Some(brightest) = finite().reduce(f32::max) else { return Err(FrameError::NoPixels) };
    let largest = finite().fold(0.0f32, |largest, value| largest.max(value.abs()));
    if largest * exposure.max(1.0) > MAX_PHOTO_RADIANCE {
        return Err(FrameError::Radiance { largest, exposure, limit: MAX_PHOTO_RADIANCE });
    }
    for value in image.pixels_mut().iter_mut().flatten().filter(|value| !value.is_finite()) {
        *value = if *value == f32::INFINITY { brightest } else { 0.0 };
    }
    Ok(())
}

/// Returns the median; `values` must not be empty.
pub(crate) fn median(mut values: Vec<f32>) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn photo(width: usize, height: usize) -> Photo {
        Photo::Srgb8(Image::from_fn(width, height, |x, y| [(x % 256) as u8, (y % 256) as u8, 128]))
    }

    fn camera(width: usize, height: usize) -> Camera {
        Camera::from_hfov_deg(70.0, width as u32, height as u32).unwrap()
    }

    #[test]
    fn lidar_size_fits_and_another_aspect_does_not() {
        let depth = |w, h| Image::new(w, h, vec![2.0f32; w * h]);
        assert!(Frame::new(photo(1920, 1440), depth(256, 192), camera(1920, 1440), 1.0).is_ok());
        let error = Frame::new(photo(640, 480), depth(640, 360), camera(640, 480), 1.0).unwrap_err().to_string();
        assert!(error.contains("640 × 360") && error.contains("640 × 480"), "{error}");
        let error = Frame::new(photo(640, 480), depth(640, 480), camera(320, 240), 1.0).unwrap_err().to_string();
        assert!(error.contains("320 × 240"), "{error}");
    }

    #[test]
    fn senseless_readings_are_named_or_dropped() {
        let make = |depth: Vec<f32>| Frame::new(photo(8, 8), Image::new(8, 8, depth), camera(8, 8), 1.0);
        assert!(matches!(make(vec![0.0; 64]), Err(FrameError::NoReadings { .. })));
        assert!(matches!(make(vec![f32::NAN; 64]), Err(FrameError::NoReadings { .. })));
        assert!(matches!(make(vec![1571.0; 64]), Err(FrameError::DepthScale { .. })));
        let mut few = vec![-1.0; 64];
        few[3] = 2.0;
        assert!(matches!(make(few), Err(FrameError::TooFewReadings { found: 1, .. })));
        let mut mixed = vec![2.0; 64];
        mixed[..4].copy_from_slice(&[f32::NAN, f32::INFINITY, -3.0, 1e30]);
        let frame = make(mixed).unwrap();
        assert!((0..4).all(|x| frame.point(x, 0).is_none()) && frame.point(4, 0).is_some());
        let mut far = vec![2.0; 15];
        far.extend([250.0; 10]);
        far.resize(64, 0.0);
        assert!(matches!(make(far), Err(FrameError::TooFewReadings { found: 15, .. })));
        // The median of the valid readings is 0.01 m, of all readings 1 m.
        let near = [vec![0.01; 24], vec![1.0; 20], vec![1e3; 20]].concat();
        assert!(matches!(make(near), Err(FrameError::DepthScale { median_m: 0.01 })));
        let nothing = Frame::new(photo(8, 8), Image::new(0, 0, vec![]), camera(8, 8), 1.0);
        assert!(matches!(nothing, Err(FrameError::NoReadings { .. })));
        let dark = Frame::new(photo(8, 8), Image::new(8, 8, vec![1.0; 64]), camera(8, 8), 0.0);
        assert!(matches!(dark, Err(FrameError::Exposure(_))));
    }

    #[test]
    fn linear_photos_are_finite_and_have_a_range() {
        let make = |values: [f32; 3], exposure: f32| {
            let photo = Photo::Linear(Image::from_fn(8, 8, |x, y| if (x, y) == (3, 2) { values } else { [0.5; 3] }));
            Frame::new(photo, Image::new(8, 8, vec![2.0; 64]), camera(8, 8), exposure)
        };
        let Photo::Linear(image) = make([f32::NAN, f32::INFINITY, 7.0], 1.0).unwrap().photo else { panic!() };
        assert_eq!(image[(3, 2)], [0.0, 7.0, 7.0]);
        let nothing = Photo::Linear(Image::new(8, 8, vec![[f32::NAN; 3]; 64]));
        let nothing = Frame::new(nothing, Image::new(8, 8, vec![2.0; 64]), camera(8, 8), 1.0);
        assert_eq!(nothing, Err(FrameError::NoPixels));
        let bright = |value: f32, exposure: f32| make([0.0, 0.0, value], exposure).map(|_| ());
        let (limit, exposure) = (1e12, 1.0);
        assert_eq!(bright(1e38, 1.0), Err(FrameError::Radiance { largest: 1e38, exposure, limit }));
        assert_eq!(bright(1e10, 1000.0), Err(FrameError::Radiance { largest: 1e10, exposure: 1000.0, limit }));
        assert_eq!(bright(1e12, 1.0), Ok(()));
        assert!(matches!(bright(1.0, 1e13), Err(FrameError::Exposure(_))));
        assert!(matches!(bright(1.0, f32::NAN), Err(FrameError::Exposure(_))));
    }

    #[test]
    fn another_resolution_sees_the_same_points() {
        // A slanted plane: inverse depth is affine in the image, so resampled points must stay on the plane.
        let camera = camera(64, 48);
        let depth = Image::from_fn(64, 48, |x, y| 1.0 / (0.4 + 0.003 * x as f32 + 0.002 * y as f32));
        let frame = Frame::new(photo(64, 48), depth, camera, 1.0).unwrap();
        let fit = |p: Vec3| {
            let (u, v, z) = camera.project(p).unwrap();
            1.0 / (0.4 + 0.003 * (u - 0.5) + 0.002 * (v - 0.5)) - z
        };
        for (w, h) in [(128, 96), (192, 144)] {
            let other = frame.at_resolution(w, h);
            for (x, y) in [(20, 30), (64, 40), (101, 77)] {
                assert!(fit(other.point(x, y).unwrap()).abs() < 1e-3, "{w} × {h}: {x}, {y}");
            }
        }
    }

    #[test]
    fn working_resolution_is_bounded() {
        let frame = |w: usize, h: usize| Frame {
            camera: camera(w, h),
            photo: photo(w, h),
            depth_m: Image::new(4, 4, vec![1.0; 16]),
            exposure: 1.0,
        };
        for ((w, h), size) in
            [((1920, 1440), (452, 339)), ((1920, 1280), (480, 320)), ((100, 10), (100, 10)), ((1, 1), (1, 1))]
        {
            let working = frame(w, h).working();
            assert_eq!((working.photo.width(), working.photo.height()), size);
            assert_eq!((working.depth_m.width(), working.depth_m.height()), size);
            assert_eq!((working.camera.width as usize, working.camera.height as usize), size);
        }
    }

    #[test]
    fn clipping_is_a_matter_of_low_range_photos() {
        let mut frame = Frame {
            camera: camera(2, 1),
            photo: Photo::Srgb8(Image::new(2, 1, vec![[255, 10, 10], [249, 249, 249]])),
            depth_m: Image::new(2, 1, vec![1.0; 2]),
            exposure: 2.0,
        };
        assert_eq!(frame.clipped().pixels(), &[true, false]);
        assert!((frame.radiance().pixels()[0][0] - 2.0).abs() < 1e-6);
        frame.photo = Photo::Linear(Image::new(2, 1, vec![[1.0, 0.0, 0.0], [0.9, 0.9, f32::NAN]]));
        assert_eq!(frame.clipped().pixels(), &[true, false]);
        assert_eq!(frame.radiance().pixels()[1][2], 0.0);
        frame.photo = Photo::Linear(Image::new(2, 1, vec![[1.0, 0.0, 0.0], [40.0, 0.9, 0.9]]));
        assert_eq!(frame.clipped().pixels(), &[false, false]);
    }
}
