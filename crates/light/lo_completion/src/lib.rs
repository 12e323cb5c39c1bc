//! Completion of a room without a network (`shell`, `docs/method.md` §11).
//!
//! The room is closed by planes, radiance is extrapolated over unobserved surfaces, and clipped highlights and lamps
//! outside the view get plausible light. Lamp fitting also serves rooms that networks complete, and panoramas of the
//! room serve both.

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
mod warning;

pub use expected::{ExpectedLightOptions, ExpectedLightReport, GatheredLamp, apply_expected_light};
pub use fit::{InitialLamps, LampFit, ObservedShading, fit_lamps, preview_lamps};
pub use gravity::{up_from_predicted_depth, up_near};
pub use highlights::HighlightReport;
pub use irradiance::irradiance_at;
pub use lamps::LampReport;
pub use light_from_above::light_from_above;
pub use panorama::{
    ApplyPanoramaError, MIN_CONFIDENCE, PanoramaError, PanoramaMatch, PanoramaPrior, PanoramaReport, PanoramaWarning,
    apply_panorama, match_panorama,
};
pub use shell::{Enclosure, Shell, ShellOptions, ShellReport, filled_warning, shell, shell_of_photos};
pub use warning::CompletionWarning;
