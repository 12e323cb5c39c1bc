//! Two guesses of light that the photo does not show are better than one: the light network's, and the single map of the global decoder.

use lo_imaging::{RadianceImage, luminance, sample_equirectangular};
use lo_octree::LightOctree;

use crate::light::refine::{guess, known};

/// Weight of the map's brightness beside that of the light network's guess (`docs/design/010-brightness-of-two-guesses.md`).
const MAP_SHARE: f32 = 0.4;

/// Gives what is guessed of the nodes of `light` a brightness between the guess and what a panorama at the camera shows in their direction: the
/// weighted mean of both log(1 + luminance). Colour, opacity, and what is known from `visible` stay.
///
/// `map` is turned as the octrees' frame is, whose origin is the camera.
pub(crate) fn blend(light: &mut LightOctree, visible: &LightOctree, map: &RadianceImage) {
    for (depth, level) in (0..).zip(light.octree.levels()) {
        for (key, rgba) in level.row_keys().zip(&mut light.rgba[depth as usize]) {
            let known = known(visible, depth, key);
            let doubt = 1.0 - known.map_or(0.0, |(_, seen)| f32::from(seen) / 255.0);
            let [r, g, b, _] = guess(*rgba, known);
            let brightness = luminance([r, g, b]);
            if doubt == 0.0 || brightness == 0.0 {
                continue;
            }
            let shown = luminance(sample_equirectangular(map, lo_octree::node_middle_m(light.cube, depth, key)));
            let blended = ((1.0 - MAP_SHARE) * brightness.ln_1p() + MAP_SHARE * shown.ln_1p()).exp_m1();
            let change = doubt * (blended / brightness - 1.0);
            rgba.iter_mut().zip([r, g, b]).for_each(|(c, guess)| *c += change * guess);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Cube, Vec3, pixel_direction};
    use lo_octree::{Coverage, RadiancePoint};

    use super::*;

    /// Surfaces in six directions, those below seen half.
    fn room() -> LightOctree {
        let cube = Cube::centred(Vec3::ZERO, 8.0);
        let at = |position_m: Vec3, coverage| RadiancePoint { position_m, radiance: [0.9, 0.6, 0.3], coverage };
        let place = |axis: Vec3, i: usize| 2.9 * axis + 0.01 * i as f32 * Vec3::ONE;
        let points: Vec<RadiancePoint> = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]
            .into_iter()
            .flat_map(|axis| (0..4).map(move |i| (axis, i)))
            .map(|(axis, i)| {
                let seen = axis == Vec3::NEG_Z || (axis == Vec3::NEG_Y && i < 2);
                at(place(axis, i), if seen { Coverage::Seen } else { Coverage::Inferred })
            })
            .collect();
        LightOctree::from_points(&points, cube, 4, 2).unwrap().0
    }

    #[test]
    fn brightness_lies_between_both_guesses_and_colour_stays() {
        let visible = room();
        let mut light = visible.clone();
        // The network guesses twice as much light as there is.
        for (rows, seen) in light.rgba.iter_mut().zip(&visible.seen) {
            for (rgba, &seen) in rows.iter_mut().zip(seen) {
                let guess = 2.0 - f32::from(seen) / 255.0;
                rgba[..3].iter_mut().for_each(|c| *c *= guess);
            }
        }
        let before = light.clone();
        let map = RadianceImage::from_fn(64, 32, |x, y| [1.0 + pixel_direction(x, y, 64, 32).y; 3]);
        blend(&mut light, &visible, &map);
        assert_eq!((&light.octree, &light.seen), (&before.octree, &before.seen));
        let level = &light.octree.levels()[4];
        let rows = level.row_keys().zip(&light.rgba[4]).zip(&before.rgba[4]).zip(&visible.seen[4]);
        let mut half_seen = 0;
        for (((key, after), before), &seen) in rows {
            if seen == 255 {
                assert_eq!(after, before);
                continue;
            }
            let trust = f64::from(seen) / 255.0;
            half_seen += u32::from(seen > 0);
            let up = f64::from(light.node_middle_m(4, key).normalize().y);
            let guess: f64 = 2.0 * (0.2126 * 0.9 + 0.7152 * 0.6 + 0.0722 * 0.3);
            let blended = (1.0 + guess).powf(0.6) * (2.0 + up).powf(0.4) - 1.0;
            for (c, own) in [0.9, 0.6, 0.3].into_iter().enumerate() {
                let expected = own * (trust + (1.0 - trust) * 2.0 * blended / guess);
                assert!((f64::from(after[c]) - expected).abs() < 0.02 * expected, "{after:?}: {expected}");
            }
            assert_eq!(after[3], before[3]);
        }
        assert!(half_seen > 0 && light.rgba[2] != before.rgba[2]);
    }

    #[test]
    fn what_is_black_stays_black() {
        let visible = room();
        let mut light = visible.clone();
        light.rgba.iter_mut().flatten().for_each(|rgba| rgba[..3].fill(0.0));
        let before = light.clone();
        blend(&mut light, &visible, &RadianceImage::from_fn(4, 2, |_, _| [1.0; 3]));
        assert_eq!(light, before);
    }
}
