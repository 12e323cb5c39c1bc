//! The length of a track's unit, in metres of the scene.
//!
//! Tracks of footage alone have an arbitrary unit, and predicted depth has a scale of its own. If they differ, objects
//! slide over the floor. Pixels of the scene's photo, moved to the plates' cameras through its depth, show the same
//! there only with the right length: the one of the least photometric error wins (direct alignment as in Engel et al.,
//! *Direct Sparse Odometry*, 2018, with the scale as its only unknown).

use lo_geometry::{Camera, RigidTransform, Vec3};
use lo_imaging::{Image, RadianceImage, luminance};
use rayon::prelude::*;

/// Longer sides of the images, ranges below and above the best scale before, and steps, in octaves.
const LEVELS: [(usize, [f32; 2], f32); 3] =
    [(96, [5.0, 3.0], 1.0 / 16.0), (192, [0.125, 0.125], 1.0 / 32.0), (384, [0.0625, 0.0625], 1.0 / 128.0)];

/// Length of the farthest camera's way as a share of the median distance of surfaces, around which scales are searched.
const USUAL_WAY: f32 = 0.3;

/// Share of the pixels that is compared: those with the largest gradients.
const COMPARED: f32 = 0.3;

/// Fewest pixels that give a scale.
const LEAST_SAMPLES: usize = 50;

/// Smallest luminance that is compared, as a share of the median.
const LEAST_LIGHT: f32 = 0.02;

/// Largest error of a pixel, natural logarithm of luminance.
const MOST: f32 = 0.4;

/// Error of a pixel that leaves a plate.
const OUTSIDE: f32 = 0.3;

/// Distance from an object within which pixels count most, as a share of its distance from the camera.
const NEAR: f32 = 0.08;

/// Weight of a pixel far from all objects.
const FAR_WEIGHT: f32 = 0.01;

/// Least decrease of a plate's error from the median of all scales to the best. Others show too little of what the
/// scene's photo shows.
const LEAST_GAIN: f32 = 0.04;

/// A fitted scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleFit {
    /// Metres of the scene per unit of the track.
    pub scale: f32,
    /// How it was found.
    pub source: ScaleSource,
}

/// Source of a [`ScaleFit`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScaleSource {
    /// The plates agree best with it.
    Plates,
    /// It is 1 and matters little: the camera only turns.
    NoMotion,
    /// It is 1, because no scale fits the plates.
    Unknown,
}

/// A plate with its camera's pose for a unit of one metre.
pub(crate) struct View {
    pub light: RadianceImage,
    pub camera: Camera,
    pub room_from_camera: RigidTransform,
}

/// A pixel of the scene's photo.
struct Sample {
    log_light: f32,
    point: Vec3,
    weight: f32,
}

/// Finds the scale by which the scene's photo agrees best with the plates. Positions `near` it count most.
pub(crate) fn fit(
    photo: &RadianceImage,
    points: &dyn Fn(usize, usize, &Camera) -> Option<Vec3>,
    camera: &Camera,
    views: &[View],
    near: &[Vec3],
) -> ScaleFit {
    let one = |source| ScaleFit { scale: 1.0, source };
    let way = views.iter().map(|view| view.room_from_camera.translation_m.length()).fold(0.0, f32::max);
    if way == 0.0 {
        return one(ScaleSource::NoMotion);
    }
    let mut best = f32::NAN;
    let mut used: Vec<usize> = (0..views.len()).collect();
    for (level, &(side, [below, above], step)) in LEVELS.iter().enumerate() {
        let scaled = reduced(photo, side);
        let own = camera.resized(scaled.width() as u32, scaled.height() as u32);
        let samples = samples(&scaled, &own, points, near);
        if samples.len() < LEAST_SAMPLES {
            return one(ScaleSource::Unknown);
        }
        if level == 0 {
            best = (USUAL_WAY * median(samples.iter().map(|sample| sample.point.length()).collect()) / way).log2();
        }
        let steps = (-(below / step).round() as i32)..=(above / step).round() as i32;
        let octaves: Vec<f32> = steps.map(|i| best + i as f32 * step).collect();
        let errors = |&view: &usize| {
            let View { light, camera, room_from_camera } = &views[view];
            let light = logarithm(&reduced(light, side));
            let camera = camera.resized(light.width() as u32, light.height() as u32);
            let at = |scale: f32| error(&samples, &light, &camera, room_from_camera, scale);
            let errors: Vec<f32> = octaves.par_iter().map(|octave| at(octave.exp2())).collect();
            (view, errors, at(0.0))
        };
        let mut errors: Vec<(usize, Vec<f32>, f32)> = used.iter().map(errors).collect();
        if level == 0 {
            let least = |errors: &[f32]| errors.iter().copied().fold(f32::INFINITY, f32::min);
            // Plates that the camera only turns to agree best without any motion.
            let turns = |(_, errors, still): &&(usize, Vec<f32>, f32)| {
                *still < (1.0 - LEAST_GAIN) * median(errors.clone()) && *still <= (1.0 + LEAST_GAIN) * least(errors)
            };
            let turned = errors.iter().filter(turns).count();
            errors.retain(|(_, errors, still)| least(errors) < (1.0 - LEAST_GAIN) * median(errors.clone()).min(*still));
            if errors.is_empty() {
                return one(if turned > 0 { ScaleSource::NoMotion } else { ScaleSource::Unknown });
            }
            used = errors.iter().map(|(view, ..)| *view).collect();
        }
        let total = |i: usize| errors.iter().map(|(_, errors, _)| errors[i]).sum::<f32>();
        let least = (0..octaves.len()).min_by(|&a, &b| total(a).total_cmp(&total(b)));
        best = least.map_or(best, |i| octaves[i]);
    }
    ScaleFit { scale: best.exp2(), source: ScaleSource::Plates }
}

