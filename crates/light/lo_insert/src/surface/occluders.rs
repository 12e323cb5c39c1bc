//! The real surfaces that may stand before an object.

use lo_geometry::{Camera, Plane, Vec3};
use lo_scene::Frame;

use crate::surface::depth_steps::DepthSteps;
use crate::surface::seen_surfaces::{Surface, SurfaceMap};

/// Long side at which the photo's depth hides the object; above it, a depth pixel serves several photo pixels.
const LONG_SIDE: usize = 2048;

/// A real surface hides what lies behind its tangent plane by more than this: depth noise must not bite into an object that
/// touches it. Metres, and metres per metre of depth.
const BIAS: (f32, f32) = (0.004, 0.005);

/// The same where depth was predicted: floors and desks are wavy then.
const PREDICTED_BIAS: (f32, f32) = (0.01, 0.025);

/// Real surfaces of the photo as occluders; positions in the photo are relative ones, in [0, 1]².
pub(crate) struct Occluders {
    map: SurfaceMap,
    /// At the depth map's own resolution.
    steps: DepthSteps,
    bias: (f32, f32),
    /// Photo pixels along the side of a depth pixel, at least 1.
    pub depth_pixel: f32,
}

impl Occluders {
    /// Of a frame's depth, whose `surfaces` have the normals; `predicted` where the depth is no measurement.
    pub fn new(surfaces: &SurfaceMap, frame: &Frame, predicted: bool) -> Self {
        let steps = DepthSteps::new(&frame.depth_m, &frame.depth_camera());
        let map = surfaces.resampled_with(frame, LONG_SIDE, |depth_m| steps.sharpened(depth_m));
        let depth_pixel = (frame.camera.width as f32 / frame.depth_m.width() as f32).max(1.0);
        Self { map, steps, bias: if predicted { PREDICTED_BIAS } else { BIAS }, depth_pixel }
    }

    /// The surface seen at a place of the photo; `None` at holes.
    pub fn at(&self, u: f64, v: f64) -> Option<Surface> {
        self.map.at(u, v)
    }

    /// Depth of what is seen there; `None` at holes.
    pub fn depth_m(&self, u: f64, v: f64) -> Option<f32> {
        self.map.reading_m(u, v)
    }

    /// Depth pixels of steps and holes.
    pub fn steps(&self) -> &DepthSteps {
        &self.steps
    }

    /// What depth may be off by at a depth.
    pub fn bias_m(&self, depth_m: f32) -> f32 {
        self.bias.0 + self.bias.1 * depth_m
    }

    /// Whether a real surface carries a point of an object whose up is `up`: `None` where something stands before that place, or nothing
    /// is known.
    pub fn carries(&self, camera: &Camera, point: Vec3, up: Vec3) -> Option<bool> {
        let (u, v, z) = camera.project(point)?;
        let surface = self.at(u / f64::from(camera.width), v / f64::from(camera.height))?;
        let bias_m = self.bias_m(-surface.position_m.z);
        if (surface.position_m - point).dot(up).abs() < 3.0 * bias_m {
            return Some(true);
        }
        (-surface.position_m.z > z as f32 - bias_m).then_some(false)
    }

    /// Whether a real surface stands before a point, seen at photo position `(u, v)`, of an object that stands on `support`. Holes
    /// hide nothing.
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
        // The surface that carries the object cannot hide what stands on it, however noisy its depth.
        let on_support = |plane: &Plane| {
            plane.signed_distance_m(surface.position_m).abs() < 3.0 * bias_m && plane.signed_distance_m(point) > -bias_m
        };
        !support.is_some_and(on_support)
    }
}
