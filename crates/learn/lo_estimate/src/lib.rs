//! Estimates a room's radiance from photos, and applies light to an estimate.
//!
//! [`Estimator`] turns photos into an [`Estimate`](lo_scene::Estimate). It runs the depth and light networks, or closes
//! the room by planes. [`apply_light`] turns an estimate into a [`LitScene`](lo_scene::LitScene) in one choice of
//! light. [`FittedLight`] does so repeatedly, with the user's edits.

mod camera;
mod completed_room;
#[cfg(feature = "depth-models")]
mod depth_model;
mod error;
mod estimator;
mod fitted_light;
mod framed;
mod given_depth;
mod input;
mod lighting;
mod lighting_error;
mod observed_frame;
mod options;
mod panorama;
mod photos;
mod prepared_input;
mod request;
pub mod stages;
mod sun;
#[cfg(test)]
mod tests;
mod warning;
#[cfg(feature = "weights")]
mod weights;
mod white;

pub use camera::DEFAULT_HFOV_DEG;
pub use error::EstimateError;
pub use estimator::Estimator;
pub use fitted_light::{AppliedLight, FittedLight};
pub use input::{Exposures, Input, PredictedDepth};
pub use lighting::{LightReport, apply_light, for_viewpoint, indirect_only, plausible_light};
pub use lighting_error::LightingError;
pub use observed_frame::ObservedFrame;
pub use options::{DEFAULT_OCTREE_DEPTH, EstimateOptions};
pub use request::{DepthSource, PhotoRequest, ResolvedPhoto};
pub use sun::{PhotoSun, ShadowError, sun_from_photo, supported_sun};
pub use warning::EstimateWarning;
#[cfg(feature = "weights")]
pub use weights::WEIGHTS_SHA256;
pub use white::check_white;
