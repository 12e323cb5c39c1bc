use lo_geometry::{Camera, DMat3, DQuat, DVec3, Distortion, RigidTransform};

use super::error::PoseError;
use super::values::checked_position;

/// Largest deviation from unit length and from orthogonality; files have four digits or more.
const TOLERANCE: f64 = 0.01;

/// Pose of a camera, with further data of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// File name of the photo, if poses are identified by it.
    pub file: Option<String>,
    /// Time stamp in seconds, if poses are identified by it.
    pub time_s: Option<f64>,
    /// Frame number, if poses are identified by it; `None` in a USD file for a camera that does not move.
    pub frame: Option<i64>,
    /// Rotation from the camera's axes (ours) to the world's.
    pub(super) rotation: DMat3,
    /// World position of the camera, metres; in the model's arbitrary unit for COLMAP.
    pub position_m: DVec3,
    /// Intrinsics, if given.
    pub lens: Option<Lens>,
    /// Distortion of the lens, if given and not zero.
    pub distortion: Option<Distortion>,
    /// Exposure relative to the other photos, stops; +1 is twice as bright.
    pub exposure_ev: Option<f64>,
}

/// Intrinsics of a camera as given in a pose file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// Focal lengths and principal point.
    Pixels {
        /// `fx fy cx cy`, pixels.
        intrinsics: [f64; 4],
        /// Size of the image that they refer to; the photo's own if absent.
        size: Option<(u32, u32)>,
    },
    /// Horizontal field of view in degrees, for a centred lens with square pixels.
    HfovDeg(f64),
    /// Vertical field of view in degrees, for a centred lens with square pixels.
    VfovDeg(f64),
    /// Focal length and film back, all in one unit, with square pixels.
    FilmBack {
        /// Focal length.
        focal: f64,
        /// Width of the film back, which is the image's width.
        width: f64,
        /// Centre of the image relative to the optical axis, to the right and up.
        offset: [f64; 2],
    },
}

/// Largest difference in aspect ratio between a photo and the size in the file.
const ASPECT_TOLERANCE: f64 = 0.01;

impl Lens {
    /// Returns the camera of a photo of this size. `file` and `photo` are names for errors.
    ///
    /// # Errors
    /// If the intrinsics are for an image of another aspect ratio, or are invalid.
    pub fn camera(&self, width: u32, height: u32, file: &str, photo: &str) -> Result<Camera, PoseError> {
        let names = || (file.to_owned(), photo.to_owned());
        let camera = match *self {
            Self::HfovDeg(hfov_deg) => Camera::from_hfov_deg(hfov_deg, width, height),
            Self::VfovDeg(vfov_deg) => {
                let [cx, cy] = [width, height].map(|side| 0.5 * f64::from(side));
                let focal_px = cy / (0.5 * vfov_deg.to_radians()).tan();
                Camera::new(focal_px, focal_px, cx, cy, width, height)
            }
            Self::FilmBack { focal, width: film_width, offset: [right, up] } => {
                let scale = f64::from(width) / film_width;
                let (cx, cy) = (0.5 * f64::from(width) - scale * right, 0.5 * f64::from(height) + scale * up);
                Camera::new(scale * focal, scale * focal, cx, cy, width, height)
            }
            Self::Pixels { intrinsics: [fx, fy, cx, cy], size } => {
                let stated = size.unwrap_or((width, height));
                let aspect = |(width, height): (u32, u32)| f64::from(width) / f64::from(height);
                if (aspect(stated) / aspect((width, height))).ln().abs() > ASPECT_TOLERANCE {
                    let (file, photo) = names();
                    return Err(PoseError::PictureSize { file, photo, stated, found: (width, height) });
                }
                Camera::new(fx, fy, cx, cy, stated.0, stated.1).map(|camera| camera.resized(width, height))
            }
        };
        let (file, photo) = names();
        camera.map_err(|source| PoseError::Camera { file, photo, source })
    }
}

/// Convention of a camera's axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Axes {
    /// OpenGL (ours): +X right, +Y up, looking along −Z.
    OpenGl,
    /// OpenCV: +X right, +Y down, looking along +Z.
    OpenCv,
}

impl Axes {
    fn turned(self, rotation: DMat3) -> DMat3 {
        match self {
            Self::OpenGl => rotation,
            Self::OpenCv => rotation * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
        }
    }
}

