//! Training of the systems that the paper compares with (`docs/method.md` §17), on cached features of a frozen depth
//! network.

mod config;
mod example;
mod example_set;
mod run;
mod trainer;

pub use config::BaselineConfig;
pub use run::{BaselineRequest, train_baseline};
