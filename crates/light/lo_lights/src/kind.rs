use serde::Serialize;

/// Source of a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum LightOrigin {
    /// Observed in the photo.
    #[serde(rename = "seen")]
    Observed,
    /// Observed in a panorama of the room.
    Panorama,
    /// Inferred by the completion of the room.
    #[serde(rename = "guessed")]
    Inferred,
    /// Added by the user.
    Added,
}

/// Kind of light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum LightKind {
    /// A lamp.
    Lamp,
    /// A window.
    Window,
    /// A bright surface that is neither a lamp nor a window.
    BrightSurface,
    /// An added rectangle or sphere.
    Area,
    /// An added sun.
    Sun,
}
