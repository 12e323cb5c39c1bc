//! Alignment of a panorama with the room: yaw, small tilt and exposure, from the photo's view of it.

use std::f32::consts::{PI, TAU};
use std::ops::Range;

use lo_geometry::{Mat3, Vec3, uv_from_direction};
use lo_imaging::{Image, RadianceImage, luminance, resize_equirectangular, sample_equirectangular, view_rotation};
use lo_scene::{ObservedPhoto, PanoramaSource};
use rayon::prelude::*;

use super::observed_rays::{ObservedRays, ObservedTexel};
use super::prior::shares;
use super::{PanoramaPrior, PanoramaWarning};

/// Matches below this confidence cause a warning. On rooms of seed 778 all but 6 % of other rooms' panoramas are below
/// it, and none of the right ones where depth is measured. Of those beside the camera of a photo without depth, a tenth
/// are (`docs/design/035-panorama-prior.md`).
pub const MIN_CONFIDENCE: f32 = 0.4;

/// Columns of the compared images, coarsest first.
const COLUMNS: [usize; 3] = [64, 128, 256];

/// Greatest tilt of a panorama against the room's vertical, in radians: tripods are upright, and up is known to some
/// degrees.
const MAX_TILT: f32 = 10.0 * PI / 180.0;

/// Penalty of that tilt, in correlation.
const TILT_COST: f32 = 0.02;

/// Number of orientations kept at each resolution, and their least distance in yaw, in radians.
const CANDIDATES: [usize; 3] = [8, 4, 2];
const APART: f32 = 10.0 * PI / 180.0;

/// Greatest number of texels compared while searching.
const MAX_TEXELS: usize = 3000;

/// Multiple of the median luminance below which dark values are not distinguished.
const FLOOR: f32 = 0.02;

/// Limits of the panorama's log luminance relative to the median: lamps that it shows were clipped in the photo.
const DARKEST: f32 = -4.0;
const BRIGHTEST: f32 = 2.5;

/// Weight of colour relative to brightness.
const COLOUR: f32 = 1.5;

/// Variance of log luminance that is uninformative: white walls are alike.
const PLAIN: f32 = 0.01;

/// Luminance of the photo at which its tone curve is assumed accurate: cameras darken shadows increasingly.
const MIDDLE: f32 = 0.2;

/// Least number of compared texels at the middle resolution.
const MIN_TEXELS: usize = 40;

/// Alignment of a panorama with the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PanoramaMatch {
    /// Rotation from the panorama's axes (its centre −Z, +X to the right, +Y up) to the photo's frame.
    pub world_from_panorama: Mat3,
    /// Angle from the photo's heading to the panorama's centre, to the right about the room's vertical, in radians.
    pub yaw_rad: f32,
    /// Upward tilt of the panorama's centre, in radians.
    pub pitch_rad: f32,
    /// Clockwise tilt about it, in radians.
    pub roll_rad: f32,
    /// Factor from the panorama's values to the photo's.
    pub exposure: f32,
    /// Agreement of the panorama with the photo, from 0 to 1; below [`MIN_CONFIDENCE`] they hardly agree.
    pub confidence: f32,
    /// Whether the panorama's position sees enough of the photo's surfaces for a comparison.
    pub compared: bool,
}

impl PanoramaMatch {
    /// Returns the source as stored in a scene.
    pub fn source(&self, prior: &PanoramaPrior) -> PanoramaSource {
        PanoramaSource {
            file: prior.file.clone(),
            position_m: prior.position_m,
            yaw_deg: self.yaw_rad.to_degrees(),
            pitch_deg: self.pitch_rad.to_degrees(),
            roll_deg: self.roll_rad.to_degrees(),
            exposure_ev: self.exposure.log2(),
            confidence: self.confidence,
            clipped: prior.clipped().is_some(),
        }
    }

    /// Returns the warning about a panorama that was not compared or matches poorly.
    pub fn warning(&self) -> Option<PanoramaWarning> {
        let Self { yaw_rad, confidence, compared, .. } = *self;
        if !compared {
            return Some(PanoramaWarning::NotCompared);
        }
        (confidence < MIN_CONFIDENCE).then(|| PanoramaWarning::PoorMatch {
            confidence,
            least: MIN_CONFIDENCE,
            yaw_deg: yaw_rad.to_degrees(),
        })
    }
}

