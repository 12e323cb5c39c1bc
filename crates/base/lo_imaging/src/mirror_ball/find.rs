//! The ball's outline: Hough's transform along gradients on a small picture proposes circles, how a mirror squeezes the room towards its rim decides.
//!
//! Towards the outline the ball shows ever more of the room on ever fewer pixels along the radius and ever less around it, by the
//! factor 1 − r² of the radius r: there its gradients point along the radius, and right beside it those of the background point anywhere. An edge
//! at the outline itself is no sign of a ball, and often there is none: its last pixel shows what is seen right beside it.

use rayon::prelude::*;

use super::circles::{SMALL_SIDE, Small, distinct};
use super::slopes::{Slopes, distance};
use super::{BallCircle, BallError, BallLens, BallView};
use crate::{Image, RadianceImage, luminance};

/// The best outline that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallFind {
    /// The ball with this outline.
    pub view: BallView,
    /// From 0 to 1, the product of three: how much more gradients inside of the rim point along the radius than those outside, compared with what balls in real
    /// rooms show; the share of the outline with an edge; and less for a small ball, since chance makes small ones more often.
    pub confidence: f64,
}

impl BallFind {
    /// From this confidence on the find is a ball. Of 28 photos and 14 views of panoramas without one the best circles have up to 0.38 (the
    /// ignored test `survey` prints them all).
    pub const SURE: f64 = 0.4;
}

/// Circles that are fitted.
const FITTED: usize = 8;
/// Contrast inside and outside of the rim of balls in real rooms.
const MIRROR_CONTRAST: f64 = 0.4;
/// Radius over the photo's shorter side from which on a ball is not small.
const LARGE: f64 = 0.25;

/// Finds the ball in a photo of it, with a lens as for [`BallView::new`]; `None` where no circle at all is found, and for an unsure one see
/// [`BallFind::SURE`].
///
/// # Errors
/// A photo without pixels, a lens that is none.
pub fn find_ball(photo: &RadianceImage, lens: BallLens) -> Result<Option<BallFind>, BallError> {
    let size = [photo.width(), photo.height()];
    if size[0] * size[1] == 0 {
        return Err(BallError::NoPhoto);
    }
    check_lens(lens)?;
    let grey = grey(photo);
    let small = Small::of(&grey);
    let mut moved: Vec<(f64, BallCircle)> =
        small.candidates().into_par_iter().filter_map(|circle| small.best_near(circle)).collect();
    moved.sort_by(|a, b| b.0.total_cmp(&a.0));
    let finds = distinct(moved, FITTED).into_par_iter().filter_map(|circle| {
        let view = fitted(&grey, BallView::new(small.in_photo(circle), lens, size).ok()?)?;
        // a fit that ran away is no find
        BallView::new(view.circle(), lens, size).ok()?;
        let squeezed = (small.contrast(small.of_photo(view.circle()))? / MIRROR_CONTRAST).clamp(0.0, 1.0);
        let large = (view.circle().radius_px / (LARGE * size[0].min(size[1]) as f64)).sqrt().min(1.0);
        Some(BallFind { view, confidence: squeezed * large * Slopes::across(&grey, &view, 8.0)?.edges_on_outline() })
    });
    Ok(finds.collect::<Vec<BallFind>>().into_iter().max_by(|a, b| a.confidence.total_cmp(&b.confidence)))
}

fn check_lens(lens: BallLens) -> Result<(), BallError> {
    let valid = match lens {
        BallLens::Orthographic => true,
        BallLens::Focal { focal_px } => focal_px.is_finite() && focal_px > 0.0,
        BallLens::Distance { radii } => radii.is_finite() && radii > 1.0,
    };
    if valid { Ok(()) } else { Err(BallError::Lens { lens }) }
}

/// Logarithm of luminance over the median one: lamps do not hide all other edges, and noise in the dark counts little.
fn grey(photo: &RadianceImage) -> Image<f32> {
    let mut values: Vec<f32> = photo.pixels().par_iter().map(|&rgb| luminance(rgb).max(0.0)).collect();
    let step = (values.len() / 100_000).max(1);
    let mut some: Vec<f32> = values.iter().copied().step_by(step).collect();
    let middle = some.len() / 2;
    let median = some.select_nth_unstable_by(middle, f32::total_cmp).1.max(1e-6);
    values.par_iter_mut().for_each(|v| *v = (1.0 + *v / median).ln());
    Image::new(photo.width(), photo.height(), values)
}

/// Fits the outline in the photo itself: in each sector where the slopes along the radius, which grow up to the outline, end.
fn fitted(grey: &Image<f32>, start: BallView) -> Option<BallView> {
    let small_pixel = (grey.width().max(grey.height()) as f64 / SMALL_SIDE as f64).max(1.0);
    let mut view = start;
    for (share, pixels, tukey_px) in [(0.02, 1.5, 3.0), (0.01, 0.5, 1.5), (0.01, 0.0, 1.0)] {
        let radius_px = view.circle().radius_px;
        let ends = Slopes::across(grey, &view, share * radius_px + pixels * small_pixel + 6.0)?.ends();
        let middle = [view.circle().x, view.circle().y];
        // as far as the sectors agree at all
        let mut scale_px = 2.0 * tukey_px + share * radius_px;
        for _ in 0..10 {
            let weighted: Vec<([f64; 2], f64)> = ends
                .iter()
                .filter_map(|end| {
                    let offset = distance(end.point, middle) - distance(view.outline(end.turn)?, middle);
                    let share = 1.0 - (offset / scale_px).powi(2);
                    (share > 0.0).then_some((end.point, share * share * end.contrast))
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
