//! Expected light (`docs/method.md` §5.11): what shading, surfaces and colours of a photo say of the light around it, as an arithmetic mean.
//!
//! Losses of logarithms and tone curves teach a network the *geometric* mean of what may be there: lamps and windows, whose places are uncertain, vanish
//! from it. Objects are lit by energy. So a small network of its own predicts the panorama whose irradiance is right on average.

mod directions;
mod losses;
mod network;
mod statistics;

pub use losses::{ExpectedLosses, ExpectedTruth, expected_losses};
pub use network::{ExpectedLight, ExpectedLightNet, PANORAMA_HEIGHT};
pub use statistics::{PhotoStatistics, STATISTICS};
