use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::color::{luminance, srgb8_from_linear};
use crate::{Image, RadianceImage};

/// Tone curves from radiance to display light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ToneCurve {
    /// Linear up to 1 and clipped there: a photo is unchanged.
    #[default]
    Clip,
    /// Reinhard et al. 2002, eq. 4, on luminance: `L (1 + L / W²) / (1 + L)` with white point W = 4.
    Reinhard,
    /// The fit to the ACES filmic curve by Krzysztof Narkowicz (2016),
    /// <https://knarkowicz.wordpress.com/2016/01/06/aces-filmic-tone-mapping-curve/>, per channel, without its 0.6
    /// pre-exposure.
    Aces,
}

/// White point of [`ToneCurve::Reinhard`]: two stops above the photo's white.
const REINHARD_WHITE: f32 = 4.0;

impl ToneCurve {
    /// Converts linear radiance to display light in `[0, 1]` (linear, before the sRGB curve). NaN and negative values
    /// become 0.
    pub fn apply(self, rgb: [f32; 3]) -> [f32; 3] {
        let rgb = rgb.map(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, f32::MAX.sqrt()) });
        let mapped = match self {
            Self::Clip => rgb,
            Self::Reinhard => {
                let l = luminance(rgb);
                let scale = (1.0 + l / (REINHARD_WHITE * REINHARD_WHITE)) / (1.0 + l);
                rgb.map(|v| v * scale)
            }
            // the ratio tends to 2.51 / 2.43; values are clamped so that their squares stay finite in f32
            Self::Aces => rgb.map(|v| v.min(1e6)).map(|v| (v * (2.51 * v + 0.03)) / (v * (2.43 * v + 0.59) + 0.14)),
        };
        mapped.map(|v| v.min(1.0))
    }

    /// Converts radiance times 2^`exposure_ev` to an 8-bit sRGB image.
    pub fn map(self, image: &RadianceImage, exposure_ev: f32) -> Image<[u8; 3]> {
        let gain = exposure_ev.exp2();
        let pixel = |rgb: &[f32; 3]| self.apply(rgb.map(|v| v * gain)).map(srgb8_from_linear);
        Image::new(image.width(), image.height(), image.pixels().par_iter().map(pixel).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_meet_their_published_points() {
        let grey = |curve: ToneCurve, v: f32| curve.apply([v; 3])[0];
        assert_eq!(grey(ToneCurve::Clip, 0.25), 0.25);
        assert_eq!(grey(ToneCurve::Clip, 3.0), 1.0);
        // the white point maps to 1, and 1 to (1 + 1/16) / 2
        assert!((grey(ToneCurve::Reinhard, 4.0) - 1.0).abs() < 1e-6);
        assert!((grey(ToneCurve::Reinhard, 1.0) - 0.53125).abs() < 1e-6);
        // 2.54 / 3.16, from the coefficients of the source
        assert!((grey(ToneCurve::Aces, 1.0) - 2.54 / 3.16).abs() < 1e-6);
        assert!(grey(ToneCurve::Aces, 0.18) > 0.0);
    }

    #[test]
    fn curves_are_monotonic_and_accept_any_value() {
        for curve in [ToneCurve::Clip, ToneCurve::Reinhard, ToneCurve::Aces] {
            let mut last = 0.0;
            for step in -40..128 {
                let value = curve.apply([(step as f32 / 2.0).exp2(); 3])[0];
                assert!(value >= last && value <= 1.0, "{curve:?} at 2^{}", step as f32 / 2.0);
                last = value;
            }
            assert_eq!(curve.apply([f32::NAN, -1.0, 0.0]), [0.0; 3]);
            let white = curve.apply([f32::INFINITY; 3]);
            assert!(white.iter().all(|v| *v > 0.99), "{curve:?} {white:?}");
        }
    }

    #[test]
    fn exposure_counts_in_stops() {
        let image = RadianceImage::new(1, 1, vec![[0.5, 0.25, 0.125]]);
        assert_eq!(ToneCurve::Clip.map(&image, 1.0).pixels(), [[255, 188, 137]]);
    }
}
