//! Appearance augmentation: contrast, saturation, blur and noise, in which generated photos differ from real ones.

use lo_imaging::Image;
use lo_random::{RngExt, Stream};
use serde::{Deserialize, Serialize};

/// Appearance augmentation of photos. All strengths are 0 (off) by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StyleConfig {
    /// Largest absolute natural logarithm of the exponent of sRGB values.
    pub contrast: f32,
    /// Largest relative change of saturation.
    pub saturation: f32,
    /// Largest standard deviation of blur, in pixels of the network's input.
    pub blur_px: f32,
    /// Largest standard deviation of noise, in sRGB values from 0 to 1.
    pub noise: f32,
}

impl StyleConfig {
    /// Applies a random style to a photo.
    pub(crate) fn apply(&self, photo: &Image<[u8; 3]>, stream: &mut Stream) -> Image<[u8; 3]> {
        if *self == Self::default() {
            return photo.clone();
        }
        let mut either_way = |most: f32| most * stream.random_range(-1.0f32..=1.0);
        let (exponent, saturation) = (either_way(self.contrast).exp(), 1.0 + either_way(self.saturation));
        // Half of the photos stay sharp and free of noise.
        let mut in_half = |most: f32| most * (2.0 * stream.random::<f32>() - 1.0).max(0.0);
        let (blur_px, noise) = (in_half(self.blur_px), in_half(self.noise));
        let styled = photo.map(|rgb| {
            let [r, g, b] = rgb.map(|v| (f32::from(v) / 255.0).powf(exponent));
            let grey = (r + g + b) / 3.0;
            [r, g, b].map(|v| grey + saturation * (v - grey))
        });
        let styled = blurred(&styled, blur_px);
        // The sum of three uniform variables has a variance of 1/4 and is close enough to a Gaussian.
        let mut gaussian = || 2.0 * ((0..3).map(|_| stream.random::<f32>()).sum::<f32>() - 1.5);
        let mut noisy = |v: f32| if noise > 0.0 { v + noise * gaussian() } else { v };
        styled.map(|rgb| rgb.map(|v| (255.0 * noisy(v).clamp(0.0, 1.0)).round() as u8))
    }
}

/// Blurs with a separable Gaussian; border pixels are replicated.
fn blurred(image: &Image<[f32; 3]>, sigma_px: f32) -> Image<[f32; 3]> {
    let reach = (3.0 * sigma_px).ceil() as isize;
    if reach == 0 {
        return image.clone();
    }
    let weights: Vec<f32> = (-reach..=reach).map(|i| (-0.5 * (i as f32 / sigma_px).powi(2)).exp()).collect();
    let total: f32 = weights.iter().sum();
    let along = |image: &Image<[f32; 3]>, step: [isize; 2]| {
        let size = [image.width() as isize, image.height() as isize];
        Image::from_fn(image.width(), image.height(), |x, y| {
            let mut sum = [0.0; 3];
            for (weight, i) in weights.iter().zip(-reach..=reach) {
                let at = [x as isize + i * step[0], y as isize + i * step[1]];
                let at = [0, 1].map(|axis| at[axis].clamp(0, size[axis] - 1) as usize);
                let pixel = image[(at[0], at[1])];
                (0..3).for_each(|c| sum[c] += weight * pixel[c]);
            }
            sum.map(|v| v / total)
        })
    };
    along(&along(image, [1, 0]), [0, 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn styles_change_what_they_name() {
        let photo = Image::from_fn(40, 30, |x, y| [if x < 20 { 60 } else { 180 }, 120, (4 * y) as u8]);
        let styled = |config: StyleConfig| {
            let mut stream = lo_random::stream(3, "test", 0);
            (0..20).map(|_| config.apply(&photo, &mut stream)).collect::<Vec<_>>()
        };
        assert!(styled(StyleConfig::default()).iter().all(|same| *same == photo));
        let level = |image: &Image<[u8; 3]>| f32::from(image[(5, 15)][1]);
        let contrast: Vec<f32> =
            styled(StyleConfig { contrast: 0.4, ..StyleConfig::default() }).iter().map(level).collect();
        // 120 of 255 to the power of e^0.4 and of e^-0.4: 83 and 154.
        assert!(
            contrast.iter().all(|v| (82.0..=155.0).contains(v)) && contrast.iter().any(|v| (v - 120.0).abs() > 10.0)
        );
        let spread = |image: &Image<[u8; 3]>| f32::from(image[(35, 2)][0]) - f32::from(image[(35, 2)][2]);
        let grey = styled(StyleConfig { saturation: 1.0, ..StyleConfig::default() });
        assert!(grey.iter().any(|image| spread(image) < 60.0) && grey.iter().all(|image| spread(image) >= 0.0));
        let edge = |image: &Image<[u8; 3]>| i32::from(image[(20, 15)][0]) - i32::from(image[(19, 15)][0]);
        let soft = styled(StyleConfig { blur_px: 3.0, ..StyleConfig::default() });
        assert!(soft.iter().any(|image| edge(image) < 60) && soft.iter().any(|image| edge(image) == 120));
        let noisy = styled(StyleConfig { noise: 0.1, ..StyleConfig::default() });
        let rough = |image: &Image<[u8; 3]>| (0..30).any(|y| image[(3, y)][1].abs_diff(120) > 6);
        assert!(noisy.iter().any(rough) && !noisy.iter().all(rough));
    }
}
