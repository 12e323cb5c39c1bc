//! Light on objects and surfaces.

pub(crate) mod aperture;
pub(crate) mod environment;
pub(crate) mod gather;
pub(crate) mod irradiance;
pub(crate) mod lighting;
pub(crate) mod map;
pub(crate) mod radiosity;
pub(crate) mod room_light;
pub(crate) mod samples;
