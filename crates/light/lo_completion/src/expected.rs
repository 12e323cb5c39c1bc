//! Expected light on unobserved surfaces, optionally gathered into lamps and windows (`docs/method.md` §10.8).
//!
//! An octree holds the likeliest radiance, in which lamps of uncertain position vanish. [`ExpectedLight`] has their
//! energy, spread over their possible positions. Inferred leaves are scaled by direction until the octree has that
//! energy; their detail is kept. For inserted objects, part of the light is gathered into compact lamps at the
//! likeliest positions, until a matte sphere has the contrast of real rooms. Shadows are then as sharp as in real
//! rooms.

use std::f32::consts::PI;

use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr};
use lo_imaging::{DepthMap, RadianceImage, luminance, sample_equirectangular};
use lo_octree::LightOctree;
use lo_scene::ExpectedLight;

use crate::fit::{ClippedLeaves, ObservedShading, restore_clipped};
use crate::irradiance::tracer;

/// Rows of the panorama in which light is balanced.
const HEIGHT: usize = 24;

/// Rows of the panorama of distances to leaves.
const DISTANCE_HEIGHT: usize = 64;

/// Rows of the panorama that measures the size of lamps.
const LAMP_HEIGHT: usize = 128;

/// Rows and columns of the sphere's normals.
const NORMALS: [usize; 2] = [12, 24];

/// Sharpness of the kernel e^(λ (cos − 1)) that smooths the octree's own light to the resolution of expected light.
const SHARPNESS: f32 = 10.0;

/// Least inferred share of a direction for it to count.
const OPEN: f32 = 0.2;

/// Range of the gain on inferred leaves.
const GAIN: [f32; 2] = [0.02, 50.0];

/// Greatest radiance that is expected or assigned.
const MAX_RADIANCE: f32 = 65_504.0;

/// Range of contrasts for gathering, in stops: the middle nine tenths of real rooms are 1.2 to 6.3.
const CONTRAST_STOPS: [f32; 2] = [1.0, 6.0];

/// Greatest share of the inferred light that is gathered into lamps.
const MAX_SHARE: f32 = 0.97;

const MAX_LAMPS: usize = 3;

/// Radius from which a lamp takes energy, and the least share of the first lamp's energy that it needs.
const REACH_DEG: f32 = 40.0;
const LEAST_SHARE: f32 = 0.25;

/// Half-angles of lamps overhead and of windows at the side, as seen from the camera, and the sine of the elevation
/// that separates them.
const LAMP_DEG: f32 = 8.0;
const WINDOW_DEG: f32 = 13.0;
const ABOVE: f32 = 0.7;

/// Greatest distance of a lamp's leaf behind the first hit in its direction, in leaf edges.
const BEHIND: f32 = 2.0;

/// Options of [`apply_expected_light`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedLightOptions {
    /// Factor on the expected contrast, in stops; `None` applies the expectation without lamps.
    pub contrast: Option<f32>,
    /// Gain per channel on inferred light.
    pub tint: [f32; 3],
    /// Whether to use a quarter of the rays to measure the size of lamps.
    pub is_preview: bool,
}

impl Default for ExpectedLightOptions {
    /// Returns the expectation without lamps.
    fn default() -> Self {
        Self { contrast: None, tint: [1.0; 3], is_preview: false }
    }
}

/// A lamp or window into which expected light was gathered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatheredLamp {
    /// Unit direction from the camera.
    pub direction: Vec3,
    /// Luminance times solid angle as seen from the camera.
    pub flux: f32,
}

/// Result of [`apply_expected_light`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExpectedLightReport {
    /// Lamps, brightest first.
    pub lamps: Vec<GatheredLamp>,
    /// Their share of the inferred light.
    pub gathered_share: f32,
    /// log₂ of the ratio of the greatest to the least irradiance of a matte sphere at the camera.
    pub contrast_stops: f32,
}

