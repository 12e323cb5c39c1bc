use std::sync::Arc;

use burn::tensor::Tensor;
use geometry::Cube;
use octree::{LightOctree, MAX_ALPHA, Octree};

use crate::light::{KnownLight, LightError};

/// Nodes more opaque than this count as opaque: a few percent that shine through cost a ray twice the samples and show nothing (24 rooms:
/// 15.66 dB with and without).
const OPAQUE: f32 = 0.9;

/// What the light network gives.
#[derive(Debug)]
pub struct LightOutput {
    /// The octree that was grown, by predictions or along the truth.
    pub octree: Octree,
    /// Part of the world that it covers.
    pub cube: Cube,
    /// One for each depth from the full depth on.
    pub levels: Vec<LevelOutput>,
    /// What was not done as predicted: the node budget, nothing predicted.
    pub messages: Vec<String>,
}

/// The network's outputs at one depth.
#[derive(Debug)]
pub struct LevelOutput {
    /// `[nodes of this depth, 1]`: logit of being occupied, which above the finest depth is that of being split.
    pub logits: Tensor<2>,
    /// `[non-empty nodes of this depth, 5]`: linear RGB, opacity, expected error of log(1 + radiance).
    pub light: Tensor<2>,
    /// What the photo says of the same nodes.
    pub known: Arc<KnownLight>,
}

impl LightOutput {
    /// RGBα of all levels, one after the other: `[non-empty nodes from the full depth on, 4]`.
    pub fn rgba(&self) -> Tensor<2> {
        Tensor::cat(
            self.levels.iter().map(|level| level.light.clone().slice([0..level.light.dims()[0], 0..4])).collect(),
            0,
        )
    }

    /// The lighting octree, in which what is nearly opaque is opaque, and for each of its rows how sure the network is: e^−(expected error), in (0, 1].
    ///
    /// Levels above the full depth hold the means of those below.
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn into_light(self) -> Result<(LightOctree, Vec<Vec<f32>>), LightError> {
        let full_depth = self.octree.full_depth();
        let (mut rgba, mut seen, mut confidence) = (Vec::new(), Vec::new(), Vec::<Vec<f32>>::new());
        for (depth, level) in (full_depth..).zip(self.levels) {
            let values: Vec<f32> = level.light.into_data().iter::<f32>().collect();
            if !values.iter().all(|value| value.is_finite()) {
                return Err(LightError::NotFinite { what: "radiance, opacity or error", depth });
            }
            let rows = values.as_chunks::<5>().0;
            let rgba_of = |&[r, g, b, a, _]: &[f32; 5]| [r, g, b, if a > OPAQUE { MAX_ALPHA } else { a }];
            rgba.push(rows.iter().map(rgba_of).collect());
            confidence.push(rows.iter().map(|row| (-row[4]).exp()).collect());
            seen.push(level.known.trust().map(|trust| (255.0 * trust).round() as u8).collect());
        }
        let mut light = LightOctree { octree: self.octree, cube: self.cube, rgba, seen };
        for depth in (0..full_depth).rev() {
            let (above, certain) = means_above(&light, depth, &confidence[0]);
            light.rgba.insert(0, above.iter().map(|&(rgba, _)| rgba).collect());
            light.seen.insert(0, above.iter().map(|&(_, seen)| seen).collect());
            confidence.insert(0, certain);
        }
        Ok((light, confidence))
    }
}

/// Rows of `depth` from those of the next one, which are the first of `light` and `confidence`. All nodes are split here.
fn means_above(light: &LightOctree, depth: u32, confidence: &[f32]) -> (Vec<([f32; 4], u8)>, Vec<f32>) {
    let levels = light.octree.levels();
    let (level, below) = (&levels[depth as usize], &levels[depth as usize + 1]);
    let nonempty = (0..level.len()).filter(|&node| level.rows[node] >= 0);
    nonempty
        .map(|node| {
            let children = level.children[node] as usize..level.children[node] as usize + 8;
            let rows: Vec<usize> = children.filter_map(|child| usize::try_from(below.rows[child]).ok()).collect();
            let share = 1.0 / rows.len() as f32;
            let mean = |value: &dyn Fn(usize) -> f32| rows.iter().map(|&row| value(row)).sum::<f32>() * share;
            let rgba = std::array::from_fn(|c| mean(&|row| light.rgba[0][row][c]));
            ((rgba, mean(&|row| f32::from(light.seen[0][row])).round() as u8), mean(&|row| confidence[row]))
        })
        .unzip()
}
