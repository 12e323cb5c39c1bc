//! A probe that moves one metre: light must change gradually, and near features must show the correct parallax.

use lo_cone::Cone;
use lo_dataset::{NovelView, Sample};
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::{DepthMap, RadianceImage, luminance, sample_equirectangular};
use lo_metrics::solid_angles_sr;

use crate::method::trace;
use crate::{EstimatedLight, MethodOutput};

/// Length of the path, metres, and its number of steps.
const LENGTH_M: f32 = 1.0;
const STEPS: usize = 100;
/// Free space beyond the end of the path, metres.
const CLEARANCE_M: f32 = 0.4;
/// Size of the panorama of each step.
const STEP_MAP: [usize; 2] = [128, 64];

/// Width of the panorama in whose pixels errors are stated.
const PIXELS_AROUND: f32 = 256.0;
/// Largest number of tracked features, and smallest number of matches.
const MAX_FEATURES: usize = 120;
const MIN_FEATURES: usize = 8;
/// Side of a feature patch, and search radius; in samples of half a pixel.
const PATCH: usize = 13;
const REACH: usize = 16;
/// Smallest height of a panorama for corner detection.
const MIN_ROWS: usize = 16;
/// Smallest correlation of a match.
const MIN_CORRELATION: f32 = 0.85;

/// Figures of a moving probe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walk {
    /// Largest change between steps over the median change, as the mean of |Δ ln(1 + radiance)| over the sphere.
    ///
    /// `None` if nothing changes, as with a single map.
    pub largest_step_ratio: Option<f64>,
    /// Median position error of near features, in pixels of a panorama 256 pixels wide.
    ///
    /// `None` with fewer than eight matches.
    pub parallax_px: Option<f64>,
}

/// Moves a probe through the room from the first view with enough free space; `None` without such a view.
///
/// Features are corners on the nearest quarter of the walls around the start. Their positions and normals come from
/// true depth. Patches are rendered from the estimate at the start and matched on the same surface at the end. For a
/// single map, the error is the entire motion.
pub fn walk(sample: &Sample, estimate: &MethodOutput) -> Option<Walk> {
    let up = sample.up.unwrap_or(Vec3::Y);
    let (view, depth_m, direction) = sample.views.iter().find_map(|view| {
        let depth_m = view.depth_m.as_ref()?;
        Some((view, depth_m, free_direction(view, depth_m, up)?))
    })?;
    let at = |step: usize| view.position_m + direction * (LENGTH_M * step as f32 / STEPS as f32);
    Some(Walk {
        largest_step_ratio: largest_step_ratio(estimate, at),
        parallax_px: parallax_px(estimate, view, depth_m, at(STEPS), up),
    })
}