/// Applies expected light to unobserved leaves, and gives clipped leaves the typical radiance of such regions.
/// Unclipped observed radiance is kept.
///
/// If nodes have lobes, the octree becomes its view from the camera.
pub fn apply_expected_light(
    light: &mut LightOctree,
    expected: &ExpectedLight,
    seen: &ObservedShading,
    options: &ExpectedLightOptions,
) -> ExpectedLightReport {
    if let std::borrow::Cow::Owned(from_camera) = light.seen_from(Vec3::ZERO) {
        *light = from_camera;
    }
    let clipped = restore_clipped(light, seen);
    let sphere = LightSphere::new(light, &clipped, expected, options.tint);
    let mut report = ExpectedLightReport::default();
    let mut lamps = Vec::new();
    let mut rest = 1.0;
    if let Some(contrast) = options.contrast {
        let wanted = (expected.contrast_stops * contrast).clamp(CONTRAST_STOPS[0], CONTRAST_STOPS[1]);
        lamps = sphere.peaks(seen.up).into_iter().map(|peak| Lamp { peak, share: 0.0, radiance: Vec3::ZERO }).collect();
        let height = if options.is_preview { LAMP_HEIGHT / 2 } else { LAMP_HEIGHT };
        size_lamps(light, &clipped, &sphere, &mut lamps, height);
        report.gathered_share = sphere.gather(&mut lamps, wanted);
        rest = 1.0 - report.gathered_share;
    }
    let gains = sphere.gains.map(|gain| gain.map(|c| c * rest));
    light.change_leaves(|light, leaf| {
        let own = light.radiance(leaf);
        if clipped[leaf.depth as usize][leaf.row].is_some() {
            return own;
        }
        let open = light.unseen(leaf);
        let middle_m = light.node_middle_m(leaf.depth, light.octree.key(leaf));
        let gain = Vec3::from(sample_equirectangular(&gains, middle_m.normalize_or(Vec3::Y)));
        let lamp = lamps.iter().filter(|lamp| lamp.holds(light, leaf.depth, middle_m, &sphere));
        let lamp: Vec3 = lamp.map(|lamp| lamp.radiance).sum();
        (own * (1.0 + open * (gain - 1.0)) + open * lamp).min(Vec3::splat(MAX_RADIANCE))
    });
    report.contrast_stops = sphere.stops(report.gathered_share, &lamps);
    report.lamps = lamps
        .iter()
        .map(|lamp| GatheredLamp { direction: lamp.peak.direction, flux: lamp.share * sphere.flux })
        .collect();
    report
}

/// A local maximum of expected light on the sphere.
#[derive(Clone, Copy, Debug)]
struct Peak {
    direction: Vec3,
    /// Energy of its surroundings.
    energy: f32,
    /// Cosine of the half-angle.
    cosine: f32,
    /// Colour, normalised to luminance 1.
    colour: Vec3,
}

#[derive(Clone, Copy, Debug)]
struct Lamp {
    peak: Peak,
    /// Share of the inferred light.
    share: f32,
    radiance: Vec3,
}

impl Lamp {
    /// Returns whether a leaf of this depth belongs to the lamp: inside its cone, and not behind the first hit there.
    fn holds(&self, light: &LightOctree, depth: u32, middle_m: Vec3, sphere: &LightSphere) -> bool {
        let distance_m = middle_m.length();
        let edge_m = light.cube.node_edge_m(depth);
        middle_m.dot(self.peak.direction) > self.peak.cosine * distance_m
            && distance_m < sphere.distance_m(middle_m) + BEHIND * edge_m
    }
}

/// Light around the camera, per pixel.
struct LightSphere {
    directions: Vec<Vec3>,
    solid_angles: Vec<f32>,
    /// Inferred share of each pixel.
    open: Vec<f32>,
    /// Expected linear RGB radiance of the inferred share.
    expected: Vec<Vec3>,
    /// Gain per channel from the octree's own light to the expected light.
    gains: RadianceImage,
    /// Expected distance of the first hit, in metres.
    distance_m: DepthMap,
    /// Luminance of irradiance over π for each normal: from observed light, and from all inferred light.
    observed_light: Vec<f32>,
    inferred_light: Vec<f32>,
    /// Luminance times solid angle of all inferred light.
    flux: f32,
    normals: Vec<Vec3>,
}

fn directions(height: usize) -> impl Iterator<Item = (Vec3, f32)> {
    (0..2 * height * height).map(move |i| {
        let (x, y) = (i % (2 * height), i / (2 * height));
        (pixel_direction(x, y, 2 * height, height), pixel_solid_angle_sr(y, 2 * height, height))
    })
}

