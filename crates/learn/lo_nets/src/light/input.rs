use std::ops::Range;
use std::sync::Arc;

use lo_geometry::{Camera, Cube, DVec3, Vec3};
use lo_imaging::{RadianceImage, sample_equirectangular};
use lo_octree::{LightOctree, Octree, Provenance, RadiancePoint};
use lo_random::RngExt;

use crate::graph::GraphLevel;
use crate::light::channels::columns::{CARRIER, CENTRE, CERTAIN, LOG_RADIANCE, NORMAL, OFFSET, VISIBLE};
use crate::light::channels::{MAX_RADIANCE, NODE_FEATURES};
use crate::light::{FreeSpace, LightError, LightNetConfig, PhotoView, VisiblePoint};

/// Number of points that carry the global lighting feature into unobserved space.
const GLOBAL_POINTS: usize = 4096;

/// Lower limit of initial radiance.
const MIN_AMBIENT: f32 = 1e-3;

/// Input of the light network: graphs of the input octree, features of their finest nodes, and observations.
#[derive(Debug)]
pub struct LightInput {
    /// Graphs from the full depth on.
    pub levels: Vec<Arc<GraphLevel>>,
    /// Octree of the graphs: visible points, and carriers of `f_L`.
    pub octree: Octree,
    /// Features of the finest graph's nodes, `[nodes, NODE_FEATURES]`:
    ///
    /// - mean over the node's points of log(1 + radiance) (3), and of the position in the node, −1 to 1 (3);
    /// - the node's centre in the cube, −1 to 1 (3);
    /// - mean normal (3);
    /// - shares of the points that are visible, certain, and carriers of `f_L` (1 each).
    ///
    /// Nodes without points have a centre only. Carriers are black and have no normal, until [`LightInput::with_map`]
    /// and [`LightInput::with_up`] set them.
    pub features: Vec<f32>,
    /// Octree of the visible points. Its `seen` holds the certain shares.
    pub visible: LightOctree,
    /// Ambient light, the initial radiance of unobserved nodes: linear RGB above 0, or 0.2 without visible points.
    pub ambient: [f32; 3],
    /// Single map: a panorama at the first camera, in the octree's axes. Without it, initial radiance is `ambient`
    /// alone.
    pub map: Option<RadianceImage>,
    /// Space that the photos show to be empty.
    pub free: FreeSpace,
}

impl LightInput {
    /// Builds the input from the visible points and their camera, both in the frame of `cube`.
    ///
    /// Carriers of `f_L` are drawn outside of the view: directions uniform over the sphere, distances from those of the
    /// visible points. Points outside of the cube are ignored.
    ///
    /// # Errors
    /// The first point that is not finite; depths or a cube that octrees do not support.
    pub fn new(
        points: &[VisiblePoint],
        camera: &Camera,
        cube: Cube,
        config: &LightNetConfig,
        seed: u64,
    ) -> Result<Self, LightError> {
        Self::of_photos(points, &[PhotoView::only(*camera, points.len())], cube, config, seed)
    }

    /// Builds the input from several cameras. `points` are grouped by camera in the order of `views`.
    ///
    /// The network infers from the first camera's observations only, as in training. Observations of the other cameras
    /// replace its predictions where available (`docs/design/036-several-photos.md`).
    ///
    /// # Errors
    /// As [`LightInput::new`].
    ///
    /// # Panics
    /// Where the views have more points than there are.
    pub fn of_photos(
        points: &[VisiblePoint],
        views: &[PhotoView],
        cube: Cube,
        config: &LightNetConfig,
        seed: u64,
    ) -> Result<Self, LightError> {
        let finite = |p: &VisiblePoint| {
            p.position_m.is_finite() && p.normal.is_finite() && p.radiance.iter().all(|c| c.is_finite() && *c >= 0.0)
        };
        if let Some(index) = points.iter().position(|point| !finite(point)) {
            return Err(LightError::Point { index, point: points[index] });
        }
        let mut surface: Vec<RadiancePoint> = points.iter().map(VisiblePoint::radiance_point).collect();
        let (visible, _) = LightOctree::from_points(&surface, cube, config.depth, config.full_depth)?;
        let free = FreeSpace::of_photos(points, views);
        let points = &points[..views.first().map_or(0, |view| view.points)];
        surface.truncate(points.len());
        let carriers = carriers(points, &views[..views.len().min(1)], cube, seed);
        surface.extend(carriers.iter().map(|&position_m| RadiancePoint {
            position_m,
            radiance: [0.0; 3],
            provenance: Provenance::Inferred,
        }));
        let (light, _) = LightOctree::from_points(&surface, cube, config.depth, config.full_depth)?;
        let levels = GraphLevel::all(&light.octree);
        let features = features(&light, &levels[levels.len() - 1], points, &carriers);
        Ok(Self { levels, octree: light.octree, features, visible, ambient: ambient_light(points), map: None, free })
    }

