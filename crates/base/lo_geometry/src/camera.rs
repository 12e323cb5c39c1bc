use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A pinhole camera at the world's origin, looking along −Z.
///
/// Lengths are in pixels of an image of `width` × `height`. Pixel centres are at +0.5; `u` points right and `v` down.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Camera {
    /// Horizontal focal length in pixels.
    pub fx: f64,
    /// Vertical focal length in pixels.
    pub fy: f64,
    /// Horizontal coordinate of the principal point in pixels.
    pub cx: f64,
    /// Vertical coordinate of the principal point in pixels.
    pub cy: f64,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
}

/// Smallest focal length, as a share of the image's shorter side: 177° across it.
const MIN_FOCAL: f64 = 0.02;

/// Largest focal length, as a multiple of the image's longer side: 0.06° across it.
const MAX_FOCAL: f64 = 1000.0;

/// Longest side of an image, pixels.
const MAX_SIDE: u32 = 1 << 20;

/// Errors of invalid intrinsics.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// A focal length is not that of a pinhole camera with an image of this size.
    #[error(
        "focal lengths of a {width} × {height} image must be from {} to {} pixels, got fx = {fx}, fy = {fy}",
        MIN_FOCAL * f64::from(*width.min(height)), MAX_FOCAL * f64::from(*width.max(height))
    )]
    FocalLength {
        /// Horizontal focal length as given.
        fx: f64,
        /// Vertical focal length as given.
        fy: f64,
        /// Image width in pixels.
        width: u32,
        /// Image height in pixels.
        height: u32,
    },
    /// The principal point is outside the image.
    #[error(
        "the principal point ({cx}, {cy}) is outside the {width} × {height} image; \
         give the intrinsics at the photo's full resolution"
    )]
    PrincipalPoint {
        /// Horizontal coordinate as given.
        cx: f64,
        /// Vertical coordinate as given.
        cy: f64,
        /// Image width in pixels.
        width: u32,
        /// Image height in pixels.
        height: u32,
    },
    /// The image has no pixels, or too many.
    #[error("the image has {width} × {height} pixels; each side must have 1 to {MAX_SIDE}")]
    Size {
        /// Image width in pixels.
        width: u32,
        /// Image height in pixels.
        height: u32,
    },
    /// The horizontal field of view, in degrees, is outside the supported range.
    #[error("the horizontal field of view must be between 1 and 170 degrees, got {0}")]
    FieldOfView(f64),
}

impl Camera {
    /// Creates a camera from intrinsics in pixels.
    ///
    /// # Errors
    /// [`CameraError`] for an empty image, a focal length of no pinhole camera (below 2 % of the image's shorter side
    /// or above 1000 times its longer side), or a principal point outside the image.
    pub fn new(fx: f64, fy: f64, cx: f64, cy: f64, width: u32, height: u32) -> Result<Self, CameraError> {
        if ![width, height].iter().all(|side| (1..=MAX_SIDE).contains(side)) {
            return Err(CameraError::Size { width, height });
        }
        let focal_range = MIN_FOCAL * f64::from(width.min(height))..=MAX_FOCAL * f64::from(width.max(height));
        if ![fx, fy].iter().all(|focal| focal_range.contains(focal)) {
            return Err(CameraError::FocalLength { fx, fy, width, height });
        }
        let inside = (0.0..=f64::from(width)).contains(&cx) && (0.0..=f64::from(height)).contains(&cy);
        if !inside {
            return Err(CameraError::PrincipalPoint { cx, cy, width, height });
        }
        Ok(Self { fx, fy, cx, cy, width, height })
    }

    /// Creates a camera with square pixels and a centred principal point from its horizontal field of view in degrees.
    ///
    /// # Errors
    /// Those of [`Camera::new`], and [`CameraError::FieldOfView`] for an angle outside 1° to 170°.
    pub fn from_hfov_deg(hfov_deg: f64, width: u32, height: u32) -> Result<Self, CameraError> {
        if !(1.0..=170.0).contains(&hfov_deg) {
            return Err(CameraError::FieldOfView(hfov_deg));
        }
        let focal = 0.5 * f64::from(width) / (0.5 * hfov_deg.to_radians()).tan();
        Self::new(focal, focal, 0.5 * f64::from(width), 0.5 * f64::from(height), width, height)
    }

    /// Half of the image's longer side divided by the focal length: the tangent of half the field of view along it.
    #[inline]
    pub fn half_extent(&self) -> f64 {
        0.5 * f64::from(self.width.max(self.height)) / self.fx
    }

    /// Horizontal field of view in degrees.
    #[inline]
    pub fn hfov_deg(&self) -> f64 {
        let left = (self.cx / self.fx).atan();
        let right = ((f64::from(self.width) - self.cx) / self.fx).atan();
        (left + right).to_degrees()
    }

