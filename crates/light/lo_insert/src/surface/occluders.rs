//! Real surfaces that may hide an object.

use lo_geometry::{Camera, Plane, Vec3};
use lo_scene::Frame;

use crate::surface::depth_steps::DepthSteps;
use crate::surface::observed_surfaces::{Surface, SurfaceMap};

/// Largest long side of the depth used for occlusion; for larger photos, one depth pixel covers several photo pixels.
const LONG_SIDE: usize = 2048;

/// Smallest distance of hidden points behind a surface's tangent plane: metres, and metres per metre of depth. It
/// keeps depth noise from hiding parts of an object that touches the surface.
const BIAS: (f32, f32) = (0.004, 0.005);

/// Smallest distance where depth is predicted: predicted floors and desks are wavy.
const PREDICTED_BIAS: (f32, f32) = (0.01, 0.025);

/// Real surfaces of the photo as occluders. Photo positions are relative, in [0, 1]².
pub(crate) struct Occluders {
    map: SurfaceMap,
    /// Steps at the depth map's own resolution.
    steps: DepthSteps,
    bias: (f32, f32),
    /// Photo pixels along the side of a depth pixel, at least 1.
    pub depth_pixel: f32,
}

impl Occluders {
    /// Prepares a frame's depth with the normals of `surfaces`; `predicted` if the depth is not measured.
    pub fn new(surfaces: &SurfaceMap, frame: &Frame, predicted: bool) -> Self {
        let steps = DepthSteps::new(&frame.depth_m, &frame.depth_camera());
        let map = surfaces.resampled_with(frame, LONG_SIDE, |depth_m| steps.sharpened(depth_m));
        let depth_pixel = (frame.camera.width as f32 / frame.depth_m.width() as f32).max(1.0);
        Self { map, steps, bias: if predicted { PREDICTED_BIAS } else { BIAS }, depth_pixel }
    }

    /// Returns the surface at a photo position; `None` at holes.
    pub fn at(&self, u: f64, v: f64) -> Option<Surface> {
        self.map.at(u, v)
    }

    /// Returns the depth at a photo position; `None` at holes.
    pub fn depth_m(&self, u: f64, v: f64) -> Option<f32> {
        self.map.reading_m(u, v)
    }

    /// Returns the depth steps and holes.
    pub fn steps(&self) -> &DepthSteps {
        &self.steps
    }

    /// Returns the possible error of a depth.
    pub fn bias_m(&self, depth_m: f32) -> f32 {
        self.bias.0 + self.bias.1 * depth_m
    }

    /// Returns whether a real surface supports a point of an object whose up is `up`; `None` if the point is occluded
    /// or there is no reading.
    pub fn carries(&self, camera: &Camera, point: Vec3, up: Vec3) -> Option<bool> {
        let (u, v, z) = camera.project(point)?;
        let surface = self.at(u / f64::from(camera.width), v / f64::from(camera.height))?;
        let bias_m = self.bias_m(-surface.position_m.z);
        if (surface.position_m - point).dot(up).abs() < 3.0 * bias_m {
            return Some(true);
        }
        (-surface.position_m.z > z as f32 - bias_m).then_some(false)
    }

    /// Returns whether a real surface hides a point, at photo position `(u, v)`, of an object that rests on
    /// `support`. Holes hide nothing.
    pub fn hides(&self, u: f64, v: f64, point: Vec3, support: Option<&Plane>) -> bool {
        if -point.z < self.map.depth_before_m(u, v) {
            return false;
        }
        let Some(surface) = self.map.at(u, v) else { return false };
        let depth_m = -surface.position_m.z;
        if -point.z <= depth_m {
            return false;
        }
        let bias_m = self.bias_m(depth_m);
        if surface.normal.dot(point - surface.position_m) > -bias_m {
            return false;
        }
        // The supporting surface cannot hide an object on it, however noisy its depth is.
        let on_support = |plane: &Plane| {
            plane.signed_distance_m(surface.position_m).abs() < 3.0 * bias_m && plane.signed_distance_m(point) > -bias_m
        };
        !support.is_some_and(on_support)
    }
}
