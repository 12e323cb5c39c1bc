//! Indoor lighting from one photo: the public Rust API.
//!
//! ```no_run
//! use lightoctree::{EstimateOptions, camera_of_photo, cone, estimate, geometry::Vec3, imaging, scene::Frame};
//!
//! let photo = imaging::read_photo("room.jpg")?;
//! let depth_m = imaging::read_depth("room_depth.png", None)?;
//! let (camera, _source) = camera_of_photo(&photo)?;
//! let frame = Frame::new(photo.photo, depth_m, camera, 1.0)?;
//! let scene = estimate(frame, None, &EstimateOptions::default(), &mut |_| ())?;
//! let tracer = cone::ConeTracer::new(&scene.light, cone::Settings::default())?;
//! let panorama = tracer.panorama(Vec3::new(0.0, 0.0, -1.0), 256, 128);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The crates below are re-exported whole: [`geometry`], [`imaging`], [`octree`], [`cone`], [`mesh`], [`scene`],
//! [`completion`], [`nets`], [`insert`] and [`export`].

mod camera;
mod estimate;
mod lamp;
mod message;
mod network;
mod place;
#[cfg(feature = "weights")]
mod weights;

pub use camera::{CameraSource, DEFAULT_HFOV_DEG, camera_of_photo};
pub use completion;
pub use cone;
pub use estimate::{DEFAULT_OCTREE_DEPTH, EstimateError, EstimateOptions, Input, estimate};
pub use export;
pub use geometry;
pub use imaging;
pub use insert;
pub use lamp::add_lamp;
pub use mesh;
pub use message::Message;
pub use nets;
pub use nets::Networks;
pub use network::SeenFrame;
pub use octree;
pub use place::probe_grid;
pub use scene;
#[cfg(feature = "weights")]
pub use weights::shipped_networks;