impl Pose {
    /// Creates a pose from a 4 × 4 or 3 × 4 matrix in row-major order.
    pub(super) fn from_rows(rows: &[f64], axes: Axes, file: &str, pose: &str) -> Result<Self, PoseError> {
        let wrong = |what: String| PoseError::NotRigid { file: file.to_owned(), pose: pose.to_owned(), what };
        if rows.len() != 16 && rows.len() != 12 {
            return Err(wrong(format!("{} numbers instead of 4 × 4", rows.len())));
        }
        if let Some(&value) = rows.iter().find(|v| !v.is_finite()) {
            return Err(PoseError::Value { file: file.to_owned(), pose: pose.to_owned(), value });
        }
        if rows.len() == 16 && rows[12..].iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(a, b)| (a - b).abs() > 1e-6) {
            let last = &rows[12..];
            return Err(wrong(format!("the last row is {last:?}, not 0 0 0 1; is the matrix transposed?")));
        }
        let row = |i: usize| DVec3::new(rows[4 * i], rows[4 * i + 1], rows[4 * i + 2]);
        let matrix = DMat3::from_cols(row(0), row(1), row(2)).transpose();
        Self::from_matrix(matrix, DVec3::new(rows[3], rows[7], rows[11]), axes, file, pose)
    }

    /// Creates a pose from a quaternion, real part last.
    pub(super) fn from_quaternion(
        xyzw: [f64; 4],
        position_m: DVec3,
        axes: Axes,
        file: &str,
        pose: &str,
    ) -> Result<Self, PoseError> {
        if let Some(value) = xyzw.into_iter().find(|v| !v.is_finite()) {
            return Err(PoseError::Value { file: file.to_owned(), pose: pose.to_owned(), value });
        }
        let quaternion = DQuat::from_array(xyzw);
        let length = quaternion.length();
        if (length - 1.0).abs() > TOLERANCE {
            let what = format!("the quaternion has length {length:.4}, not 1");
            return Err(PoseError::NotRigid { file: file.to_owned(), pose: pose.to_owned(), what });
        }
        Self::from_matrix(DMat3::from_quat(quaternion.normalize()), position_m, axes, file, pose)
    }

    /// Creates a pose from a rotation matrix from the camera's axes to the world's.
    pub(super) fn from_matrix(
        matrix: DMat3,
        position_m: DVec3,
        axes: Axes,
        file: &str,
        pose: &str,
    ) -> Result<Self, PoseError> {
        let position_m = checked_position(position_m, file, pose)?;
        let (file, pose) = (file.to_owned(), pose.to_owned());
        let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
        let off = |length: &f64| (length - 1.0).abs();
        let lengths = columns.map(|c| c.length());
        let farthest = lengths.into_iter().max_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(1.0);
        if farthest.is_nan() || off(&farthest) > TOLERANCE {
            return Err(PoseError::Scale { file, pose, scale: farthest });
        }
        let cosine =
            [(0, 1), (1, 2), (2, 0)].map(|(i, j)| columns[i].dot(columns[j]).abs()).into_iter().fold(0.0, f64::max);
        if cosine > TOLERANCE {
            let what = format!("two of its axes meet at {:.1} degrees", cosine.acos().to_degrees());
            return Err(PoseError::NotRigid { file, pose, what });
        }
        if matrix.determinant() < 0.0 {
            return Err(PoseError::Mirror { file, pose });
        }
        let rotation = DMat3::from_quat(DQuat::from_mat3(&matrix).normalize());
        let rotation = axes.turned(rotation);
        Ok(Self {
            file: None,
            time_s: None,
            frame: None,
            rotation,
            position_m,
            lens: None,
            distortion: None,
            exposure_ev: None,
        })
    }

    /// Returns the transform from another camera's axes to this one's.
    pub fn this_from(&self, other: &Self) -> RigidTransform {
        let back = self.rotation.transpose();
        let rotation = DQuat::from_mat3(&(back * other.rotation)).normalize();
        RigidTransform {
            rotation: rotation.as_quat(),
            translation_m: (back * (other.position_m - self.position_m)).as_vec3(),
        }
    }

    /// Rotates a world direction to this camera's axes.
    pub fn camera_from_world(&self, direction: lo_geometry::Vec3) -> lo_geometry::Vec3 {
        (self.rotation.transpose() * direction.as_dvec3()).as_vec3()
    }
}
