//! The length of a track's unit, in metres of the scene.
//!
//! Tracks of footage alone have an arbitrary unit, and predicted depth has a scale of its own. If they differ, objects
//! slide over the floor. Pixels of the scene's photo, moved to the plates' cameras through its depth, show the same
//! there only with the right length: the one of the least photometric error wins (direct alignment as in Engel et al.,
//! *Direct Sparse Odometry*, 2018, with the scale as its only unknown).

use lo_geometry::{Camera, RigidTransform, Vec3};
use lo_imaging::{Image, RadianceImage, luminance};
use rayon::prelude::*;

/// Longer sides of the images, and ranges and steps of the search in octaves around the best scale before.
const LEVELS: [(usize, f32, f32); 3] = [(96, 3.0, 0.125), (192, 0.25, 0.0625), (384, 0.125, 1.0 / 64.0)];

/// Share of the pixels that is compared: those with the largest gradients.
const COMPARED: f32 = 0.3;

/// Smallest luminance that is compared, as a share of the median.
const LEAST_LIGHT: f32 = 0.02;

/// Largest error of a pixel, natural logarithm of luminance.
const MOST: f32 = 0.4;

/// Error of a pixel that leaves a plate.
const OUTSIDE: f32 = 0.3;

/// Distance from an object within which pixels count most, as a share of its distance from the camera.
const NEAR: f32 = 0.25;

/// Weight of a pixel far from all objects.
const FAR_WEIGHT: f32 = 0.05;

/// Least shift of pixels by a scale that is 10 % longer, as a share of the image's longer side, in the plate with the
/// most: with less, the scale matters little and is not measured.
const LEAST_SHIFT: f32 = 0.002;

/// Least decrease of the error from the median of all scales to the best.
const LEAST_GAIN: f32 = 0.08;

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
    /// It is 1 and matters little: the camera hardly moves, or only turns.
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
    let mut best = (0.0f32, f32::INFINITY);
    let mut all_errors = Vec::new();
    for (level, &(side, range, step)) in LEVELS.iter().enumerate() {
        let scaled = reduced(photo, side);
        let own = camera.resized(scaled.width() as u32, scaled.height() as u32);
        let samples = samples(&scaled, &own, points, near);
        if samples.len() < 50 {
            return one(ScaleSource::Unknown);
        }
        let views: Vec<(Image<f32>, Camera, RigidTransform)> = views
            .iter()
            .map(|view| {
                let light = reduced(&view.light, side);
                let camera = view.camera.resized(light.width() as u32, light.height() as u32);
                (logarithm(&light), camera, view.room_from_camera)
            })
            .collect();
        if level == 0 && largest_shift(&samples, &views) < LEAST_SHIFT * side as f32 {
            return one(ScaleSource::NoMotion);
        }
        let middle = best.0;
        let steps = (range / step).round() as i32;
        let octaves: Vec<f32> = (-steps..=steps).map(|i| middle + i as f32 * step).collect();
        let errors: Vec<f32> = octaves.par_iter().map(|octave| error(&samples, &views, octave.exp2())).collect();
        best = octaves
            .iter()
            .copied()
            .zip(errors.iter().copied())
            .fold((middle, f32::INFINITY), |best, new| if new.1 < best.1 { new } else { best });
        if level == 0 {
            all_errors = errors;
        }
    }
    all_errors.sort_unstable_by(f32::total_cmp);
    let usual = all_errors[all_errors.len() / 2];
    let gain = 1.0 - all_errors[0] / usual.max(1e-6);
    if gain < LEAST_GAIN {
        one(ScaleSource::Unknown)
    } else {
        ScaleFit { scale: best.0.exp2(), source: ScaleSource::Plates }
    }
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
    let mut sorted = light.pixels().to_vec();
    let middle = sorted.len() / 2;
    let median = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
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

/// Returns the position of a sample in a view with the camera's translation scaled.
fn place(sample: &Sample, camera: &Camera, room_from_camera: &RigidTransform, scale: f32) -> Option<(f32, f32)> {
    let pose = RigidTransform { translation_m: room_from_camera.translation_m * scale, ..*room_from_camera };
    let (u, v, _) = camera.project(pose.inverse().point(sample.point))?;
    Some((u as f32, v as f32))
}

/// Returns the largest median shift of the samples in a view by a scale that is 10 % longer, pixels.
fn largest_shift(samples: &[Sample], views: &[(Image<f32>, Camera, RigidTransform)]) -> f32 {
    let shift = |(_, camera, pose): &(Image<f32>, Camera, RigidTransform)| {
        let of = |sample: &Sample| {
            let (a, b) = (place(sample, camera, pose, 1.0)?, place(sample, camera, pose, 1.1)?);
            Some((a.0 - b.0).hypot(a.1 - b.1))
        };
        let mut shifts: Vec<f32> = samples.iter().filter_map(of).collect();
        let middle = shifts.len() / 2;
        if shifts.is_empty() { 0.0 } else { *shifts.select_nth_unstable_by(middle, f32::total_cmp).1 }
    };
    views.iter().map(shift).fold(0.0, f32::max)
}

/// Returns the mean photometric error over the views.
fn error(samples: &[Sample], views: &[(Image<f32>, Camera, RigidTransform)], scale: f32) -> f32 {
    let of_view = |(light, camera, pose): &(Image<f32>, Camera, RigidTransform)| {
        let seen = |sample: &Sample| {
            let (u, v) = place(sample, camera, pose, scale)?;
            Some(sample.log_light - interpolated(light, u - 0.5, v - 0.5)?)
        };
        let differences: Vec<Option<f32>> = samples.iter().map(seen).collect();
        // The exposures differ.
        let mut known: Vec<f32> = differences.iter().flatten().copied().collect();
        let middle = known.len() / 2;
        let offset = if known.is_empty() { 0.0 } else { *known.select_nth_unstable_by(middle, f32::total_cmp).1 };
        let of = |(sample, difference): (&Sample, &Option<f32>)| {
            sample.weight * difference.map_or(OUTSIDE, |difference| (difference - offset).abs().min(MOST))
        };
        let sum: f32 = samples.iter().zip(&differences).map(of).sum();
        sum / samples.iter().map(|sample| sample.weight).sum::<f32>()
    };
    views.iter().map(of_view).sum::<f32>() / views.len().max(1) as f32
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
