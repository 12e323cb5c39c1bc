//! Gain maps: the HDR rendition of a photo, stored beside it (ISO 21496-1, Ultra HDR).

use serde::{Deserialize, Serialize};

use crate::Image;

/// Parameters of a gain map, one value for each of red, green and blue (ISO 21496-1, 5.2).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GainMapParameters {
    /// log2 of the gain where the map is 0.
    pub min_log2: [f32; 3],
    /// log2 of the gain where the map is 1.
    pub max_log2: [f32; 3],
    /// Exponent of the stored map: gain is encoded as `share^gamma`.
    pub gamma: [f32; 3],
    /// Offset added to the photo's linear values before the gain.
    pub offset_sdr: [f32; 3],
    /// Offset subtracted after the gain.
    pub offset_hdr: [f32; 3],
}

/// Largest log2 of a gain: 1000 cd/m² beside a white of 100 is 3.3, and cameras write at most 6.
const MAX_LOG2: f32 = 16.0;

impl Default for GainMapParameters {
    /// The defaults of Ultra HDR 1.0, with a maximum of one stop where the file states none, as Skia reads it.
    fn default() -> Self {
        Self {
            min_log2: [0.0; 3],
            max_log2: [1.0; 3],
            gamma: [1.0; 3],
            offset_sdr: [1.0 / 64.0; 3],
            offset_hdr: [1.0 / 64.0; 3],
        }
    }
}

impl GainMapParameters {
    /// Whether the values are finite and plausible.
    pub fn is_valid(&self) -> bool {
        let within = |values: [f32; 3], low: f32, high: f32| values.iter().all(|v| (low..=high).contains(v));
        within(self.min_log2, -MAX_LOG2, MAX_LOG2)
            && within(self.max_log2, -MAX_LOG2, MAX_LOG2)
            && self.min_log2.iter().zip(self.max_log2).all(|(min, max)| *min <= max)
            && within(self.gamma, 1e-3, 1e3)
            && within(self.offset_sdr, 0.0, 1.0)
            && within(self.offset_hdr, 0.0, 1.0)
    }
}

/// A photo's gain map, at its own resolution, upright like the photo.
#[derive(Clone, Debug, PartialEq)]
pub struct GainMap {
    /// Encoded gains; grey maps have three equal values.
    pub image: Image<[u8; 3]>,
    /// Their meaning.
    pub parameters: GainMapParameters,
}

/// Linear value of the brightest channel from which the gain map begins to count: 230 of 255 in sRGB.
const FIRST: f32 = 0.79;

/// Linear value from which it counts fully: 250 of 255, where photos count as clipped.
const FULL: f32 = 0.956;

impl GainMap {
    /// Returns the radiance of a pixel of the photo, given its linear value and its position in [0, 1]².
    ///
    /// Clipped pixels have the radiance of the HDR rendition. Darker ones keep their own, since objects are composited
    /// over the photo as it is shown; in between both are mixed.
    pub fn radiance(&self, linear: [f32; 3], [u, v]: [f32; 2]) -> [f32; 3] {
        let brightest = linear.iter().fold(0.0f32, |a, &b| a.max(b));
        let weight = ((brightest - FIRST) / (FULL - FIRST)).clamp(0.0, 1.0);
        if weight == 0.0 {
            return linear;
        }
        let GainMapParameters { min_log2, max_log2, gamma, offset_sdr, offset_hdr } = self.parameters;
        let encoded = self.sample(u, v);
        std::array::from_fn(|c| {
            let share = encoded[c].powf(1.0 / gamma[c]);
            let gain = (min_log2[c] + (max_log2[c] - min_log2[c]) * share).exp2();
            let hdr = (linear[c] + offset_sdr[c]) * gain - offset_hdr[c];
            linear[c] + weight * (hdr.max(linear[c]) - linear[c])
        })
    }

    /// Samples the map bilinearly, in [0, 1].
    fn sample(&self, u: f32, v: f32) -> [f32; 3] {
        let axis = |t: f32, size: usize| {
            let at = (t * size as f32 - 0.5).clamp(0.0, (size - 1) as f32);
            (at as usize, (at as usize + 1).min(size - 1), at.fract())
        };
        let ((x0, x1, fx), (y0, y1, fy)) = (axis(u, self.image.width()), axis(v, self.image.height()));
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        std::array::from_fn(|c| {
            let at = |x, y| f32::from(self.image[(x, y)][c]) / 255.0;
            mix(mix(at(x0, y0), at(x1, y0), fx), mix(at(x0, y1), at(x1, y1), fx), fy)
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn clipped_pixels_have_the_hdr_rendition() {
        let parameters = GainMapParameters { max_log2: [2.0; 3], ..GainMapParameters::default() };
        let map = GainMap { image: Image::new(2, 1, vec![[0; 3], [255; 3]]), parameters };
        // ISO 21496-1, formula 1: (1 + 1/64) · 2² − 1/64
        assert!((map.radiance([1.0; 3], [0.75, 0.5])[0] - (65.0 / 64.0 * 4.0 - 1.0 / 64.0)).abs() < 1e-5);
        assert_eq!(map.radiance([1.0; 3], [0.25, 0.5]), [1.0; 3]);
        // half of the gain in log2 between the two
        assert!((map.radiance([1.0; 3], [0.5, 0.5])[0] - (65.0 / 64.0 * 2.0 - 1.0 / 64.0)).abs() < 1e-5);
        // what the photo shows unclipped stays
        assert_eq!(map.radiance([0.5, 0.2, 0.1], [0.75, 0.5]), [0.5, 0.2, 0.1]);
    }

    #[test]
    fn parameters_have_ranges() {
        assert!(GainMapParameters::default().is_valid());
        assert!(!GainMapParameters { max_log2: [f32::NAN; 3], ..Default::default() }.is_valid());
        assert!(!GainMapParameters { gamma: [0.0; 3], ..Default::default() }.is_valid());
        assert!(!GainMapParameters { min_log2: [2.0; 3], ..Default::default() }.is_valid());
    }
}
