//! MoGe-2: focal length and shift of affine points, and metres.
//!
//! Points are in OpenCV's axes (+X right, +Y down, +Z forward), up to scale and a shift along Z. With the focal length
//! `f` and the shift `s` they project onto their pixels: `f · (x, y) / (z + s) = (u, v)`. Wang et al., "MoGe" (CVPR
//! 2025), section 3.1.

use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, Image};

use crate::FieldOfView;
use crate::robust::{median, most_agreed, tukey};

/// A pixel with a smaller mask value has no reading.
pub(crate) const MASK_THRESHOLD: f32 = 0.5;

/// Points sampled along each side.
const SAMPLES: usize = 64;
/// Fewest points for a solution.
const MIN_COUNT: usize = 32;
/// Smallest relative spread of the points' distances that separates focal length from shift.
const MIN_RELIEF: f64 = 0.02;
/// Smallest share of agreeing points for a solution.
const MIN_AGREE: f64 = 0.5;
/// Largest distance of an agreeing point's projection from its pixel, in half diagonals.
const AGREES: f64 = 0.1;
/// [`AGREES`] for a known lens, which may differ from the network's.
const AGREES_WITH_KNOWN_LENS: f64 = 0.3;

/// Errors of solving for focal length and shift.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PointsError {
    /// Too few pixels have a point.
    #[error("only {0} of the sampled pixels have a point")]
    TooFew(usize),
    /// All points are at one distance, such as a wall seen head-on.
    #[error("all points are at about the same distance, so the lens cannot be inferred and must be given")]
    Flat,
    /// Points do not project onto their pixels.
    #[error("at best {:.0} % of the points project onto their pixels", 100.0 * .0)]
    Scattered(f64),
    /// The field of view is not possible.
    #[error("the points imply a field of view of {0:.1} degrees")]
    FieldOfView(f64),
    /// The metric scale is not finite or not positive.
    #[error("the metric scale is {0}")]
    Scale(f32),
}

/// Solution for affine points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FocalShift {
    /// Focal length in half diagonals of the photo; the camera's if it was given.
    pub focal: f64,
    /// Shift that is added to the points' Z, in their unit.
    pub shift: f64,
    /// Share of sampled points that project within 5 % of the diagonal of their pixel, 15 % if the lens is known.
    pub agree: f64,
}

impl FocalShift {
    /// Field of view of a photo of `photo` pixels with this lens, principal point in the centre.
    pub fn field_of_view(&self, photo: (u32, u32)) -> FieldOfView {
        let (width, height) = (f64::from(photo.0), f64::from(photo.1));
        let angle = |side: f64| 2.0 * (side / width.hypot(height) / self.focal).atan().to_degrees();
        FieldOfView { horizontal_deg: angle(width), vertical_deg: angle(height) }
    }
}

/// Solves for focal length and shift of `points` [h, w], which show a whole photo of `photo` pixels; for the shift
/// alone if the camera, in pixels of the photo, is known.
///
/// Least squares of the projection errors with Tukey's weights, from the line that most points agree with. Up to a
/// third of the points may be outliers. `mask`, 0 to 1, excludes pixels below one half.
///
/// # Errors
/// Too few points, points all at one distance with an unknown lens, points that no lens explains.
pub(crate) fn focal_and_shift(
    points: &Image<[f32; 3]>,
    mask: Option<&Image<f32>>,
    photo: (u32, u32),
    camera: Option<&Camera>,
) -> Result<FocalShift, PointsError> {
    let samples = samples(points, mask, photo, camera);
    if samples.len() < MIN_COUNT {
        return Err(PointsError::TooFew(samples.len()));
    }
    let known = camera.map(|camera| {
        let half_diagonal = 0.5 * f64::from(photo.0).hypot(f64::from(photo.1));
        0.5 * (camera.fx + camera.fy) / half_diagonal
    });
    let (mut focal, mut shift) = match known {
        Some(focal) => (focal, shift_of_median(&samples, focal)),
        None => line_of_most(&samples)?,
    };
    for _ in 0..30 {
        let (df, ds) = step(&samples, focal, shift, known.is_some());
        (focal, shift) = (focal + df, shift + ds);
        if df.abs() < 1e-9 * focal.abs() && ds.abs() < 1e-9 * shift.abs().max(1e-3) {
            break;
        }
    }
    let most = if known.is_some() { AGREES_WITH_KNOWN_LENS } else { AGREES };
    let near = samples.iter().filter(|sample| sample.miss(focal, shift) < most).count();
    let agree = near as f64 / samples.len() as f64;
    if !(focal.is_finite() && shift.is_finite() && agree >= MIN_AGREE) {
        return Err(PointsError::Scattered(agree));
    }
    let solved = FocalShift { focal, shift, agree };
    let angle = solved.field_of_view(photo).horizontal_deg;
    if known.is_none() && !(1.0..=170.0).contains(&angle) {
        return Err(PointsError::FieldOfView(angle));
    }
    Ok(solved)
}

