//! Training of the networks (`docs/method.md` §7): depth network, light network, both jointly, and expected light.
//! [`train_baseline`] trains the systems that the paper compares with.
//!
//! [`train`] runs all phases of a [`TrainConfig`] in one folder and reports progress through `lo_events`. The light
//! network's inputs come from [`lo_estimate::ObservedFrame`], as in estimation.

mod augmentation;
mod baseline;
mod batcher;
mod config;
mod encoder_weights;
mod error;
mod example;
mod learner;
mod log;
mod net_trainer;
mod oversampled;
mod panorama_data;
#[doc(hidden)]
pub mod peer_cases;
mod phases;
mod prefetch;
mod prepare;
mod rays;
mod report;
mod request;
mod run;
mod sheet;
mod sources;
pub mod stages;
mod state;
mod style;
mod training_phase;
mod transfer;
mod validation;
mod warning;
pub mod weight_files;
mod weights;

pub use augmentation::AugmentationConfig;
pub use baseline::{BaselineConfig, BaselineRequest, train_baseline};
pub use config::{DataConfig, FramesData, TrainConfig, ValidationConfig};
pub use encoder_weights::{EncoderOrigin, published, read_encoder};
pub use error::{ConfigError, StepError, TrainError};
pub use panorama_data::PanoramaData;
pub use phases::{DepthPhase, LightPhase, Schedule};
pub use rays::{panorama_rays, sample_panorama_rays};
pub use report::{LightReport, ValidationReport};
pub use request::{CHECKPOINT_FILE, InitialWeights, LOG_FILE, SHEET_FILE, TrainRequest, WEIGHTS_FILE};
pub use run::train;
pub use style::StyleConfig;
pub use training_phase::{TrainedNetworks, TrainingPhase};
pub use warning::TrainingWarning;
