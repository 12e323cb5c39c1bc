//! From photos to an [`Estimate`](lo_scene::Estimate) of the room's radiance, and from an estimate to a
//! [`LitScene`](lo_scene::LitScene).
//!
//! [`Estimator`] runs depth and light networks, or closes the room by planes. [`lit_by`] applies a choice of light;
//! [`FittedLight`] does so repeatedly with edits.

mod camera;
mod completed;
#[cfg(feature = "depth-models")]
mod depth_model;
mod error;
mod estimator;
mod fitted_light;
mod input;
mod lighting;
mod options;
mod panorama;
mod photos;
mod request;
mod seen_frame;
mod sun;
#[cfg(test)]
mod tests;
mod view;
#[cfg(feature = "weights")]
mod weights;
mod white;

pub use camera::DEFAULT_HFOV_DEG;
pub use error::EstimateError;
pub use estimator::Estimator;
pub use fitted_light::{FittedLight, LaidLight};
pub use input::{Exposures, Input, PredictedDepth};
pub use lighting::{LightReport, LightingError, indirect_only, lit_by, plausible, seen_from};
pub use options::{DEFAULT_OCTREE_DEPTH, EstimateOptions};
pub use request::{DepthSource, PhotoRequest, ResolvedPhoto};
pub use seen_frame::SeenFrame;
pub use sun::{PhotoSun, ShadowError, sun_of_photo, supported_sun};
pub use white::check_white;
