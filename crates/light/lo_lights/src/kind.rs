use serde::Serialize;

/// Who says that a light is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// The photo shows it.
    Seen,
    /// A panorama of the room shows it.
    Panorama,
    /// Whoever completed the room guessed it.
    Guessed,
    /// Somebody added it.
    Added,
}

/// What a light is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A lamp.
    Lamp,
    /// A window.
    Window,
    /// A surface that gives much light, whatever it is.
    BrightSurface,
    /// An added rectangle or sphere.
    Area,
    /// An added sun.
    Sun,
}
