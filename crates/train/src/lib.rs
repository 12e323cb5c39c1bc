//! Training of the networks (SPEC §7): the depth network, then the light network, then both, from one configuration.
//!
//! [`train`] runs all phases of a [`TrainConfig`] in a folder of its own and says on its way what happens ([`Message`]). What the light network is given comes from
//! [`lightoctree::SeenFrame`], as in estimation.

mod augmentation;
mod config;
mod deepen;
mod error;
mod example;
mod feed;
mod learner;
mod log;
mod message;
mod run;
mod sheet;
mod truth;
mod validation;
mod weights;

pub use augmentation::AugmentationConfig;
pub use config::{DataConfig, DepthPhase, JointPhase, LightPhase, TrainConfig, ValidationConfig};
pub use error::TrainError;
pub use message::{Message, ValidationReport};
pub use run::{CHECKPOINT_FILE, LOG_FILE, Outcome, Request, SHEET_FILE, WEIGHTS_FILE, train};
pub use truth::true_octree;
