//! Expected light on what no photo saw, and expected light gathered into lamps and windows (`docs/method.md` §10.8).
//!
//! An octree holds the likeliest radiance, in which lamps of uncertain place vanish. [`ExpectedLight`] has their energy, spread over where they may be.
//! Guessed leaves are scaled by direction until the octree has that energy; their detail stays. For objects, a part of it is gathered into compact lamps
//! where it is likeliest, until a matte sphere has the contrast of real rooms: shadows are then as sharp as rooms have them.

use std::f32::consts::PI;

use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr};
use lo_imaging::{DepthMap, RadianceImage, luminance, sample_equirectangular};
use lo_octree::LightOctree;
use lo_scene::ExpectedLight;

use crate::fit::{ClippedLeaves, SeenShading, restore_clipped};
use crate::irradiance::tracer;

/// Rows of the panorama that light is balanced on.
const HEIGHT: usize = 24;

/// Rows of the panorama that tells how far away leaves are.
const DISTANCE_HEIGHT: usize = 64;

/// Rows of the panorama that measures how large a lamp is.
const LAMP_HEIGHT: usize = 128;

/// Rows and columns of the sphere's normals.
const NORMALS: [usize; 2] = [12, 24];

/// Sharpness of the kernel that smooths the octree's own light, e^(λ (cos − 1)): as coarse as expected light is.
const SHARPNESS: f32 = 10.0;

/// Share of a direction that must be guessed for it to count.
const OPEN: f32 = 0.2;

/// Guessed leaves change by a factor within these.
const GAIN: [f32; 2] = [0.02, 50.0];

/// Largest radiance that is expected or given.
const MAX_RADIANCE: f32 = 65_504.0;

/// Contrasts that are gathered, stops: the middle nine tenths of real rooms are 1.2 to 6.3.
const CONTRAST_STOPS: [f32; 2] = [1.0, 6.0];

/// Most of the guessed light that is gathered into lamps.
const MAX_SHARE: f32 = 0.97;

const MAX_LAMPS: usize = 3;

/// A lamp takes the energy of what lies so near, and needs this share of the first one's.
const REACH_DEG: f32 = 40.0;
const LEAST_SHARE: f32 = 0.25;

/// Half-angles of lamps above and of windows at the side, as seen from the camera, and the sine of the elevation that tells them apart.
const LAMP_DEG: f32 = 8.0;
const WINDOW_DEG: f32 = 13.0;
const ABOVE: f32 = 0.7;

/// A leaf is of a lamp where it lies no more than so many edges behind what is met in its direction.
const BEHIND: f32 = 2.0;

/// How expected light is laid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayExpected {
    /// Factor on the contrast that is expected, in stops; `None` leaves the expectation as it is, without lamps.
    pub contrast: Option<f32>,
    /// Gain of each channel on guessed light.
    pub tint: [f32; 3],
    /// Whether a quarter of the rays is enough to tell how large lamps are.
    pub is_preview: bool,
}

impl Default for LayExpected {
    /// The expectation.
    fn default() -> Self {
        Self { contrast: None, tint: [1.0; 3], is_preview: false }
    }
}

/// A lamp or window that expected light was gathered into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatheredLamp {
    /// Unit vector from the camera.
    pub direction: Vec3,
    /// Luminance times solid angle as seen from the camera.
    pub flux: f32,
}

/// What became of expected light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LaidExpectation {
    /// Lamps, the brightest first.
    pub lamps: Vec<GatheredLamp>,
    /// Share of the guessed light that they give.
    pub gathered_share: f32,
    /// log2 of the largest over the smallest irradiance of a matte sphere at the camera.
    pub contrast_stops: f32,
}

