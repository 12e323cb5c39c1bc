use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, Image};
use lo_octree::{Provenance, RadiancePoint};

/// A point of a surface observed in a photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisiblePoint {
    /// World position in metres.
    pub position_m: Vec3,
    /// Linear RGB radiance.
    pub radiance: [f32; 3],
    /// Unit normal, or zero where unknown.
    pub normal: Vec3,
    /// Whether radiance is exact. Where the photo is clipped, it is only a lower bound.
    pub certain: bool,
}

impl VisiblePoint {
    /// Collects the points of a linear RGB photo with a depth map of the same size.
    ///
    /// Values of at least `white` in any channel count as clipped. Depth is in metres along the optical axis, 0 or NaN
    /// without a reading. Normals, where known, are in the camera's axes.
    ///
    /// # Panics
    /// Where the images differ in size.
    pub fn from_photo(
        photo: &Image<[f32; 3]>,
        depth_m: &DepthMap,
        normal: Option<&Image<[f32; 3]>>,
        camera: &Camera,
        white: f32,
    ) -> Vec<Self> {
        let size = (photo.width(), photo.height());
        assert_eq!(size, (depth_m.width(), depth_m.height()), "photo and depth have the same size");
        assert!(normal.is_none_or(|n| (n.width(), n.height()) == size), "photo and normals have the same size");
        let camera = camera.resized(photo.width() as u32, photo.height() as u32);
        let pixels = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
        let with_depth = pixels.filter(|&at| depth_m[at].is_finite() && depth_m[at] > 0.0);
        with_depth
            .map(|at| Self {
                position_m: camera.unproject(at.0 as f64 + 0.5, at.1 as f64 + 0.5, f64::from(depth_m[at])),
                radiance: photo[at],
                normal: normal.map_or(Vec3::ZERO, |normal| Vec3::from(normal[at])),
                certain: photo[at].iter().all(|&c| c < white),
            })
            .collect()
    }

    pub(crate) fn radiance_point(&self) -> RadiancePoint {
        let provenance = if self.certain { Provenance::Observed } else { Provenance::Inferred };
        RadiancePoint { position_m: self.position_m, radiance: self.radiance, provenance }
    }
}
