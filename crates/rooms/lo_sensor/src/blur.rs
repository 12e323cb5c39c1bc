use lo_imaging::RadianceImage;

/// Gaussian blur with clamped borders.
pub(crate) fn blurred(image: &RadianceImage, sigma_px: f32) -> RadianceImage {
    let radius = (3.0 * sigma_px).ceil() as usize;
    if radius == 0 || image.pixels().is_empty() {
        return image.clone();
    }
    let mut weights: Vec<f32> = (0..=radius).map(|i| (-0.5 * (i as f32 / sigma_px).powi(2)).exp()).collect();
    let total = weights[0] + 2.0 * weights[1..].iter().sum::<f32>();
    weights.iter_mut().for_each(|w| *w /= total);
    let (width, height) = (image.width(), image.height());
    let pass = |source: &RadianceImage, dx: usize, dy: usize| {
        RadianceImage::from_fn(width, height, |x, y| {
            let mut sum = source[(x, y)].map(|v| v * weights[0]);
            for (i, weight) in weights.iter().enumerate().skip(1) {
                let before = source[(x.saturating_sub(i * dx), y.saturating_sub(i * dy))];
                let after = source[((x + i * dx).min(width - 1), (y + i * dy).min(height - 1))];
                for c in 0..3 {
                    sum[c] += weight * (before[c] + after[c]);
                }
            }
            sum
        })
    };
    pass(&pass(image, 1, 0), 0, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blur_keeps_light_and_has_the_stated_width() {
        let mut point = RadianceImage::new(41, 41, vec![[0.0; 3]; 41 * 41]);
        point[(20, 20)] = [100.0; 3];
        let spread = blurred(&point, 1.5);
        let sum: f32 = spread.pixels().iter().map(|p| p[0]).sum();
        assert!((sum - 100.0).abs() < 0.01);
        let second: f32 =
            (0..41).map(|x| (0..41).map(|y| spread[(x, y)][0]).sum::<f32>() * (x as f32 - 20.0).powi(2)).sum();
        // Variance of the Gaussian cut at 3.3 σ.
        assert!((second / 100.0 - 2.25).abs() < 0.08, "{}", second / 100.0);
    }
}
