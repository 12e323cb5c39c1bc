//! Refinement of observed leaves below the network's depth: photos have more detail than the network predicts.

use lo_octree::{LightOctree, Neighbours, OctreeError};

use crate::light::{FreeSpace, MAX_RADIANCE};

/// Observations as octrees of two depths.
pub(crate) struct ObservedDetail<'a> {
    /// Octree of the depth that is to be refined. Its `seen` holds the certain shares.
    pub coarse: &'a LightOctree,
    /// Octree of the requested depth. Its `seen` holds the certain shares.
    pub fine: &'a LightOctree,
    /// Space that the photos show to be empty.
    pub free: &'a FreeSpace,
}

impl ObservedDetail<'_> {
    /// Splits the observed leaves of `light`, and their rows of `confidence`, down to the depth of the finer octree.
    ///
    /// Observed children take the observed radiance, as far as it is certain. The remaining radiance is interpolated
    /// between the surrounding leaves. Children inherit the leaf's opacity, so that surfaces keep their thickness,
    /// except for observed free space in front of them. Unobserved leaves do not change.
    ///
    /// # Errors
    /// None for octrees of the same cube.
    pub fn refine(&self, light: &mut LightOctree, confidence: &mut Vec<Vec<f32>>) -> Result<(), OctreeError> {
        let mut predictions = self.predictions(light);
        while light.octree.depth() < self.fine.octree.depth() {
            let depth = light.octree.depth();
            let finest = &light.octree.levels()[depth as usize];
            let seen =
                |node: &usize| finest.rows[*node] >= 0 && observed(self.fine, depth, finest.keys[*node]).is_some();
            let split: Vec<bool> = (0..finest.len()).map(|node| seen(&node)).collect();
            let neighbours = light.octree.neighbours(depth);
            let (mut finer, mut nonempty) = (FinerRows::default(), Vec::new());
            for parent in (0..finest.len()).filter(|&node| split[node]) {
                for child in 0..8 {
                    let key = finest.keys[parent] << 3 | child;
                    let observation = observed(self.fine, depth + 1, key);
                    let occupied = observation.is_some() || !self.free.contains_node(light.cube, depth + 1, key);
                    nonempty.push(occupied);
                    if occupied {
                        let neighbourhood = ParentNeighbourhood::new(&neighbours[parent], &finest.rows, child);
                        let prediction = neighbourhood.interpolate(&predictions);
                        let (rgba, seen) = match observation {
                            Some((observed, seen)) => (blended(observed, seen, prediction), seen),
                            None => (neighbourhood.interpolate(&light.rgba[depth as usize]), 0),
                        };
                        finer.push(rgba, seen, prediction, finest.rows[parent] as usize);
                    }
                }
            }
            light.octree.grow(&split)?;
            light.octree.set_nonempty(&nonempty)?;
            light.rgba.push(finer.rgba);
            if let Some(lobes) = &mut light.lobes {
                let inherited = |(&parent, &seen): (&usize, &u8)| {
                    // Observed radiance is known towards the camera and has no lobe.
                    let unobserved = 1.0 - f32::from(seen) / 255.0;
                    lobes[depth as usize][parent].map(|v| unobserved * v)
                };
                let below = finer.parents.iter().zip(&finer.seen).map(inherited).collect();
                lobes.push(below);
            }
            confidence.push(finer.parents.iter().map(|&parent| confidence[depth as usize][parent]).collect());
            light.seen.push(finer.seen);
            predictions = finer.predictions;
        }
        Ok(())
    }

    /// Returns the network's own prediction for each finest row, without the observed part.
    fn predictions(&self, light: &LightOctree) -> Vec<[f32; 4]> {
        let depth = light.octree.depth();
        let keys = light.octree.levels()[depth as usize].row_keys();
        keys.zip(&light.rgba[depth as usize])
            .map(|(key, &rgba)| predicted(rgba, observed(self.coarse, depth, key)))
            .map(|[r, g, b, alpha]| [r.min(MAX_RADIANCE), g.min(MAX_RADIANCE), b.min(MAX_RADIANCE), alpha.min(1.0)])
            .collect()
    }
}

/// Rows of the eight nodes around a child's centre, the parent first, with trilinear weights. −1 marks missing nodes.
struct ParentNeighbourhood([(i32, f32); 8]);