impl LightSphere {
    fn new(light: &LightOctree, clipped: &ClippedLeaves, expected: &ExpectedLight, tint: [f32; 3]) -> Self {
        let (directions, solid_angles): (Vec<Vec3>, Vec<f32>) = directions(HEIGHT).unzip();
        let trace = |light: &LightOctree| tracer(light).panorama(Vec3::ZERO, 2 * HEIGHT, HEIGHT);
        let rendering = trace(light);
        let inferred = light.merged(|leaf| {
            let is_clipped = clipped[leaf.depth as usize][leaf.row].is_some();
            Vec3::splat(if is_clipped { 0.0 } else { light.unseen(leaf) })
        });
        let shares = LightOctree { rgba: light.rows_with(|depth, row, _| inferred[depth][row]), ..light.clone() };
        let open: Vec<f32> = trace(&shares).radiance.pixels().iter().map(|share| share[0].clamp(0.0, 1.0)).collect();
        let own: Vec<Vec3> = rendering.radiance.pixels().iter().map(|&rgb| Vec3::from(rgb)).collect();
        let world_from_panorama = expected.image.world_from_panorama;
        let wanted = |direction: &Vec3| {
            let local = world_from_panorama.conjugate() * *direction;
            let radiance = sample_equirectangular(&expected.image.radiance, local);
            (Vec3::from(radiance) * Vec3::from(tint)).min(Vec3::splat(MAX_RADIANCE))
        };
        let expected: Vec<Vec3> = directions.iter().map(wanted).collect();
        let smooth = |values: &dyn Fn(usize) -> Vec3| -> Vec<Vec3> {
            let at = |direction: &Vec3| {
                let (mut sum, mut weights) = (Vec3::ZERO, 1e-6);
                for (i, other) in directions.iter().enumerate() {
                    let weight = open[i] * solid_angles[i] * (SHARPNESS * (direction.dot(*other) - 1.0)).exp();
                    sum += weight * values(i);
                    weights += weight;
                }
                sum / weights
            };
            directions.iter().map(at).collect()
        };
        let smoothed = smooth(&|i| own[i]);
        let gain = |i: usize| {
            (expected[i] / smoothed[i].max(Vec3::splat(1e-4))).clamp(Vec3::splat(GAIN[0]), Vec3::splat(GAIN[1]))
        };
        // Where hardly anything is inferred, expected light is unreliable: use the surrounding gains.
        let around = smooth(&gain);
        let gains = RadianceImage::from_fn(2 * HEIGHT, HEIGHT, |x, y| {
            let i = y * 2 * HEIGHT + x;
            (if open[i] > OPEN { gain(i) } else { around[i] }).to_array()
        });
        let normals: Vec<Vec3> = (0..NORMALS[0] * NORMALS[1])
            .map(|i| pixel_direction(i % NORMALS[1], i / NORMALS[1], NORMALS[1], NORMALS[0]))
            .collect();
        let lit = |of: &dyn Fn(usize) -> f32| -> Vec<f32> {
            let values: Vec<f32> = (0..directions.len()).map(|i| of(i) * solid_angles[i] / PI).collect();
            let at = |normal: &Vec3| {
                values.iter().zip(&directions).map(|(value, direction)| value * normal.dot(*direction).max(0.0)).sum()
            };
            normals.iter().map(at).collect()
        };
        let observed_light = lit(&|i| (1.0 - open[i]) * luminance(own[i].to_array()));
        let inferred_light = lit(&|i| open[i] * luminance(expected[i].to_array()));
        let flux = (0..directions.len()).map(|i| open[i] * solid_angles[i] * luminance(expected[i].to_array())).sum();
        let distance_m = tracer(light).panorama(Vec3::ZERO, 2 * DISTANCE_HEIGHT, DISTANCE_HEIGHT).distance_m;
        Self {
            directions,
            solid_angles,
            open,
            expected,
            gains,
            distance_m,
            observed_light,
            inferred_light,
            flux,
            normals,
        }
    }