/// Lays expected light onto the leaves that the photo did not see, and gives clipped ones what such regions usually have. What was seen unclipped stays.
///
/// Where nodes have lobes, the octree becomes what is seen of it from the camera.
pub fn lay_expected(
    light: &mut LightOctree,
    expected: &ExpectedLight,
    seen: &SeenShading,
    how: &LayExpected,
) -> LaidExpectation {
    if let std::borrow::Cow::Owned(from_camera) = light.seen_from(Vec3::ZERO) {
        *light = from_camera;
    }
    let clipped = restore_clipped(light, seen);
    let sphere = Sphere::new(light, &clipped, expected, how.tint);
    let mut report = LaidExpectation::default();
    let mut lamps = Vec::new();
    let mut rest = 1.0;
    if let Some(contrast) = how.contrast {
        let wanted = (expected.contrast_stops * contrast).clamp(CONTRAST_STOPS[0], CONTRAST_STOPS[1]);
        lamps = sphere.peaks(seen.up).into_iter().map(|peak| Lamp { peak, share: 0.0, radiance: Vec3::ZERO }).collect();
        let height = if how.is_preview { LAMP_HEIGHT / 2 } else { LAMP_HEIGHT };
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

/// A place on the sphere where expected light is densest.
#[derive(Clone, Copy, Debug)]
struct Peak {
    direction: Vec3,
    /// Energy of its surroundings.
    energy: f32,
    /// Cosine of its half-angle.
    cosine: f32,
    /// Colour of luminance 1.
    colour: Vec3,
}

#[derive(Clone, Copy, Debug)]
struct Lamp {
    peak: Peak,
    /// Share of the guessed light.
    share: f32,
    radiance: Vec3,
}

impl Lamp {
    /// Whether a leaf of this depth is the lamp's: within its cone, and not behind what is met there.
    fn holds(&self, light: &LightOctree, depth: u32, middle_m: Vec3, sphere: &Sphere) -> bool {
        let distance_m = middle_m.length();
        let edge_m = light.cube.node_edge_m(depth);
        middle_m.dot(self.peak.direction) > self.peak.cosine * distance_m
            && distance_m < sphere.distance_m(middle_m) + BEHIND * edge_m
    }
}

/// Light around the camera, pixel by pixel.
struct Sphere {
    directions: Vec<Vec3>,
    solid_angles: Vec<f32>,
    /// Share of each pixel that is guessed.
    open: Vec<f32>,
    /// Expected linear RGB radiance of what is guessed.
    expected: Vec<Vec3>,
    /// Factor by channel from the octree's own light to the expected one.
    gains: RadianceImage,
    /// Expected distance of what is met, metres.
    distance_m: DepthMap,
    /// Luminance of irradiance over π by normals: by what is known, and by all that is guessed.
    known_light: Vec<f32>,
    guessed_light: Vec<f32>,
    /// Luminance of all guessed light times solid angle.
    flux: f32,
    normals: Vec<Vec3>,
}

fn directions(height: usize) -> impl Iterator<Item = (Vec3, f32)> {
    (0..2 * height * height).map(move |i| {
        let (x, y) = (i % (2 * height), i / (2 * height));
        (pixel_direction(x, y, 2 * height, height), pixel_solid_angle_sr(y, 2 * height, height))
    })
}

impl Sphere {
    fn new(light: &LightOctree, clipped: &ClippedLeaves, expected: &ExpectedLight, tint: [f32; 3]) -> Self {
        let (directions, solid_angles): (Vec<Vec3>, Vec<f32>) = directions(HEIGHT).unzip();
        let trace = |light: &LightOctree| tracer(light).panorama(Vec3::ZERO, 2 * HEIGHT, HEIGHT);
        let rendering = trace(light);
        let guessed = light.merged(|leaf| {
            let is_clipped = clipped[leaf.depth as usize][leaf.row].is_some();
            Vec3::splat(if is_clipped { 0.0 } else { light.unseen(leaf) })
        });
        let shares = LightOctree { rgba: light.rows_with(|depth, row, _| guessed[depth][row]), ..light.clone() };
        let open: Vec<f32> = trace(&shares).radiance.pixels().iter().map(|share| share[0].clamp(0.0, 1.0)).collect();
        let own: Vec<Vec3> = rendering.radiance.pixels().iter().map(|&rgb| Vec3::from(rgb)).collect();
        let world_from_panorama = expected.picture.world_from_panorama;
        let wanted = |direction: &Vec3| {
            let local = world_from_panorama.conjugate() * *direction;
            let radiance = sample_equirectangular(&expected.picture.radiance, local);
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
        // Where hardly anything is guessed, expected light says nothing: what lies around goes on.
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
        let known_light = lit(&|i| (1.0 - open[i]) * luminance(own[i].to_array()));
        let guessed_light = lit(&|i| open[i] * luminance(expected[i].to_array()));
        let flux = (0..directions.len()).map(|i| open[i] * solid_angles[i] * luminance(expected[i].to_array())).sum();
        let distance_m = tracer(light).panorama(Vec3::ZERO, 2 * DISTANCE_HEIGHT, DISTANCE_HEIGHT).distance_m;
        Self { directions, solid_angles, open, expected, gains, distance_m, known_light, guessed_light, flux, normals }
    }

    /// How far away is what is met in the direction of a place.
    fn distance_m(&self, place_m: Vec3) -> f32 {
        let uv = lo_geometry::uv_from_direction(place_m.normalize_or(Vec3::Y));
        let pixel = |at: f32, size: usize| ((at * size as f32) as usize).min(size - 1);
        let distance_m = self.distance_m[(pixel(uv.x, 2 * DISTANCE_HEIGHT), pixel(uv.y, DISTANCE_HEIGHT))];
        if distance_m > 0.0 { distance_m } else { f32::INFINITY }
    }

    /// Where light is likeliest to come from: the densest places of what exceeds the mean, each with its surroundings, the brightest first.
    fn peaks(&self, up: Vec3) -> Vec<Peak> {
        let light = |i: usize| self.open[i] * luminance(self.expected[i].to_array());
        // Squared: the likeliest places count more than they are likely.
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

    /// log2 of the largest over the smallest irradiance where `share` of the guessed light is in lamps.
    fn stops(&self, share: f32, lamps: &[Lamp]) -> f32 {
        let total: f32 = lamps.iter().map(|lamp| lamp.peak.energy).sum();
        let at = |n: usize| {
            let of_lamp = |lamp: &Lamp| lamp.peak.energy * self.normals[n].dot(lamp.peak.direction).max(0.0);
            let lamps = lamps.iter().map(of_lamp).sum::<f32>() / total.max(1e-12) * self.flux / PI;
            self.known_light[n] + (1.0 - share) * self.guessed_light[n] + share * lamps
        };
        let (least, most) = (0..self.normals.len()).map(at).fold((f32::MAX, 0.0f32), |(l, m), e| (l.min(e), m.max(e)));
        (most.max(1e-9) / least.max(1e-9)).log2()
    }

    /// Gives lamps as much of the guessed light as a contrast of `wanted` stops asks for. Returns that share.
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
            // Until here for a flux of 1.
            lamp.radiance *= lamp.share * self.flux;
        }
        low
    }
}

/// Finds out how large lamps are as seen from the camera: their radiance becomes that of a flux of 1. Lamps without leaves are dropped. `height`
/// rows of rays.
fn size_lamps(light: &LightOctree, clipped: &ClippedLeaves, sphere: &Sphere, lamps: &mut Vec<Lamp>, height: usize) {
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
    // Less than a pixel is none.
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

    /// A grey cubic room around a camera that looks at its far wall, which it sees.
    fn room() -> (LightOctree, SeenShading) {
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
        (light, SeenShading::new(frame, Vec3::Y))
    }

    /// Where most of the expected light comes from: above to the right.
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

    /// Luminance of irradiance over π by 288 normals.
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

    /// The irradiance of expected light where the room is guessed and of the photo where it is seen.
    fn wanted() -> Vec<f32> {
        let expected = expected().picture.radiance;
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
        let report = lay_expected(&mut light, &expected(), &frame, &LayExpected::default());
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
            let how = LayExpected { contrast: Some(contrast), ..LayExpected::default() };
            let report = lay_expected(&mut light, &expected(), &frame, &how);
            assert!(report.lamps[0].direction.dot(towards()) > 0.97, "{report:?}");
            let got = irradiance(&panorama(&light));
            assert!(plain < 2.5 && (stops(&got) - 3.0 * contrast).abs() < 0.35, "{} {report:?}", stops(&got));
            let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
            let ratio = mean(&got) / mean(&wanted());
            assert!((0.85..1.15).contains(&ratio), "{ratio}");
        }
    }

    #[test]
    fn a_tint_is_of_guessed_light_alone() {
        let (mut light, frame) = room();
        let (mut plain, seen) = (light.clone(), light.seen.clone());
        let how = LayExpected { tint: [1.2, 1.0, 0.8], ..LayExpected::default() };
        lay_expected(&mut light, &expected(), &frame, &how);
        lay_expected(&mut plain, &expected(), &frame, &LayExpected::default());
        let finest = light.octree.depth() as usize;
        let ratios = light.rgba[finest].iter().zip(&plain.rgba[finest]).zip(&seen[finest]);
        for ((tinted, plain), seen) in ratios {
            let wanted = if *seen == 255 { 1.0 } else { 1.2 };
            assert!((tinted[0] / plain[0] - wanted).abs() < 0.01 || (*seen > 0 && *seen < 255));
        }
    }
}