/// Metres along the optical axis; 0 where masked, behind the camera, or not finite.
///
/// # Errors
/// A scale that is not finite or not positive.
pub(crate) fn metres(
    points: &Image<[f32; 3]>,
    mask: Option<&Image<f32>>,
    shift: f64,
    metric_scale: f32,
) -> Result<DepthMap, PointsError> {
    if !(metric_scale.is_finite() && metric_scale > 0.0) {
        return Err(PointsError::Scale(metric_scale));
    }
    let metres = |[_, _, z]: [f32; 3]| ((f64::from(z) + shift) * f64::from(metric_scale)) as f32;
    let reading = |x: usize, y: usize| {
        let z = metres(points.pixels()[y * points.width() + x]);
        if is_seen(mask, x, y) && z.is_finite() && z > 0.0 { z } else { 0.0 }
    };
    Ok(DepthMap::from_fn(points.width(), points.height(), reading))
}

/// Converts unit normals from OpenCV's axes to this project's, towards the camera; zero where masked or without
/// direction.
///
/// `half_width` and `half_height` are the image's at one metre: tangents of half the field of view.
pub(crate) fn normals(
    opencv: &Image<[f32; 3]>,
    mask: Option<&Image<f32>>,
    half_width: f32,
    half_height: f32,
) -> Image<Vec3> {
    let (width, height) = (opencv.width(), opencv.height());
    Image::from_fn(width, height, |x, y| {
        let [nx, ny, nz] = opencv.pixels()[y * width + x];
        let normal = Vec3::new(nx, -ny, -nz).normalize_or_zero();
        if !is_seen(mask, x, y) || !normal.is_finite() {
            return Vec3::ZERO;
        }
        let across = |index: usize, count: usize| (2.0 * index as f32 + 1.0) / count as f32 - 1.0;
        let ray = Vec3::new(across(x, width) * half_width, -across(y, height) * half_height, -1.0);
        if normal.dot(ray) > 0.0 { -normal } else { normal }
    })
}

fn is_seen(mask: Option<&Image<f32>>, x: usize, y: usize) -> bool {
    // NaN counts as masked.
    mask.is_none_or(|mask| mask.pixels()[y * mask.width() + x] >= MASK_THRESHOLD)
}

/// A point and its pixel, from the principal point, in half diagonals.
#[derive(Clone, Copy, Debug)]
struct Sample {
    point: [f64; 3],
    pixel: [f64; 2],
    /// Least-squares estimate of `(z + s) / f` from `(x, y) = r · (u, v)`.
    ratio: f64,
}

impl Sample {
    /// Distance of the point's projection from its pixel; infinite behind the camera.
    fn miss(&self, focal: f64, shift: f64) -> f64 {
        let [x, y, z] = self.point;
        let depth = z + shift;
        if depth <= 0.0 {
            return f64::INFINITY;
        }
        (focal * x / depth - self.pixel[0]).hypot(focal * y / depth - self.pixel[1])
    }
}

fn samples(
    points: &Image<[f32; 3]>,
    mask: Option<&Image<f32>>,
    photo: (u32, u32),
    camera: Option<&Camera>,
) -> Vec<Sample> {
    let (width, height) = (f64::from(photo.0), f64::from(photo.1));
    let half_diagonal = 0.5 * width.hypot(height);
    let (cx, cy) = camera.map_or((0.5 * width, 0.5 * height), |camera| (camera.cx, camera.cy));
    // Pixels that are not square are rescaled to one focal length.
    let (sx, sy) = camera.map_or((1.0, 1.0), |camera| {
        let focal = 0.5 * (camera.fx + camera.fy);
        (focal / camera.fx, focal / camera.fy)
    });
    let (columns, rows) = (points.width().min(SAMPLES), points.height().min(SAMPLES));
    let mut samples = Vec::with_capacity(columns * rows);
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let x = (2 * column + 1) * points.width() / (2 * columns);
        let y = (2 * row + 1) * points.height() / (2 * rows);
        let point = points.pixels()[y * points.width() + x].map(f64::from);
        if !is_seen(mask, x, y) || !point.iter().all(|value| value.is_finite()) {
            continue;
        }
        let u = ((x as f64 + 0.5) / points.width() as f64 * width - cx) * sx / half_diagonal;
        let v = ((y as f64 + 0.5) / points.height() as f64 * height - cy) * sy / half_diagonal;
        let square = u * u + v * v;
        // In the centre of the image, x and y do not constrain the distance.
        if square > 0.01 {
            samples.push(Sample { point, pixel: [u, v], ratio: (point[0] * u + point[1] * v) / square });
        }
    }
    samples
}