/// Returns the horizontal direction with the most free space, of sixteen; `None` if it is too short.
fn free_direction(view: &NovelView, depth_m: &DepthMap, up: Vec3) -> Option<Vec3> {
    let (width, height) = (depth_m.width(), depth_m.height());
    let side = up.any_orthonormal_vector();
    let candidates = (0..16).map(|i| {
        let (sin, cos) = (std::f32::consts::TAU * i as f32 / 16.0).sin_cos();
        side * cos + up.cross(side) * sin
    });
    let free_m = |direction: Vec3| {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let in_the_way =
            pixels.filter(|&(x, y)| (view.rotation * pixel_direction(x, y, width, height)).dot(direction) > 0.94);
        in_the_way.map(|pixel| depth_m[pixel]).filter(|z| *z > 0.0).fold(f32::INFINITY, f32::min)
    };
    let best = candidates.map(|direction| (direction, free_m(direction))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    (best.1 > LENGTH_M + CLEARANCE_M).then_some(best.0)
}

/// Returns the largest change between steps over the median one.
fn largest_step_ratio(estimate: &MethodOutput, at: impl Fn(usize) -> Vec3) -> Option<f64> {
    let [width, height] = STEP_MAP;
    let angles = solid_angles_sr(width, height);
    let log = |map: RadianceImage| map.map(|rgb| rgb.map(|v| v.max(0.0).ln_1p()));
    let mut last = log(estimate.panorama_at(at(0), width, height, |direction| direction));
    let mut changes = Vec::with_capacity(STEPS);
    for step in 1..=STEPS {
        let next = log(estimate.panorama_at(at(step), width, height, |direction| direction));
        let pixels = last.pixels().iter().zip(next.pixels()).zip(&angles);
        let change = pixels
            .map(|((a, b), &angle)| f64::from(angle) * (0..3).map(|c| f64::from((a[c] - b[c]).abs())).sum::<f64>());
        changes.push(change.sum::<f64>());
        last = next;
    }
    changes.sort_unstable_by(f64::total_cmp);
    let median = changes[STEPS / 2];
    (median > 0.0).then(|| changes[STEPS - 1] / median)
}

/// A point on a surface, with the axes of a sampling grid.
struct Feature {
    point: Vec3,
    axes: [Vec3; 2],
}

/// Returns the median position error of the features.
fn parallax_px(estimate: &MethodOutput, view: &NovelView, depth_m: &DepthMap, end: Vec3, up: Vec3) -> Option<f64> {
    let features = features(estimate, view, depth_m, up);
    let px_of_angle = |angle: f32| f64::from(angle / std::f32::consts::TAU * PIXELS_AROUND);
    let mut errors: Vec<f64> = match &estimate.light {
        EstimatedLight::Map(_) => features
            .iter()
            .map(|feature| px_of_angle((feature.point - view.position_m).angle_between(feature.point - end)))
            .collect(),
        EstimatedLight::Octree { .. } | EstimatedLight::Predicted(_) => {
            let found = features
                .iter()
                .filter_map(|feature| matched_at(estimate, view.position_m, end, feature).map(|p| (feature, p)));
            found.map(|(feature, point)| px_of_angle((feature.point - end).angle_between(point - end))).collect()
        }
    };
    errors.sort_unstable_by(f64::total_cmp);
    (errors.len() >= MIN_FEATURES).then(|| errors[errors.len() / 2])
}

/// Detects corners of the estimate's panorama on the nearest quarter of the walls.
fn features(estimate: &MethodOutput, view: &NovelView, depth_m: &DepthMap, up: Vec3) -> Vec<Feature> {
    let (width, height) = (depth_m.width(), depth_m.height());
    if height < MIN_ROWS {
        return Vec::new();
    }
    let rotate = |x: usize, y: usize| view.rotation * pixel_direction(x, y, width, height);
    let map = estimate.panorama_at(view.position_m, width, height, |direction| view.rotation * direction);
    let light = map.map(|&rgb| luminance(rgb).max(0.0).ln_1p());
    let point = |x: usize, y: usize| view.position_m + rotate(x % width, y) * depth_m[(x % width, y)];
    let inner = (height / 4..3 * height / 4).flat_map(|y| (0..width).map(move |x| (x, y)));
    let mut distances: Vec<f32> = inner.clone().map(|pixel| depth_m[pixel]).filter(|z| *z > 0.0).collect();
    distances.sort_unstable_by(f32::total_cmp);
    let Some(&near) = distances.get(distances.len() / 4) else { return Vec::new() };
    let mut corners: Vec<(f32, usize, usize)> = inner
        .filter(|&pixel| depth_m[pixel] > 0.0 && depth_m[pixel] <= near)
        .map(|(x, y)| (corner(&light, x, y), x, y))
        .filter(|corner| corner.0 > 0.0)
        .collect();
    corners.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut taken: Vec<(usize, usize)> = Vec::new();
    let mut features = Vec::new();
    for (_, x, y) in corners {
        let apart = |&(u, v): &(usize, usize)| {
            let across = x.abs_diff(u);
            across.min(width - across).max(y.abs_diff(v)) >= 5
        };
        let [here, right, below] = [point(x, y), point(x + 1, y), point(x, y + 1)];
        let normal = (right - here).cross(below - here).normalize_or_zero();
        let direction = rotate(x, y);
        // Accept walls that are not seen too obliquely. At a depth edge, the three points are on different surfaces.
        let wall = normal.dot(up).abs() < 0.3 && normal.dot(direction).abs() > 0.4;
        if !wall || !taken.iter().all(apart) {
            continue;
        }
        taken.push((x, y));
        let spacing_m = 0.5 * std::f32::consts::TAU / PIXELS_AROUND * depth_m[(x, y)];
        let across = normal.cross(up).normalize_or(normal.any_orthonormal_vector());
        features.push(Feature { point: here, axes: [across, across.cross(normal)].map(|axis| axis * spacing_m) });
        if features.len() == MAX_FEATURES {
            break;
        }
    }
    features
}

/// Returns the smaller eigenvalue of the structure tensor over 5 × 5 pixels (Shi & Tomasi 1994).
fn corner(light: &lo_imaging::Image<f32>, x: usize, y: usize) -> f32 {
    let width = light.width();
    let at = |dx: usize, dy: usize| light[((x + width + dx - 3) % width, y + dy - 3)];
    let [mut xx, mut xy, mut yy] = [0.0f32; 3];
    for (dx, dy) in (1..6).flat_map(|dy| (1..6).map(move |dx| (dx, dy))) {
        let (gx, gy) = (at(dx + 1, dy) - at(dx - 1, dy), at(dx, dy + 1) - at(dx, dy - 1));
        (xx, xy, yy) = (xx + gx * gx, xy + gx * gy, yy + gy * gy);
    }
    0.5 * (xx + yy - ((xx - yy).powi(2) + 4.0 * xy * xy).sqrt())
}

/// Matches a feature seen from `start` on its surface as seen from `end`; `None` without a match.
fn matched_at(estimate: &MethodOutput, start: Vec3, end: Vec3, feature: &Feature) -> Option<Vec3> {
    let side = PATCH + 2 * REACH;
    let patch = grid(estimate, start, feature, PATCH);
    let field = grid(estimate, end, feature, side);
    let mut best = (MIN_CORRELATION, None);
    for (i, j) in (0..=2 * REACH).flat_map(|j| (0..=2 * REACH).map(move |i| (i, j))) {
        let window = (0..PATCH).flat_map(|y| field[(j + y) * side + i..][..PATCH].iter().copied());
        let correlation = correlation(&patch, window);
        if correlation > best.0 {
            let offset = |k: usize| k as f32 - REACH as f32;
            best = (correlation, Some(feature.point + feature.axes[0] * offset(i) + feature.axes[1] * offset(j)));
        }
    }
    best.1
}

/// Samples `ln(1 + luminance)` of the estimate on `side`² points of the feature's grid, as seen from `eye`.
fn grid(estimate: &MethodOutput, eye: Vec3, feature: &Feature, side: usize) -> Vec<f32> {
    let offset = |k: usize| k as f32 - 0.5 * (side - 1) as f32;
    let points = (0..side).flat_map(|j| (0..side).map(move |i| (i, j)));
    let cones: Vec<Cone> = points
        .map(|(i, j)| {
            let to = feature.point + feature.axes[0] * offset(i) + feature.axes[1] * offset(j) - eye;
            let tan_half_angle = 0.5 * feature.axes[0].length() / to.length();
            Cone { origin: eye, direction: to.normalize(), tan_half_angle }
        })
        .collect();
    match &estimate.light {
        EstimatedLight::Map(map) => {
            cones.iter().map(|cone| luminance(sample_equirectangular(map, cone.direction)).max(0.0).ln_1p()).collect()
        }
        EstimatedLight::Predicted(prediction) => {
            let directions: Vec<Vec3> = cones.iter().map(|cone| cone.direction).collect();
            let radiance = prediction.radiance(eye, &directions);
            radiance.into_iter().map(|rgb| luminance(rgb).max(0.0).ln_1p()).collect()
        }
        EstimatedLight::Octree { tracer, .. } => {
            let samples = trace(tracer, eye, &cones);
            samples.iter().map(|sample| luminance(sample.radiance).max(0.0).ln_1p()).collect()
        }
    }
}

/// Returns the normalised cross-correlation.
fn correlation(a: &[f32], b: impl Iterator<Item = f32>) -> f32 {
    let [mut sa, mut sb, mut aa, mut bb, mut ab] = [0.0f32; 5];
    for (&a, b) in a.iter().zip(b) {
        (sa, sb, aa, bb, ab) = (sa + a, sb + b, aa + a * a, bb + b * b, ab + a * b);
    }
    let count = a.len() as f32;
    let variance = (aa - sa * sa / count) * (bb - sb * sb / count);
    if variance > 0.0 { (ab - sa * sb / count) / variance.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{Method, Tools, testing};
    use lo_estimate::Estimator;

    const TOOLS: Tools<'static> = Tools {
        estimator: &Estimator::without_networks(),
        profile: None,
        octree_depth: 7,
        seed: 0,
        known: None,
        foreign: None,
        baselines: &[],
    };

    /// Returns the box room with random grey squares on its walls.
    fn textured() -> Sample {
        let mut sample = testing::box_room();
        for point in &mut sample.points {
            let [x, y, z] = point.position_m.to_array().map(|v| (v / 0.25).floor() as i64);
            // Random squares of 25 cm.
            let number = lo_random::hash(&[x, y, z].map(|v| v.to_le_bytes()).concat());
            point.radiance = [0.1 + (number % 1000) as f32 / 1000.0; 3];
        }
        sample
    }

    #[test]
    fn a_true_octree_moves_as_geometry_says_and_a_map_does_not() {
        let sample = textured();
        let estimate = Method::TrueOctree.estimate(&sample, &TOOLS).unwrap();
        let found = walk(&sample, &estimate).unwrap();
        let (ratio, parallax) = (found.largest_step_ratio.unwrap(), found.parallax_px.unwrap());
        assert!(parallax < 1.0 && (1.0..2.0).contains(&ratio), "{found:?}");
        // In a single map, features do not move. A metre should move walls 1.2 to 2.8 m away by tens of pixels.
        let view = &sample.views[0];
        let map = estimate.panorama_at(view.position_m, 256, 128, |direction| direction);
        let single = MethodOutput::of_light(EstimatedLight::Map(map));
        let found = walk(&sample, &single).unwrap();
        assert!(found.largest_step_ratio.is_none() && found.parallax_px.unwrap() > 10.0, "{found:?}");
    }

    #[test]
    fn walls_in_the_wrong_place_are_noticed() {
        let sample = textured();
        let start = sample.views[0].position_m;
        // Nearer to the start: the same panorama there, but a different parallax.
        let error = |nearer: f32| {
            let mut moved = sample.clone();
            let to = |point: Vec3| start + (1.0 - nearer) * (point - start);
            moved.points.iter_mut().for_each(|point| point.position_m = to(point.position_m));
            let estimate = Method::TrueOctree.estimate(&moved, &TOOLS).unwrap();
            walk(&sample, &estimate).unwrap().parallax_px.expect("features are found again")
        };
        let errors = [0.0, 0.04, 0.08].map(error);
        assert!(errors[1] > 2.0 * errors[0] && errors[2] > 1.5 * errors[1], "{errors:?}");
    }

    #[test]
    fn nobody_walks_through_walls() {
        let mut sample = textured();
        for view in &mut sample.views {
            view.depth_m.as_mut().unwrap().pixels_mut().fill(1.2);
        }
        let estimate = Method::MeanColour.estimate(&sample, &TOOLS).unwrap();
        assert_eq!(walk(&sample, &estimate), None);
    }
}
