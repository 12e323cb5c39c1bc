//! Conversion between light colour and colour temperature.

use lo_geometry::{Vec2, Vec3};
use lo_scene::LightColor;

/// Range of reported colour temperatures, in kelvin. McCamy's formula is accurate from 2,000 to 12,500 K, and
/// approximate in this range.
const TOLD_K: std::ops::RangeInclusive<f32> = 1600.0..=20_000.0;

/// Greatest distance from the Planckian locus in CIE 1960 uv at which a colour temperature is meaningful (CIE 15:2004,
/// 9.5).
const MAX_DISTANCE_UV: f32 = 0.05;

/// Least share of a light's luminance that each channel is assumed to have when its colour is changed. A gain cannot
/// add blue to light that has none.
const MIN_CHANNEL: f32 = 0.02;

/// Returns the correlated colour temperature in kelvin of linear Rec. 709 light; `None` if it is far from any black
/// body's colour.
///
/// C. S. McCamy, "Correlated color temperature as an explicit function of chromaticity coordinates", Color Research &
/// Application 17 (1992).
pub fn color_temperature_k(rgb: [f32; 3]) -> Option<f32> {
    let xy = xy_from_rgb(rgb)?;
    let n = (xy.x - 0.3320) / (0.1858 - xy.y);
    let kelvin = 449.0 * n.powi(3) + 3525.0 * n * n + 6823.3 * n + 5520.33;
    let near = || (uv(xy) - uv(planckian_xy(kelvin))).length() <= MAX_DISTANCE_UV;
    (TOLD_K.contains(&kelvin) && near()).then_some(kelvin)
}

/// Returns linear Rec. 709 of luminance 1 in this colour; colours outside the gamut are clipped to its edge.
pub fn rgb_from_color(color: LightColor) -> Vec3 {
    let rgb = match color {
        LightColor::Kelvin(kelvin) => rgb_from_xy(planckian_xy(kelvin)),
        LightColor::Rgb(rgb) => Vec3::from(rgb),
    };
    let rgb = rgb.max(Vec3::ZERO);
    rgb / lo_imaging::luminance(rgb.to_array()).max(1e-9)
}

/// Returns the gain per channel that changes light of colour `own` to this colour at the same luminance (von Kries).
pub(crate) fn gain_to_color(own: Vec3, color: LightColor) -> Vec3 {
    let luminance = lo_imaging::luminance(own.to_array());
    if luminance <= 0.0 {
        return Vec3::ONE;
    }
    let gain = rgb_from_color(color) * luminance / own.max(Vec3::splat(MIN_CHANNEL * luminance));
    gain * (luminance / lo_imaging::luminance((own * gain).to_array()).max(1e-9))
}

/// Returns the chromaticity of a black body from 1667 to 25,000 K, clamped to that range.
///
/// Cubic splines of Kim et al., "Design of advanced color temperature control system for HDTV applications", Journal of
/// the Korean Physical Society 41 (2002).
fn planckian_xy(kelvin: f32) -> Vec2 {
    let t = f64::from(kelvin.clamp(lo_scene::MIN_KELVIN, lo_scene::MAX_KELVIN));
    let i = 1e3 / t;
    let x = if t <= 4000.0 {
        ((-0.266_123_9 * i - 0.234_358_9) * i + 0.877_695_6) * i + 0.179_910
    } else {
        ((-3.025_846_9 * i + 2.107_037_9) * i + 0.222_634_7) * i + 0.240_390
    };
    let y = if t <= 2222.0 {
        ((-1.106_381_4 * x - 1.348_110_20) * x + 2.185_558_32) * x - 0.202_196_83
    } else if t <= 4000.0 {
        ((-0.954_947_6 * x - 1.374_185_93) * x + 2.091_370_15) * x - 0.167_488_67
    } else {
        ((3.081_758_0 * x - 5.873_386_70) * x + 3.751_129_97) * x - 0.370_014_83
    };
    Vec2::new(x as f32, y as f32)
}

