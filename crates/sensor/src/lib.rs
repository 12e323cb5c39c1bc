//! Camera and depth-sensor models: from radiance and true depth to what a device records.
//!
//! A model holds ranges, in serde structs with documented defaults. [`PhotoModel::draw`] and [`DepthModel::draw`] choose one
//! device and its settings; what was chosen is kept with the sample, so that every photo can be explained.

mod curve;
mod depth;
mod interval;
mod lidar;
mod metering;
mod photo;

pub use curve::ResponseCurve;
pub use depth::{DepthModel, DepthSettings, DepthShares, DepthView};
pub use interval::{Interval, IntervalError};
pub use metering::{Metering, meter};
pub use photo::{CurveShares, PhotoModel, PhotoSettings, Photograph};
