//! Stages of rendering an image with objects.

use lo_events::Stage;

/// Computing the objects' coarse shadow on real surfaces, for the light that they reflect back to the objects.
pub const COARSE_SHADOW: Stage = Stage::new("coarse shadow");

/// Computing the objects' radiosity, for their light on themselves and their surroundings.
pub const RADIOSITY: Stage = Stage::new("radiosity");

/// Computing the objects' shadow on real surfaces, and the light that they reflect onto them.
pub const FINE_SHADOW: Stage = Stage::new("fine shadow");

/// Computing which parts of the objects the camera sees.
pub const VISIBILITY: Stage = Stage::new("visibility");

/// Shading the visible parts of the objects.
pub const SHADING: Stage = Stage::new("shading");

/// Compositing photo, shadow and objects.
pub const COMPOSITE: Stage = Stage::new("composite");
