//! Runs the program with the helpers of `lightoctree`'s tests.

#[allow(dead_code, reason = "the viewer's tests need more of a browser")]
#[path = "../../../../lightoctree-cli/tests/it/support/browser.rs"]
pub mod browser;
#[path = "../../../../lightoctree-cli/tests/it/support/programs.rs"]
pub mod programs;
#[path = "../../../../lightoctree-cli/tests/it/support/run.rs"]
pub mod run;
#[path = "../../../../lightoctree-cli/tests/it/support/weights.rs"]
pub mod weights;

pub use run::{done, json, refused};

/// The program under test.
const PROGRAM: &str = "lightoctree-lab";
