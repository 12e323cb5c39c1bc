//! User studies of object insertion: pairs of videos, their page, and statistics of the answers (`docs/study.md`).
//!
//! [`Study::plan`] chooses rooms, paths and sides. [`Study::make`] renders the videos and writes the page.
//! [`read_answers`] checks what participants saved, and [`Results`] has shares, exact tests and [`chart`].

mod answers;
mod binomial;
mod chart;
mod config;
mod error;
mod holm;
mod key;
mod make;
mod motion;
mod page;
mod path;
mod plan;
mod results;
pub mod stages;

pub use answers::{Answer, AnswerError, read_answers};
pub use chart::{ChartError, chart};
pub use config::{StudyConfig, StudyConfigError};
pub use error::StudyError;
pub use key::{KEY_FILE, Key, KeyError, Pair, Side, Video};
pub use make::Made;
pub use page::{PAGE_FILE, VIDEO_FOLDER};
pub use plan::Study;
pub use results::{Comparison, Participants, Results};
