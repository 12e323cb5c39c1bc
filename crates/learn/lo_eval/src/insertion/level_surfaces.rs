//! Level surfaces of a generated room on which a photo can show objects.

use lo_geometry::{Ray, Vec3};
use lo_mesh::PreparedModel;
use lo_synth::{CameraPose, Interior};

/// Range of depth, metres along the optical axis.
const DEPTH_M: (f32, f32) = (0.9, 4.5);

/// Length of rays, metres.
const FAR_M: f32 = 100.0;

/// Largest unevenness of a surface that carries an object, metres.
const UNEVEN_M: f32 = 0.005;

/// Margin at the photo's border, as a share of its width.
const BORDER_SHARE: f64 = 0.02;

/// Queries for places of objects on the level surfaces of a generated room, visible in a photo.
#[derive(Clone, Copy, Debug)]
pub struct LevelSurfaces<'a> {
    /// The room.
    pub interior: &'a Interior,
    /// Its model.
    pub model: &'a PreparedModel,
    /// The photo's camera.
    pub view: &'a CameraPose,
}

impl LevelSurfaces<'_> {
    /// Returns the point in the room at a pixel and its depth along the optical axis, in metres. `None` if the surface
    /// is not level, too near or too far.
    pub fn at_pixel(&self, [u, v]: [f64; 2]) -> Option<(Vec3, f32)> {
        let pose = &self.view.pose;
        let direction = (pose.rotation * self.view.camera.direction(u, v)).normalize();
        let hit = self.model.intersect_both_sides(&Ray { origin: pose.position, direction }, FAR_M)?;
        let axis_m = hit.distance_m * direction.dot(pose.rotation * Vec3::NEG_Z);
        let is_level = normal(self.model, hit.triangle).y.abs() > 0.999;
        let is_in_range = (DEPTH_M.0..DEPTH_M.1).contains(&axis_m);
        (is_in_range && is_level).then(|| (pose.position + direction * hit.distance_m, axis_m))
    }

    /// Whether a surface carries the rim of a disc around a point on it.
    pub fn carries(&self, base_m: Vec3, radius_m: f32) -> bool {
        (0..8).all(|i| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / 8.0).sin_cos();
            let origin = base_m + radius_m * Vec3::new(cos, 0.5, sin);
            let hit = self.model.intersect_both_sides(&Ray { origin, direction: Vec3::NEG_Y }, FAR_M);
            hit.is_some_and(|hit| (hit.distance_m - 0.5 * radius_m).abs() < UNEVEN_M)
        })
    }

    /// Whether a point in the room is in the photo, away from its border, and no surface hides it. Surfaces within
    /// `tolerance_m` of the point do not hide it.
    pub fn shows(&self, point: Vec3, tolerance_m: f32) -> bool {
        let (camera, pose) = (&self.view.camera, &self.view.pose);
        let inside = camera.project(pose.rotation.inverse() * (point - pose.position)).is_some_and(|(u, v, _)| {
            let margin = BORDER_SHARE * f64::from(camera.width);
            u > margin && v > margin && u < camera.width as f64 - margin && v < camera.height as f64 - margin
        });
        let to = point - pose.position;
        let ray = Ray { origin: pose.position, direction: to.normalize() };
        inside && self.model.intersect_both_sides(&ray, to.length() - tolerance_m).is_none()
    }
}

/// Returns the unit normal of a triangle; 0 if it is degenerate.
pub(crate) fn normal(model: &PreparedModel, triangle: u32) -> Vec3 {
    let model = model.model();
    let [a, b, c] = model.triangles[triangle as usize].map(|v| model.positions[v as usize]);
    (b - a).cross(c - a).normalize_or_zero()
}
