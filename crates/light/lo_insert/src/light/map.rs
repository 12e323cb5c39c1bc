//! Environment maps at infinity, split into lights and the rest.

use std::f32::consts::{PI, TAU};

use lo_geometry::Vec3;
use lo_imaging::{Image, RadianceImage};
use lo_lights::{LightPatch, PatchShape, cap_luminance, excess};

/// Splits a map at the cap (see [`crate::light::samples`]): patches of light, and the map without their excess.
pub(crate) fn split(map: &RadianceImage) -> (Vec<LightPatch>, RadianceImage) {
    let (width, height) = (map.width(), map.height());
    let solid_angle = |y: usize| lo_geometry::pixel_solid_angle_sr(y, width, height);
    let cap = cap_luminance(lo_imaging::mean_luminance(map) as f32);
    let mut emitters = Vec::new();
    let dimmed = Image::from_fn(width, height, |x, y| {
        let radiance = Vec3::from(map[(x, y)]);
        let light = excess(radiance, cap);
        if light != Vec3::ZERO {
            let direction = lo_geometry::pixel_direction(x, y, width, height);
            let east = Vec3::new(-direction.z, 0.0, direction.x);
            let north = direction.cross(east.normalize_or(Vec3::X));
            let tangents = [east * (TAU / width as f32), north * (PI / height as f32)];
            emitters.push(LightPatch {
                shape: PatchShape::Infinity { direction, tangents },
                radiance: light,
                extent: solid_angle(y),
            });
        }
        (radiance - light).to_array()
    });
    (emitters, dimmed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splitting_loses_no_light() {
        let map =
            Image::from_fn(64, 32, |x, y| if x == 20 && y < 9 && y > 6 { [500.0, 400.0, 300.0] } else { [0.5; 3] });
        let (emitters, dimmed) = split(&map);
        assert_eq!(emitters.len(), 2);
        let total = |image: &RadianceImage| -> f64 {
            let weight = |i: usize| f64::from(lo_geometry::pixel_solid_angle_sr(i / 64, 64, 32));
            image.pixels().iter().enumerate().map(|(i, p)| weight(i) * f64::from(p[0])).sum()
        };
        let lights: f64 = emitters.iter().map(|e| f64::from(e.radiance.x * e.extent)).sum();
        assert!((total(&map) - total(&dimmed) - lights).abs() < 1e-4 * total(&map));
    }
}