/// Returns the median; 0 for an empty list.
fn median(mut values: Vec<f32>) -> f32 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f32::total_cmp).1 }
}

/// Returns the image with at most `side` pixels on the longer side.
fn reduced(image: &RadianceImage, side: usize) -> RadianceImage {
    let (width, height) = (image.width(), image.height());
    let scale = (side as f64 / width.max(height) as f64).min(1.0);
    let scaled = |length: usize| ((length as f64 * scale).round() as usize).max(2);
    lo_scene::resized_photo(&lo_imaging::Photo::Linear(image.clone()), scaled(width), scaled(height)).into_radiance()
}

fn logarithm(light: &RadianceImage) -> Image<f32> {
    let light = light.map(|&rgb| luminance(rgb).max(0.0));
    let median = median(light.pixels().to_vec());
    light.map(|&value| value.max(LEAST_LIGHT * median).max(1e-9).ln())
}

fn samples(
    photo: &RadianceImage,
    camera: &Camera,
    points: &dyn Fn(usize, usize, &Camera) -> Option<Vec3>,
    near: &[Vec3],
) -> Vec<Sample> {
    let light = logarithm(photo);
    let (width, height) = (light.width(), light.height());
    let inner = (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (x, y)));
    let gradient = |(x, y): (usize, usize)| {
        (light[(x + 1, y)] - light[(x - 1, y)]).abs() + (light[(x, y + 1)] - light[(x, y - 1)]).abs()
    };
    let mut places: Vec<((usize, usize), f32)> = inner.map(|at| (at, gradient(at))).collect();
    places.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    places.truncate((places.len() as f32 * COMPARED) as usize);
    let weight = |point: Vec3| {
        let of = |&place: &Vec3| {
            let squared = (point - place).length_squared() / (NEAR * place.length()).powi(2).max(1e-6);
            (1.0 + squared).powi(-2)
        };
        FAR_WEIGHT + near.iter().map(of).fold(0.0, f32::max)
    };
    let sample = |((x, y), _): ((usize, usize), f32)| {
        let point = points(x, y, camera)?;
        Some(Sample { log_light: light[(x, y)], point, weight: if near.is_empty() { 1.0 } else { weight(point) } })
    };
    places.into_iter().filter_map(sample).collect()
}

/// Returns the mean photometric error in a view.
fn error(
    samples: &[Sample],
    light: &Image<f32>,
    camera: &Camera,
    room_from_camera: &RigidTransform,
    scale: f32,
) -> f32 {
    let pose = RigidTransform { translation_m: room_from_camera.translation_m * scale, ..*room_from_camera };
    let camera_from_room = pose.inverse();
    let seen = |sample: &Sample| {
        let (u, v, _) = camera.project(camera_from_room.point(sample.point))?;
        Some(sample.log_light - interpolated(light, u as f32 - 0.5, v as f32 - 0.5)?)
    };
    let differences: Vec<Option<f32>> = samples.iter().map(seen).collect();
    // The exposures differ.
    let offset = median(differences.iter().flatten().copied().collect());
    let of = |(sample, difference): (&Sample, &Option<f32>)| {
        sample.weight * difference.map_or(OUTSIDE, |difference| (difference - offset).abs().min(MOST))
    };
    let sum: f32 = samples.iter().zip(&differences).map(of).sum();
    sum / samples.iter().map(|sample| sample.weight).sum::<f32>()
}

/// Interpolates between four pixels, whose centres are at integers; `None` outside of the image.
fn interpolated(image: &Image<f32>, u: f32, v: f32) -> Option<f32> {
    let (width, height) = (image.width(), image.height());
    if !(u >= 0.0 && v >= 0.0 && u <= (width - 1) as f32 && v <= (height - 1) as f32) {
        return None;
    }
    let (x, y) = ((u as usize).min(width - 2), (v as usize).min(height - 2));
    let (fx, fy) = (u - x as f32, v - y as f32);
    let row = |y: usize| image[(x, y)] * (1.0 - fx) + image[(x + 1, y)] * fx;
    Some(row(y) * (1.0 - fy) + row(y + 1) * fy)
}
