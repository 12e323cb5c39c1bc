use geometry::{Camera, Vec3};
use imaging::{DepthMap, Photo};

/// A photo with depth and camera.
///
/// Photo and depth show the same field of view; their resolutions may differ until [`Frame::at_resolution`] makes them equal.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Pinhole camera, in pixels of the photo.
    pub camera: Camera,
    /// The photo.
    pub photo: Photo,
    /// Depth along the optical axis in metres; 0 where there is no reading.
    pub depth_m: DepthMap,
    /// Factor by which linear photo values are multiplied to give radiance (1 unless the user says otherwise).
    pub exposure: f32,
}

impl Frame {
    /// World point seen at the centre of depth pixel `(x, y)`; `None` where there is no reading.
    pub fn point(&self, x: usize, y: usize) -> Option<Vec3> {
        let depth_m = self.depth_m[(x, y)];
        let camera = self.camera.resized(self.depth_m.width() as u32, self.depth_m.height() as u32);
        (depth_m > 0.0).then(|| camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(depth_m)))
    }
}
