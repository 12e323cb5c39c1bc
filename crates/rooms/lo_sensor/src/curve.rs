use serde::{Deserialize, Serialize};

/// Camera response curve: maps exposed linear light to display light, per channel. The sRGB encoding follows it.
///
/// All families but the first compress highlights. Light of [`GREY`](Self::GREY) is unchanged, so that linearised
/// midtones of a photo match radiance in units of its white under any curve. Measured cameras vary around such curves:
/// 201 responses, steeper than sRGB in the midtones or with a long shoulder (Grossberg & Nayar, "What is the Space of
/// Camera Response Functions?", CVPR 2003).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "family", rename_all = "kebab-case")]
pub enum ResponseCurve {
    /// Linear, clipped at 1: the neutral curve.
    Srgb,
    /// Filmic curve of J. Hable ("Uncharted 2: HDR Lighting", GDC 2010): toe, linear part, shoulder.
    Filmic {
        /// Linear light that maps to white, at least 1.
        white: f32,
    },
    /// Sigmoid on logarithmic light (Naka–Rushton form), `xⁿ (1 + s) / (xⁿ + s)`: a camera's "vivid" or "standard"
    /// picture style.
    Contrast {
        /// Exponent n, above 1: midtone slope on logarithmic axes.
        slope: f32,
    },
    /// Logarithm, `ln(1 + a x) / ln(1 + a w)`: how phones render a bright window. White is reached at `w > 1`.
    Shoulder {
        /// Strength a, positive.
        strength: f32,
    },
}

impl ResponseCurve {
    /// Linear light that every curve leaves unchanged: the 18 % grey card.
    pub const GREY: f32 = 0.18;

    /// Returns the curve as a function with its constants precomputed.
    pub(crate) fn prepared(self) -> impl Fn(f32) -> f32 {
        let (a, b) = match self {
            Self::Srgb => (0.0, 0.0),
            Self::Filmic { white } => filmic_scales(white.max(1.0)),
            Self::Contrast { slope } => {
                let power = Self::GREY.powf(slope);
                // From T(GREY) = GREY; at slope 1 the curve is the straight line, s = ∞.
                let s = (power * (1.0 - Self::GREY) / (Self::GREY - power).max(1e-9)).min(1e9);
                (slope, s)
            }
            Self::Shoulder { strength } => {
                let a = strength.max(1e-3);
                // ln(1 + a w) = ln(1 + a GREY) / GREY
                (a, Self::GREY / (1.0 + a * Self::GREY).ln())
            }
        };
        move |light: f32| {
            let x = if light.is_nan() { 0.0 } else { light.clamp(0.0, 1e6) };
            let y = match self {
                Self::Srgb => x,
                Self::Filmic { .. } => hable(a * x) * b,
                Self::Contrast { .. } => {
                    let power = x.powf(a);
                    power * (1.0 + b) / (power + b)
                }
                Self::Shoulder { .. } => (1.0 + a * x).ln() * b,
            };
            y.clamp(0.0, 1.0)
        }
    }

    /// Maps linear light to display light in [0, 1]. NaN and negative light become black.
    pub fn apply(self, light: f32) -> f32 {
        self.prepared()(light)
    }
}

/// Hable's rational function with his constants, 0 at 0.
fn hable(x: f32) -> f32 {
    const A: f32 = 0.15;
    const B: f32 = 0.50;
    const C: f32 = 0.10;
    const D: f32 = 0.20;
    const E: f32 = 0.02;
    const F: f32 = 0.30;
    (x * (A * x + C * B) + D * E) / (x * (A * x + B) + D * F) - E / F
}

/// Returns the input and output scales of [`hable`] with which `white` maps to 1 and the grey card to itself. Found by
/// bisection on the input scale.
///
/// `hable(k GREY) / hable(k white)` increases with k where the shoulder applies (k above the toe). The scale lies
/// between 0.2 and 200.
fn filmic_scales(white: f32) -> (f32, f32) {
    let (mut low, mut high) = (0.2f32, 200.0f32);
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if hable(middle * ResponseCurve::GREY) / hable(middle * white) < ResponseCurve::GREY {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low, 1.0 / hable(low * white))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn curves() -> Vec<ResponseCurve> {
        let mut curves = vec![ResponseCurve::Srgb];
        curves.extend([1.5, 4.0, 11.2].map(|white| ResponseCurve::Filmic { white }));
        curves.extend([1.05, 1.2, 1.5].map(|slope| ResponseCurve::Contrast { slope }));
        curves.extend([0.3, 1.0, 4.0].map(|strength| ResponseCurve::Shoulder { strength }));
        curves
    }

    #[test]
    fn curves_rise_from_black_to_white_and_keep_the_grey() {
        for curve in curves() {
            assert!(curve.apply(0.0).abs() < 1e-6 && curve.apply(1e9) == 1.0, "{curve:?}");
            assert!((curve.apply(0.18) - 0.18).abs() < 2e-4, "{curve:?}: {}", curve.apply(0.18));
            let mut last = -1.0;
            for step in 0..4000 {
                let y = curve.apply(step as f32 / 400.0);
                assert!(y >= last && (0.0..=1.0).contains(&y), "{curve:?} at {step}");
                last = y;
            }
            assert!(curve.apply(f32::NAN) < 1e-6 && curve.apply(-1.0) < 1e-6);
        }
    }

    #[test]
    fn each_family_does_what_its_name_says() {
        // Closed form: a = 1 clips at ((1.18)^(1/0.18) − 1) / 1 = 1.508.
        let shoulder = ResponseCurve::Shoulder { strength: 1.0 };
        assert!(shoulder.apply(1.4) < 1.0 && shoulder.apply(1.52) == 1.0);
        // White is where it was set.
        let filmic = ResponseCurve::Filmic { white: 4.0 };
        assert!(filmic.apply(3.8) < 1.0 && filmic.apply(4.01) > 0.9999);
        // A contrast curve darkens shadows and brightens light above the grey card.
        let contrast = ResponseCurve::Contrast { slope: 1.3 };
        assert!(contrast.apply(0.05) < 0.05 && contrast.apply(0.5) > 0.5);
        assert!((contrast.apply(1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn files_name_the_family() {
        let text = serde_json::to_string(&ResponseCurve::Contrast { slope: 1.25 }).unwrap();
        assert_eq!(text, r#"{"family":"contrast","slope":1.25}"#);
        assert_eq!(serde_json::from_str::<ResponseCurve>(r#"{"family":"srgb"}"#).unwrap(), ResponseCurve::Srgb);
    }
}
