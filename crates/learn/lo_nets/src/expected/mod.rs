//! Expected light (`docs/method.md` §5.11): the arithmetic mean of the light around a photo, inferred from its shading,
//! surfaces and colours.
//!
//! Losses of logarithms and tone curves make a network predict the *geometric* mean, in which lamps and windows of
//! uncertain position vanish. Objects are lit by energy. So a separate small network predicts the panorama whose
//! irradiance is right on average.

mod directions;
mod losses;
mod network;
mod statistics;

pub use losses::{ExpectedLosses, ExpectedTruth, expected_losses};
pub use network::{ExpectedLight, ExpectedLightNet, PANORAMA_HEIGHT};
pub use statistics::{PhotoStatistics, STATISTICS};
