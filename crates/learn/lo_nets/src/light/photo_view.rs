use lo_geometry::{Camera, RigidTransform, Vec3};

/// A camera that took one of several photos of a room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotoView {
    /// The lens, in pixels of any resolution.
    pub camera: Camera,
    /// From the octree's frame to the camera's axes.
    pub camera_from_world: RigidTransform,
    /// How many of the visible points are its photo's: those of the photos lie one after another.
    pub points: usize,
}

impl PhotoView {
    /// A camera at the origin that took the only photo.
    pub const fn only(camera: Camera, points: usize) -> Self {
        Self { camera, camera_from_world: RigidTransform::IDENTITY, points }
    }

    /// Place in the image and depth of a point of the octree's frame; `None` at or behind the camera.
    pub(crate) fn project(&self, point: Vec3) -> Option<(f64, f64, f64)> {
        self.camera.project(self.camera_from_world.point(point))
    }

    /// Whether a point lies in the view, hidden or not.
    pub(crate) fn holds(&self, point: Vec3) -> bool {
        self.project(point).is_some_and(|(u, v, _)| self.camera.contains(u, v))
    }
}