    /// Adds the single map. It sets the radiance of `f_L`'s carriers, and is blended into the initial radiance of
    /// unobserved nodes.
    #[must_use]
    pub fn with_map(mut self, map: RadianceImage) -> Self {
        self.add_to_carriers(LOG_RADIANCE, |place_m| sample_map(&map, place_m).map(f32::ln_1p));
        self.map = Some(map);
        self
    }

    /// Adds the unit vector against gravity, by normals of the nodes that carry `f_L`.
    ///
    /// Each gets the normal of a horizontal surface at its position (floor below the camera, ceiling above), scaled by
    /// the sine of its elevation.
    #[must_use]
    pub fn with_up(mut self, up: Vec3) -> Self {
        self.add_to_carriers(NORMAL, |place_m| (-place_m.normalize_or_zero().dot(up) * up).to_array());
        self
    }

    /// Adds `value_at` of the node's centre to three features of nodes that carry `f_L`, weighted by their share of
    /// carriers.
    fn add_to_carriers(&mut self, columns: Range<usize>, value_at: impl Fn(Vec3) -> [f32; 3]) {
        let (half_edge_m, middle_m) = (0.5 * self.cube().edge_m, self.cube().centre_m());
        for row in self.features.chunks_exact_mut(NODE_FEATURES) {
            let carriers = row[CARRIER];
            if carriers > 0.0 {
                let values = value_at(middle_m + half_edge_m * Vec3::from_slice(&row[CENTRE]));
                row[columns.clone()].iter_mut().zip(values).for_each(|(sum, value)| *sum += carriers * value);
            }
        }
    }

    /// Returns the single map's radiance towards a point of the octree's frame: linear RGB above 0, or `ambient`
    /// without a map.
    pub fn map_towards(&self, place_m: Vec3) -> [f32; 3] {
        self.map.as_ref().map_or(self.ambient, |map| sample_map(map, place_m))
    }

    /// Returns the cube that the octrees cover.
    pub fn cube(&self) -> Cube {
        self.visible.cube
    }
}

fn sample_map(map: &RadianceImage, direction: Vec3) -> [f32; 3] {
    sample_equirectangular(map, direction).map(|c| c.clamp(MIN_AMBIENT, MAX_RADIANCE))
}

/// Estimates ambient light from the visible points.
///
/// Brightness is the log average of the middle half of the points by brightness (the key of a scene in Reinhard et al.
/// 2002), which excludes windows, lamps and dark corners. Colour is the mean over all points, bright or dark.
pub fn ambient_light(points: &[VisiblePoint]) -> [f32; 3] {
    // Bounds the influence of black.
    const DARK: f64 = 0.01;
    const UNKNOWN: f32 = 0.2;
    if points.is_empty() {
        return [UNKNOWN; 3];
    }
    let mut brightness: Vec<f32> = points.iter().map(|point| Vec3::from(point.radiance).element_sum() / 3.0).collect();
    brightness.sort_unstable_by(f32::total_cmp);
    let middle = &brightness[points.len() / 4..points.len() - points.len() / 4];
    let log_mean = middle.iter().map(|&b| (f64::from(b) + DARK).ln()).sum::<f64>() / middle.len() as f64;
    let colours = points.iter().map(|point| Vec3::from(point.radiance).normalize_or_zero().as_dvec3()).sum::<DVec3>();
    let colour = if colours == DVec3::ZERO { DVec3::ONE } else { 3.0 * colours / colours.element_sum() };
    ((log_mean.exp() - DARK) * colour).as_vec3().to_array().map(|c| c.clamp(MIN_AMBIENT, MAX_RADIANCE))
}

