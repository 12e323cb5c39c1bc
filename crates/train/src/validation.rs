//! Figures on held-out scenes, and pictures of them.

use std::collections::BTreeMap;

use burn::tensor::{Device, Tensor, TensorData};
use cone::Viewers;
use dataset::{Dataset, NovelView, Sample, Split};
use imaging::{DepthMap, Image, RadianceImage, srgb_from_linear};
use lightoctree::{EstimateOptions, estimate};
use nets::depth::{LONGER_SIDE, panorama_image};
use nets::light::{Growth, LightNetConfig};
use octree::LightOctree;

use crate::augmentation::Variation;
use crate::example::{DepthExample, KnownDepth, VariedRoom};
use crate::learner::{Learner, in_pool};
use crate::message::ValidationReport;
use crate::sheet::{Row, sheet};

/// Seed of what is drawn for the light network's input: always the same.
const SEED: u64 = 1;

/// Held-out photos, with what does not change while the networks learn.
pub(crate) struct Validation {
    samples: Vec<Sample>,
    sheet_rows: usize,
    /// By octree depth: PSNR of each photo's true octree and of its shell.
    bounds: BTreeMap<u32, Vec<[Option<f32>; 2]>>,
}

impl Validation {
    /// The first photos of the dataset's validation part, one of each scene. They are kept in memory, about 12 MB each.
    pub fn new(dataset: &dyn Dataset, photos: usize, sheet_rows: usize, mut skipped: impl FnMut(String)) -> Self {
        let (mut samples, mut last) = (Vec::new(), String::new());
        for index in 0..dataset.len() {
            if samples.len() == photos {
                break;
            }
            let scene = dataset.scene_id(index);
            if scene == last || Split::of(&scene) != Split::Validation {
                continue;
            }
            last = scene.into_owned();
            match dataset.get(index) {
                Ok(sample) if sample.depth_m.is_some() && !sample.points.is_empty() => {
                    samples.push(Sample { radiance: None, normal: None, albedo: None, sensor_depth_m: None, ..sample });
                }
                Ok(sample) => skipped(format!("{}: no true depth or no surface points", sample.id)),
                Err(error) => skipped(error.to_string()),
            }
        }
        Self { samples, sheet_rows, bounds: BTreeMap::new() }
    }

    /// Figures of the averaged weights, and the contact sheet where it has rows. `lit`: the light network too.
    pub fn run(&mut self, learner: &Learner, lit: bool) -> (ValidationReport, Option<Image<[u8; 3]>>) {
        let depth = learner.network.depth;
        if lit && !self.bounds.contains_key(&depth) {
            let bounds = self.samples.iter().map(|sample| in_pool(|| bounds(sample, &learner.network))).collect();
            self.bounds.insert(depth, bounds);
        }
        let (mut means, mut rows) = (Means::default(), Vec::new());
        for sample in &self.samples {
            let row = in_pool(|| judge(learner, sample, lit, &mut means));
            rows.extend(row.filter(|_| rows.len() < self.sheet_rows));
        }
        let mut report = means.report(self.samples.len());
        if lit {
            let of = |which: usize| mean(self.bounds[&depth].iter().filter_map(|bound| bound[which]));
            (report.true_octree_psnr_db, report.shell_psnr_db) = (of(0), of(1));
        }
        (report, (!rows.is_empty()).then(|| sheet(&rows)))
    }
}

#[derive(Default)]
struct Means {
    abs_rel: Vec<f32>,
    delta1: Vec<f32>,
    global_db: Vec<f32>,
    db: Vec<f32>,
    alone_db: Vec<f32>,
    splits: Vec<f32>,
}

impl Means {
    fn report(&self, photos: usize) -> ValidationReport {
        let of = |values: &[f32]| mean(values.iter().copied());
        ValidationReport {
            photos,
            depth_abs_rel: of(&self.abs_rel),
            depth_delta1: of(&self.delta1),
            global_psnr_db: of(&self.global_db),
            psnr_db: of(&self.db),
            photo_alone_psnr_db: of(&self.alone_db),
            split_accuracy: of(&self.splits),
            ..ValidationReport::default()
        }
    }
}

