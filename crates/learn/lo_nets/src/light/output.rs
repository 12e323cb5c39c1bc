use std::sync::Arc;

use burn::tensor::Tensor;
use lo_cone::{Cone, Settings, TracerError};
use lo_geometry::{Cube, Vec3};
use lo_octree::{LightOctree, MAX_ALPHA, Octree};

use crate::graph::{RowMap, select_rows};
use crate::light::channels::{LIGHT_CHANNELS, LOBE_CHANNELS};
use crate::light::lobes::{directions_to_viewer, gains};
use crate::light::{LightError, NetworkWarning, ObservedLight};
use crate::rendering::render;

/// Opacity above which nodes count as opaque. Transmitting a few percent doubles a ray's samples without visible effect
/// (`docs/design/002-crossing-opacity.md`).
const OPAQUE: f32 = 0.9;

/// Output of the light network.
#[derive(Debug)]
pub struct LightOutput {
    /// Octree grown by predictions or along the truth.
    pub octree: Octree,
    /// Cube that the octree covers.
    pub cube: Cube,
    /// Outputs for each depth from the full depth on.
    pub levels: Vec<LevelOutput>,
    /// Deviations from the prediction: node budget exceeded, nothing predicted.
    pub warnings: Vec<NetworkWarning>,
}

/// Output of the network at one depth.
#[derive(Debug)]
pub struct LevelOutput {
    /// Logits of occupancy, `[nodes of this depth, 1]`. Above the finest depth, occupied nodes are split.
    pub logits: Tensor<2>,
    /// Linear RGB, opacity and expected error of log(1 + radiance), `[non-empty nodes of this depth, 5]`.
    ///
    /// With lobes `[…, 8]`: the lobe follows, and RGB is the mean over directions ([`lo_octree::lobe_gain`]).
    pub light: Tensor<2>,
    /// Observations of the same nodes.
    pub observed: Arc<ObservedLight>,
}

impl LightOutput {
    /// Reports whether nodes have lobes.
    pub fn has_lobes(&self) -> bool {
        self.levels[0].light.dims()[1] > LIGHT_CHANNELS
    }

    /// Returns RGBα of all levels as seen from `viewer_m`, concatenated: `[non-empty nodes from the full depth on, 4]`.
    pub fn rgba_from(&self, viewer_m: Vec3) -> Tensor<2> {
        let depths = self.octree.full_depth()..;
        let of_level = |(depth, level): (u32, &LevelOutput)| {
            let rgba = level.light.clone().narrow(1, 0, 4);
            if !self.has_lobes() {
                return rgba;
            }
            let towards = directions_to_viewer(&self.octree, self.cube, depth, viewer_m);
            let lobes = level.light.clone().narrow(1, LIGHT_CHANNELS, LOBE_CHANNELS);
            Tensor::cat(vec![rgba.clone().narrow(1, 0, 3) * gains(lobes, &towards), rgba.narrow(1, 3, 1)], 1)
        };
        Tensor::cat(depths.zip(&self.levels).map(of_level).collect(), 0)
    }

    /// Renders cones as [`render`] does: `[cones, 5]`. With lobes, renders once for each distinct apex.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn rendered(&self, cones: &[Cone], settings: Settings) -> Result<Tensor<2>, TracerError> {
        let from = |apex: Vec3, cones: Arc<[Cone]>| {
            render(self.rgba_from(apex), self.octree.clone(), self.cube, cones, settings)
        };
        if !self.has_lobes() || cones.is_empty() {
            return from(Vec3::ZERO, cones.into());
        }
        let mut apexes: Vec<(Vec3, Vec<u32>)> = Vec::new();
        for (i, cone) in (0..).zip(cones) {
            match apexes.iter_mut().find(|(apex, _)| *apex == cone.origin) {
                Some((_, members)) => members.push(i),
                None => apexes.push((cone.origin, vec![i])),
            }
        }
        let rendered =
            apexes.iter().map(|(apex, members)| from(*apex, members.iter().map(|&i| cones[i as usize]).collect()));
        let rendered = Tensor::cat(rendered.collect::<Result<_, _>>()?, 0);
        let mut sources = vec![None; cones.len()];
        for (at, i) in (0..).zip(apexes.into_iter().flat_map(|(_, members)| members)) {
            sources[i as usize] = Some(at);
        }
        Ok(select_rows(rendered, &RowMap::new(sources, cones.len())))
    }

    /// Converts to a light octree, with near-opaque nodes made opaque, and the confidence of each row: e^−(expected
    /// error), in (0, 1].
    ///
    /// Levels above the full depth hold the means of those below.
    ///
    /// # Errors
    /// Values that are not finite.
    pub fn into_light(self) -> Result<(LightOctree, Vec<Vec<f32>>), LightError> {
        let full_depth = self.octree.full_depth();
        let has_lobes = self.has_lobes();
        let (mut rgba, mut seen) = (Vec::new(), Vec::new());
        let (mut confidence, mut lobes) = (Vec::<Vec<f32>>::new(), Vec::<Vec<[f32; 3]>>::new());
        for (depth, level) in (full_depth..).zip(self.levels) {
            let (channels, values) = (level.light.dims()[1], level.light.into_data().iter::<f32>().collect::<Vec<_>>());
            if !values.iter().all(|value| value.is_finite()) {
                return Err(LightError::NotFinite { what: "radiance, opacity, error or lobe", depth });
            }
            let rows = || values.chunks_exact(channels);
            rgba.push(
                rows().map(|row| [row[0], row[1], row[2], if row[3] > OPAQUE { MAX_ALPHA } else { row[3] }]).collect(),
            );
            confidence.push(rows().map(|row| (-row[4]).exp()).collect());
            if has_lobes {
                lobes.push(rows().map(|row| [row[5], row[6], row[7]]).collect());
            }
            seen.push(level.observed.trust().map(|trust| (255.0 * trust).round() as u8).collect());
        }
        let mut light =
            LightOctree { octree: self.octree, cube: self.cube, rgba, seen, lobes: has_lobes.then_some(lobes) };
        for depth in (0..full_depth).rev() {
            let families = families(&light.octree, depth);
            light.rgba.insert(0, families.iter().map(|rows| mean(rows, |row| light.rgba[0][row])).collect());
            let seen = |row: usize| [f32::from(light.seen[0][row])];
            light.seen.insert(0, families.iter().map(|rows| mean(rows, seen)[0].round() as u8).collect());
            confidence.insert(0, families.iter().map(|rows| mean(rows, |row| [confidence[0][row]])[0]).collect());
            if let Some(lobes) = &mut light.lobes {
                lobes.insert(0, families.iter().map(|rows| mean(rows, |row| lobes[0][row])).collect());
            }
        }
        Ok((light, confidence))
    }
}

/// Returns the children's rows of each row of `depth`, whose nodes are all split.
fn families(octree: &Octree, depth: u32) -> Vec<Vec<usize>> {
    let (level, below) = (&octree.levels()[depth as usize], &octree.levels()[depth as usize + 1]);
    let nonempty = (0..level.len()).filter(|&node| level.rows[node] >= 0);
    let rows = nonempty.map(|node| {
        let children = level.children[node] as usize..level.children[node] as usize + 8;
        children.filter_map(|child| usize::try_from(below.rows[child]).ok()).collect()
    });
    rows.collect()
}

fn mean<const N: usize>(rows: &[usize], of: impl Fn(usize) -> [f32; N]) -> [f32; N] {
    let share = 1.0 / rows.len() as f32;
    std::array::from_fn(|c| rows.iter().map(|&row| of(row)[c]).sum::<f32>() * share)
}