impl ParentNeighbourhood {
    fn new(neighbours: &Neighbours, rows: &[i32], child: u32) -> Self {
        Self(std::array::from_fn(|corner| {
            let (mut neighbour, mut weight) = (13i32, 1.0);
            // A child's centre is a quarter of an edge from its parent's, towards the neighbours on its side.
            for (bit, stride) in [(4, 9), (2, 3), (1, 1)] {
                let side = if child & bit == 0 { -stride } else { stride };
                let aside = corner as u32 & bit != 0;
                neighbour += if aside { side } else { 0 };
                weight *= if aside { 0.25 } else { 0.75 };
            }
            let node = usize::try_from(neighbours[neighbour as usize]);
            (node.map_or(-1, |node| rows[node]), weight)
        }))
    }

    /// Returns radiance interpolated in proportion to opacity, as the tracer does, with the parent's opacity.
    fn interpolate(&self, rgba: &[[f32; 4]]) -> [f32; 4] {
        let parent = rgba[self.0[0].0 as usize];
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for &(row, weight) in self.0.iter().filter(|(row, _)| *row >= 0) {
            let [r, g, b, alpha] = rgba[row as usize];
            let weight = weight * alpha;
            sum = [sum[0] + weight * r, sum[1] + weight * g, sum[2] + weight * b];
            total += weight;
        }
        if total > 0.0 { [sum[0] / total, sum[1] / total, sum[2] / total, parent[3]] } else { parent }
    }
}

/// Rows of the new level.
#[derive(Default)]
struct FinerRows {
    rgba: Vec<[f32; 4]>,
    seen: Vec<u8>,
    predictions: Vec<[f32; 4]>,
    parents: Vec<usize>,
}

impl FinerRows {
    fn push(&mut self, rgba: [f32; 4], seen: u8, prediction: [f32; 4], parent: usize) {
        self.rgba.push(rgba);
        self.seen.push(seen);
        self.predictions.push(prediction);
        self.parents.push(parent);
    }
}

/// Returns a node's RGBα and observed share, or `None` where it is missing or empty.
fn observed(light: &LightOctree, depth: u32, key: u32) -> Option<([f32; 4], u8)> {
    let row = light.row(depth, key)?;
    Some((light.rgba[depth as usize][row], light.seen[depth as usize][row]))
}

/// Returns the predicted part of a node's RGBα. Fully observed nodes return their own.
fn predicted(rgba: [f32; 4], observation: Option<([f32; 4], u8)>) -> [f32; 4] {
    match observation {
        Some((observed, seen)) if seen < 255 => {
            let trust = f32::from(seen) / 255.0;
            std::array::from_fn(|c| ((rgba[c] - trust * observed[c]) / (1.0 - trust)).max(0.0))
        }
        _ => rgba,
    }
}

