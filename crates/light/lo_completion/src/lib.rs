//! Completion without a network (`shell`, `docs/method.md` §11): the room closed by planes, unseen surfaces extrapolated, clipped highlights
//! and lamps outside of the view given plausible light. The lamps also for rooms that networks complete, and panoramas of the room for both.

mod expected;
mod extrapolate;
mod face;
mod fill;
mod fit;
mod gravity;
mod highlights;
mod irradiance;
mod lamps;
mod layout;
mod light_from_above;
mod panorama;
mod shell;
mod visibility;

pub use expected::{GatheredLamp, LaidExpectation, LayExpected, lay_expected};
pub use fit::{LampFit, LampGuess, SeenShading, fit_lamps, preview_lamps};
pub use gravity::{up_from_predicted_depth, up_near};
pub use highlights::HighlightReport;
pub use irradiance::irradiance_at;
pub use lamps::LampReport;
pub use light_from_above::light_from_above;
pub use panorama::{
    LaidLight, LayError, MIN_CONFIDENCE, PanoramaError, PanoramaMatch, PanoramaPrior, lay_panorama, match_panorama,
};
pub use shell::{Enclosure, Shell, ShellOptions, ShellReport, filled_warning, shell, shell_of_photos};
