//! Part of a probe's panorama that the photo observes.

use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::DepthMap;

use crate::{NovelView, Sample};

/// Tolerance between the photo's depth and a surface point, in metres and relative to the depth. A panorama's pixel
/// covers some centimetres of a surface, more at grazing angles.
const TOLERANCE_M: f64 = 0.1;
const TOLERANCE_SHARE: f64 = 0.03;

/// A probe within this distance of the camera, in metres, sees the same in each direction.
const AT_CAMERA_M: f32 = 1e-3;

/// Returns for every pixel of the view's panorama, row by row, whether the photo observes that surface.
///
/// With depth maps of both, a surface point is observed if it projects into the photo and its depth matches the photo's
/// true depth. Open sky is observed where the photo has open sky in that direction. Without depth, a probe at the
/// camera observes the camera's frustum; for other probes the result is unknown (`None`).
pub fn observed_mask(sample: &Sample, view: &NovelView) -> Option<Vec<bool>> {
    let (width, height) = (view.radiance.width(), view.radiance.height());
    let directions = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let directions = directions.map(|(x, y)| ((x, y), view.rotation * pixel_direction(x, y, width, height)));
    match (&view.depth_m, &sample.depth_m) {
        (Some(distance_m), Some(depth_m)) => {
            let observed = |((x, y), direction): ((usize, usize), Vec3)| {
                // The two maps may differ in size.
                let distance = distance_m[(x * distance_m.width() / width, y * distance_m.height() / height)];
                let open = !(distance.is_finite() && distance > 0.0);
                let point = if open { direction } else { view.position_m + direction * distance };
                is_observed(sample, depth_m, point, open)
            };
            Some(directions.map(observed).collect())
        }
        _ if view.position_m.length() < AT_CAMERA_M => {
            Some(directions.map(|(_, direction)| pixel_of(sample, direction).is_some()).collect())
        }
        _ => None,
    }
}

/// Whether the photo shows a surface point or, if `open`, the sky in that direction.
fn is_observed(sample: &Sample, depth_m: &DepthMap, point: Vec3, open: bool) -> bool {
    pixel_of(sample, point).is_some_and(|([u, v], z)| {
        let column = (u * depth_m.width() as f64) as usize;
        let row = (v * depth_m.height() as f64) as usize;
        let there = f64::from(depth_m[(column.min(depth_m.width() - 1), row.min(depth_m.height() - 1))]);
        let surface = there.is_finite() && there > 0.0;
        if open { !surface } else { surface && (there - z).abs() < TOLERANCE_M + TOLERANCE_SHARE * z }
    })
}

/// Projects a point into the photo: coordinates in `[0, 1)`, and depth. `None` outside of the image.
fn pixel_of(sample: &Sample, point: Vec3) -> Option<([f64; 2], f64)> {
    let (u, v, z) = sample.camera.project(point)?;
    let position = [u / f64::from(sample.camera.width), v / f64::from(sample.camera.height)];
    position.iter().all(|t| (0.0..1.0).contains(t)).then_some((position, z))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Metadata;
    use lo_geometry::{Camera, Quat, pixel_solid_angle_sr};
    use lo_imaging::{Image, RadianceImage};

    /// A sample with only a photo, 65 degrees wide.
    fn sample() -> Sample {
        Sample {
            id: "room-0".to_owned(),
            scene_id: "room".to_owned(),
            photo: Image::new(96, 64, vec![[128; 3]; 96 * 64]),
            camera: Camera::from_hfov_deg(65.0, 96, 64).unwrap(),
            up: Some(Vec3::Y),
            radiance: None,
            depth_m: None,
            sensor_depth_m: None,
            normal: None,
            albedo: None,
            points: Vec::new(),
            point_area_m2: None,
            views: Vec::new(),
            metadata: Metadata::new(),
        }
    }

    /// Distance to the walls of a cube of 4 m around the origin.
    fn distance_m(origin: Vec3, direction: Vec3) -> f32 {
        let along = |o: f32, d: f32| if d == 0.0 { f32::INFINITY } else { (2f32.copysign(d) - o) / d };
        along(origin.x, direction.x).min(along(origin.y, direction.y)).min(along(origin.z, direction.z))
    }

    #[test]
    fn the_frustum_has_its_solid_angle() {
        let sample = sample();
        let view = NovelView {
            position_m: Vec3::ZERO,
            rotation: Quat::from_rotation_y(2.0),
            radiance: RadianceImage::new(512, 256, vec![[1.0; 3]; 512 * 256]),
            depth_m: None,
        };
        let mask = observed_mask(&sample, &view).unwrap();
        let angle = |(index, _): (usize, &bool)| pixel_solid_angle_sr(index / 512, 512, 256);
        let got: f32 = mask.iter().enumerate().filter(|(_, seen)| **seen).map(angle).sum();
        // A centred rectangle a × b at distance 1: 4 asin(ab / √((1 + a²)(1 + b²))).
        let camera = sample.camera;
        let (a, b) = (camera.cx / camera.fx, camera.cy / camera.fy);
        let expected = 4.0 * (a * b / ((1.0 + a * a) * (1.0 + b * b)).sqrt()).asin();
        assert!((f64::from(got) / expected - 1.0).abs() < 0.01, "{got} {expected}");
        let elsewhere = NovelView { position_m: Vec3::X, ..view };
        assert_eq!(observed_mask(&sample, &elsewhere), None);
    }

    #[test]
    fn with_depth_only_unoccluded_surfaces_are_observed() {
        // The photo shows only the wall at z = −2.
        let sample = Sample { depth_m: Some(DepthMap::new(96, 64, vec![2.0; 96 * 64])), ..sample() };
        let position_m = Vec3::new(0.4, -0.2, -0.8);
        let distance = |x, y| distance_m(position_m, pixel_direction(x, y, 64, 32));
        let view = &NovelView {
            position_m,
            rotation: Quat::IDENTITY,
            radiance: RadianceImage::new(64, 32, vec![[1.0; 3]; 64 * 32]),
            depth_m: Some(DepthMap::from_fn(64, 32, distance)),
        };
        let mask = observed_mask(&sample, view).unwrap();
        let (width, height) = (view.radiance.width(), view.radiance.height());
        for (index, &seen) in mask.iter().enumerate() {
            let direction = pixel_direction(index % width, index / width, width, height);
            let point = view.position_m + direction * view.depth_m.as_ref().unwrap().pixels()[index];
            let (u, v) = (point.x / -point.z, point.y / -point.z);
            let (a, b) = (sample.camera.cx / sample.camera.fx, sample.camera.cy / sample.camera.fy);
            let inside = point.z < 0.0 && f64::from(u.abs()) < a - 0.01 && f64::from(v.abs()) < b - 0.01;
            let outside = point.z >= 0.0 || f64::from(u.abs()) > a + 0.01 || f64::from(v.abs()) > b + 0.01;
            assert!((seen || !inside) && !(seen && outside), "{direction} {point} {seen}");
        }
        // An obstacle in the photo hides the wall.
        let mut hidden = sample.clone();
        hidden.depth_m.as_mut().unwrap().pixels_mut().fill(0.5);
        assert!(observed_mask(&hidden, view).unwrap().iter().all(|seen| !seen));
    }
}
