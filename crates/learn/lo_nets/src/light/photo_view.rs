use lo_geometry::{Camera, RigidTransform, Vec3};

/// Camera and pose of one of several photos of a room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotoView {
    /// Camera, in pixels of any resolution.
    pub camera: Camera,
    /// Transform from the octree's frame to the camera's axes.
    pub camera_from_world: RigidTransform,
    /// Number of visible points that belong to this photo. Points are grouped by photo.
    pub points: usize,
}

impl PhotoView {
    /// Creates the view of a single photo, with its camera at the origin.
    pub const fn only(camera: Camera, points: usize) -> Self {
        Self { camera, camera_from_world: RigidTransform::IDENTITY, points }
    }

    /// Projects a point of the octree's frame to image position and depth. Returns `None` at or behind the camera.
    pub(crate) fn project(&self, point: Vec3) -> Option<(f64, f64, f64)> {
        self.camera.project(self.camera_from_world.point(point))
    }

    /// Reports whether a point lies within the view, occluded or not.
    pub(crate) fn contains(&self, point: Vec3) -> bool {
        self.project(point).is_some_and(|(u, v, _)| self.camera.contains(u, v))
    }
}
