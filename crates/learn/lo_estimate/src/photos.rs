//! Several photos of one room: whether their poses fit, and how brightly each shows the same light.

use lo_events::{Figure, OnEvent, Stage, Warning, figures, stage, warn};
use lo_geometry::RigidTransform;
use lo_nets::light::{VisiblePoint, ambient_light};
use lo_scene::{ObservedPhoto, Overlap, PosedFrame, overlap};

use crate::{EstimateError, Exposures};

/// Median difference of the depths of two photos, share of the depth, beyond which their poses are warned about (`docs/design/036-several-photos.md`).
const SUSPECT: f32 = 0.07;

/// The same from which on they are refused.
const WRONG: f32 = 0.2;

/// Photos in the frame of the first one's camera, with one measure of light.
pub(crate) struct Together {
    /// As they were taken.
    pub photos: Vec<PosedFrame>,
    /// At working resolution.
    pub working: Vec<PosedFrame>,
}

/// Brings photos together.
pub(crate) fn together(
    photos: Vec<PosedFrame>,
    exposures: Exposures,
    on_event: OnEvent<'_>,
) -> Result<Together, EstimateError> {
    let mut photos = in_first_frame(photos);
    let mut working: Vec<PosedFrame> = stage(on_event, Stage::WorkingResolution, || {
        let working = |photo: &PosedFrame| PosedFrame {
            frame: photo.frame.working(),
            first_from_camera: photo.first_from_camera,
        };
        photos.iter().map(working).collect()
    })?;
    let pairs = stage(on_event, Stage::Photos, || pairs(&working))?;
    for pair in &pairs {
        let (photos, disagreement) = (pair.photos, pair.overlap.disagreement);
        if disagreement > WRONG {
            return Err(EstimateError::PosesDisagree { photos, disagreement });
        }
        if disagreement > SUSPECT {
            warn(on_event, Warning::PosesDisagree { photos, disagreement })?;
        }
    }
    if exposures == Exposures::Matched {
        let (brighter_ev, guessed) = matched(&working, &pairs);
        for ((photo, working), ev) in photos.iter_mut().zip(&mut working).zip(&brighter_ev) {
            photo.frame.exposure *= ev.exp2();
            working.frame.exposure = photo.frame.exposure;
        }
        if !guessed.is_empty() {
            warn(on_event, Warning::AssumedExposures { photos: guessed })?;
        }
    }
    let first_exposure = photos.first().map_or(1.0, |photo| photo.frame.exposure);
    let figure = |photo: &PosedFrame| Figure {
        name: "exposure_ev",
        value: -f64::from((photo.frame.exposure / first_exposure).log2()),
    };
    figures(on_event, Stage::Photos, photos.iter().map(figure).collect())?;
    Ok(Together { photos, working })
}

/// The first camera stands at the origin, whatever the poses were relative to.
fn in_first_frame(mut photos: Vec<PosedFrame>) -> Vec<PosedFrame> {
    let Some(first) = photos.first().map(|photo| photo.first_from_camera) else { return photos };
    if first != RigidTransform::IDENTITY {
        let back = first.inverse();
        photos.iter_mut().for_each(|photo| photo.first_from_camera = back.after(&photo.first_from_camera));
        photos[0].first_from_camera = RigidTransform::IDENTITY;
    }
    photos
}

/// Two photos that show the same places.
struct Pair {
    photos: [usize; 2],
    overlap: Overlap,
}

fn pairs(working: &[PosedFrame]) -> Vec<Pair> {
    let seen: Vec<ObservedPhoto> =
        working.iter().map(|photo| ObservedPhoto::new(&photo.frame, photo.first_from_camera)).collect();
    let all = (0..seen.len()).flat_map(|i| (i + 1..seen.len()).map(move |j| [i, j]));
    all.filter_map(|photos| Some(Pair { photos, overlap: overlap(&seen[photos[0]], &seen[photos[1]])? })).collect()
}

