//! Absolute photometric units and emission of lamps.
//!
//! One unit of radiance (luminance of linear RGB) is 100 cd/m². A wall of reflectance 0.7 under 300 lx has 67 cd/m² or
//! 0.67 units. Ceiling panels have 20–60 units, bare bulbs 100–1,000, an overcast sky 10–60, the sun's disc about 10⁷.

use std::ops::Range;

use crate::palette::Palette;
use crate::solids::Shape;

/// Luminance of one unit of radiance, cd/m².
pub const UNIT_CD_M2: f32 = 100.0;

/// Angular radius of the sun's disc, radians.
pub(crate) const SUN_RADIUS_RAD: f32 = 0.004_65;

/// Light of a lamp that is on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glow {
    pub flux_lm: f32,
    /// Correlated colour temperature.
    pub kelvin: f32,
}

/// Makes the triangles from `first` on emit the lamp's flux as a uniform Lambertian surface.
pub(crate) fn emit_from(palette: &mut Palette, shape: &mut Shape, first: usize, glow: &Glow) {
    let end = shape.triangles.len();
    emit_range(palette, shape, first..end, glow);
}

/// Makes a range of triangles emit the lamp's flux as a uniform Lambertian surface.
pub(crate) fn emit_range(palette: &mut Palette, shape: &mut Shape, range: Range<usize>, glow: &Glow) {
    let area_m2 = shape.area(range.clone()).max(1e-6);
    let luminance = glow.flux_lm / (std::f32::consts::PI * area_m2);
    let radiance = luminance_color(glow.kelvin).map(|c| c * luminance / UNIT_CD_M2);
    let paint = palette.emitter("lamp", radiance);
    for material in &mut shape.materials[range] {
        *material = paint.material;
    }
}

/// Linear RGB of a black body at luminance 1 (Krystek 1985 in CIE 1960 u, v; 1,000–15,000 K).
pub(crate) fn luminance_color(kelvin: f32) -> [f32; 3] {
    let t = f64::from(kelvin.clamp(1000.0, 15_000.0));
    let u = (0.860_117_757 + 1.541_182_54e-4 * t + 1.286_412_12e-7 * t * t)
        / (1.0 + 8.424_202_35e-4 * t + 7.081_451_63e-7 * t * t);
    let v = (0.317_398_726 + 4.228_062_45e-5 * t + 4.204_816_91e-8 * t * t)
        / (1.0 - 2.897_418_16e-5 * t + 1.614_560_53e-7 * t * t);
    let (x, y) = (3.0 * u / (2.0 * u - 8.0 * v + 4.0), 2.0 * v / (2.0 * u - 8.0 * v + 4.0));
    from_xyz([x / y, 1.0, (1.0 - x - y) / y])
}

/// Converts CIE XYZ to linear Rec. 709. Negative channels are clipped at constant luminance.
pub(crate) fn from_xyz([x, y, z]: [f64; 3]) -> [f32; 3] {
    let rgb = [
        3.240_969_94 * x - 1.537_383_18 * y - 0.498_610_76 * z,
        -0.969_243_64 * x + 1.875_967_5 * y + 0.041_555_06 * z,
        0.055_630_08 * x - 0.203_976_96 * y + 1.056_971_51 * z,
    ]
    .map(|c| c.max(0.0) as f32);
    let found = lo_imaging::luminance(rgb);
    let scale = if found > 0.0 { y as f32 / found } else { 0.0 };
    rgb.map(|c| c * scale)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn black_bodies_have_their_colours() {
        // 6504 K is close to D65, which lies slightly off the Planckian locus.
        let white = luminance_color(6504.0);
        assert!(white.iter().all(|c| (c - 1.0).abs() < 0.06), "{white:?}");
        // Charity's table of black-body colours (D65 white) gives #ffa957 for 2,700 K: linear 1, 0.397, 0.095.
        let bulb = luminance_color(2700.0);
        assert!((bulb[1] / bulb[0] - 0.397).abs() < 0.04 && (bulb[2] / bulb[0] - 0.095).abs() < 0.03, "{bulb:?}");
        assert!((lo_imaging::luminance(bulb) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_lamp_gives_off_its_flux() {
        let style =
            crate::palette::Style::draw(&mut lo_random::stream(1, "", 0), crate::palette::Mood::Light, false, false);
        let mut palette = Palette::new(1, 0, style);
        let mut shape = Shape::default();
        let paint = palette.paint(crate::palette::Finish::Matte);
        shape.ball(lo_geometry::Vec3::ZERO, [0.15, 0.15], 48, paint);
        emit_from(&mut palette, &mut shape, 0, &Glow { flux_lm: 800.0, kelvin: 2700.0 });
        let emissive = palette.materials.last().unwrap().emissive;
        // A ball of radius 0.15 m has 0.2827 m² (the polyhedron slightly less): 800 / (π · 0.2827) = 900.7 cd/m².
        assert!((lo_imaging::luminance(emissive) - 9.007).abs() < 0.15);
    }
}
