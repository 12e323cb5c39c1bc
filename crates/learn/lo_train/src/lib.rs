//! Training of the networks (`docs/method.md` §7): the depth network, then the light network, then both, from one configuration.
//!
//! [`train`] runs all phases of a [`TrainConfig`] in a folder of its own and says on its way what happens (`lo_events`). What the light network is given comes from
//! [`lo_estimate::SeenFrame`], as in estimation.

mod augmentation;
mod config;
mod deepen;
mod encoder_weights;
mod error;
mod example;
mod feed;
mod learner;
mod log;
#[doc(hidden)]
pub mod peer_cases;
mod phases;
mod prepare;
mod rays;
mod repeated;
mod report;
mod run;
mod sheet;
mod state;
mod style;
mod trained;
mod validation;
pub mod weight_files;
mod weights;

pub use augmentation::AugmentationConfig;
pub use config::{DataConfig, FramesData, PanoramaData, TrainConfig, ValidationConfig};
pub use encoder_weights::{EncoderOrigin, published, read_encoder};
pub use error::{ConfigError, Fault, TrainError};
pub use phases::{DepthPhase, LightPhase, Schedule};
pub use rays::{drawn_panorama_rays, panorama_rays};
pub use report::{LightReport, ValidationReport};
pub use run::{CHECKPOINT_FILE, LOG_FILE, Request, SHEET_FILE, Start, WEIGHTS_FILE, train};
pub use style::StyleConfig;