/// Converts to CIE 1960 uniform chromaticity.
fn uv(xy: Vec2) -> Vec2 {
    Vec2::new(4.0 * xy.x, 6.0 * xy.y) / (-2.0 * xy.x + 12.0 * xy.y + 3.0)
}

/// Converts to chromaticity by IEC 61966-2-1; `None` for black.
fn xy_from_rgb([r, g, b]: [f32; 3]) -> Option<Vec2> {
    let x = 0.4124 * r + 0.3576 * g + 0.1805 * b;
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let z = 0.0193 * r + 0.1192 * g + 0.9505 * b;
    let sum = x + y + z;
    (sum > 1e-9 && sum.is_finite()).then(|| Vec2::new(x, y) / sum)
}

/// Converts chromaticity to linear Rec. 709 of luminance 1.
fn rgb_from_xy(xy: Vec2) -> Vec3 {
    let (x, z) = (xy.x / xy.y, (1.0 - xy.x - xy.y) / xy.y);
    Vec3::new(3.2406 * x - 1.5372 - 0.4986 * z, -0.9689 * x + 1.8758 + 0.0415 * z, 0.0557 * x - 0.2040 + 1.0570 * z)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn published_white_points_have_their_temperatures() {
        // D65, D50 and illuminant A, from CIE 15:2004; correlated colour temperatures 6504, 5003 and 2856 K.
        for (xy, kelvin) in
            [((0.31271, 0.32902), 6504.0), ((0.34567, 0.35850), 5003.0), ((0.44757, 0.40745), 2856.0f32)]
        {
            let found = color_temperature_k(rgb_from_xy(Vec2::new(xy.0, xy.1)).to_array()).unwrap();
            assert!((found / kelvin - 1.0).abs() < 0.005, "{found} for {kelvin}");
        }
        assert!((color_temperature_k([1.0; 3]).unwrap() / 6504.0 - 1.0).abs() < 0.005);
        for coloured in [[0.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0; 3]] {
            assert_eq!(color_temperature_k(coloured), None, "{coloured:?}");
        }
    }

    #[test]
    fn black_bodies_are_where_plancks_law_has_them() {
        // Chromaticities by integration of Planck's law with the CIE 1931 observer (Wyszecki & Stiles, table 1(3.11)).
        for (kelvin, x, y) in
            [(2000.0, 0.5267, 0.4133), (3000.0, 0.4369, 0.4041), (5000.0, 0.3451, 0.3516), (10_000.0, 0.2807, 0.2884)]
        {
            let xy = planckian_xy(kelvin);
            assert!((xy - Vec2::new(x, y)).length() < 1e-3, "{kelvin}: {xy}");
        }
    }

    proptest! {
        #[test]
        fn temperatures_come_back(kelvin in 2000.0f32..10_000.0) {
            let rgb = rgb_from_color(LightColor::Kelvin(kelvin));
            prop_assert!((lo_imaging::luminance(rgb.to_array()) - 1.0).abs() < 1e-4);
            prop_assert!((color_temperature_k(rgb.to_array()).unwrap() / kelvin - 1.0).abs() < 0.02);
        }

        #[test]
        fn another_colour_keeps_the_luminance(own in prop::array::uniform3(0.0f32..50.0), kelvin in 2000.0f32..10_000.0) {
            let own = Vec3::from(own);
            let before = lo_imaging::luminance(own.to_array());
            prop_assume!(before > 1e-3);
            let after = own * gain_to_color(own, LightColor::Kelvin(kelvin));
            prop_assert!((lo_imaging::luminance(after.to_array()) / before - 1.0).abs() < 1e-3);
            // Light that has all channels reaches the colour.
            if own.min_element() > MIN_CHANNEL * before {
                prop_assert!((color_temperature_k(after.to_array()).unwrap() / kelvin - 1.0).abs() < 0.02);
            }
        }
    }
}
