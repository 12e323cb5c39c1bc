use lo_imaging::luminance;

use crate::ObservedPhoto;
use crate::frame::median;

/// Approximate number of readings that are looked up in the other photo.
const SAMPLES: usize = 20_000;

/// Fewest readings of one photo in the other's view that give a result.
const MIN_SHARED: usize = 200;

/// Fewest pixels of a common surface for a comparison of exposures.
const MIN_MATCHED: usize = 100;

/// Largest difference in depth of two readings of one surface: metres, and share of the depth.
const SAME_SURFACE: (f32, f32) = (0.03, 0.02);

/// Smallest cosine between the normals of one surface in two photos: 32°.
const SAME_NORMAL: f32 = 0.85;

/// Smallest luminance for a comparison of exposures; lower values are dominated by noise and the tone curve's toe.
const MIN_LIGHT: f32 = 0.01;

/// Overlap of two photos according to their poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// Share of a photo's readings within the other's view; the larger of both directions.
    pub share: f32,
    /// Median relative difference of depth over those readings; the smaller of both directions, because an occluder
    /// near the other camera affects one of them.
    pub disagreement: f32,
    /// Ratio of exposures, from pixels that show one surface unclipped in both photos.
    pub exposure: Option<ExposureRatio>,
}

/// Ratio of the exposures of two photos.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureRatio {
    /// Median of log₂(first photo's luminance / second photo's): stops by which the first is brighter.
    pub log2: f32,
    /// Number of compared pixels.
    pub pixels: usize,
}

/// Compares two photos of one room; `None` if too little of one is within the other's view.
pub fn overlap(a: &ObservedPhoto, b: &ObservedPhoto) -> Option<Overlap> {
    let (mut there, back) = (Shared::of(a, b), Shared::of(b, a));
    let directions = [&there, &back].into_iter().filter(|shared| shared.differences.len() >= MIN_SHARED);
    let disagreement = directions.filter_map(|shared| median_of_some(shared.differences.clone())).reduce(f32::min)?;
    there.log2_ratios.extend(back.log2_ratios.iter().map(|ratio| -ratio));
    let pixels = there.log2_ratios.len();
    let ratio = if pixels >= MIN_MATCHED { median_of_some(there.log2_ratios) } else { None };
    let exposure = ratio.map(|log2| ExposureRatio { log2, pixels });
    Some(Overlap { share: there.share.max(back.share), disagreement, exposure })
}

/// The part of a photo that is within another's view.
struct Shared {
    share: f32,
    differences: Vec<f32>,
    log2_ratios: Vec<f32>,
}

impl Shared {
    fn of(a: &ObservedPhoto, b: &ObservedPhoto) -> Self {
        let (from, to) = (a.clean.depth_camera(), b.clean.depth_camera());
        let b_from_a = b.first_from_camera.inverse().after(&a.first_from_camera);
        let (clipped_a, clipped_b) = (a.clean.clipped(), b.clean.clipped());
        let (width, height) = (a.clean.depth_m.width(), a.clean.depth_m.height());
        let stride = (((width * height) as f64 / SAMPLES as f64).sqrt() as usize).max(1);
        let (mut readings, mut differences, mut log2_ratios) = (0usize, Vec::new(), Vec::new());
        for y in (stride / 2..height).step_by(stride) {
            for x in (stride / 2..width).step_by(stride) {
                let z = a.clean.depth_m[(x, y)];
                if z <= 0.0 {
                    continue;
                }
                readings += 1;
                let point = b_from_a.point(from.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(z)));
                let Some((u, v, depth_m)) = to.project(point).filter(|&(u, v, _)| to.contains(u, v)) else { continue };
                let at = (u as usize, v as usize);
                let there = b.clean.depth_m[at];
                if there <= 0.0 {
                    continue;
                }
                let depth_m = depth_m as f32;
                differences.push((depth_m - there).abs() / depth_m);
                let (Some(own), Some(other)) = (a.normals[(x, y)], b.normals[at]) else { continue };
                let same = (depth_m - there).abs() < SAME_SURFACE.0 + SAME_SURFACE.1 * depth_m
                    && b_from_a.direction(own).dot(other) > SAME_NORMAL;
                let (here, over) = (photo_pixel(a, (x, y)), photo_pixel(b, at));
                if !same || clipped_a[here] || clipped_b[over] {
                    continue;
                }
                let light = [luminance(a.radiance[here]), luminance(b.radiance[over])];
                if light[0] > MIN_LIGHT * a.clean.exposure && light[1] > MIN_LIGHT * b.clean.exposure {
                    log2_ratios.push((light[0] / light[1]).log2());
                }
            }
        }
        Self { share: differences.len() as f32 / readings.max(1) as f32, differences, log2_ratios }
    }
}