/// Median of the points' shifts `f · r − z`, for a known focal length.
fn shift_of_median(samples: &[Sample], focal: f64) -> f64 {
    median(&mut samples.iter().map(|sample| focal * sample.ratio - sample.point[2]).collect::<Vec<_>>())
}

/// The line `z = f · r − s` that most points agree with, among lines through two points.
fn line_of_most(samples: &[Sample]) -> Result<(f64, f64), PointsError> {
    let mut sorted = samples.to_vec();
    sorted.sort_by(|a, b| a.ratio.total_cmp(&b.ratio));
    let half = sorted.len() / 2;
    let every = |count: usize, most: usize| (0..count).step_by(count.div_ceil(most).max(1));
    let judges: Vec<_> = every(samples.len(), 512).map(|index| samples[index]).collect();
    let through = |index: usize| {
        let (near, far) = (sorted[index], sorted[index + half]);
        let focal = (far.point[2] - near.point[2]) / (far.ratio - near.ratio);
        (focal, focal * near.ratio - near.point[2])
    };
    let lines: Vec<_> = every(half, 400).map(through).filter(|(focal, _)| focal.is_finite() && *focal > 0.0).collect();
    let agreed = most_agreed(&lines, judges.len(), |(focal, shift), judge| judges[judge].miss(focal, shift));
    let ((focal, shift), most) = agreed.ok_or(PointsError::Flat)?;
    // Spread of agreeing points only, since outliers may be anywhere.
    let agrees = |sample: &&Sample| sample.miss(focal, shift) <= most;
    let ratios: Vec<_> = samples.iter().filter(agrees).map(|sample| sample.ratio).collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len().max(1) as f64;
    let variance = ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum::<f64>() / ratios.len().max(1) as f64;
    if ratios.len() < MIN_COUNT || variance.sqrt() < MIN_RELIEF * mean.abs() {
        return Err(PointsError::Flat);
    }
    Ok((focal, shift))
}

