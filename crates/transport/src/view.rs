use geometry::{Camera, Quat, Vec3};
use imaging::{DepthMap, Image, RadianceImage};

/// Where a camera stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// World position, metres.
    pub position: Vec3,
    /// World direction = rotation · camera direction; the camera looks along −Z, +Y is up in the picture.
    pub rotation: Quat,
}

/// What to render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// A photo.
    Pinhole {
        /// Where it is taken from.
        pose: Pose,
        /// Lens and size.
        camera: Camera,
    },
    /// An equirectangular panorama, twice as wide as high.
    Panorama {
        /// Where it is taken from.
        pose: Pose,
        /// Pixels from zenith to nadir.
        height: usize,
    },
}

/// A rendered view; all images have its size.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// Linear radiance, in the world's units, anti-aliased.
    pub radiance: RadianceImage,
    /// Metres: along the optical axis (pinhole) or from the centre (panorama), of the first surface that is not a
    /// clear pane, at the pixel's centre; 0 where there is none.
    pub depth_m: DepthMap,
    /// Unit shading normals in camera axes, towards the camera; 0 where there is no surface.
    pub normal: Image<[f32; 3]>,
    /// Diffuse or specular base colour.
    pub albedo: Image<[f32; 3]>,
    /// Whether the first surface is a clear pane or a mirror: no depth sensor measures these rightly.
    pub specular: Image<bool>,
}