    /// Rescales the intrinsics to another resolution with the same field of view.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let sx = f64::from(width) / f64::from(self.width);
        let sy = f64::from(height) / f64::from(self.height);
        Self { fx: self.fx * sx, fy: self.fy * sy, cx: self.cx * sx, cy: self.cy * sy, width, height }
    }

    /// Returns the world point of image position `(u, v)` at depth `depth_m` (distance along the optical axis).
    #[inline]
    pub fn unproject(&self, u: f64, v: f64, depth_m: f64) -> Vec3 {
        Vec3::new(
            ((u - self.cx) / self.fx * depth_m) as f32,
            (-(v - self.cy) / self.fy * depth_m) as f32,
            -depth_m as f32,
        )
    }

    /// Returns the image position and depth `(u, v, depth_m)` of a world point; `None` at or behind the camera.
    #[inline]
    pub fn project(&self, point: Vec3) -> Option<(f64, f64, f64)> {
        let depth_m = -f64::from(point.z);
        if depth_m <= 0.0 {
            return None;
        }
        let u = self.fx * f64::from(point.x) / depth_m + self.cx;
        let v = -self.fy * f64::from(point.y) / depth_m + self.cy;
        Some((u, v, depth_m))
    }

    /// Whether image position `(u, v)` is inside the image.
    #[inline]
    pub fn contains(&self, u: f64, v: f64) -> bool {
        (0.0..f64::from(self.width)).contains(&u) && (0.0..f64::from(self.height)).contains(&v)
    }

    /// Unit direction from the camera through image position `(u, v)`.
    #[inline]
    pub fn direction(&self, u: f64, v: f64) -> Vec3 {
        self.unproject(u, v, 1.0).normalize()
    }

    /// Angle between the rays of neighbouring pixels at the principal point, in radians.
    #[inline]
    pub fn pixel_angle_rad(&self) -> f32 {
        (1.0 / self.fx.min(self.fy)).atan() as f32
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn forward_is_minus_z_and_v_points_down() {
        let camera = Camera::from_hfov_deg(90.0, 640, 480).unwrap();
        assert!((camera.direction(320.0, 240.0) - Vec3::NEG_Z).length() < 1e-6);
        assert!(camera.direction(640.0, 240.0).x > 0.7);
        assert!(camera.direction(320.0, 480.0).y < 0.0);
        assert!((camera.hfov_deg() - 90.0).abs() < 1e-9);
    }

    #[test]
    fn bad_intrinsics_are_named() {
        assert!(matches!(Camera::new(0.0, 1.0, 0.0, 0.0, 4, 4), Err(CameraError::FocalLength { .. })));
        assert!(matches!(Camera::new(f64::NAN, 1.0, 0.0, 0.0, 4, 4), Err(CameraError::FocalLength { .. })));
        assert!(matches!(Camera::new(1.0, 1.0, 9.0, 0.0, 4, 4), Err(CameraError::PrincipalPoint { .. })));
        assert!(matches!(Camera::new(1.0, 1.0, f64::NAN, 0.0, 4, 4), Err(CameraError::PrincipalPoint { .. })));
        assert!(matches!(Camera::from_hfov_deg(180.0, 4, 4), Err(CameraError::FieldOfView(_))));
        assert!(matches!(Camera::new(1.0, 1.0, 0.0, 0.0, 0, 4), Err(CameraError::Size { .. })));
        assert!(matches!(Camera::new(1.0, 1.0, 0.0, 0.0, 4, u32::MAX), Err(CameraError::Size { .. })));
        // Both ends of the range of focal lengths of a 640 × 480 image: 9.6 and 640,000 pixels.
        for focal in [0.001, 9.59, 640_001.0, f64::INFINITY, -500.0] {
            let error = Camera::new(focal, 500.0, 320.0, 240.0, 640, 480).unwrap_err().to_string();
            let range = "focal lengths of a 640 × 480 image must be from 9.6 to 640000 pixels";
            assert!(error.starts_with(range), "{error}");
            assert!(Camera::new(500.0, focal, 320.0, 240.0, 640, 480).is_err());
        }
        assert!(Camera::new(9.6, 640_000.0, 320.0, 240.0, 640, 480).is_ok());
        assert!(Camera::from_hfov_deg(170.0, 480, 640).is_ok() && Camera::from_hfov_deg(1.0, 640, 480).is_ok());
    }

    proptest! {
        #[test]
        fn project_inverts_unproject(u in 0.0..640.0f64, v in 0.0..480.0f64, z in 0.1..50.0f64, scale in 0.1..4.0f64) {
            let camera = Camera::new(525.0, 520.0, 319.5, 239.5, 640, 480).unwrap();
            let (pu, pv, pz) = camera.project(camera.unproject(u, v, z)).unwrap();
            // f32 points: 2^-24 relative of up to 640 pixels, with a few roundings
            prop_assert!((pu - u).abs() < 1e-3 && (pv - v).abs() < 1e-3 && (pz - z).abs() < 1e-5 * z);
            let (w, h) = ((640.0 * scale) as u32, (480.0 * scale) as u32);
            let resized = camera.resized(w, h);
            let (su, sv) = (u * f64::from(w) / 640.0, v * f64::from(h) / 480.0);
            prop_assert!((resized.direction(su, sv) - camera.direction(u, v)).length() < 1e-5);
        }
    }
}
