use std::fmt;

use lo_events::Warning;

/// Warnings of completion and of lamp fitting.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum CompletionWarning {
    /// Pixels without a depth reading were filled from the room's planes or from their neighbours.
    FilledDepth {
        /// Number of filled pixels.
        filled: usize,
        /// Number of all pixels.
        pixels: usize,
    },
    /// Clipped highlights were reconstructed brighter than white.
    Highlights {
        /// Share of the photo's pixels that are clipped, from 0 to 1.
        clipped_share: f32,
        /// Number of connected regions that were made brighter.
        regions: usize,
        /// Greatest reconstructed radiance; the photo's white is 1.
        peak_radiance: f32,
    },
    /// Visible emitters do not explain the photo's shading: a lamp was assumed in the unobserved part of the ceiling.
    AssumedLamp {
        /// Radiance at its centre; the photo's white is 1.
        radiance: f32,
    },
    /// The brightness of inferred lamps, windows and surfaces was fitted to the photo's shading.
    FittedLamps {
        /// Factor on inferred lamps and windows; `None` if their share of the light is too small to fit.
        lamps: Option<f32>,
        /// Their fitted share of the light on observed surfaces.
        lamps_share: f32,
        /// Factor on clipped lamps and windows beyond the usual highlight reconstruction; `None` as for `lamps`.
        clipped_lamps: Option<f32>,
        /// Their fitted share of the light on observed surfaces.
        clipped_share: f32,
        /// Factor on inferred surfaces.
        surfaces: f32,
    },
    /// Positions of unobserved planes of the room were assumed.
    AssumedPlanes {
        /// Whether the floor's was.
        floor: bool,
        /// Whether the ceiling's was.
        ceiling: bool,
        /// For how many of the four walls.
        walls: usize,
    },
}

impl Warning for CompletionWarning {}

impl fmt::Display for CompletionWarning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::FilledDepth { filled, pixels } => write!(
                f,
                "{:.0} % of the pixels have no depth reading and were filled from the room's planes or their neighbours",
                100.0 * *filled as f32 / *pixels as f32
            ),
            Self::Highlights { clipped_share, regions, peak_radiance } => write!(
                f,
                "{:.1} % of the photo is clipped; {regions} bright regions were reconstructed, up to {peak_radiance:.1} \
                 times white",
                100.0 * clipped_share
            ),
            Self::AssumedLamp { radiance } => write!(
                f,
                "visible lights do not explain the photo's shading: a lamp of radiance {radiance:.1} was assumed in the \
                 unobserved part of the ceiling"
            ),
            Self::FittedLamps { lamps, lamps_share, clipped_lamps, clipped_share, surfaces } => {
                let part = |factor: Option<f32>, share: f32, what: &str, than: &str| {
                    let text = |factor| {
                        format!("{what} {factor:.1} times as bright as {than} ({:.0} % of the light)", 100.0 * share)
                    };
                    factor.map(text)
                };
                let lamps = part(*lamps, *lamps_share, "lamps and windows", "inferred");
                let clipped = part(*clipped_lamps, *clipped_share, "clipped lamps and windows", "usual");
                let surfaces = ((surfaces - 1.0).abs() > 0.05)
                    .then(|| format!("unobserved surfaces {surfaces:.1} times as bright as inferred"));
                let parts: Vec<String> = lamps.into_iter().chain(clipped).chain(surfaces).collect();
                write!(f, "fitted to the photo's shading: {}", parts.join(", "))
            }
            Self::AssumedPlanes { floor, ceiling, walls } => {
                let planes = [
                    floor.then(|| "the floor".to_owned()),
                    ceiling.then(|| "the ceiling".to_owned()),
                    (*walls > 0).then(|| format!("{walls} of 4 walls")),
                ];
                let planes: Vec<String> = planes.into_iter().flatten().collect();
                write!(f, "not observed, so their positions are assumed: {}", planes.join(", "))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_contain_the_values() {
        let filled = CompletionWarning::FilledDepth { filled: 1, pixels: 5 }.to_string();
        assert!(filled.starts_with("20 % of the pixels have no depth reading"), "{filled}");
        let clipped = CompletionWarning::Highlights { clipped_share: 0.012, regions: 3, peak_radiance: 4.56 };
        assert_eq!(
            clipped.to_string(),
            "1.2 % of the photo is clipped; 3 bright regions were reconstructed, up to 4.6 times white"
        );
        let planes = CompletionWarning::AssumedPlanes { floor: false, ceiling: true, walls: 2 };
        assert_eq!(planes.to_string(), "not observed, so their positions are assumed: the ceiling, 2 of 4 walls");
    }

    #[test]
    fn only_fitted_factors_are_listed() {
        let fitted = CompletionWarning::FittedLamps {
            lamps: None,
            lamps_share: 0.0,
            clipped_lamps: Some(2.0),
            clipped_share: 0.25,
            surfaces: 1.04,
        };
        assert_eq!(
            fitted.to_string(),
            "fitted to the photo's shading: clipped lamps and windows 2.0 times as bright as usual (25 % of the light)"
        );
    }
}
