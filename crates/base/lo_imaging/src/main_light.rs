use std::borrow::Cow;

use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr};
use serde::{Deserialize, Serialize};

use crate::{RadianceImage, Sh9, luminance, resize_equirectangular};

/// The light that contributes the most power at a point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MainLight {
    /// Unit direction towards the light's power-weighted centre, in the map's frame.
    pub direction: [f32; 3],
    /// Solid angle of the light, in steradians.
    pub solid_angle_sr: f32,
    /// Mean radiance, linear RGB.
    pub radiance: [f32; 3],
    /// Irradiance on a surface that faces the light (∫ L cos θ dω), linear RGB.
    pub power: [f32; 3],
    /// Share of the light in the luminous ∫ L dω of the whole map, from 0 to 1.
    pub share: f32,
}

/// Least ratio of a light's luminance to the map's mean: a wall or a sky that fills half of the sphere is not a light.
const MIN_MEAN_RATIO: f32 = 2.0;

/// Share of a light's peak luminance below which it ends.
const MIN_PEAK_SHARE: f32 = 1.0 / 3.0;

/// Width of the downsampled map in which lights are detected: 0.7° a pixel.
const WORKING_WIDTH: usize = 512;

/// Gap, in pixels of that map, up to which parts are joined: bars of windows, grilles of lamps.
const MAX_GAP_PX: i64 = 2;

/// Finds the light of the greatest power in an equirectangular map; `None` if nothing stands out.
///
/// Uses the seeds and region growing with which Gardner et al. fit parametric lights ("Deep Parametric Indoor Lighting
/// Estimation", ICCV 2019). A region grows from the brightest pixel over connected pixels down to a third of its peak.
/// The next one starts at the brightest remaining pixel, until none is twice as bright as the mean.
///
/// In addition, the map is first reduced to 512 columns by solid angle, and regions cross the seam, the poles and gaps
/// of a degree. The region with the greatest ∫ luminance dω wins; an isolated hot pixel has little power.
pub fn main_light(map: &RadianceImage) -> Option<MainLight> {
    find(&working_map(map)).map(|(light, _)| light)
}

/// Splits the light of an equirectangular map into its main light ([`main_light`]) and the rest.
///
/// The irradiance of both together is that of the map.
pub fn split_main_light(map: &RadianceImage) -> (Option<MainLight>, Sh9) {
    let map = working_map(map);
    let Some((light, region)) = find(&map) else { return (None, Sh9::project(&map)) };
    let mut rest = map.into_owned();
    for index in region {
        rest.pixels_mut()[index] = [0.0; 3];
    }
    (Some(light), Sh9::project(&rest))
}

/// Returns the map with at most [`WORKING_WIDTH`] columns.
fn working_map(map: &RadianceImage) -> Cow<'_, RadianceImage> {
    if map.width() <= WORKING_WIDTH {
        return Cow::Borrowed(map);
    }
    Cow::Owned(resize_equirectangular(map, WORKING_WIDTH, (map.height() * WORKING_WIDTH / map.width()).max(1)))
}

/// Finds the main light and its pixels.
fn find(map: &RadianceImage) -> Option<(MainLight, Vec<usize>)> {
    let (width, height) = (map.width(), map.height());
    let solid_angle = |index: usize| pixel_solid_angle_sr(index / width, width, height);
    let brightness: Vec<f32> = map
        .pixels()
        .iter()
        .map(|&rgb| Some(luminance(rgb)).filter(|l| l.is_finite()).map_or(0.0, |l| l.max(0.0)))
        .collect();
    let flux = |index: usize| f64::from(brightness[index] * solid_angle(index));
    let total: f64 = (0..brightness.len()).map(flux).sum();
    let threshold = MIN_MEAN_RATIO * (total / (4.0 * std::f64::consts::PI)) as f32;

    let mut seeds: Vec<usize> = (0..brightness.len()).filter(|&i| brightness[i] > threshold).collect();
    // brightest first, ties by index
    seeds.sort_by(|&a, &b| brightness[b].total_cmp(&brightness[a]).then(a.cmp(&b)));
    let mut taken = vec![false; brightness.len()];
    let mut best: Option<(f64, Vec<usize>)> = None;
    for seed in seeds {
        if taken[seed] {
            continue;
        }
        let floor = threshold.max(MIN_PEAK_SHARE * brightness[seed]);
        let region = grow(seed, (width, height), &mut taken, |index| brightness[index] > floor);
        let power: f64 = region.iter().map(|&index| flux(index)).sum();
        if best.as_ref().is_none_or(|(greatest, _)| power > *greatest) {
            best = Some((power, region));
        }
    }
    let (power, region) = best?;
    Some((describe(map, &region, (power / total) as f32, solid_angle, flux), region))
}

