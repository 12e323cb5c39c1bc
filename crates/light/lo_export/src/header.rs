//! Metadata common to all files.

/// Name and version of the writing program.
pub(crate) const GENERATOR: &str = concat!("lightoctree export ", env!("CARGO_PKG_VERSION"));

/// Name of the writing program in OpenEXR's own attribute.
pub(crate) const SOFTWARE: &str = "lightoctree export";

/// Description of the axes.
pub(crate) const FRAME: &str = "right-handed, +X right, +Y up, the photo's camera at the origin looks along -Z; metres";

/// Description of the axes of a levelled scene.
pub(crate) const LEVEL_FRAME: &str =
    "right-handed, +Y against gravity, the floor at 0, the photo's camera above the origin looks towards -Z; metres";

/// Description of the radiance.
pub(crate) const UNITS: &str = "radiance: linear, Rec. 709 primaries, relative; 1.0 is the photo's white";
