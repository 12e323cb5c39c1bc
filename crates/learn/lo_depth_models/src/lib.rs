//! Third-party depth networks as ONNX files: recognised by their inputs and outputs, checked, run on rten and converted
//! to metres.
//!
//! [`DepthModel::read`] reads a file and recognises its family. [`DepthModel::predict`] runs it on a photo. Predictions
//! use this project's axes (+X right, +Y up, −Z forward) and, except for relative depth, metres.

mod config;
mod error;
mod facts;
mod integer_products;
mod model;
mod onnx;
mod plan;
mod prediction;
mod preprocess;
mod recipe;
mod resize;
mod runtime;
mod shapes;
pub mod stages;

pub mod affine;
mod depth_anything;
mod metric3d;
mod moge;
mod robust;

pub use config::{AxisOrder, Channels, Focal, ModelConfig, OutputKind, SizeRule};
pub use error::ModelError;
pub use model::DepthModel;
pub use prediction::{FieldOfView, Geometry, Prediction};
