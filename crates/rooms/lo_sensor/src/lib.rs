//! Camera and depth-sensor models: from radiance and true depth to the data a device records.
//!
//! A model holds parameter ranges in serde structs with documented defaults. [`PhotoModel::draw`] and
//! [`DepthModel::draw`] choose one device and its settings. The settings are stored with the sample, so that every
//! photo can be reproduced.

mod blur;
mod curve;
mod depth;
mod depth_view;
mod flash;
mod interval;
mod kinect;
mod lidar;
mod metering;
mod phone;
mod photo;
mod photo_model;

pub use curve::ResponseCurve;
pub use depth::{DepthModel, DepthSettings, DepthShares};
pub use depth_view::DepthView;
pub use interval::{Interval, IntervalError};
pub use metering::{Metering, meter};
pub use phone::{PhoneModel, PhoneSettings};
pub use photo::{PhotoSettings, Photograph};
pub use photo_model::{CurveShares, PhotoModel};

/// Luminance of one unit of radiance, in cd/m². `lo_synth` generates rooms in the same unit.
const UNIT_CD_M2: f32 = 100.0;