/// Aligns a panorama with the room, from a photo at [working resolution](lo_scene::Frame::working) and the unit vector
/// against gravity.
///
/// Compares the photo's unclipped pixels in the directions in which the panorama's position sees them. At the camera
/// these are the pixels' directions; elsewhere they are those of the depth map's points that face the position and are
/// not occluded.
///
/// The measure is the correlation of log luminance and of two log colour ratios together, which is invariant to
/// exposure and white balance, on images of 64, 128 and 256 columns. All yaws and tilts of up to 10° are tried at the
/// coarsest resolution, and the best are refined at the others. With a known yaw, only tilts are searched. The exposure
/// is the median ratio of luminances. Deterministic.
pub fn match_panorama(prior: &PanoramaPrior, photo: &ObservedPhoto, up: Vec3) -> PanoramaMatch {
    let base = level_axes(up);
    let rays = ObservedRays::new(photo, prior.position_m);
    let levels = COLUMNS.map(|columns| MatchLevel::new(&rays, prior, columns));
    let compared = levels[1].texels.len() >= MIN_TEXELS && !rays.is_dark();
    let level = YawPitchRoll { yaw: prior.yaw_rad.unwrap_or(0.0), ..YawPitchRoll::default() };
    let confidence_of =
        |pose: YawPitchRoll| levels[COLUMNS.len() - 1].confidence(pose.world_from_panorama(base).transpose());
    let pose = match prior.yaw_rad {
        _ if !compared => level,
        None => search(&levels, base, None),
        // A tilt is as reliable as the match that found it.
        Some(yaw) => {
            let tilted = search(&levels, base, Some(yaw));
            if confidence_of(tilted) < MIN_CONFIDENCE { level } else { tilted }
        }
    };
    let world_from_panorama = pose.world_from_panorama(base);
    let panorama_from_world = world_from_panorama.transpose();
    let confidence = if compared { confidence_of(pose) } else { 0.0 };
    let finest = &levels[COLUMNS.len() - 1];
    let exposure = prior.exposure.unwrap_or_else(|| finest.exposure(panorama_from_world));
    PanoramaMatch {
        world_from_panorama,
        yaw_rad: pose.yaw,
        pitch_rad: pose.pitch,
        roll_rad: pose.roll,
        exposure,
        confidence,
        compared,
    }
}

/// Returns the axes, as columns, of a level panorama whose centre is in the photo's heading.
fn level_axes(up: Vec3) -> Mat3 {
    let up = up.normalize_or(Vec3::Y);
    // In a photo of the floor or the ceiling, the heading is where its upper edge points.
    let heading = |forward: Vec3| (forward - up * forward.dot(up)).try_normalize();
    let steep = up.z.abs() > 0.98;
    let forward = if steep { heading(Vec3::Y * up.z.signum()) } else { heading(Vec3::NEG_Z) }.unwrap_or(Vec3::NEG_Z);
    Mat3::from_cols(forward.cross(up), up, -forward)
}

/// Yaw, pitch and roll in radians.
#[derive(Clone, Copy, Debug, Default)]
struct YawPitchRoll {
    yaw: f32,
    pitch: f32,
    roll: f32,
}

impl YawPitchRoll {
    fn world_from_panorama(self, base: Mat3) -> Mat3 {
        base * view_rotation(self.yaw, self.pitch, self.roll)
    }

    fn moved(self, [yaw, pitch, roll]: [f32; 3]) -> Self {
        let tilt = |angle: f32| angle.clamp(-MAX_TILT, MAX_TILT);
        Self { yaw: wrapped(self.yaw + yaw), pitch: tilt(self.pitch + pitch), roll: tilt(self.roll + roll) }
    }

    fn cost(self) -> f32 {
        TILT_COST * (self.pitch.powi(2) + self.roll.powi(2)) / MAX_TILT.powi(2)
    }
}

/// Wraps an angle to [−π, π).
fn wrapped(angle: f32) -> f32 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// Returns the orientation with the best match, restricted to the known yaw if there is one.
fn search(levels: &[MatchLevel; 3], base: Mat3, known_yaw: Option<f32>) -> YawPitchRoll {
    let score = |level: &MatchLevel, pose: YawPitchRoll| {
        let stride = level.texels.len().div_ceil(MAX_TEXELS).max(1);
        level.correlation(pose.world_from_panorama(base).transpose(), stride) - pose.cost()
    };
    let steps = COLUMNS[0] as i32;
    let tilts = [-0.8, 0.0, 0.8].map(|share| share * MAX_TILT);
    let all = || (-steps / 2..steps / 2).map(|step| step as f32 * TAU / steps as f32).collect();
    let poses = known_yaw.map_or_else(all, |yaw| vec![yaw]).into_iter().flat_map(|yaw| {
        tilts.into_iter().flat_map(move |pitch| tilts.into_iter().map(move |roll| YawPitchRoll { yaw, pitch, roll }))
    });
    let poses: Vec<YawPitchRoll> = poses.collect();
    let mut scored: Vec<(f32, YawPitchRoll)> = poses.par_iter().map(|&pose| (score(&levels[0], pose), pose)).collect();
    let axes = if known_yaw.is_some() { 1..3 } else { 0..3 };
    for ((level, finest_step_deg), candidates) in levels.iter().zip([1.4f32, 0.7, 0.2]).zip(CANDIDATES) {
        scored = distinct(scored, candidates);
        scored = scored
            .par_iter()
            .map(|&(_, pose)| refined(pose, axes.clone(), finest_step_deg.to_radians(), |pose| score(level, pose)))
            .collect();
    }
    distinct(scored, 1).first().map_or_else(YawPitchRoll::default, |&(_, pose)| pose)
}