    /// Returns the distance of the first hit in the direction of a point.
    fn distance_m(&self, point_m: Vec3) -> f32 {
        let uv = lo_geometry::uv_from_direction(point_m.normalize_or(Vec3::Y));
        let pixel = |at: f32, size: usize| ((at * size as f32) as usize).min(size - 1);
        let distance_m = self.distance_m[(pixel(uv.x, 2 * DISTANCE_HEIGHT), pixel(uv.y, DISTANCE_HEIGHT))];
        if distance_m > 0.0 { distance_m } else { f32::INFINITY }
    }

    /// Returns the likeliest light directions: the densest positions of light above the mean, each with its
    /// surroundings, brightest first.
    fn peaks(&self, up: Vec3) -> Vec<Peak> {
        let light = |i: usize| self.open[i] * luminance(self.expected[i].to_array());
        // Squared, to emphasise the likeliest positions.
        let square = |i: usize| light(i) * light(i);
        let area: f32 = (0..self.directions.len()).map(|i| self.open[i] * self.solid_angles[i]).sum();
        let mean = (0..self.directions.len()).map(|i| square(i) * self.solid_angles[i]).sum::<f32>() / area.max(1e-6);
        let mut left: Vec<f32> =
            (0..self.directions.len()).map(|i| (square(i) - mean).max(0.0) * self.solid_angles[i]).collect();
        let reach = REACH_DEG.to_radians().cos();
        let mut peaks: Vec<Peak> = Vec::new();
        while peaks.len() < MAX_LAMPS {
            let density = |direction: &Vec3| -> f32 {
                let near = self.directions.iter().zip(&left).map(|(other, energy)| {
                    if *energy > 0.0 { energy * (30.0 * (direction.dot(*other) - 1.0)).exp() } else { 0.0 }
                });
                near.sum()
            };
            let densities: Vec<f32> = self.directions.iter().map(density).collect();
            let Some(most) = (0..densities.len()).max_by(|&a, &b| densities[a].total_cmp(&densities[b])) else { break };
            let (mut middle, mut colour, mut energy) = (Vec3::ZERO, Vec3::ZERO, 0.0);
            for (i, direction) in self.directions.iter().enumerate() {
                if left[i] > 0.0 && direction.dot(self.directions[most]) > reach {
                    middle += left[i] * *direction;
                    colour += left[i] * self.expected[i];
                    energy += std::mem::take(&mut left[i]);
                }
            }
            if energy <= 0.0 || peaks.first().is_some_and(|first| energy < LEAST_SHARE * first.energy) {
                break;
            }
            let direction = middle.normalize_or(self.directions[most]);
            let half_angle_deg = if direction.dot(up) > ABOVE { LAMP_DEG } else { WINDOW_DEG };
            let colour = colour / luminance(colour.to_array()).max(1e-9);
            peaks.push(Peak { direction, energy, cosine: half_angle_deg.to_radians().cos(), colour });
        }
        peaks
    }

    /// Returns log₂ of the ratio of the greatest to the least irradiance if `share` of the inferred light is in lamps.
    fn stops(&self, share: f32, lamps: &[Lamp]) -> f32 {
        let total: f32 = lamps.iter().map(|lamp| lamp.peak.energy).sum();
        let at = |n: usize| {
            let of_lamp = |lamp: &Lamp| lamp.peak.energy * self.normals[n].dot(lamp.peak.direction).max(0.0);
            let lamps = lamps.iter().map(of_lamp).sum::<f32>() / total.max(1e-12) * self.flux / PI;
            self.observed_light[n] + (1.0 - share) * self.inferred_light[n] + share * lamps
        };
        let (least, most) = (0..self.normals.len()).map(at).fold((f32::MAX, 0.0f32), |(l, m), e| (l.min(e), m.max(e)));
        (most.max(1e-9) / least.max(1e-9)).log2()
    }

    /// Assigns to lamps the share of the inferred light that gives a contrast of `wanted` stops. Returns that share.
    fn gather(&self, lamps: &mut [Lamp], wanted: f32) -> f32 {
        let total: f32 = lamps.iter().map(|lamp| lamp.peak.energy).sum();
        if total <= 0.0 || self.stops(0.0, lamps) >= wanted {
            return 0.0;
        }
        let (mut low, mut high) = (0.0, MAX_SHARE);
        for _ in 0..16 {
            let middle = 0.5 * (low + high);
            if self.stops(middle, lamps) < wanted { low = middle } else { high = middle }
        }
        for lamp in lamps {
            lamp.share = low * lamp.peak.energy / total;
            // So far for a flux of 1.
            lamp.radiance *= lamp.share * self.flux;
        }
        low
    }
}

