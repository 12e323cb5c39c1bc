//! The systems that the paper compares with, as trainable baselines on our image encoder (`docs/method.md` §17).
//!
//! Each system is one module: its network, its losses and its answer to "which light arrives at this point". All read
//! the features of the same frozen depth network ([`PhotoFeatures`]). `lo_train` trains them, `lo_eval` scores them.

mod baseline;
mod deeplight;
mod dense;
mod error;
mod example;
mod features;
mod gardner;
mod garon;
mod gaussians;
mod global;
mod harmonics;
mod li;
mod lighthouse;
mod losses;
mod nir;
mod planes;
mod prediction;
mod spheres;
mod system;
#[cfg(test)]
mod testing;
mod volume;

pub use baseline::{BASELINE, Baseline, BaselineNet, fingerprint};
pub use error::BaselineError;
pub use example::{BaselineExample, PANORAMA, PROBE_MAP, Probe};
pub use features::{CELL, FeatureBatch, FeatureShape, PhotoFeatures};
pub use gaussians::Gaussian;
pub use harmonics::{COEFFICIENTS, Harmonics};
pub use losses::Losses;
pub use planes::Planes;
pub use prediction::{CellLight, Prediction, SurfaceLight};
pub use spheres::{BallMaterial, Balls};
pub use system::{System, UnknownSystem};
pub use volume::{Grid, Volume};
