//! The units of a depth map, and which would fit better.

use lightoctree::events::EstimateWarning;
use lo_imaging::DepthFile;

/// Units per metre of common depth maps: metres, centimetres, KITTI's 1/256 m, millimetres, TUM's 1/5000 m, 0.1 mm.
const COMMON: [f64; 6] = [1.0, 100.0, 256.0, 1000.0, 5000.0, 10_000.0];

/// Largest ratio of a common unit to the fitted one at which it is suggested.
const MAX_RATIO: f64 = 2.5;

/// Units of the depth map given on the command line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthUnits {
    per_metre: f64,
    spans_range: bool,
}

impl DepthUnits {
    /// Returns the units of a file.
    pub fn of(file: &DepthFile) -> Self {
        Self { per_metre: file.units_per_metre, spans_range: file.spans_range }
    }

    /// Returns what to do about a warning by `--depth-scale`, as the end of its sentence.
    pub fn hint(&self, warning: &EstimateWarning) -> Option<String> {
        let EstimateWarning::DepthScale { ratio } = warning else { return None };
        let fitted = self.per_metre * ratio;
        let apart = |unit: f64| (unit / fitted).ln().abs();
        let nearest = COMMON.into_iter().min_by(|a, b| apart(*a).total_cmp(&apart(*b)));
        let nearest = nearest.filter(|unit| apart(*unit) < MAX_RATIO.ln() && *unit != self.per_metre);
        let now = self.per_metre;
        let normalised = "if the map is normalised (its values span the file's whole range), no scale makes it metres: \
                          export metric depth, or inverse depth for --depth-is inverse";
        Some(match nearest {
            Some(unit) if self.spans_range => {
                format!(" --depth-scale {unit} would fit best (now {now}); {normalised}")
            }
            Some(unit) => format!(" --depth-scale {unit} would fit best (now {now})"),
            None if self.spans_range => format!(" No usual --depth-scale fits; {normalised}"),
            None => format!(" No usual --depth-scale fits; {} would (now {now})", two_digits(fitted)),
        })
    }
}

/// Rounds to two significant digits.
fn two_digits(value: f64) -> f64 {
    let unit = 10f64.powf(value.log10().floor() - 1.0);
    let rounded = (value / unit).round() * unit;
    // Powers of ten below 1 are not exact.
    if unit >= 1.0 { rounded } else { (rounded / unit).round() / (1.0 / unit).round() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_that_fits_best_is_suggested() {
        let hint = |per_metre: f64, ratio: f64, spans_range: bool| {
            DepthUnits { per_metre, spans_range }.hint(&EstimateWarning::DepthScale { ratio }).unwrap_or_default()
        };
        for (per_metre, ratio, unit) in [
            (1000.0, 4.1, "--depth-scale 5000 would"),
            (1000.0, 5.9, "--depth-scale 5000 would"),
            (1000.0, 0.3, "--depth-scale 256 would"),
            (1000.0, 0.001, "--depth-scale 1 would"),
            (1.0, 800.0, "--depth-scale 1000 would"),
            (5000.0, 0.2, "--depth-scale 1000 would"),
            (1.0, 0.2, "0.2 would"),
            (1000.0, 1e4, "10000000 would"),
        ] {
            let hint = hint(per_metre, ratio, false);
            assert!(hint.contains(unit) && !hint.contains("normalised"), "{per_metre}, {ratio}: {hint}");
        }
        assert!(hint(1000.0, 14.0, true).contains("normalised"));
        assert_eq!(DepthUnits { per_metre: 1.0, spans_range: false }.hint(&EstimateWarning::PredictedDepth), None);
    }
}
