//! A panorama of the room that somebody has (`docs/method.md` §15): how it lies in the room, and its light on what the photo does not show.

mod lay;
mod leaves;
mod march;
mod matching;
mod prior;
mod rays;
mod seen_map;

pub use lay::{LaidLight, LayError, lay_panorama};
pub use matching::{MIN_CONFIDENCE, PanoramaMatch, match_panorama};
pub use prior::{PanoramaError, PanoramaPrior};