fn mean(values: impl Iterator<Item = f32>) -> Option<f32> {
    let (sum, count) = values.fold((0.0f64, 0), |(sum, count), value| (sum + f64::from(value), count + 1));
    (count > 0).then(|| (sum / f64::from(count)) as f32)
}

/// Figures of one photo into `means`, and its row of the sheet.
fn judge(learner: &Learner, sample: &Sample, lit: bool, means: &mut Means) -> Option<Row> {
    let example = DepthExample::new(sample, &Variation::NONE, LONGER_SIDE).ok()?;
    let output = learner.depth.average.forward(&[&example.photo]);
    let predicted_m = output.depth_m(&sample.camera);
    let (abs_rel, delta1) = depth_figures(&predicted_m, &example.depth_m);
    means.abs_rel.extend(abs_rel);
    means.delta1.extend(delta1);
    let global_panorama = panorama_image(learner.depth.average.panorama.forward(output.global.clone()));
    means.global_db.push(psnr_db(&global_panorama, &example.panorama));
    let mut row = Row {
        photo: sample.photo.clone(),
        panoramas: [global_panorama, example.panorama.clone()],
        depths_m: [predicted_m.clone(), example.depth_m.clone()],
        octrees: None,
    };
    if lit {
        let global: Vec<f32> = output.global.into_data().iter().collect();
        if let Some((light, truth, accuracy)) = completed(learner, sample, KnownDepth::True, &global) {
            means.splits.push(accuracy);
            means.db.extend(views_db(&light, &sample.views, 1.0));
            if let Some(view) = sample.views.first() {
                row.panoramas = [seen_from(&Viewers::new(&light), view, 1.0), view.radiance.clone()];
            }
            row.octrees = Some([light, truth]);
        }
        let room = VariedRoom::new(sample, &Variation::NONE, KnownDepth::Predicted(&predicted_m)).ok();
        if let Some((light, scale)) = room.and_then(|room| Some((grown(learner, &room, &global)?, room.scale))) {
            means.alone_db.extend(views_db(&light, &sample.views, scale));
        }
    }
    Some(row)
}

/// The octree that the light network gives, the true one, and the share of right labels along the latter.
fn completed(
    learner: &Learner,
    sample: &Sample,
    depth: KnownDepth,
    global: &[f32],
) -> Option<(LightOctree, LightOctree, f32)> {
    let room = VariedRoom::new(sample, &Variation::NONE, depth).ok()?;
    let truth = room.truth(&learner.network).ok()?;
    let input = room.input(&learner.network, SEED).ok()?;
    let along = learner.light.average.forward(&input, Some(tensor(global)), Growth::Truth(&truth.octree)).ok()?;
    let (mut right, mut all) = (0, 0);
    for (depth, level) in (learner.network.full_depth..).zip(&along.levels) {
        let logits: Vec<f32> = level.logits.clone().into_data().iter().collect();
        let rows = &truth.octree.levels()[depth as usize].rows;
        right += logits.iter().zip(rows).filter(|(logit, row)| (**logit > 0.0) == (**row >= 0)).count();
        all += logits.len();
    }
    drop(along);
    Some((grown(learner, &room, global)?, truth, right as f32 / all.max(1) as f32))
}

/// The octree that the light network makes of a room, grown by its own predictions.
fn grown(learner: &Learner, room: &VariedRoom, global: &[f32]) -> Option<LightOctree> {
    let input = room.input(&learner.network, SEED).ok()?;
    let output = learner.light.average.forward(&input, Some(tensor(global)), Growth::Predicted).ok()?;
    Some(output.into_light().ok()?.0)
}