/// Blends observation and prediction by the observed share.
fn blended(observed: [f32; 4], seen: u8, prediction: [f32; 4]) -> [f32; 4] {
    let trust = f32::from(seen) / 255.0;
    std::array::from_fn(|c| trust * observed[c] + (1.0 - trust) * prediction[c])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Camera, Cube, Vec3};
    use lo_octree::RadiancePoint;

    use super::*;
    use crate::light::VisiblePoint;

    const CUBE: Cube = Cube { origin_m: Vec3::new(-4.0, -4.0, -4.0), edge_m: 8.0 };

    /// A wall 3.1 m away, each pixel in its own colour, the right half clipped.
    fn wall() -> (Vec<VisiblePoint>, Camera) {
        let camera = Camera::from_hfov_deg(80.0, 96, 96).unwrap();
        let point = |i: usize| {
            let (u, v) = (i % 96, i / 96);
            VisiblePoint {
                position_m: camera.unproject(u as f64 + 0.5, v as f64 + 0.5, 3.1),
                radiance: [0.1 + u as f32 / 96.0, 0.5, 0.1 + v as f32 / 96.0],
                normal: Vec3::Z,
                certain: u < 48,
            }
        };
        ((0..96 * 96).map(point).collect(), camera)
    }

    /// Octree of the wall, at a depth.
    fn octree_of(points: &[VisiblePoint], depth: u32) -> LightOctree {
        let points: Vec<RadiancePoint> = points.iter().map(VisiblePoint::radiance_point).collect();
        LightOctree::from_points(&points, CUBE, depth, 2).unwrap().0
    }

    #[test]
    fn observed_leaves_are_refined_and_others_kept() {
        let (points, camera) = wall();
        let behind = VisiblePoint { position_m: Vec3::new(0.1, 0.1, 3.0), certain: false, ..points[0] };
        let mut light = octree_of(&[&points[..], &[behind]].concat(), 5);
        // The network predicts clipped nodes as ten times as bright.
        for (rgba, seen) in light.rgba[5].iter_mut().zip(&light.seen[5]) {
            if *seen == 0 {
                *rgba = rgba.map(|c| 10.0 * c);
                rgba[3] = 0.9;
            }
        }
        light.lobes = Some(light.rgba.iter().map(|rows| vec![[1.0, 2.0, -3.0]; rows.len()]).collect());
        let before = light.clone();
        let mut confidence: Vec<Vec<f32>> =
            light.rgba.iter().map(|rows| (0..rows.len()).map(|row| 1.0 / (1.0 + row as f32)).collect()).collect();
        let (coarse, fine) = (octree_of(&points, 5), octree_of(&points, 7));
        let free = FreeSpace::new(&points, &camera);
        ObservedDetail { coarse: &coarse, fine: &fine, free: &free }.refine(&mut light, &mut confidence).unwrap();
        assert_eq!(light.octree.depth(), 7);
        assert_eq!((&light.rgba[..6], &light.seen[..6]), (&before.rgba[..], &before.seen[..]));
        assert!(confidence.iter().map(Vec::len).eq(light.rgba.iter().map(Vec::len)));
        // Certain nodes have equal radiance in all directions; clipped ones keep the prediction.
        let lobes = &light.lobes.as_ref().unwrap()[7];
        assert!(lobes.iter().zip(&light.seen[7]).all(|(lobe, &seen)| seen < 255 || *lobe == [0.0; 3]));
        assert!(lobes.contains(&[1.0, 2.0, -3.0]));
        for point in &points {
            let (depth, node) = light.locate(point.position_m, 7).unwrap();
            let rgba = light.node_rgba(depth, node).unwrap();
            let (_, known) = fine.locate(point.position_m, 7).unwrap();
            let expected = fine.node_rgba(7, known).unwrap();
            assert_eq!(depth, 7);
            if point.certain && fine.seen[7][fine.octree.levels()[7].rows[known] as usize] == 255 {
                assert!((0..4).all(|c| (rgba[c] - expected[c]).abs() < 1e-4), "{rgba:?} {expected:?}");
            } else if point.position_m.x > 0.3 {
                assert!((rgba[1] - 5.0).abs() < 1e-5 && rgba[3] == 0.9, "clipped: {rgba:?}");
            }
        }
        // Leaves of 6 cm: the space in front of the wall is empty, and the wall keeps its thickness.
        let is_empty = |z: f32| {
            let (depth, node) = light.locate(Vec3::new(-0.5, 0.3, z), 7).unwrap();
            light.octree.levels()[depth as usize].rows[node] < 0
        };
        assert!([-3.2, -3.13, -3.09].iter().all(|&z| !is_empty(z)) && is_empty(-3.03) && is_empty(-2.9));
        let (depth, node) = light.locate(behind.position_m, 7).unwrap();
        assert_eq!((depth, light.node_rgba(depth, node).unwrap()[3]), (5, 0.9));
    }

    #[test]
    fn predictions_are_interpolated_between_leaves() {
        let (mut points, camera) = wall();
        points.iter_mut().for_each(|point| point.certain = false);
        let (coarse, fine) = (octree_of(&points, 5), octree_of(&points, 7));
        let ramp = |middle: Vec3| [5.0 + middle.x, 5.0 - middle.y, 5.0 + 0.5 * (middle.x + middle.y)];
        let mut light = coarse.clone();
        let keys: Vec<u32> = light.octree.levels()[5].row_keys().collect();
        for (rgba, key) in light.rgba[5].iter_mut().zip(keys) {
            rgba[..3].copy_from_slice(&ramp(coarse.node_middle_m(5, key)));
        }
        let free = FreeSpace::new(&points, &camera);
        let mut confidence = light.rgba.iter().map(|rows| vec![1.0; rows.len()]).collect();
        ObservedDetail { coarse: &coarse, fine: &fine, free: &free }.refine(&mut light, &mut confidence).unwrap();
        let keys = light.octree.levels()[7].row_keys().map(|key| light.node_middle_m(7, key));
        let inside: Vec<_> = keys.zip(&light.rgba[7]).filter(|(middle, _)| middle.truncate().length() < 1.8).collect();
        assert!(inside.len() > 2000, "{}", inside.len());
        for (middle, rgba) in inside {
            assert!(
                ramp(middle).iter().zip(rgba).all(|(expected, c)| (expected - c).abs() < 1e-4),
                "{middle}: {rgba:?}"
            );
        }
    }

    #[test]
    fn octrees_of_full_depth_do_not_change() {
        let (points, camera) = wall();
        let same = octree_of(&points, 5);
        let mut light = same.clone();
        let mut confidence = light.rgba.iter().map(|rows| vec![1.0; rows.len()]).collect();
        let free = FreeSpace::new(&points, &camera);
        ObservedDetail { coarse: &same, fine: &same, free: &free }.refine(&mut light, &mut confidence).unwrap();
        assert_eq!(light, same);
    }
}