/// Draws the positions of the points that carry `f_L`.
fn carriers(points: &[VisiblePoint], views: &[PhotoView], cube: Cube, seed: u64) -> Vec<Vec3> {
    if points.is_empty() {
        return Vec::new();
    }
    let mut stream = lo_random::stream(seed, "global light points", 0);
    let in_view = |point: Vec3| views.iter().any(|view| view.contains(point));
    (0..GLOBAL_POINTS)
        .filter_map(|_| {
            let z: f32 = stream.random_range(-1.0..1.0);
            let longitude: f32 = stream.random_range(0.0..std::f32::consts::TAU);
            let distance_m = points[stream.random_range(0..points.len())].position_m.length();
            let r = (1.0 - z * z).sqrt();
            let point = distance_m * Vec3::new(r * longitude.cos(), r * longitude.sin(), z);
            (cube.contains(point) && !in_view(point)).then_some(point)
        })
        .collect()
}

/// Features that a point adds to its node.
#[derive(Default)]
struct PointFeatures {
    log_radiance: [f32; 3],
    normal: [f32; 3],
    visible: f32,
    certain: f32,
    carrier: f32,
}

fn features(light: &LightOctree, finest: &GraphLevel, points: &[VisiblePoint], carriers: &[Vec3]) -> Vec<f32> {
    let (octree, cube) = (&light.octree, light.cube);
    let graph = &finest.graph;
    let mut features = vec![0.0f32; graph.len() * NODE_FEATURES];
    for (node, row) in graph.nodes().iter().zip(features.chunks_exact_mut(NODE_FEATURES)) {
        let xyz = lo_octree::xyz_from_key(octree.levels()[node.depth as usize].keys[node.index as usize]);
        for (centre, coordinate) in row[CENTRE].iter_mut().zip(xyz) {
            *centre = (2.0 * coordinate as f32 + 1.0) / (1u32 << node.depth) as f32 - 1.0;
        }
    }
    let mut counts = vec![0u32; graph.len()];
    let depth = octree.depth();
    let mut add = |position_m: Vec3, point: PointFeatures| {
        if let Some((found, node)) = light.locate(position_m, depth)
            && found == depth
        {
            let node = graph.first_finest() + node;
            let row = &mut features[node * NODE_FEATURES..][..NODE_FEATURES];
            let offset = cube.unit_from_world(position_m) * 2.0 - Vec3::ONE - Vec3::from_slice(&row[CENTRE]);
            let offset = offset * (1u32 << depth) as f32;
            counts[node] += 1;
            for (columns, added) in
                [(LOG_RADIANCE, point.log_radiance), (OFFSET, offset.to_array()), (NORMAL, point.normal)]
            {
                row[columns].iter_mut().zip(added).for_each(|(sum, value)| *sum += value);
            }
            for (column, added) in [(VISIBLE, point.visible), (CERTAIN, point.certain), (CARRIER, point.carrier)] {
                row[column] += added;
            }
        }
    };
    for point in points {
        let own = PointFeatures {
            log_radiance: point.radiance.map(f32::ln_1p),
            normal: point.normal.to_array(),
            visible: 1.0,
            certain: f32::from(u8::from(point.certain)),
            carrier: 0.0,
        };
        add(point.position_m, own);
    }
    for &carrier in carriers {
        add(carrier, PointFeatures { carrier: 1.0, ..PointFeatures::default() });
    }
    for (row, count) in features.chunks_exact_mut(NODE_FEATURES).zip(counts).filter(|(_, count)| *count > 1) {
        let share = 1.0 / count as f32;
        // All columns but the centre are means over the points.
        row[..CENTRE.start].iter_mut().for_each(|sum| *sum *= share);
        row[CENTRE.end..].iter_mut().for_each(|sum| *sum *= share);
    }
    features
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn config() -> LightNetConfig {
        LightNetConfig { depth: 4, full_depth: 2, ..LightNetConfig::default() }
    }

    fn input(points: &[VisiblePoint]) -> Result<LightInput, LightError> {
        let camera = Camera::from_hfov_deg(70.0, 30, 20).unwrap();
        LightInput::new(points, &camera, Cube::centred(Vec3::ZERO, 8.0), &config(), 7)
    }

    fn point(position_m: [f32; 3]) -> VisiblePoint {
        VisiblePoint { position_m: Vec3::from(position_m), radiance: [1.0, 0.0, 3.0], normal: Vec3::Z, certain: true }
    }

    #[test]
    fn features_describe_points_and_carriers() {
        let points = [point([0.1, 0.2, -3.1]), VisiblePoint { certain: false, ..point([0.3, 0.2, -3.1]) }];
        let input = input(&points).unwrap();
        let graph = &input.levels.last().unwrap().graph;
        let rows: Vec<&[f32]> = input.features.chunks_exact(NODE_FEATURES).collect();
        assert_eq!(rows.len(), graph.len());
        let seen: Vec<&&[f32]> = rows.iter().filter(|row| row[VISIBLE] > 0.0).collect();
        assert_eq!(seen.len(), 1, "both lie in one leaf of half a metre");
        let row = seen[0];
        assert!((row[LOG_RADIANCE][0] - 2f32.ln()).abs() < 1e-6 && (row[LOG_RADIANCE][2] - 4f32.ln()).abs() < 1e-6);
        // The leaf is [0, 0.5] × [0, 0.5] × [−3.5, −3], its centre (0.25, 0.25, −3.25).
        let close = |got: &[f32], expected: [f32; 3]| got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(close(&row[OFFSET], [-0.2, -0.2, 0.6]), "{:?}", &row[OFFSET]);
        assert!(close(&row[CENTRE], [0.0625, 0.0625, -0.8125]), "{:?}", &row[CENTRE]);
        assert!(close(&row[NORMAL], [0.0, 0.0, 1.0]) && close(&row[VISIBLE..], [1.0, 0.5, 0.0]));
        let carriers = rows.iter().filter(|row| row[CARRIER] > 0.0).count();
        assert!(carriers > 100, "{carriers} leaves of carriers");
        assert!(rows.iter().all(|row| row[VISIBLE] + row[CARRIER] < 1.001));
    }

    #[test]
    fn single_map_sets_carriers_and_initial_light() {
        let plain = input(&[point([0.1, 0.2, -3.1])]).unwrap();
        let features = plain.features.clone();
        // Light from the right.
        let radiance = RadianceImage::from_fn(32, 16, |x, y| {
            if lo_geometry::pixel_direction(x, y, 32, 16).x > 0.0 { [4.0, 2.0, 1.0] } else { [0.5; 3] }
        });
        let ambient = plain.ambient;
        assert_eq!(plain.map_towards(Vec3::X), ambient);
        let input = plain.with_map(radiance);
        let mut shown = 0;
        for (row, before) in input.features.chunks_exact(NODE_FEATURES).zip(features.chunks_exact(NODE_FEATURES)) {
            assert_eq!(row[LOG_RADIANCE.end..], before[LOG_RADIANCE.end..]);
            if before[CARRIER] < 1.0 || row[CENTRE][0].abs() < 0.2 {
                continue;
            }
            shown += 1;
            let expected: [f32; 3] = if row[CENTRE][0] > 0.0 { [4.0, 2.0, 1.0] } else { [0.5; 3] };
            assert!(row[LOG_RADIANCE].iter().zip(expected).all(|(a, b)| (a - b.ln_1p()).abs() < 1e-5), "{row:?}");
        }
        assert!(shown > 100, "{shown} leaves of carriers");
        let right = input.map_towards(Vec3::new(2.0, 0.0, 0.1));
        assert!(right.iter().zip([4.0, 2.0, 1.0]).all(|(a, b)| (a / b - 1.0).abs() < 1e-5), "{right:?}");
    }

    #[test]
    fn up_sets_the_carriers_normals() {
        let plain = input(&[point([0.1, 0.2, -3.1])]).unwrap();
        let features = plain.features.clone();
        let up = Vec3::new(0.0, 0.6, 0.8);
        let input = plain.with_up(up);
        let mut value_at = 0;
        for (row, before) in input.features.chunks_exact(NODE_FEATURES).zip(features.chunks_exact(NODE_FEATURES)) {
            assert_eq!((&row[..NORMAL.start], &row[NORMAL.end..]), (&before[..NORMAL.start], &before[NORMAL.end..]));
            let (normal, centre) = (Vec3::from_slice(&row[NORMAL]), Vec3::from_slice(&row[CENTRE]));
            if before[CARRIER] < 1.0 {
                continue;
            }
            value_at += 1;
            assert!((normal.dot(up) + centre.normalize().dot(up)).abs() < 1e-5 && normal.cross(up).length() < 1e-5);
        }
        assert!(value_at > 100, "{value_at} leaves of carriers");
    }

    #[test]
    fn a_window_hardly_raises_the_ambient_light() {
        let seen = |radiance: f32| VisiblePoint { radiance: [radiance; 3], ..point([0.0, 0.0, -3.0]) };
        let [grey, dark, window] = [0.3, 0.02, 1.0].map(seen);
        assert!((ambient_light(&[grey; 9])[1] - 0.3).abs() < 1e-5);
        // A window fills a quarter of a dark room's photo.
        assert!((ambient_light(&[window, dark, dark, dark, dark, dark, dark, window])[1] - 0.02).abs() < 1e-5);
        assert_eq!((ambient_light(&[seen(0.0); 4]), ambient_light(&[])), ([1e-3; 3], [0.2; 3]));
    }

    #[test]
    fn bright_and_dark_colours_count_alike() {
        let seen = |radiance| VisiblePoint { radiance, ..point([0.0, 0.0, -3.0]) };
        let [r, g, b] = ambient_light(&[seen([0.4, 0.3, 0.0]), seen([0.0, 0.003, 0.004])]);
        // The unit vectors are (0.8, 0.6, 0) and (0, 0.6, 0.8).
        assert!((r / g - 0.8 / 1.2).abs() < 1e-4 && (b / g - 0.8 / 1.2).abs() < 1e-4, "{r} {g} {b}");
    }

    #[test]
    fn carriers_lie_outside_of_the_view() {
        let camera = Camera::from_hfov_deg(70.0, 30, 20).unwrap();
        let points = [point([0.0, 0.0, -2.0]), point([0.0, 0.0, -3.0])];
        let carriers = carriers(&points, &[PhotoView::only(camera, 2)], Cube::centred(Vec3::ZERO, 8.0), 7);
        let view = (35f32.to_radians().tan(), 35f32.to_radians().tan() * 2.0 / 3.0);
        for p in &carriers {
            assert!(p.z >= 0.0 || (p.x / p.z).abs() > view.0 - 1e-4 || (p.y / p.z).abs() > view.1 - 1e-4, "{p}");
            assert!((p.length() - 2.0).abs() < 1e-4 || (p.length() - 3.0).abs() < 1e-4);
        }
    }

    #[test]
    fn points_that_are_not_finite_are_named() {
        let bad = VisiblePoint { radiance: [0.0, f32::NAN, 0.0], ..point([0.0; 3]) };
        let error = input(&[point([0.0; 3]), bad]).unwrap_err();
        assert!(error.to_string().contains("point 1"), "{error}");
    }

    #[test]
    fn photos_without_depth_are_valid_input() {
        let input = input(&[]).unwrap();
        assert!(input.features.chunks_exact(NODE_FEATURES).all(|row| row[..CENTRE.start].iter().all(|&v| v == 0.0)));
    }
}
