//! Depth Anything V2: its input, and the meaning of its output. Yang et al., "Depth Anything V2" (NeurIPS 2024).

use lo_imaging::{DepthMap, Image};

/// Mean of ImageNet, subtracted from values of 0 to 1.
pub(crate) const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
/// Standard deviation of ImageNet.
pub(crate) const DEVIATION: [f32; 3] = [0.229, 0.224, 0.225];
/// Side of a patch in pixels; sizes are multiples of it.
const PATCH: usize = 14;
/// Shorter side that the networks were trained at, in pixels.
const SIDE: usize = 518;
/// Beyond this aspect ratio a photo is resized by area instead of by its shorter side.
const LONGEST: f64 = 2.0;

/// Width and height to which a photo of `photo` pixels is resized: shorter side 518 as in the publisher's code, both
/// multiples of 14.
pub(crate) fn input_size(photo: (usize, usize)) -> (usize, usize) {
    let (width, height) = (photo.0 as f64, photo.1 as f64);
    let scale = (SIDE as f64 / width.min(height)).min(SIDE as f64 * (LONGEST / (width * height)).sqrt());
    let side = |pixels: f64| ((pixels * scale / PATCH as f64).round() as usize).max(1) * PATCH;
    (side(width), side(height))
}

/// Meaning of the output, recognised by the last operators before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Variant {
    /// Metres: a sigmoid times the largest depth.
    Metric,
    /// Affine inverse depth, not negative.
    Relative,
}

/// Recognises the variant by the last activation, given operators from the output backwards. Both variants have
/// the same names and shapes.
pub(crate) fn variant<'a>(backwards: impl IntoIterator<Item = &'a str>) -> Option<Variant> {
    for operator in backwards {
        match operator {
            "Sigmoid" => return Some(Variant::Metric),
            "Relu" => return Some(Variant::Relative),
            "Mul" | "Squeeze" | "Unsqueeze" | "Reshape" | "Transpose" | "Identity" | "Cast" | "Resize" | "Slice" => {}
            _ => return None,
        }
    }
    None
}

/// The output as metres; 0 where it is not finite or not positive.
pub(crate) fn metres(depth: &Image<f32>) -> DepthMap {
    depth.map(|&z| if z.is_finite() && z > 0.0 { z } else { 0.0 })
}

/// The output as affine inverse depth; NaN where it is not finite or not positive. Zero marks the farthest distance and
/// has no usable inverse.
pub(crate) fn inverse(depth: &Image<f32>) -> Image<f32> {
    depth.map(|&d| if d.is_finite() && d > 0.0 { d } else { f32::NAN })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn sizes_are_those_of_the_publisher() {
        assert_eq!(input_size((518, 518)), (518, 518));
        assert_eq!(input_size((1920, 1440)), (686, 518));
        assert_eq!(input_size((1440, 1920)), (518, 686));
        assert_eq!(input_size((1920, 1080)), (924, 518));
        assert_eq!(input_size((100, 75)), (686, 518));
        // 4000 × 500 by area: 518² · 2 pixels at 8:1.
        assert_eq!(input_size((4000, 500)), (2072, 266));
    }

    proptest! {
        #[test]
        fn sizes_are_bounded_multiples_of_a_patch(width in 1usize..20_000, height in 1usize..20_000) {
            let (w, h) = input_size((width, height));
            prop_assert!(w % PATCH == 0 && h % PATCH == 0 && w > 0 && h > 0);
            // Rounding matters more where a narrow strip has few patches.
            let thin = width.max(height) / width.min(height) > 20;
            prop_assert!(thin || w * h <= 2 * SIDE * SIDE * 21 / 20, "{w} × {h}");
        }
    }

    #[test]
    fn the_last_activation_tells_metric_from_relative() {
        assert_eq!(variant(["Squeeze", "Mul", "Sigmoid", "Conv"]), Some(Variant::Metric));
        assert_eq!(variant(["Squeeze", "Mul", "Relu", "Conv", "Sigmoid"]), Some(Variant::Relative));
        assert_eq!(variant(["Relu"]), Some(Variant::Relative));
        assert_eq!(variant(["Squeeze", "Conv", "Relu"]), None);
        assert_eq!(variant([]), None);
    }

    #[test]
    fn values_that_are_not_finite_are_no_reading() {
        let output = Image::new(5, 1, vec![2.0, 0.0, -1.0, f32::NAN, f32::INFINITY]);
        assert_eq!(metres(&output).pixels(), [2.0, 0.0, 0.0, 0.0, 0.0]);
        let inverse = inverse(&output);
        assert!(inverse.pixels()[0] == 2.0 && inverse.pixels()[1..].iter().all(|d| d.is_nan()));
    }
}