/// One Gauss–Newton step on the weighted squares of the projection errors.
fn step(samples: &[Sample], focal: f64, shift: f64, focal_is_known: bool) -> (f64, f64) {
    let misses: Vec<_> = samples.iter().map(|sample| sample.miss(focal, shift)).collect();
    let scale = 1.4826 * median(&mut misses.clone());
    let [mut ff, mut fs, mut ss, mut ef, mut es] = [0.0; 5];
    for (sample, &miss) in samples.iter().zip(&misses) {
        let weight = tukey(miss, scale);
        if weight == 0.0 {
            continue;
        }
        let depth = sample.point[2] + shift;
        for (value, pixel) in [(sample.point[0], sample.pixel[0]), (sample.point[1], sample.pixel[1])] {
            let error = focal * value / depth - pixel;
            let by_focal = if focal_is_known { 0.0 } else { value / depth };
            let by_shift = -focal * value / (depth * depth);
            ff += weight * by_focal * by_focal;
            fs += weight * by_focal * by_shift;
            ss += weight * by_shift * by_shift;
            ef += weight * by_focal * error;
            es += weight * by_shift * error;
        }
    }
    if focal_is_known {
        return if ss > 0.0 { (0.0, -es / ss) } else { (0.0, 0.0) };
    }
    let determinant = ff * ss - fs * fs;
    if determinant <= 1e-12 * ff * ss {
        return (0.0, 0.0);
    }
    ((fs * es - ss * ef) / determinant, (fs * ef - ff * es) / determinant)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    const PHOTO: (u32, u32) = (640, 480);

    /// A corner of a room with floor, side wall and back wall: metres along the optical axis at a pixel.
    fn room(camera: &Camera, u: f64, v: f64) -> f64 {
        // From −1 to 1 across the image, so that a long lens sees as much of the walls.
        let (x, y) = (2.0 * u / f64::from(camera.width) - 1.0, 2.0 * v / f64::from(camera.height) - 1.0);
        let plane = |along: f64, distance: f64| if along > 0.0 { distance / along } else { f64::INFINITY };
        4.0f64.min(plane(y, 1.5)).min(plane(x, 2.0)).min(plane(-x + 0.3 * y, 3.0))
    }

    /// The room's affine points: `size` times smaller and nearer by `shift`.
    fn affine(camera: &Camera, size: f64, shift: f64) -> Image<[f32; 3]> {
        Image::from_fn(160, 120, |x, y| {
            let (u, v) = (4.0 * (x as f64 + 0.5), 4.0 * (y as f64 + 0.5));
            let z = room(camera, u, v) / size;
            [((u - camera.cx) / camera.fx * z) as f32, ((v - camera.cy) / camera.fy * z) as f32, (z - shift) as f32]
        })
    }

    /// A number of 0 to 1 for each pixel, from a Weyl sequence.
    fn dice(index: usize, stream: f64) -> f64 {
        (index as f64 * 0.618_033_988_749_895 + stream * index as f64 * 0.324_717_957_244_746).fract()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn lens_and_shift_are_recovered_through_outliers(hfov in 30.0..110.0f64, size in 0.3..4.0f64, shift in -0.4..0.6f64) {
            let camera = Camera::from_hfov_deg(hfov, PHOTO.0, PHOTO.1).unwrap();
            let mut points = affine(&camera, size, shift);
            // A fifth are outliers, and a masked corner is nonsense.
            for (index, point) in points.pixels_mut().iter_mut().enumerate() {
                if dice(index, 0.0) < 0.2 {
                    *point = [1, 2, 3].map(|stream| (6.0 * dice(index, f64::from(stream)) - 2.0) as f32);
                }
            }
            let mask = Image::from_fn(160, 120, |x, y| if x < 40 && y < 40 { 0.2 } else { 0.9 });
            for (index, point) in points.pixels_mut().iter_mut().enumerate() {
                if index % 160 < 40 && index / 160 < 40 {
                    *point = [f32::NAN, 1.0, -5.0];
                }
            }
            let solved = focal_and_shift(&points, Some(&mask), PHOTO, None).unwrap();
            prop_assert!((solved.field_of_view(PHOTO).horizontal_deg / hfov - 1.0).abs() < 1e-3, "{solved:?} of {hfov}");
            prop_assert!((solved.shift - shift).abs() < 1e-3 * 4.0 / size, "{solved:?}, shift {shift}");
            prop_assert!((0.7..=0.9).contains(&solved.agree), "{solved:?}");

            // Known lens: the shift alone, for a camera with an off-centre principal point and pixels that are not
            // square.
            let camera = Camera::new(500.0, 520.0, 300.0, 250.0, PHOTO.0, PHOTO.1).unwrap();
            let solved = focal_and_shift(&affine(&camera, size, shift), Some(&mask), PHOTO, Some(&camera)).unwrap();
            prop_assert!((solved.shift - shift).abs() < 1e-3 * 4.0 / size, "{solved:?}, shift {shift}");

            // Metres are those of the room, and the masked corner has none.
            let depth = metres(&affine(&camera, size, shift), Some(&mask), solved.shift, size as f32).unwrap();
            for (x, y) in [(41, 0), (80, 60), (159, 119), (3, 100)] {
                let truth = room(&camera, 4.0 * (x as f64 + 0.5), 4.0 * (y as f64 + 0.5));
                let read = f64::from(depth.pixels()[y * 160 + x]);
                prop_assert!((read / truth - 1.0).abs() < 1e-3, "{read} of {truth}");
            }
            prop_assert_eq!(depth.pixels()[0], 0.0);
        }
    }

    #[test]
    fn noise_of_a_percent_costs_a_percent() {
        let camera = Camera::from_hfov_deg(65.0, PHOTO.0, PHOTO.1).unwrap();
        let mut points = affine(&camera, 1.3, 0.2);
        for (index, point) in points.pixels_mut().iter_mut().enumerate() {
            point[2] *= (1.0 + 0.02 * (dice(index, 1.0) - 0.5)) as f32;
        }
        let solved = focal_and_shift(&points, None, PHOTO, None).unwrap();
        assert!((solved.field_of_view(PHOTO).horizontal_deg - 65.0).abs() < 0.65, "{solved:?}");
    }

    #[test]
    fn field_of_view_is_that_of_the_sides() {
        // 3-4-5: with a focal length of half the diagonal, 2 atan(4/5) across and 2 atan(3/5) up.
        let angles = FocalShift { focal: 1.0, shift: 0.0, agree: 1.0 }.field_of_view(PHOTO);
        assert!((angles.horizontal_deg - 77.319_617).abs() < 1e-5 && (angles.vertical_deg - 61.927_513).abs() < 1e-5);
    }

    #[test]
    fn a_wall_seen_head_on_determines_the_shift_alone() {
        let camera = Camera::from_hfov_deg(60.0, PHOTO.0, PHOTO.1).unwrap();
        let wall = |shift: f32| {
            Image::from_fn(160, 120, |x, y| {
                let ray = camera.unproject(4.0 * (x as f64 + 0.5), 4.0 * (y as f64 + 0.5), 2.0);
                [ray.x, -ray.y, 2.0 - shift]
            })
        };
        assert_eq!(focal_and_shift(&wall(0.5), None, PHOTO, None), Err(PointsError::Flat));
        let solved = focal_and_shift(&wall(0.5), None, PHOTO, Some(&camera)).unwrap();
        assert!((solved.shift - 0.5).abs() < 1e-5);
    }

    #[test]
    fn a_given_lens_overrides_the_networks() {
        // The points have 65 degrees, the given camera 78: 0.79 times the focal length.
        let built_in = Camera::from_hfov_deg(65.0, PHOTO.0, PHOTO.1).unwrap();
        let given = Camera::from_hfov_deg(78.0, PHOTO.0, PHOTO.1).unwrap();
        let points = affine(&built_in, 1.0, 0.2);
        let solved = focal_and_shift(&points, None, PHOTO, Some(&given)).unwrap();
        let depth = metres(&points, None, solved.shift, 1.0).unwrap();
        // One shift for all distances compensates a part of the focal length: between 4 m and 4 m times its ratio.
        let middle = f64::from(depth.pixels()[60 * 160 + 80]);
        assert!((4.0 * given.fx / built_in.fx..4.0).contains(&middle) && solved.agree > 0.99, "{middle} m, {solved:?}");
    }

    #[test]
    fn points_of_no_use_are_named() {
        let nothing = Image::new(160, 120, vec![[f32::NAN; 3]; 160 * 120]);
        assert_eq!(focal_and_shift(&nothing, None, PHOTO, None), Err(PointsError::TooFew(0)));
        let camera = Camera::from_hfov_deg(60.0, PHOTO.0, PHOTO.1).unwrap();
        let points = affine(&camera, 1.0, 0.0);
        let unseen = Image::new(160, 120, vec![0.49; 160 * 120]);
        assert_eq!(focal_and_shift(&points, Some(&unseen), PHOTO, None), Err(PointsError::TooFew(0)));
        let mut index = 0;
        let chaos = points.map(|_| {
            index += 1;
            [1, 2, 3].map(|stream| (6.0 * dice(index, f64::from(stream)) - 3.0) as f32)
        });
        assert!(matches!(
            focal_and_shift(&chaos, None, PHOTO, None),
            Err(PointsError::Scattered(_) | PointsError::Flat)
        ));
        let same = Image::new(160, 120, vec![[0.1, 0.1, 1.0]; 160 * 120]);
        assert!(focal_and_shift(&same, None, PHOTO, None).is_err());
        let none = Image::new(0, 0, Vec::new());
        assert_eq!(focal_and_shift(&none, None, PHOTO, None), Err(PointsError::TooFew(0)));
        for scale in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(matches!(metres(&points, None, 0.0, scale), Err(PointsError::Scale(_))));
        }
        // Points behind the camera have no reading.
        assert!(metres(&points, None, -100.0, 1.0).unwrap().pixels().iter().all(|&z| z == 0.0));
    }

    #[test]
    fn normals_are_turned_into_our_axes_and_towards_the_camera() {
        // In OpenCV's axes a floor's normal is −Y and that of a wall ahead −Z. The third points away and is flipped,
        // the fourth is masked.
        let opencv = Image::new(4, 1, vec![[0.0, -2.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]);
        let mask = Image::new(4, 1, vec![1.0, 0.5, 1.0, 0.4]);
        let ours = normals(&opencv, Some(&mask), 1.0, 0.75);
        // The floor is in the middle row: its normal is perpendicular to the ray, and stays.
        assert_eq!(ours.pixels(), [Vec3::Y, Vec3::Z, Vec3::Z, Vec3::ZERO]);
        let strange = Image::new(2, 1, vec![[0.0; 3], [f32::NAN, 0.0, 1.0]]);
        assert_eq!(normals(&strange, None, 1.0, 1.0).pixels(), [Vec3::ZERO; 2]);
    }
}
