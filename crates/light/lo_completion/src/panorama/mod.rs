//! Panoramas of the room given by the user (`docs/method.md` §15): alignment with the room, and application to
//! unobserved surfaces.

mod accumulator;
mod apply;
mod balance;
mod build;
mod deposits;
mod leaves;
mod march;
mod matching;
mod observed_rays;
mod prior;
mod rays;
mod splitting;
mod warning;

pub use apply::{ApplyPanoramaError, PanoramaReport, apply_panorama};
pub use matching::{MIN_CONFIDENCE, PanoramaMatch, match_panorama};
pub use prior::{PanoramaError, PanoramaPrior};
pub use warning::PanoramaWarning;