/// Returns the photo's pixel at the centre of a depth pixel.
fn photo_pixel(photo: &ObservedPhoto, (x, y): (usize, usize)) -> (usize, usize) {
    let (depth_m, radiance) = (&photo.clean.depth_m, &photo.radiance);
    let along = |i: usize, pixels: usize, of: usize| (2 * i + 1) * pixels / (2 * of);
    (along(x, radiance.width(), depth_m.width()), along(y, radiance.height(), depth_m.height()))
}

/// Returns the median; `None` for an empty list.
fn median_of_some(values: Vec<f32>) -> Option<f32> {
    (!values.is_empty()).then(|| median(values))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Camera, Plane, Quat, Ray, RigidTransform, Vec3};
    use lo_imaging::{DepthMap, Image, Photo};

    use super::*;
    use crate::Frame;

    /// A corner of two walls and a floor, striped, as seen by a camera at this pose; `gain` is its exposure.
    fn photo(first_from_camera: RigidTransform, gain: f32, believed: RigidTransform) -> ObservedPhoto {
        let camera = Camera::from_hfov_deg(70.0, 96, 64).unwrap();
        let planes = [(Vec3::Z, -3.0), (Vec3::NEG_X, -2.5), (Vec3::X, -2.0), (Vec3::Y, -1.4), (Vec3::NEG_Y, -1.3)];
        let hit = |x: usize, y: usize| {
            let local = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let ray = Ray { origin: first_from_camera.translation_m, direction: first_from_camera.direction(local) };
            let hits = planes.iter().filter_map(|&(normal, offset_m)| Plane { normal, offset_m }.intersect(&ray));
            let distance_m = hits.fold(f32::INFINITY, f32::min);
            (ray.origin + distance_m * ray.direction, -distance_m * local.z)
        };
        let depth_m = DepthMap::from_fn(96, 64, |x, y| hit(x, y).1);
        let light = Image::from_fn(96, 64, |x, y| {
            let point = hit(x, y).0;
            let stripes = 0.3 + 0.2 * (2.0 * (point.x + point.y + point.z)).sin();
            [(gain * stripes).min(1.0); 3]
        });
        ObservedPhoto::new(&Frame::new(Photo::Linear(light), depth_m, camera, 1.0).unwrap(), believed)
    }

    fn turned(yaw_deg: f32, translation_m: Vec3) -> RigidTransform {
        RigidTransform { rotation: Quat::from_rotation_y(yaw_deg.to_radians()), translation_m }
    }

    #[test]
    fn exposures_of_overlapping_photos_are_found_and_right_poses_agree() {
        let pose = turned(-30.0, Vec3::new(0.4, 0.1, -0.2));
        let first = photo(RigidTransform::IDENTITY, 1.0, RigidTransform::IDENTITY);
        for gain in [0.25f32, 1.0, 3.0] {
            let found = overlap(&photo(pose, gain, pose), &first).unwrap();
            let exposure = found.exposure.unwrap();
            // Both photos sample the stripes at different pixels: a few hundredths of a stop. At 3, half of the image
            // is clipped.
            assert!((exposure.log2 - gain.log2()).abs() < 0.05, "{gain}: {exposure:?}");
            assert!(found.disagreement < 0.01 && (0.3..0.9).contains(&found.share), "{found:?}");
        }
    }

    #[test]
    fn wrong_poses_disagree_and_photos_that_share_nothing_say_nothing() {
        let first = photo(RigidTransform::IDENTITY, 1.0, RigidTransform::IDENTITY);
        let pose = turned(-30.0, Vec3::new(0.4, 0.1, -0.2));
        for (wrong, least) in
            [(turned(30.0, pose.translation_m), 0.07), (turned(-30.0, Vec3::new(0.4, 0.1, -1.2)), 0.07)]
        {
            let found = overlap(&photo(pose, 1.0, wrong), &first).unwrap();
            assert!(found.disagreement > least, "{found:?}");
        }
        let away = turned(120.0, Vec3::ZERO);
        assert_eq!(overlap(&photo(away, 1.0, away), &first), None);
    }
}
