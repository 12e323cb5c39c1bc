//! Checks the poses of several photos of one room, and matches their exposures.

use lo_events::{Figure, OnEvent, figures, stage, warn};
use lo_geometry::RigidTransform;
use lo_nets::light::{VisiblePoint, ambient_light};
use lo_scene::{ObservedPhoto, Overlap, PosedFrame, overlap};

use crate::{EstimateError, EstimateWarning, Exposures, stages};

/// Median difference of two photos' depths, as a share of the depth, above which poses cause a warning
/// (`docs/design/036-several-photos.md`).
const WARN_DISAGREEMENT: f32 = 0.07;

/// Median difference above which poses are rejected.
const MAX_DISAGREEMENT: f32 = 0.2;

/// Photos in the first camera's frame, with matched exposures.
pub(crate) struct AlignedPhotos {
    /// At full resolution.
    pub photos: Vec<PosedFrame>,
    /// At working resolution.
    pub working: Vec<PosedFrame>,
}

/// Moves photos into the first camera's frame, checks their poses and matches their exposures.
pub(crate) fn align_photos(
    photos: Vec<PosedFrame>,
    exposures: Exposures,
    on_event: OnEvent<'_>,
) -> Result<AlignedPhotos, EstimateError> {
    let mut photos = in_first_frame(photos);
    let mut working: Vec<PosedFrame> = stage(on_event, stages::WORKING_RESOLUTION, || {
        let working = |photo: &PosedFrame| PosedFrame {
            frame: photo.frame.working(),
            first_from_camera: photo.first_from_camera,
        };
        photos.iter().map(working).collect()
    })?;
    let pairs = stage(on_event, stages::PHOTOS, || overlapping_pairs(&working))?;
    for pair in &pairs {
        let (photos, disagreement) = (pair.photos, pair.overlap.disagreement);
        if disagreement > MAX_DISAGREEMENT {
            return Err(EstimateError::PosesDisagree { photos, disagreement });
        }
        if disagreement > WARN_DISAGREEMENT {
            warn(on_event, EstimateWarning::PosesDisagree { photos, disagreement })?;
        }
    }
    if exposures == Exposures::Matched {
        let (gains_ev, assumed) = match_exposures(&working, &pairs);
        for ((photo, working), ev) in photos.iter_mut().zip(&mut working).zip(&gains_ev) {
            photo.frame.exposure *= ev.exp2();
            working.frame.exposure = photo.frame.exposure;
        }
        if !assumed.is_empty() {
            warn(on_event, EstimateWarning::AssumedExposures { photos: assumed })?;
        }
    }
    let first_exposure = photos.first().map_or(1.0, |photo| photo.frame.exposure);
    let figure = |photo: &PosedFrame| Figure {
        name: "exposure_ev",
        value: -f64::from((photo.frame.exposure / first_exposure).log2()),
    };
    figures(on_event, stages::PHOTOS, photos.iter().map(figure).collect())?;
    Ok(AlignedPhotos { photos, working })
}

/// Makes poses relative to the first camera.
fn in_first_frame(mut photos: Vec<PosedFrame>) -> Vec<PosedFrame> {
    let Some(first) = photos.first().map(|photo| photo.first_from_camera) else { return photos };
    if first != RigidTransform::IDENTITY {
        let back = first.inverse();
        photos.iter_mut().for_each(|photo| photo.first_from_camera = back.after(&photo.first_from_camera));
        photos[0].first_from_camera = RigidTransform::IDENTITY;
    }
    photos
}

/// Two photos with a common region.
struct PhotoPair {
    photos: [usize; 2],
    overlap: Overlap,
}

fn overlapping_pairs(working: &[PosedFrame]) -> Vec<PhotoPair> {
    let seen: Vec<ObservedPhoto> =
        working.iter().map(|photo| ObservedPhoto::new(&photo.frame, photo.first_from_camera)).collect();
    let all = (0..seen.len()).flat_map(|i| (i + 1..seen.len()).map(move |j| [i, j]));
    all.filter_map(|photos| Some(PhotoPair { photos, overlap: overlap(&seen[photos[0]], &seen[photos[1]])? })).collect()
}

/// Returns the gain of each photo in stops relative to the first, and the indices of photos whose gain is assumed.
///
/// Overlapping photos are matched by least squares over all pairs, weighted by their pixels. A group without overlap
/// with the first photo's group is scaled to the same average of the middle half (`docs/design/036-several-photos.md`).
fn match_exposures(working: &[PosedFrame], pairs: &[PhotoPair]) -> (Vec<f32>, Vec<usize>) {
    let count = working.len();
    let edges = pairs.iter().filter_map(|pair| {
        let ratio = pair.overlap.exposure?;
        Some((pair.photos, f64::from(ratio.log2), ratio.pixels as f64))
    });
    let edges: Vec<([usize; 2], f64, f64)> = edges.collect();
    let groups = groups(count, &edges);
    let mut gains_ev = solve_gains(count, &edges, &groups);
    let mut assumed = Vec::new();
    let average_of = |group: usize, gains_ev: &[f64]| {
        let of_group = (0..count).filter(|&photo| groups[photo] == group);
        middle_half_luminance(of_group.map(|photo| (&working[photo], gains_ev[photo].exp2() as f32)))
    };
    let Some(first) = groups.first().copied() else { return (Vec::new(), assumed) };
    let first_average = average_of(first, &gains_ev);
    let mut other: Vec<usize> = groups.iter().copied().filter(|group| *group != first).collect();
    other.dedup();
    other.sort_unstable();
    other.dedup();
    for group in other {
        let shift = f64::from((first_average / average_of(group, &gains_ev)).log2());
        for photo in (0..count).filter(|&photo| groups[photo] == group) {
            gains_ev[photo] += shift;
            assumed.push(photo);
        }
    }
    assumed.sort_unstable();
    (gains_ev.into_iter().map(|ev| ev as f32).collect(), assumed)
}

/// Returns for each photo the index of the first photo in its connected group.
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

/// Solves `x[a] − x[b] = −log₂ ratio` by least squares, with the first photo of each group at 0.
///
/// Gauss–Seidel converges because the matrix is diagonally dominant.
fn solve_gains(count: usize, edges: &[([usize; 2], f64, f64)], groups: &[usize]) -> Vec<f64> {
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

/// Returns the log average of the middle half of the photos' luminance.
///
/// Clipped pixels are in the brightest quarter, which does not count.
fn middle_half_luminance<'a>(photos: impl Iterator<Item = (&'a PosedFrame, f32)>) -> f32 {
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
        // Photo 1 is half a stop brighter than 0, and 2 a stop brighter than 1. Photos 0 and 2 give 1.2 instead of 1.5.
        // Photos 3 and 4 are a separate group.
        let edges = [([0, 1], -0.5, 100.0), ([1, 2], -1.0, 100.0), ([0, 2], -1.2, 100.0), ([3, 4], 2.0, 50.0)];
        let groups = groups(5, &edges);
        assert_eq!(groups, [0, 0, 0, 3, 3]);
        let x = solve_gains(5, &edges, &groups);
        // The triangle's error of 0.3 is distributed evenly: -0.4, -1.3.
        for (found, expected) in x.iter().zip([0.0, -0.4, -1.3, 0.0, 2.0]) {
            assert!((found - expected).abs() < 1e-9, "{x:?}");
        }
    }
}
