//! Detection of the ball's outline.
//!
//! A Hough transform along gradients proposes circles in a downsampled photo. They are scored by how a mirror
//! compresses the room towards its rim.
//!
//! Towards the outline the ball compresses the room along the radius r by 1 − r². Gradients there point along the
//! radius, whereas those of the background right beside it point anywhere. An edge at the outline itself is no reliable
//! cue: the ball's last pixel shows the same as the background right beside it.

use rayon::prelude::*;

use super::circles::{CircleDetector, DETECTION_SIDE, distinct};
use super::slopes::{Slopes, distance};
use super::{BallCircle, BallError, BallLens, BallView};
use lo_imaging::{Image, RadianceImage, luminance};

/// The best detected outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallDetection {
    /// The ball with this outline.
    pub view: BallView,
    /// Confidence from 0 to 1, a product of three factors.
    ///
    /// - The excess of radial alignment of gradients inside the rim over that outside, relative to balls in real rooms.
    /// - The share of the outline with an edge.
    /// - A reduction for small balls, which arise more often by chance.
    pub confidence: f64,
}

impl BallDetection {
    /// Confidence from which a detection counts as a ball.
    ///
    /// The best circles of 28 photos and 14 views of panoramas without a ball reach 0.38 (the ignored test `survey`
    /// prints them all).
    pub const MIN_CONFIDENCE: f64 = 0.4;
}

/// Number of circles whose outline is fitted in the photo.
const MAX_FITS: usize = 8;
/// Difference of radial alignment inside and outside the rim of balls in real rooms.
const TYPICAL_CONTRAST: f64 = 0.4;
/// Radius, over the photo's shorter side, from which a ball is not small.
const LARGE_RADIUS: f64 = 0.25;

/// Detects the ball in a photo; `None` if no circle is found at all.
///
/// Compare the confidence with [`BallDetection::MIN_CONFIDENCE`].
///
/// # Errors
/// A photo without pixels, or an invalid lens.
pub fn find_ball(photo: &RadianceImage, lens: BallLens) -> Result<Option<BallDetection>, BallError> {
    let size = [photo.width(), photo.height()];
    if size[0] * size[1] == 0 {
        return Err(BallError::NoPhoto);
    }
    check_lens(lens)?;
    if let Some(circle) = inscribed(photo) {
        return Ok(Some(BallDetection { view: BallView::new(circle, lens, size)?, confidence: 1.0 }));
    }
    let grey = grey(photo);
    let detector = CircleDetector::new(&grey);
    let mut refined: Vec<(f64, BallCircle)> =
        detector.candidates().into_par_iter().filter_map(|circle| detector.refine(circle)).collect();
    refined.sort_by(|a, b| b.0.total_cmp(&a.0));
    let detections = distinct(refined, MAX_FITS).into_par_iter().filter_map(|circle| {
        let view = fitted(&grey, BallView::new(detector.photo_circle(circle), lens, size).ok()?)?;
        // discard a fit that diverged
        BallView::new(view.circle(), lens, size).ok()?;
        let contrast = detector.contrast(detector.detection_circle(view.circle()))?;
        let compressed = (contrast / TYPICAL_CONTRAST).clamp(0.0, 1.0);
        let large = (view.circle().radius_px / (LARGE_RADIUS * size[0].min(size[1]) as f64)).sqrt().min(1.0);
        let edges = Slopes::across(&grey, &view, 8.0)?.edges_on_outline();
        Some(BallDetection { view, confidence: compressed * large * edges })
    });
    Ok(detections.collect::<Vec<BallDetection>>().into_iter().max_by(|a, b| a.confidence.total_cmp(&b.confidence)))
}

/// Least share of the corners with one colour, and most of the ball's rim with that colour, in a picture of a ball that
/// fills its square.
const PLAIN_CORNERS: f64 = 0.98;
const PLAIN_RIM: f64 = 0.3;

/// Returns the circle inscribed in a square picture if its corners have one colour, as programs cut out a ball
/// (DiffusionLight's `ball` folder).
fn inscribed(photo: &RadianceImage) -> Option<BallCircle> {
    let (width, height) = (photo.width(), photo.height());
    let radius_px = 0.5 * width.min(height) as f64;
    if width.abs_diff(height) > 1 || radius_px < 16.0 {
        return None;
    }
    let middle = [0.5 * width as f64, 0.5 * height as f64];
    let (mut corners, mut rim) = (Vec::new(), Vec::new());
    for (index, &rgb) in photo.pixels().iter().enumerate() {
        let at = [(index % width) as f64 + 0.5, (index / width) as f64 + 0.5];
        // the outline itself is blended, and JPEG spreads it over its block
        match distance(at, middle) - radius_px {
            beyond if beyond > (0.2 * radius_px).min(9.0) => corners.push(rgb),
            beyond if (-0.05 * radius_px..-1.5).contains(&beyond) => rim.push(rgb),
            _ => {}
        }
    }
    let median = |c: usize| {
        let mut values: Vec<f32> = corners.iter().map(|rgb| rgb[c]).collect();
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f32::total_cmp).1
    };
    let plain = [median(0), median(1), median(2)];
    let tolerance = |c: usize| 0.004 + 0.02 * plain[c].abs();
    let is_plain = |rgb: &&[f32; 3]| (0..3).all(|c| (rgb[c] - plain[c]).abs() <= tolerance(c));
    let share = |pixels: &[[f32; 3]]| pixels.iter().filter(is_plain).count() as f64 / pixels.len() as f64;
    let found = share(&corners) >= PLAIN_CORNERS && share(&rim) <= PLAIN_RIM;
    found.then_some(BallCircle { x: middle[0], y: middle[1], radius_px })
}

