use lo_geometry::{Camera, Quat, Ray, Vec2, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage};

/// Position and orientation of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// World position, in metres.
    pub position: Vec3,
    /// World direction = rotation · camera direction. The camera looks along −Z, +Y is up in the image.
    pub rotation: Quat,
}

/// View to render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// Perspective image.
    Pinhole {
        /// Pose of the camera.
        pose: Pose,
        /// Intrinsics and image size.
        camera: Camera,
    },
    /// Equirectangular panorama, twice as wide as high.
    Panorama {
        /// Pose of the camera.
        pose: Pose,
        /// Image height in pixels, from zenith to nadir.
        height: usize,
    },
}

impl View {
    /// Returns width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Pinhole { camera, .. } => (camera.width as usize, camera.height as usize),
            Self::Panorama { height, .. } => (2 * height, *height),
        }
    }

    /// Returns the pose of the camera.
    pub fn pose(&self) -> &Pose {
        match self {
            Self::Pinhole { pose, .. } | Self::Panorama { pose, .. } => pose,
        }
    }

    /// Returns the ray through an image point, in pixels (pixel centres at +0.5).
    pub fn ray(&self, u: f32, v: f32) -> Ray {
        let direction = match self {
            Self::Pinhole { camera, .. } => camera.direction(f64::from(u), f64::from(v)),
            Self::Panorama { height, .. } => {
                lo_geometry::direction_from_uv(Vec2::new(u / (2 * height) as f32, v / *height as f32))
            }
        };
        let pose = self.pose();
        Ray { origin: pose.position, direction: (pose.rotation * direction).normalize() }
    }

    /// Returns the view with `times` as many pixels along each axis.
    pub(crate) fn supersampled(&self, times: usize) -> Self {
        match *self {
            Self::Pinhole { pose, camera } => {
                let times = times as u32;
                Self::Pinhole { pose, camera: camera.resized(camera.width * times, camera.height * times) }
            }
            Self::Panorama { pose, height } => Self::Panorama { pose, height: height * times },
        }
    }

    /// Whether the left and right edges are adjacent.
    pub(crate) fn wraps(&self) -> bool {
        matches!(self, Self::Panorama { .. })
    }

    /// Projects a world position to the image, in pixels (pixel centres at +0.5). `None` behind the camera.
    pub(crate) fn pixel(&self, position: Vec3) -> Option<Vec2> {
        let pose = self.pose();
        let local = pose.rotation.conjugate() * (position - pose.position);
        match self {
            Self::Pinhole { camera, .. } => camera.project(local).map(|(u, v, _)| Vec2::new(u as f32, v as f32)),
            Self::Panorama { height, .. } => {
                let uv = lo_geometry::uv_from_direction(local.try_normalize()?);
                Some(uv * Vec2::new((2 * height) as f32, *height as f32))
            }
        }
    }

    /// Returns the angle between neighbouring pixels in the middle of the image, in radians.
    pub fn pixel_angle_rad(&self) -> f32 {
        match self {
            Self::Pinhole { camera, .. } => camera.pixel_angle_rad(),
            Self::Panorama { height, .. } => std::f32::consts::PI / *height as f32,
        }
    }

    /// Returns the depth-map value of a surface at `distance_m` along the unit `direction`.
    pub(crate) fn depth_m(&self, distance_m: f32, direction: Vec3) -> f32 {
        match self {
            Self::Pinhole { pose, .. } => distance_m * direction.dot(pose.rotation * Vec3::NEG_Z),
            Self::Panorama { .. } => distance_m,
        }
    }
}

/// Rendered view. All images have the view's size.
#[derive(Clone, Debug)]
pub struct RenderedView {
    /// Linear radiance in the world's units, anti-aliased.
    pub radiance: RadianceImage,
    /// Depth in metres of the first surface that is not a clear pane, at the pixel's centre. Along the optical axis
    /// (pinhole) or from the centre (panorama). 0 where there is no surface.
    pub depth_m: DepthMap,
    /// Unit shading normals in camera axes, towards the camera. 0 where there is no surface.
    pub normal: Image<[f32; 3]>,
    /// Base colour, diffuse or specular.
    pub albedo: Image<[f32; 3]>,
    /// Whether the first surface is a clear pane or a mirror, which depth sensors cannot measure.
    pub specular: Image<bool>,
}
