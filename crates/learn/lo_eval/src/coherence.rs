//! The paper's spatial coherence metric.

use lo_dataset::NovelView;
use lo_imaging::{DepthMap, RadianceImage};
use lo_metrics::solid_angles_sr;

/// The paper's α, which it does not state. With depth from 0 to 1, the sharpest depth edge has the weight e².
const ALPHA: f64 = 1.0;

/// Returns `L_SC = (1/N) Σ |L̃ − L| ⊙ exp(α ‖∇D‖₁)` over the N panoramas of one scene (`docs/method.md` §9).
///
/// Errors at depth edges, where light changes as the probe moves, have more weight. `None` if no panorama has depth.
///
/// The paper leaves open the following choices:
/// - `L` is `ln(1 + radiance)`, as in its losses.
/// - The mean is over pixels by solid angle, over channels, then over panoramas. Weights are not normalised.
/// - `D` is the true distance divided by its maximum in the panorama; pixels without a reading (sky) count as 1.
/// - `∇` is the difference to the next pixel to the right (wrapping around) and below.
/// - α = 1.
///
/// The figures are therefore not comparable with the paper's (0.23 to 0.29 on FutureHouse), only among methods.
pub fn coherence<'a>(pairs: impl IntoIterator<Item = (&'a NovelView, &'a RadianceImage)>) -> Option<f64> {
    let errors: Vec<f64> = pairs
        .into_iter()
        .filter_map(|(view, got)| view.depth_m.as_ref().map(|depth_m| weighted_error(&view.radiance, got, depth_m)))
        .collect();
    (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
}

/// Returns the metric of one panorama.
fn weighted_error(truth: &RadianceImage, got: &RadianceImage, depth_m: &DepthMap) -> f64 {
    let (width, height) = (truth.width(), truth.height());
    let reading = |z: &f32| z.is_finite() && *z > 0.0;
    let farthest = depth_m.pixels().iter().copied().filter(reading).fold(0.0, f32::max);
    let depth = |x: usize, y: usize| {
        let z = depth_m[(x * depth_m.width() / width, y * depth_m.height() / height)];
        if reading(&z) { f64::from(z / farthest) } else { 1.0 }
    };
    let angles = solid_angles_sr(width, height);
    let [mut sum, mut total] = [0.0f64; 2];
    for (index, ((a, b), &angle)) in truth.pixels().iter().zip(got.pixels()).zip(&angles).enumerate() {
        let (x, y) = (index % width, index / width);
        let here = depth(x, y);
        let gradient = (depth((x + 1) % width, y) - here).abs() + (depth(x, (y + 1).min(height - 1)) - here).abs();
        let log = |v: f32| f64::from(v.max(0.0)).ln_1p();
        let error = (0..3).map(|c| (log(b[c]) - log(a[c])).abs()).sum::<f64>() / 3.0;
        sum += f64::from(angle) * error * (ALPHA * gradient).exp();
        total += f64::from(angle);
    }
    sum / total
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_geometry::{Quat, Vec3};

    #[test]
    fn closed_form() {
        let e = std::f32::consts::E;
        // ln(1 + L) is 1 everywhere, the estimate is black; one half of the sphere is twice as far as the other.
        let (width, height) = (16, 8);
        let depth_m = DepthMap::from_fn(width, height, |x, _| if x < width / 2 { 1.0 } else { 2.0 });
        let view = NovelView {
            position_m: Vec3::ZERO,
            rotation: Quat::IDENTITY,
            radiance: RadianceImage::new(width, height, vec![[e - 1.0; 3]; width * height]),
            depth_m: Some(depth_m),
        };
        let black = RadianceImage::new(width, height, vec![[0.0; 3]; width * height]);
        // Two of sixteen columns have a depth step of 1/2.
        let expected = (14.0 + 2.0 * 0.5f64.exp()) / 16.0;
        let same = view.clone();
        assert!((coherence([(&view, &black)]).unwrap() - expected).abs() < 1e-6);
        let half = coherence([(&view, &black), (&same, &same.radiance)]).unwrap();
        assert!((half - expected / 2.0).abs() < 1e-6);
        let flat = NovelView { depth_m: None, ..view };
        assert_eq!(coherence([(&flat, &black)]), None);
    }
}