fn check_lens(lens: BallLens) -> Result<(), BallError> {
    let valid = match lens {
        BallLens::Orthographic => true,
        BallLens::Focal { focal_px } => focal_px.is_finite() && focal_px > 0.0,
        BallLens::Distance { radii } => radii.is_finite() && radii > 1.0,
    };
    if valid { Ok(()) } else { Err(BallError::Lens { lens }) }
}

/// Computes ln(1 + luminance ÷ median), so that lamps do not hide all other edges and noise in the dark counts little.
fn grey(photo: &RadianceImage) -> Image<f32> {
    let mut values: Vec<f32> = photo.pixels().par_iter().map(|&rgb| luminance(rgb).max(0.0)).collect();
    let step = (values.len() / 100_000).max(1);
    let mut subset: Vec<f32> = values.iter().copied().step_by(step).collect();
    let middle = subset.len() / 2;
    let median = subset.select_nth_unstable_by(middle, f32::total_cmp).1.max(1e-6);
    values.par_iter_mut().for_each(|v| *v = (1.0 + *v / median).ln());
    Image::new(photo.width(), photo.height(), values)
}

/// Fits the outline in the photo itself, to the end of the radial slopes, which increase up to the outline, in each
/// sector.
fn fitted(grey: &Image<f32>, start: BallView) -> Option<BallView> {
    let small_pixel = (grey.width().max(grey.height()) as f64 / DETECTION_SIDE as f64).max(1.0);
    let mut view = start;
    for (share, pixels, tukey_px) in [(0.02, 1.5, 3.0), (0.01, 0.5, 1.5), (0.01, 0.0, 1.0)] {
        let radius_px = view.circle().radius_px;
        let points = Slopes::across(grey, &view, share * radius_px + pixels * small_pixel + 6.0)?.outline_points();
        let middle = [view.circle().x, view.circle().y];
        // Tukey's biweight, starting wide enough for the disagreement of the sectors
        let mut scale_px = 2.0 * tukey_px + share * radius_px;
        for _ in 0..10 {
            let weighted: Vec<([f64; 2], f64)> = points
                .iter()
                .filter_map(|found| {
                    let offset = distance(found.point, middle) - distance(view.outline(found.turn)?, middle);
                    let share = 1.0 - (offset / scale_px).powi(2);
                    (share > 0.0).then_some((found.point, share * share * found.contrast))
                })
                .collect();
            if weighted.len() < 6 {
                return None;
            }
            view = view.fitted(&weighted)?;
            scale_px = (0.7 * scale_px).max(tukey_px);
        }
    }
    Some(view)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn picture(corner: impl Fn(usize, usize) -> f32) -> RadianceImage {
        Image::from_fn(96, 96, |x, y| {
            let inside = distance([x as f64 + 0.5, y as f64 + 0.5], [48.0; 2]) < 48.0;
            [if inside { 0.2 + 0.01 * ((x * 7 + y * 3) % 40) as f32 } else { corner(x, y) }; 3]
        })
    }

    #[test]
    fn a_ball_that_fills_its_square_is_found() {
        for corner in [0.0, 1.0, 0.18] {
            let found = find_ball(&picture(|_, _| corner), BallLens::Orthographic).unwrap().unwrap();
            let BallCircle { x, y, radius_px } = found.view.circle();
            assert!((x - 48.0).abs() + (y - 48.0).abs() + (radius_px - 48.0).abs() < 1e-6);
            assert_eq!(found.confidence, 1.0);
        }
        assert_eq!(inscribed(&picture(|x, y| 0.01 * ((x * 5 + y * 11) % 50) as f32)), None, "the corners show a room");
        assert_eq!(inscribed(&Image::new(96, 96, vec![[0.0; 3]; 96 * 96])), None, "all is black");
    }

    #[test]
    fn cut_out_balls_are_found_in_files() {
        let Some(inputs) = lo_testdata::shared_data("inputs", "cut-out mirror balls") else { return };
        for name in ["ball_ev-0.png", "ball_ev-25.png", "ball_ev-50.png"] {
            let photo = lo_imaging::read_radiance(inputs.join(name)).unwrap();
            let found = find_ball(&photo, BallLens::Orthographic).unwrap().unwrap().view.circle();
            assert_eq!([found.x, found.y, found.radius_px], [128.0; 3], "{name}");
        }
    }
}