/// Returns the best candidates that differ in yaw, best first.
fn distinct(mut scored: Vec<(f32, YawPitchRoll)>, most: usize) -> Vec<(f32, YawPitchRoll)> {
    // A stable sort: the first of equals wins, for any number of threads.
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut kept: Vec<(f32, YawPitchRoll)> = Vec::new();
    for candidate in scored {
        let new = |kept: &(f32, YawPitchRoll)| wrapped(kept.1.yaw - candidate.1.yaw).abs() > APART;
        if kept.len() < most && kept.iter().all(new) {
            kept.push(candidate);
        }
    }
    kept
}

/// Ascends along the axes (yaw, pitch, roll), with steps that halve down to the finest one.
fn refined(
    mut pose: YawPitchRoll,
    axes: Range<usize>,
    finest_step: f32,
    score: impl Fn(YawPitchRoll) -> f32,
) -> (f32, YawPitchRoll) {
    let mut best = score(pose);
    let mut step = 4.0 * finest_step;
    while step >= finest_step {
        let mut gained = false;
        for axis in axes.clone() {
            for sign in [step, -step] {
                let mut by = [0.0; 3];
                by[axis] = sign;
                let moved = pose.moved(by);
                let reached = score(moved);
                if reached > best + 1e-6 {
                    (best, pose, gained) = (reached, moved, true);
                }
            }
        }
        if !gained {
            step *= 0.5;
        }
    }
    (best, pose)
}

/// Photo and panorama at one resolution.
struct MatchLevel {
    texels: Vec<ObservedTexel>,
    /// Per texel: log luminance, weighted logarithms of red over green and blue over green.
    seen: Vec<[f32; 3]>,
    /// The panorama's values of these features.
    features: Image<[f32; 3]>,
    radiance: RadianceImage,
    /// Whether the panorama shows a pixel; `None` for all.
    covered: Option<Image<bool>>,
}

impl MatchLevel {
    fn new(rays: &ObservedRays, prior: &PanoramaPrior, columns: usize) -> Self {
        let texels = rays.texels(columns);
        let median = |values: Vec<(f32, f32)>| weighted_median(values).unwrap_or(1.0).max(f32::MIN_POSITIVE);
        let of_photo = median(texels.iter().map(|texel| (luminance(texel.radiance), texel.weight)).collect());
        let seen = texels.iter().map(|texel| features(texel.radiance, of_photo)).collect();
        let radiance = resize_equirectangular(prior.radiance(), columns, columns / 2);
        let rows = radiance.height();
        let weights = (0..rows).map(|y| lo_geometry::pixel_solid_angle_sr(y, columns, rows));
        let weights = weights.flat_map(|weight| std::iter::repeat_n(weight, columns));
        let covered = prior.covered().map(|mask| {
            let missing = shares(&mask.map(|covered| !covered));
            resize_equirectangular(&missing, columns, columns / 2).map(|share| share[0] == 0.0)
        });
        let shown = |index: usize| covered.as_ref().is_none_or(|mask| mask.pixels()[index]);
        let weights = weights.enumerate().map(|(index, weight)| if shown(index) { weight } else { 0.0 });
        let of_panorama = median(radiance.pixels().iter().map(|&rgb| luminance(rgb)).zip(weights).collect());
        let features = radiance.map(|&rgb| {
            let [brightness, red, blue] = features(rgb, of_panorama);
            [brightness.clamp(DARKEST, BRIGHTEST), red, blue]
        });
        Self { texels, seen, features, radiance, covered }
    }

    /// Returns the texel's weight if the panorama shows it, else 0.
    fn weight(&self, texel: &ObservedTexel, panorama_from_world: Mat3) -> f32 {
        let Some(covered) = &self.covered else { return texel.weight };
        let [u, v] = uv_from_direction(panorama_from_world * texel.direction).to_array();
        let at = |t: f32, size: usize| ((t * size as f32) as usize).min(size - 1);
        if covered[(at(u, covered.width()), at(v, covered.height()))] { texel.weight } else { 0.0 }
    }