/// Stops by which each photo has to be made brighter to have the first one's measure, and which of them were guessed.
///
/// Photos that show the same surfaces are matched by least squares over all pairs, weighted by their pixels. A group of photos that has nothing in
/// common with the first one's gets what makes its light of the middle half as bright as that of the first one's group (`docs/design/036-several-photos.md`).
fn matched(working: &[PosedFrame], pairs: &[Pair]) -> (Vec<f32>, Vec<usize>) {
    let count = working.len();
    let edges = pairs.iter().filter_map(|pair| {
        let ratio = pair.overlap.exposure?;
        Some((pair.photos, f64::from(ratio.log2), ratio.pixels as f64))
    });
    let edges: Vec<([usize; 2], f64, f64)> = edges.collect();
    let groups = groups(count, &edges);
    let mut brighter_ev = solved(count, &edges, &groups);
    let mut guessed = Vec::new();
    let light_of = |group: usize, brighter_ev: &[f64]| {
        let of_group = (0..count).filter(|&photo| groups[photo] == group);
        key(of_group.map(|photo| (&working[photo], brighter_ev[photo].exp2() as f32)))
    };
    let Some(first) = groups.first().copied() else { return (Vec::new(), guessed) };
    let first_key = light_of(first, &brighter_ev);
    let mut other: Vec<usize> = groups.iter().copied().filter(|group| *group != first).collect();
    other.dedup();
    other.sort_unstable();
    other.dedup();
    for group in other {
        let shift = f64::from((first_key / light_of(group, &brighter_ev)).log2());
        for photo in (0..count).filter(|&photo| groups[photo] == group) {
            brighter_ev[photo] += shift;
            guessed.push(photo);
        }
    }
    guessed.sort_unstable();
    (brighter_ev.into_iter().map(|ev| ev as f32).collect(), guessed)
}

/// Number of the group of photos that each belongs to: that of its first photo.
fn groups(count: usize, edges: &[([usize; 2], f64, f64)]) -> Vec<usize> {
    let mut groups: Vec<usize> = (0..count).collect();
    for _ in 0..count {
        for &([a, b], ..) in edges {
            let least = groups[a].min(groups[b]);
            (groups[a], groups[b]) = (least, least);
        }
    }
    groups
}

/// Least squares of `x[a] − x[b] = −log₂ ratio`, the first photo of each group at 0, by Gauss and Seidel: the matrix is diagonally dominant.
fn solved(count: usize, edges: &[([usize; 2], f64, f64)], groups: &[usize]) -> Vec<f64> {
    const SWEEPS: usize = 500;
    let mut x = vec![0.0; count];
    for _ in 0..SWEEPS {
        for photo in (0..count).filter(|&photo| groups[photo] != photo) {
            let (mut sum, mut weights) = (0.0, 0.0);
            for &([a, b], log2, weight) in edges {
                let wanted = if a == photo {
                    x[b] - log2
                } else if b == photo {
                    x[a] + log2
                } else {
                    continue;
                };
                sum += weight * wanted;
                weights += weight;
            }
            if weights > 0.0 {
                x[photo] = sum / weights;
            }
        }
    }
    x
}

/// Log average of the middle half of what photos show, clipped pixels among the bright ones that do not count.
fn key<'a>(photos: impl Iterator<Item = (&'a PosedFrame, f32)>) -> f32 {
    let of_photo = |(photo, gain): (&'a PosedFrame, f32)| {
        let light = photo.frame.radiance();
        let point = move |radiance: [f32; 3]| VisiblePoint {
            position_m: lo_geometry::Vec3::ZERO,
            radiance: radiance.map(|c| gain * c),
            normal: lo_geometry::Vec3::ZERO,
            certain: true,
        };
        light.pixels().iter().copied().map(point).collect::<Vec<VisiblePoint>>()
    };
    let points: Vec<VisiblePoint> = photos.flat_map(of_photo).collect();
    lo_imaging::luminance(ambient_light(&points))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_of_overlapping_photos_add_up_over_the_graph() {
        // Photo 1 is half a stop brighter than 0, 2 is a stop brighter than 1; 0 and 2 say 1.2 where 1.5 would agree. 4 and 3 stand apart.
        let edges = [([0, 1], -0.5, 100.0), ([1, 2], -1.0, 100.0), ([0, 2], -1.2, 100.0), ([3, 4], 2.0, 50.0)];
        let groups = groups(5, &edges);
        assert_eq!(groups, [0, 0, 0, 3, 3]);
        let x = solved(5, &edges, &groups);
        // The triangle's error of 0.3 is shared alike: -0.4, -1.3.
        for (found, expected) in x.iter().zip([0.0, -0.4, -1.3, 0.0, 2.0]) {
            assert!((found - expected).abs() < 1e-9, "{x:?}");
        }
    }
}
