use std::fmt;

/// An observation about a photo's file that its reader should pass on.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum PhotoNote {
    /// The file ends early: part of the picture is missing.
    Truncated {
        /// Share of the rows that is missing, in [0, 1]; 0 if only detail is.
        missing: f64,
    },
    /// A gain map gives the radiance of clipped pixels.
    GainMap {
        /// Share of the pixels that are brighter by it, in [0, 1].
        share: f64,
        /// Brightest radiance, in stops above white.
        stops: f32,
    },
    /// The file has a gain map that cannot be used.
    UnusableGainMap {
        /// Cause.
        reason: &'static str,
    },
    /// The file has a colour profile that cannot be used; the photo is read as sRGB.
    UnusableProfile {
        /// Cause.
        reason: &'static str,
    },
    /// The file has GPano metadata that cannot be used.
    UnusablePanorama {
        /// Cause.
        reason: &'static str,
    },
    /// A header line of a Radiance file is invalid and was ignored.
    IgnoredHeader {
        /// The line.
        line: String,
    },
    /// Pixels that are not finite were replaced: infinite ones by the largest finite value, NaN by 0.
    NotFinite {
        /// Infinite values.
        infinite: usize,
        /// Values that are NaN.
        nan: usize,
        /// The largest finite value.
        largest: f32,
    },
}

impl PhotoNote {
    /// Whether the note warns of a probable fault in the file.
    pub fn is_warning(&self) -> bool {
        !matches!(self, Self::GainMap { .. })
    }
}

impl fmt::Display for PhotoNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated { missing: 0.0 } => f.write_str("the file is cut off: the picture may lack detail"),
            Self::Truncated { missing } => write!(
                f,
                "the file is cut off: {:.0} % of the picture is missing and black",
                (100.0 * missing).max(1.0)
            ),
            Self::GainMap { share, stops } => write!(
                f,
                "highlights by the gain map: {:.1} % of the pixels are brighter than white, by up to {stops:.1} stops",
                100.0 * share
            ),
            Self::UnusableGainMap { reason } => write!(f, "the gain map is not used: {reason}"),
            Self::UnusableProfile { reason } => {
                write!(f, "the colour profile is not used: {reason}; the photo is read as sRGB")
            }
            Self::UnusablePanorama { reason } => write!(f, "the GPano metadata are not used: {reason}"),
            Self::IgnoredHeader { line } => write!(f, "the invalid header line “{line}” is ignored"),
            Self::NotFinite { infinite, nan, largest } => match (infinite, nan) {
                (_, 0) => write!(f, "{infinite} infinite values were replaced by the largest finite one, {largest}"),
                (0, _) => write!(f, "{nan} values that are no number (NaN) were replaced by 0"),
                _ => write!(
                    f,
                    "{infinite} infinite values were replaced by the largest finite one, {largest}, and {nan} values \
                     that are no number (NaN) by 0"
                ),
            },
        }
    }
}
