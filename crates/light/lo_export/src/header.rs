//! What every file says of itself.

/// What every file says of its origin.
pub(crate) const GENERATOR: &str = concat!("lightoctree export ", env!("CARGO_PKG_VERSION"));

/// The same, as OpenEXR's own attribute has it.
pub(crate) const SOFTWARE: &str = "lightoctree export";

/// What every file says of its axes.
pub(crate) const FRAME: &str = "right-handed, +X right, +Y up, the photo's camera at the origin looks along -Z; metres";

/// The same of a levelled scene.
pub(crate) const LEVEL_FRAME: &str =
    "right-handed, +Y against gravity, the floor at 0, the photo's camera above the origin looks towards -Z; metres";

/// What every file says of its radiance.
pub(crate) const UNITS: &str = "radiance: linear, Rec. 709 primaries, relative; 1.0 is the photo's white";
