//! The sRGB transfer function (IEC 61966-2-1) and Rec. 709 luminance.

use std::sync::LazyLock;

/// Converts an sRGB value to linear light (IEC 61966-2-1). The curve is continued above 1 and is odd below 0.
#[inline]
pub fn linear_from_srgb(value: f32) -> f32 {
    let magnitude = value.abs();
    let linear = if magnitude <= 0.040_45 { magnitude / 12.92 } else { ((magnitude + 0.055) / 1.055).powf(2.4) };
    linear.copysign(value)
}

/// Converts linear light to an sRGB value: the inverse of [`linear_from_srgb`].
#[inline]
pub fn srgb_from_linear(value: f32) -> f32 {
    let magnitude = value.abs();
    let srgb = if magnitude <= 0.003_130_8 { magnitude * 12.92 } else { 1.055 * magnitude.powf(1.0 / 2.4) - 0.055 };
    srgb.copysign(value)
}

/// Converts an 8-bit sRGB value to linear light.
#[inline]
pub fn linear_from_srgb8(value: u8) -> f32 {
    static TABLE: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|i| linear_from_srgb(i as f32 / 255.0)));
    TABLE[usize::from(value)]
}

/// Converts linear light to the nearest 8-bit sRGB value. Values outside `[0, 1]` are clipped; NaN becomes 0.
#[inline]
pub fn srgb8_from_linear(value: f32) -> u8 {
    // `as` saturates and converts NaN to 0
    (srgb_from_linear(value) * 255.0 + 0.5) as u8
}

/// Relative luminance of linear Rec. 709 RGB: 0.2126 R + 0.7152 G + 0.0722 B.
#[inline]
pub fn luminance(rgb: [f32; 3]) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_follows_the_standard() {
        // the standard's formula in f64 at middle grey, and the published value of code 128
        assert!((linear_from_srgb8(128) - 0.215_860_5).abs() < 1e-6);
        assert!((linear_from_srgb8(10) - (10.0 / 255.0 / 12.92) as f32).abs() < 1e-9);
        assert!((srgb_from_linear(0.18) - 0.461_356_1).abs() < 1e-5);
        // the two branches meet within the precision of the standard's constants
        assert!((linear_from_srgb(0.040_45) - linear_from_srgb(0.040_451)).abs() < 1e-6);
        assert_eq!(luminance([1.0; 3]), 1.0);
    }

    #[test]
    fn every_8_bit_value_survives() {
        for value in 0..=255u8 {
            assert_eq!(srgb8_from_linear(linear_from_srgb8(value)), value);
        }
        assert_eq!(srgb8_from_linear(-1.0), 0);
        assert_eq!(srgb8_from_linear(7.0), 255);
        assert_eq!(srgb8_from_linear(f32::NAN), 0);
        assert_eq!(srgb8_from_linear(f32::INFINITY), 255);
    }
}