/// Grows a region from the seed over bright pixels within [`MAX_GAP_PX`] of one another; marks them as taken.
fn grow(
    seed: usize,
    (width, height): (usize, usize),
    taken: &mut [bool],
    bright: impl Fn(usize) -> bool,
) -> Vec<usize> {
    let (w, h) = (width as i64, height as i64);
    let mut region = vec![seed];
    taken[seed] = true;
    let mut next = 0;
    while let Some(&index) = region.get(next) {
        next += 1;
        let (x, y) = ((index % width) as i64, (index / width) as i64);
        for dy in -MAX_GAP_PX..=MAX_GAP_PX {
            // beyond a pole is the opposite meridian
            let (row, turn) = match y + dy {
                row if row < 0 => (-1 - row, w / 2),
                row if row >= h => (2 * h - 1 - row, w / 2),
                row => (row, 0),
            };
            let row = row.clamp(0, h - 1);
            // columns converge towards the poles
            let latitude = (0.5 - (row as f32 + 0.5) / height as f32) * std::f32::consts::PI;
            let reach = ((MAX_GAP_PX as f32 / latitude.cos()) as i64).min(w / 2);
            for dx in -reach..=reach {
                let neighbour = (row * w + (x + turn + dx).rem_euclid(w)) as usize;
                if !taken[neighbour] && bright(neighbour) {
                    taken[neighbour] = true;
                    region.push(neighbour);
                }
            }
        }
    }
    region
}

