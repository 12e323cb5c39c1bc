//! Runs the program with the helpers of `lightoctree`'s tests.

#[path = "../../../../lightoctree-cli/tests/it/support/run.rs"]
pub mod run;
#[path = "../../../../lightoctree-cli/tests/it/support/weights.rs"]
pub mod weights;

pub use run::{done, json, refused};

/// The program under test.
const PROGRAM: &str = "lightoctree-lab";
