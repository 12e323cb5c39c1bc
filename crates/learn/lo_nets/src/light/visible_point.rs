use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, Image};
use lo_octree::{Coverage, RadiancePoint};

/// A point of a surface that the photo shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisiblePoint {
    /// World position in metres.
    pub position_m: Vec3,
    /// Linear RGB radiance.
    pub radiance: [f32; 3],
    /// Unit normal; zero where it is not known.
    pub normal: Vec3,
    /// Whether the radiance is that of the surface: false where the photo is clipped, so that it is but a lower bound.
    pub certain: bool,
}

impl VisiblePoint {
    /// The points of a photo (linear RGB; values of at least `white` in any channel count as clipped) with its depth map (metres
    /// along the optical axis, 0 or NaN without a reading) of the same size, and normals in the camera's axes where they are known.
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
        let coverage = if self.certain { Coverage::Seen } else { Coverage::Inferred };
        RadiancePoint { position_m: self.position_m, radiance: self.radiance, coverage }
    }
}
