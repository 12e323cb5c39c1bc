use serde::{Deserialize, Serialize};

/// Position of an object, as on the command line of `insert`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum ObjectPosition {
    /// Photo position on a surface; pixel centres are at +0.5.
    Pixel([f64; 2]),
    /// World position of the middle of the base, metres.
    Position([f64; 3]),
}

impl ObjectPosition {
    /// Rounds to 0.01 pixels, or to 0.1 mm in single precision, so that the command line is short and reads back equal.
    pub(crate) fn rounded(self) -> Self {
        match self {
            Self::Pixel(pixel) => Self::Pixel(pixel.map(|x| (x * 100.0).round() / 100.0)),
            Self::Position(position) => Self::Position(position.map(|x| f64::from(((x * 1e4).round() / 1e4) as f32))),
        }
    }
}