    /// Returns the correlation of photo and panorama over every `stride`th observed texel, from −1 to 1. It tends to 0
    /// where the texels are uninformative.
    fn correlation(&self, panorama_from_world: Mat3, stride: usize) -> f32 {
        let mut sums = [Moments::default(); 3];
        let mut whole = 0.0;
        for (texel, seen) in self.texels.iter().zip(&self.seen).step_by(stride) {
            let shown = sample_equirectangular(&self.features, panorama_from_world * texel.direction);
            let weight = self.weight(texel, panorama_from_world);
            whole += texel.weight;
            (0..3).for_each(|c| sums[c].add(seen[c], shown[c], weight));
        }
        // A small overlap correlates by chance.
        let overlap = if whole > 0.0 { (sums[0].weight() / whole).sqrt() } else { 0.0 };
        let [mut both, mut photo, mut panorama] = [0.0, PLAIN, PLAIN];
        for moments in sums.map(Moments::central) {
            both += moments[0];
            photo += moments[1];
            panorama += moments[2];
        }
        overlap * both / (photo * panorama).sqrt()
    }

    /// Returns the correlation, clamped at 0, times e^−d, where d is the median absolute difference of log luminance
    /// after aligning medians.
    fn confidence(&self, panorama_from_world: Mat3) -> f32 {
        let differences = self.texels.iter().zip(&self.seen).map(|(texel, seen)| {
            let shown = sample_equirectangular(&self.features, panorama_from_world * texel.direction);
            (seen[0] - shown[0], self.weight(texel, panorama_from_world))
        });
        let mut differences: Vec<(f32, f32)> = differences.collect();
        let median = weighted_median(differences.clone()).unwrap_or(0.0);
        differences.iter_mut().for_each(|(difference, _)| *difference = (*difference - median).abs());
        let deviation = weighted_median(differences).unwrap_or(0.0);
        self.correlation(panorama_from_world, 1).clamp(0.0, 1.0) * (-deviation).exp()
    }

    /// Returns the median ratio of the photo's luminance to the panorama's, weighted by the photo's luminance up to
    /// [`MIDDLE`].
    fn exposure(&self, panorama_from_world: Mat3) -> f32 {
        let ratios = self.texels.iter().filter_map(|texel| {
            let shown = luminance(sample_equirectangular(&self.radiance, panorama_from_world * texel.direction));
            let seen = luminance(texel.radiance);
            let weight = self.weight(texel, panorama_from_world) * (seen / MIDDLE).min(1.0);
            (seen > 0.0 && shown > 0.0).then(|| ((seen / shown).ln(), weight))
        });
        weighted_median(ratios.collect()).map_or(1.0, f32::exp).clamp(1e-12, 1e12)
    }
}

fn features(rgb: [f32; 3], median: f32) -> [f32; 3] {
    let [r, g, b] = rgb.map(|c| (c / median + FLOOR).ln());
    [(luminance(rgb) / median + FLOOR).ln(), COLOUR * (r - g), COLOUR * (b - g)]
}

/// Weighted moments of two quantities.
#[derive(Clone, Copy, Default)]
struct Moments([f32; 6]);

impl Moments {
    fn add(&mut self, a: f32, b: f32, weight: f32) {
        let terms = [1.0, a, b, a * b, a * a, b * b];
        (0..6).for_each(|i| self.0[i] += weight * terms[i]);
    }

    fn weight(self) -> f32 {
        self.0[0]
    }

    /// Returns the covariance and the two variances.
    fn central(self) -> [f32; 3] {
        let [weight, a, b, ab, aa, bb] = self.0;
        if weight <= 0.0 {
            return [0.0; 3];
        }
        let (a, b) = (a / weight, b / weight);
        [ab / weight - a * b, (aa / weight - a * a).max(0.0), (bb / weight - b * b).max(0.0)]
    }
}

/// Returns the value at which half of the weight is reached; `None` for an empty list.
pub(crate) fn weighted_median(mut values: Vec<(f32, f32)>) -> Option<f32> {
    values.retain(|(value, weight)| value.is_finite() && *weight > 0.0);
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|(_, weight)| f64::from(*weight)).sum::<f64>();
    let mut sum = 0.0;
    let reached = values.iter().find(|(_, weight)| {
        sum += f64::from(*weight);
        sum >= half
    });
    reached.map(|(value, _)| *value)
}
