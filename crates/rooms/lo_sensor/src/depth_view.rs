use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, Image, luminance};

/// True geometry and materials in front of a depth sensor. All images have the camera's size.
#[derive(Clone, Copy, Debug)]
pub struct DepthView<'a> {
    /// Camera intrinsics.
    pub camera: &'a Camera,
    /// True depth along the optical axis, in metres. 0 where there is no surface.
    pub depth_m: &'a DepthMap,
    /// Unit normals in camera axes, towards the camera. 0 where there is no surface.
    pub normal: &'a Image<[f32; 3]>,
    /// Base colour.
    pub albedo: &'a Image<[f32; 3]>,
    /// Whether a pixel shows a clear pane or a mirror.
    pub specular: &'a Image<bool>,
}

/// Nearest reading of structured light and time of flight, in metres.
pub(crate) const NEAREST_M: f32 = 0.4;
/// Relative depth difference of neighbouring pixels on different surfaces.
const EDGE: f32 = 0.05;

impl DepthView<'_> {
    /// Returns the cosine between the line of sight and the normal, and the light returned by a unit source at the
    /// camera, relative to a white wall at 1 m. `None` where no light returns to the sensor.
    pub(crate) fn returned(&self, x: usize, y: usize) -> Option<(f32, f32)> {
        let z = self.depth_m[(x, y)];
        if z <= 0.0 || self.specular[(x, y)] {
            return None;
        }
        let direction = self.camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        let cosine = (-direction.dot(Vec3::from_array(self.normal[(x, y)]))).clamp(0.0, 1.0);
        let distance = -z / direction.z;
        Some((cosine, luminance(self.albedo[(x, y)]) * cosine / (distance * distance)))
    }

    /// Returns the depth of the neighbouring pixel on another surface, the one that differs most.
    pub(crate) fn across_edge(&self, x: usize, y: usize) -> Option<f32> {
        let z = self.depth_m[(x, y)];
        [(-1isize, 0isize), (1, 0), (0, -1), (0, 1)]
            .into_iter()
            .filter_map(|(dx, dy)| {
                let at = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
                (at.0 < self.depth_m.width() && at.1 < self.depth_m.height()).then(|| self.depth_m[at])
            })
            .filter(|&other| other > 0.0 && (other - z).abs() > EDGE * z.min(other))
            .max_by(|a, b| (a - z).abs().total_cmp(&(b - z).abs()))
    }
}
