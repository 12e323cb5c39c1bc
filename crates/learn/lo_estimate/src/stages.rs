//! Stages of an estimate.

use lo_events::Stage;

/// Resizing photos and their depth to the working resolution.
pub const WORKING_RESOLUTION: Stage = Stage::new("resize to working resolution");

/// Comparing several photos of one room. Its figures are the exposures relative to the first photo, in stops.
pub const PHOTOS: Stage = Stage::new("match photos");

/// Predicting depth together with global light.
pub const DEPTH_AND_GLOBAL_LIGHT: Stage = Stage::new("depth and global light");

/// Predicting global light and camera orientation, without depth.
pub const GLOBAL_LIGHT: Stage = Stage::new("global light");

/// Predicting the octree of the whole room by the light network.
pub const LIGHT_NETWORK: Stage = Stage::new("light network");

/// Completing the room without a network.
pub const COMPLETION: Stage = Stage::new("completion");

/// Building the octree.
pub const OCTREE: Stage = Stage::new("octree");

/// Aligning a panorama of the room with the photo.
pub const PANORAMA_MATCH: Stage = Stage::new("align panorama");

/// Projecting a panorama of the room onto unobserved regions.
pub const PANORAMA_PROJECTION: Stage = Stage::new("project panorama");