fn describe(
    map: &RadianceImage,
    region: &[usize],
    share: f32,
    solid_angle: impl Fn(usize) -> f32,
    flux: impl Fn(usize) -> f64,
) -> MainLight {
    let direction_of =
        |index: usize| pixel_direction(index % map.width(), index / map.width(), map.width(), map.height());
    let weighted = |&index: &usize| direction_of(index).as_dvec3() * flux(index);
    let centre = region.iter().map(weighted).reduce(|a, b| a + b).unwrap_or_default();
    // a light that surrounds the point has no centre: take its brightest pixel, which is the first
    let direction = centre.try_normalize().map_or_else(|| direction_of(region[0]), |d| d.as_vec3());
    let solid: f64 = region.iter().map(|&index| f64::from(solid_angle(index))).sum();
    let integral = |weight: &dyn Fn(Vec3) -> f32| {
        let mut sum = [0.0f64; 3];
        for &index in region {
            let weight = f64::from(weight(direction_of(index)) * solid_angle(index));
            for (sum, value) in sum.iter_mut().zip(map.pixels()[index]) {
                *sum += weight * f64::from(value);
            }
        }
        sum
    };
    MainLight {
        direction: direction.to_array(),
        solid_angle_sr: solid as f32,
        radiance: integral(&|_| 1.0).map(|v| (v / solid) as f32),
        power: integral(&|d| d.dot(direction).max(0.0)).map(|v| v as f32),
        share,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::f32::consts::PI;

    /// Map of a room of radiance `room` with round lights: direction, angular radius, radiance.
    fn room(room: f32, lights: &[(Vec3, f32, [f32; 3])]) -> RadianceImage {
        RadianceImage::from_fn(1024, 512, |x, y| {
            let direction = pixel_direction(x, y, 1024, 512);
            let light = lights.iter().find(|(d, radius, _)| d.normalize().angle_between(direction) < *radius);
            light.map_or([room; 3], |l| l.2)
        })
    }

    #[test]
    fn lights_are_found_anywhere_on_the_sphere() {
        let places = [
            Vec3::NEG_Z,
            Vec3::Z, // across the seam
            Vec3::Y, // at the pole
            Vec3::NEG_Y,
            Vec3::new(0.05, 1.0, 0.02), // over the pole
            Vec3::new(-0.02, 0.3, 1.0), // across the seam, high
            Vec3::new(1.0, 0.5, -0.5),
        ];
        for place in places {
            let (radius, radiance) = (0.2f32, [30.0, 20.0, 10.0]);
            let light = main_light(&room(0.2, &[(place, radius, radiance)])).unwrap();
            let angle = Vec3::from_array(light.direction).angle_between(place.normalize());
            assert!(angle < 3e-3, "{place}: {angle}");
            // a cap: Ω = 2π (1 − cos r), irradiance π sin² r L. A border pixel counts as a whole once a third of it is
            // lit: up to 2/3 of a pixel of 0.7° more on 11.5°
            let (solid_angle, factor) = (2.0 * PI * (1.0 - radius.cos()), PI * radius.sin().powi(2));
            let excess = light.solid_angle_sr / solid_angle - 1.0;
            assert!((-0.01..0.09).contains(&excess), "{place}: {excess}");
            // at the poles the synthetic light itself is rounded up to whole rows: 1.2 % in radius
            for (power, radiance) in light.power.into_iter().zip(radiance) {
                assert!((power / (factor * radiance) - 1.0).abs() < 0.03, "{place}: {:?}", light.power);
            }
            let lamp = solid_angle * luminance(radiance);
            let share = lamp / (lamp + (4.0 * PI - solid_angle) * 0.2);
            assert!((light.share / share - 1.0).abs() < 0.02, "{place}: {} {share}", light.share);
        }
    }

    #[test]
    fn the_main_light_and_the_rest_are_the_whole() {
        let lamp = (Vec3::new(1.0, 2.0, 0.5), 0.15, [40.0, 30.0, 20.0]);
        let map = room(0.3, &[lamp, (Vec3::new(-1.0, 0.2, 0.4), 0.3, [3.0, 4.0, 5.0])]);
        let (light, rest) = split_main_light(&map);
        let light = light.unwrap();
        assert_eq!(Some(light), main_light(&map));
        let (whole, direction) = (Sh9::project(&map), Vec3::from_array(light.direction));
        for normal in lo_geometry::fibonacci_sphere(40) {
            let (sum, expected) = (rest.irradiance(normal), whole.irradiance(normal));
            // The cosine of a lamp on the horizon is not that of nine coefficients.
            let of_light = Sh9::of_direction(direction, light.power).irradiance(normal);
            for c in 0..3 {
                assert!((sum[c] + of_light[c] - expected[c]).abs() < 0.03 * whole.irradiance(direction)[c], "{normal}");
            }
        }
        // Without a light, all is the rest.
        let (none, rest) = split_main_light(&room(0.3, &[]));
        assert!(none.is_none() && (rest.irradiance(Vec3::Y)[0] - 0.3 * PI).abs() < 1e-3);
    }

    #[test]
    fn power_counts_not_the_brightest_pixel() {
        // a window of 0.5 sr at 5 against a spark of 0.0001 sr at 1000
        let window = (Vec3::new(1.0, 0.2, 0.1), 0.4, [5.0; 3]);
        let spark = (Vec3::NEG_X, 0.006, [1000.0; 3]);
        let light = main_light(&room(0.1, &[window, spark])).unwrap();
        assert!(Vec3::from_array(light.direction).angle_between(window.0) < 0.01);
        // the sun within the window has more power: 4 % of the size, a thousand times the radiance
        let sun = (Vec3::new(1.0, 0.3, 0.1), 0.08, [5000.0; 3]);
        let light = main_light(&room(0.1, &[sun, window, spark])).unwrap();
        assert!(Vec3::from_array(light.direction).angle_between(sun.0) < 0.01);
        assert!(light.solid_angle_sr < 0.03);
    }

    #[test]
    fn bars_do_not_split_a_window() {
        let mut map = room(0.1, &[(Vec3::X, 0.3, [8.0; 3])]);
        for y in 0..512 {
            for x in 766..769 {
                map[(x, y)] = [0.1; 3];
            }
        }
        let light = main_light(&map).unwrap();
        assert!(Vec3::from_array(light.direction).angle_between(Vec3::X) < 0.01);
        assert!(light.solid_angle_sr > 0.25, "{}", light.solid_angle_sr);
    }

    #[test]
    fn nothing_stands_out_in_even_light() {
        assert_eq!(main_light(&room(1.0, &[])), None);
        assert_eq!(main_light(&room(0.0, &[])), None);
        assert_eq!(main_light(&RadianceImage::new(0, 0, vec![])), None);
        let mut damaged = room(1.0, &[]);
        damaged[(3, 3)] = [f32::NAN, f32::INFINITY, -1.0];
        assert_eq!(main_light(&damaged), None);
    }
}
