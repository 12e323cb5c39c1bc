//! Coordinate frames, cameras, the octree's cube, directions on the sphere and fixed sample patterns.
//!
//! The world frame is right-handed, in metres: +X right, +Y up, the camera at the origin looking along −Z.
//! This crate is plain mathematics without I/O.

mod camera;
mod cube;
mod distortion;
mod equirectangular;
mod limits;
mod orientation;
mod pattern;
mod perspective_field;
mod plane;
mod ray;
mod rigid;
mod smoothstep;

pub use camera::{Camera, CameraError};
pub use cube::Cube;
pub use distortion::Distortion;
pub use equirectangular::{direction_from_uv, pixel_direction, pixel_solid_angle_sr, uv_from_direction};
pub use glam::{DMat3, DQuat, DVec3, Mat2, Mat3, Mat4, Quat, Vec2, Vec3, Vec4};
pub use limits::{MAX_COORDINATE_M, is_position};
pub use orientation::Orientation;
pub use pattern::{cosine_hemisphere, fibonacci_sphere, orthonormal_basis, van_der_corput};
pub use perspective_field::{FieldCell, LensEstimate, Perspective, PerspectiveField, PerspectiveFit};
pub use plane::Plane;
pub use ray::Ray;
pub use rigid::RigidTransform;
pub use smoothstep::smoothstep;
