use lo_geometry::{Camera, Quat, Ray, Vec2, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage};

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

impl View {
    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Pinhole { camera, .. } => (camera.width as usize, camera.height as usize),
            Self::Panorama { height, .. } => (2 * height, *height),
        }
    }

    /// Where it is taken from.
    pub fn pose(&self) -> &Pose {
        match self {
            Self::Pinhole { pose, .. } | Self::Panorama { pose, .. } => pose,
        }
    }

    /// The ray through a place of the image, in pixels (centres at +0.5).
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

    /// The same with so many times as many pixels each way.
    pub(crate) fn finer(&self, times: usize) -> Self {
        match *self {
            Self::Pinhole { pose, camera } => {
                let times = times as u32;
                Self::Pinhole { pose, camera: camera.resized(camera.width * times, camera.height * times) }
            }
            Self::Panorama { pose, height } => Self::Panorama { pose, height: height * times },
        }
    }

    /// Whether the left edge goes on at the right one.
    pub(crate) fn wraps(&self) -> bool {
        matches!(self, Self::Panorama { .. })
    }

    /// Where a place of the world lies in the image, in pixels (centres at +0.5); nothing behind a camera.
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

    /// Angle between neighbouring pixels in the middle of the image, radians.
    pub fn pixel_angle_rad(&self) -> f32 {
        match self {
            Self::Pinhole { camera, .. } => camera.pixel_angle_rad(),
            Self::Panorama { height, .. } => std::f32::consts::PI / *height as f32,
        }
    }

    /// What the depth map holds for a surface at `distance_m` along the ray of direction `direction`.
    pub(crate) fn depth_m(&self, distance_m: f32, direction: Vec3) -> f32 {
        match self {
            Self::Pinhole { pose, .. } => distance_m * direction.dot(pose.rotation * Vec3::NEG_Z),
            Self::Panorama { .. } => distance_m,
        }
    }
}

/// A rendered view; all images have its size.
#[derive(Clone, Debug)]
pub struct RenderedView {
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