/// Measures the size of lamps as seen from the camera, with `height` rows of rays. Sets their radiance to that of a
/// flux of 1, and drops lamps without leaves.
fn size_lamps(
    light: &LightOctree,
    clipped: &ClippedLeaves,
    sphere: &LightSphere,
    lamps: &mut Vec<Lamp>,
    height: usize,
) {
    let own = light.merged(|leaf| {
        if clipped[leaf.depth as usize][leaf.row].is_some() {
            return Vec3::ZERO;
        }
        let middle_m = light.node_middle_m(leaf.depth, light.octree.key(leaf));
        let holds = |n: usize| lamps.get(n).is_some_and(|lamp| lamp.holds(light, leaf.depth, middle_m, sphere));
        light.unseen(leaf) * Vec3::from_array([0, 1, 2].map(|n| f32::from(holds(n))))
    });
    let masks = LightOctree { rgba: light.rows_with(|depth, row, _| own[depth][row]), ..light.clone() };
    let seen = tracer(&masks).panorama(Vec3::ZERO, 2 * height, height);
    let mut solid_angles = Vec3::ZERO;
    for ((_, solid_angle), &share) in directions(height).zip(seen.radiance.pixels()) {
        solid_angles += solid_angle * Vec3::from(share);
    }
    // Ignores lamps smaller than a pixel.
    let least_sr = pixel_solid_angle_sr(height / 2, 2 * height, height);
    let mut n = 0;
    lamps.retain_mut(|lamp| {
        let solid_angle = solid_angles[n];
        n += 1;
        lamp.radiance = lamp.peak.colour / solid_angle.max(least_sr);
        solid_angle > least_sr
    });
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_cone::{ConeTracer, Settings};
    use lo_geometry::{Camera, Cube, Quat};
    use lo_imaging::Photo;
    use lo_octree::{Provenance, RadiancePoint};
    use lo_scene::Frame;

    use super::*;

    /// Half of the room's edge.
    const HALF_M: f32 = 2.0;

    /// A grey cubic room around a camera that observes its far wall.
    fn room() -> (LightOctree, ObservedShading) {
        let mut points = Vec::new();
        for face in 0..6 {
            let at = |i: usize| HALF_M * ((i as f32 + 0.5) / 48.0 - 1.0);
            for (i, j) in (0..96 * 96).map(|n| (n % 96, n / 96)) {
                let mut p = [at(i), at(j), if face < 3 { -HALF_M } else { HALF_M }];
                p.rotate_right(2 - face % 3);
                let position_m = Vec3::from(p);
                let (x, y) = (position_m.x / -position_m.z, position_m.y / -position_m.z);
                let seen = position_m.z < 0.01 - HALF_M && x.abs() < 0.8 && y.abs() < 0.53;
                let provenance = if seen { Provenance::Observed } else { Provenance::Inferred };
                points.push(RadiancePoint { position_m, radiance: [0.3; 3], provenance });
            }
        }
        let light = LightOctree::from_points(&points, Cube::centred(Vec3::ZERO, 2.2 * HALF_M), 6, 3).unwrap().0;
        let camera = Camera::from_hfov_deg(77.0, 480, 320).unwrap();
        let photo = Photo::Linear(RadianceImage::from_fn(480, 320, |_, _| [0.3; 3]));
        let frame = Frame::new(photo, DepthMap::from_fn(480, 320, |_, _| HALF_M), camera, 1.0).unwrap();
        let normals = frame.normals();
        (light, ObservedShading::new(frame, &normals, Vec3::Y))
    }

    /// Direction of most of the expected light: above to the right.
    fn towards() -> Vec3 {
        Vec3::new(0.7, 0.6, 0.2).normalize()
    }

    fn expected() -> ExpectedLight {
        let radiance = RadianceImage::from_fn(64, 32, |x, y| {
            let near = (10.0 * (pixel_direction(x, y, 64, 32).dot(towards()) - 1.0)).exp();
            [0.2 + 3.0 * near, 0.2 + 2.5 * near, 0.2 + 2.0 * near]
        });
        ExpectedLight::new(&radiance, Quat::IDENTITY, 3.0)
    }

    fn panorama(light: &LightOctree) -> RadianceImage {
        ConeTracer::new(light, Settings::default()).unwrap().panorama(Vec3::ZERO, 128, 64).radiance
    }

    /// Returns the luminance of irradiance over π for 288 normals.
    fn irradiance(panorama: &RadianceImage) -> Vec<f32> {
        let height = panorama.height();
        let normals = (0..288).map(|i| pixel_direction(i % 24, i / 24, 24, 12));
        let at = |normal: Vec3| {
            let pixels = directions(height).zip(panorama.pixels());
            pixels.map(|((d, sr), &rgb)| luminance(rgb) * sr * normal.dot(d).max(0.0) / PI).sum()
        };
        normals.map(at).collect()
    }

    fn stops(irradiance: &[f32]) -> f32 {
        let (least, most) = irradiance.iter().fold((f32::MAX, 0.0f32), |(l, m), &e| (l.min(e), m.max(e)));
        (most / least).log2()
    }

    /// Returns the irradiance of expected light on inferred surfaces and of the photo's light on observed ones.
    fn wanted() -> Vec<f32> {
        let expected = expected().image.radiance;
        irradiance(&RadianceImage::from_fn(128, 64, |x, y| {
            let d = pixel_direction(x, y, 128, 64);
            let seen = d.z < 0.0 && (d.x / d.z).abs() < 0.8 && (d.y / d.z).abs() < 0.53;
            if seen { [0.3; 3] } else { sample_equirectangular(&expected, d) }
        }))
    }

    #[test]
    fn guessed_leaves_have_the_expected_energy_and_seen_ones_stay() {
        let (mut light, frame) = room();
        let before = light.clone();
        let report = apply_expected_light(&mut light, &expected(), &frame, &ExpectedLightOptions::default());
        assert!(report.lamps.is_empty() && report.gathered_share == 0.0);
        for (got, wanted) in irradiance(&panorama(&light)).iter().zip(wanted()) {
            assert!((got / wanted - 1.0).abs() < 0.1, "{got} {wanted}");
        }
        let finest = light.octree.depth() as usize;
        for (row, (after, before)) in light.rgba[finest].iter().zip(&before.rgba[finest]).enumerate() {
            assert!(light.seen[finest][row] < 255 || after == before);
        }
    }

    #[test]
    fn gathered_light_has_the_contrast_asked_for_and_the_same_energy() {
        let plain = stops(&wanted());
        for contrast in [0.9, 1.2] {
            let (mut light, frame) = room();
            let options = ExpectedLightOptions { contrast: Some(contrast), ..ExpectedLightOptions::default() };
            let report = apply_expected_light(&mut light, &expected(), &frame, &options);
            assert!(report.lamps[0].direction.dot(towards()) > 0.97, "{report:?}");
            let got = irradiance(&panorama(&light));
            assert!(plain < 2.5 && (stops(&got) - 3.0 * contrast).abs() < 0.35, "{} {report:?}", stops(&got));
            let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
            let ratio = mean(&got) / mean(&wanted());
            assert!((0.85..1.15).contains(&ratio), "{ratio}");
        }
    }

    #[test]
    fn a_tint_changes_inferred_light_only() {
        let (mut light, frame) = room();
        let (mut plain, seen) = (light.clone(), light.seen.clone());
        let options = ExpectedLightOptions { tint: [1.2, 1.0, 0.8], ..ExpectedLightOptions::default() };
        apply_expected_light(&mut light, &expected(), &frame, &options);
        apply_expected_light(&mut plain, &expected(), &frame, &ExpectedLightOptions::default());
        let finest = light.octree.depth() as usize;
        let ratios = light.rgba[finest].iter().zip(&plain.rgba[finest]).zip(&seen[finest]);
        for ((tinted, plain), seen) in ratios {
            let wanted = if *seen == 255 { 1.0 } else { 1.2 };
            assert!((tinted[0] / plain[0] - wanted).abs() < 0.01 || (*seen > 0 && *seen < 255));
        }
    }
}