/// PSNR of the panoramas of a photo's true octree and of its shell.
fn bounds(sample: &Sample, network: &LightNetConfig) -> [Option<f32>; 2] {
    let Ok(room) = VariedRoom::new(sample, &Variation::NONE, KnownDepth::True) else { return [None; 2] };
    let truth = room.truth(network).ok().and_then(|truth| mean(views_db(&truth, &sample.views, 1.0).into_iter()));
    let options = EstimateOptions { octree_depth: Some(network.depth), up: sample.up, ..EstimateOptions::default() };
    let shell = estimate(room.working, None, &options, &mut |_| ()).ok();
    [truth, shell.and_then(|scene| mean(views_db(&scene.light, &sample.views, 1.0).into_iter()))]
}

/// PSNR of each panorama that stands in the cube, its place moved with the room's scale.
fn views_db(light: &LightOctree, views: &[NovelView], scale: f32) -> Vec<f32> {
    let inside = views.iter().filter(|view| light.cube.contains(view.position_m * scale));
    let viewers = Viewers::new(light);
    inside.map(|view| psnr_db(&seen_from(&viewers, view, scale), &view.radiance)).collect()
}

fn seen_from(viewers: &Viewers, view: &NovelView, scale: f32) -> RadianceImage {
    let moved = NovelView { position_m: view.position_m * scale, ..view.clone() };
    let rays = nets::light::Rays::of_panorama(&moved);
    let mut samples = vec![cone::Sample::default(); rays.len()];
    viewers.at(moved.position_m).trace_batch(&rays.cones, &mut samples);
    let pixels = samples.into_iter().map(|sample| sample.radiance).collect();
    RadianceImage::new(view.radiance.width(), view.radiance.height(), pixels)
}

/// Of pictures as a screen shows them: sRGB-coded, clipped to [0, 1].
fn psnr_db(found: &RadianceImage, expected: &RadianceImage) -> f32 {
    let coded = |c: f32| f64::from(srgb_from_linear(c.clamp(0.0, 1.0)));
    let pairs = found.pixels().as_flattened().iter().zip(expected.pixels().as_flattened());
    let squares: f64 = pairs.map(|(&a, &b)| (coded(a) - coded(b)).powi(2)).sum();
    let mean = squares / (3 * expected.pixels().len()) as f64;
    (-10.0 * mean.max(1e-12).log10()) as f32
}

/// Absolute relative error and δ₁ over the pixels whose depth is known; nothing where none is.
fn depth_figures(found_m: &DepthMap, true_m: &DepthMap) -> (Option<f32>, Option<f32>) {
    let known = || found_m.pixels().iter().zip(true_m.pixels()).filter(|(_, z)| z.is_finite() && **z > 0.0);
    let within = |(a, b): (&f32, &f32)| f32::from(u8::from((a / b).max(b / a) < 1.25));
    (mean(known().map(|(a, b)| (a - b).abs() / b)), mean(known().map(within)))
}

fn tensor(global: &[f32]) -> Tensor<2> {
    Tensor::from_data(TensorData::new(global.to_vec(), [1, global.len()]), &Device::flex())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_those_of_their_formulas() {
        let grey = |value: f32| RadianceImage::from_fn(8, 4, |_, _| [value; 3]);
        // sRGB of 0.214041 is 0.5; white stays white beyond 1.
        let db = psnr_db(&grey(0.214_041_14), &grey(7.0));
        assert!((db - 6.0206).abs() < 1e-3, "{db}");
        let truth = DepthMap::new(4, 1, vec![1.0, 2.0, 4.0, 0.0]);
        let found = DepthMap::new(4, 1, vec![1.2, 1.0, 4.0, 9.0]);
        let (abs_rel, delta1) = depth_figures(&found, &truth);
        assert!((abs_rel.unwrap_or(0.0) - 0.7 / 3.0).abs() < 1e-6 && (delta1.unwrap_or(0.0) - 2.0 / 3.0).abs() < 1e-6);
        assert_eq!(depth_figures(&found, &DepthMap::new(4, 1, vec![0.0; 4])), (None, None));
    }
}
