use std::f32::consts::PI;

use burn::tensor::{Tensor, TensorData, activation};
use lo_cone::{Cone, Settings};
use lo_geometry::Vec3;
use lo_octree::LightOctree;
use serde::{Deserialize, Serialize};

use crate::energy::{self, Irradiance, NORMALS};
use crate::light::{LightError, LightOutput, Rays};
use crate::tone::tone;

/// Weights of the light network's losses (`docs/method.md` §6). Every field has a default.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightLossConfig {
    /// `L_octree`: cross-entropy of occupied and empty nodes, summed over the depths.
    pub octree: f32,
    /// λ_li: squared difference of log(1 + radiance) over rays of novel views.
    pub novel_radiance: f32,
    /// Squared difference of tone-mapped radiance over rays of novel views. Not in the paper: with log(1 + radiance)
    /// alone, a lamp of uncertain position brightens the whole room.
    pub novel_tone: f32,
    /// Difference of the irradiance at novel views, integrated over the rays: squared difference of its logarithm, plus
    /// twice its angle in colour. Not in the paper: without it, lamps of uncertain position vanish.
    pub novel_irradiance: f32,
    /// λ_ld: squared difference of log(1 + distance in metres) over rays of novel views.
    pub novel_distance: f32,
    /// `L_visible`: as λ_li, over rays of the photo.
    pub visible_radiance: f32,
    /// `L_visible`: as λ_ld, over rays of the photo.
    pub visible_distance: f32,
    /// Squared difference of log(1 + radiance) of the nodes, averaged over the depths. Not in the paper, which
    /// supervises radiance by rays alone. Nodes give a denser signal where the true octree is known.
    pub node_radiance: f32,
    /// Difference between expected and actual error of the nodes, which trains the confidence.
    pub node_error: f32,
}

impl Default for LightLossConfig {
    fn default() -> Self {
        Self {
            octree: 1.0,
            novel_radiance: 1.0,
            novel_tone: 0.0,
            novel_irradiance: 0.0,
            novel_distance: 0.1,
            visible_radiance: 0.25,
            visible_distance: 0.025,
            node_radiance: 1.0,
            node_error: 0.1,
        }
    }
}

/// Unweighted terms of the loss of one scene; each is a mean.
#[derive(Clone, Debug)]
pub struct LightLosses {
    /// Cross-entropy of occupied and empty nodes, summed over the depths.
    pub octree: Tensor<1>,
    /// Radiance and distance over rays of novel views.
    pub novel: RayLosses,
    /// Irradiance at the novel views.
    pub novel_irradiance: Tensor<1>,
    /// Radiance and distance over rays of the photo.
    pub visible: RayLosses,
    /// Radiance of the nodes.
    pub node_radiance: Tensor<1>,
    /// Expected errors of the nodes.
    pub node_error: Tensor<1>,
}

/// Losses over rays.
#[derive(Clone, Debug)]
pub struct RayLosses {
    /// Mean squared difference of log(1 + radiance).
    pub radiance: Tensor<1>,
    /// Mean squared difference of tone-mapped radiance.
    pub tone: Tensor<1>,
    /// Mean squared difference of log(1 + distance in metres), over the rays whose distance is known.
    pub distance: Tensor<1>,
}

impl LightLosses {
    /// Compares the output with the true octree, rays of panoramas and rays of the photo.
    ///
    /// # Errors
    /// A true octree of another cube; tracing settings out of range.
    pub fn new(
        output: &LightOutput,
        truth: &LightOctree,
        novel: &Rays,
        visible: &Rays,
        settings: Settings,
    ) -> Result<Self, LightError> {
        if truth.cube != output.cube {
            return Err(LightError::Cubes { truth: truth.cube, output: output.cube });
        }
        let (node_radiance, node_error) = node_losses(output, truth);
        // Traces all rays at once.
        let cones: Vec<Cone> = novel.cones.iter().chain(visible.cones.iter()).copied().collect();
        let samples = output.rendered(&cones, settings)?;
        let seen = |from: usize, rays: &Rays| ray_losses(&samples, from, rays);
        Ok(Self {
            octree: octree_loss(output, truth),
            novel: seen(0, novel),
            novel_irradiance: irradiance_loss(&samples, novel),
            visible: seen(novel.len(), visible),
            node_radiance,
            node_error,
        })
    }

    /// Returns the weighted sum of the terms.
    pub fn total(&self, weights: &LightLossConfig) -> Tensor<1> {
        self.octree.clone() * weights.octree
            + self.novel.radiance.clone() * weights.novel_radiance
            + self.novel.tone.clone() * weights.novel_tone
            + self.novel_irradiance.clone() * weights.novel_irradiance
            + self.novel.distance.clone() * weights.novel_distance
            + self.visible.radiance.clone() * weights.visible_radiance
            + self.visible.distance.clone() * weights.visible_distance
            + self.node_radiance.clone() * weights.node_radiance
            + self.node_error.clone() * weights.node_error
    }
}

/// Compares irradiance by the first rays of `samples[_, 5]`, which cover the sphere around each origin evenly.
fn irradiance_loss(samples: &Tensor<2>, rays: &Rays) -> Tensor<1> {
    let mut origins: Vec<(Vec3, Vec<usize>)> = Vec::new();
    for (i, cone) in rays.cones.iter().enumerate() {
        match origins.iter_mut().find(|(origin, _)| *origin == cone.origin) {
            Some((_, members)) => members.push(i),
            None => origins.push((cone.origin, vec![i])),
        }
    }
    if origins.is_empty() {
        return zero(samples);
    }
    // Block structure: a ray contributes to the normals of its own origin only.
    let places = origins.len();
    let mut cosines = vec![0.0f32; rays.len() * places * NORMALS];
    for (place, (_, members)) in origins.iter().enumerate() {
        let solid_angle_sr = 4.0 * PI / members.len() as f32;
        let of_place = energy::cosines(members.iter().map(|&i| (rays.cones[i].direction, solid_angle_sr)));
        for (&i, row) in members.iter().zip(of_place.chunks_exact(NORMALS)) {
            cosines[(i * places + place) * NORMALS..][..NORMALS].copy_from_slice(row);
        }
    }
    let cosines = constant(cosines, [rays.len(), places * NORMALS], samples);
    let truth = constant(rays.radiance.as_flattened().to_vec(), [rays.len(), 3], samples);
    let seen = samples.clone().narrow(0, 0, rays.len()).narrow(1, 0, 3);
    let irradiance = |radiance: &Tensor<2>| -> Irradiance {
        let all = radiance.clone().transpose().matmul(cosines.clone());
        [0, 1, 2].map(|c| all.clone().narrow(0, c, 1).reshape([places, NORMALS]))
    };
    energy::difference(&irradiance(&seen), &irradiance(&truth))
}

fn constant<const D: usize>(values: Vec<f32>, size: [usize; D], like: &Tensor<2>) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, size), (&like.device(), like.dtype()))
}

fn zero(like: &Tensor<2>) -> Tensor<1> {
    constant(vec![0.0], [1], like)
}

/// Iterates over a depth's nodes: whether the node is non-empty, and its row in the truth (`None` where empty or
/// missing).
fn true_rows<'a>(
    output: &'a LightOutput,
    truth: &'a LightOctree,
    depth: u32,
) -> impl Iterator<Item = (bool, Option<usize>)> + 'a {
    let (level, true_level) = (&output.octree.levels()[depth as usize], &truth.octree.levels()[depth as usize]);
    level.keys.iter().zip(&level.rows).map(move |(&key, &row)| {
        let found = truth.octree.find(depth, key).and_then(|node| usize::try_from(true_level.rows[node]).ok());
        (row >= 0, found)
    })
}

/// Sums the mean cross-entropy of occupancy over the depths. Nodes missing in the truth are empty.
fn octree_loss(output: &LightOutput, truth: &LightOctree) -> Tensor<1> {
    let depths = output.octree.full_depth()..;
    let losses = depths.zip(&output.levels).map(|(depth, level)| {
        let labels: Vec<f32> =
            true_rows(output, truth, depth).map(|(_, row)| f32::from(u8::from(row.is_some()))).collect();
        let count = labels.len();
        let labels = constant(labels, [count, 1], &level.logits);
        // −log σ(x) = softplus(−x), −log(1 − σ(x)) = softplus(x) = x + softplus(−x)
        let below = activation::softplus(level.logits.clone().neg(), 1.0);
        (below + (labels.neg() + 1.0) * level.logits.clone()).mean()
    });
    losses.reduce(|a, b| a + b).expect("an octree has levels")
}

fn node_losses(output: &LightOutput, truth: &LightOctree) -> (Tensor<1>, Tensor<1>) {
    let (mut radiance, mut error) = (Vec::new(), Vec::new());
    for (depth, level) in (output.octree.full_depth()..).zip(&output.levels) {
        let (mut expected, mut known) = (Vec::new(), Vec::new());
        for (_, row) in true_rows(output, truth, depth).filter(|(nonempty, _)| *nonempty) {
            expected.extend(row.map_or([0.0; 3], |row| {
                let [r, g, b, _] = truth.rgba[depth as usize][row];
                [r.ln_1p(), g.ln_1p(), b.ln_1p()]
            }));
            known.push(f32::from(u8::from(row.is_some())));
        }
        let (rows, count) = (known.len(), known.iter().sum::<f32>());
        if count == 0.0 {
            continue;
        }
        let known = constant(known, [rows, 1], &level.light);
        let difference = level.light.clone().narrow(1, 0, 3).log1p() - constant(expected, [rows, 3], &level.light);
        let difference = difference * known.clone();
        radiance.push(difference.clone().square().sum() / (3.0 * count));
        let actual = difference.detach().abs().mean_dim(1);
        let expected_error = level.light.clone().narrow(1, 4, 1) * known;
        error.push((expected_error - actual).abs().sum() / count);
    }
    let like = &output.levels[0].light;
    let mean = |parts: Vec<Tensor<1>>| {
        let count = parts.len().max(1) as f32;
        parts.into_iter().reduce(|a, b| a + b).map_or_else(|| zero(like), |sum| sum / count)
    };
    (mean(radiance), mean(error))
}

/// Compares the rows of `samples[_, 5]` from `first` on with the rays' true values.
fn ray_losses(samples: &Tensor<2>, first: usize, rays: &Rays) -> RayLosses {
    if rays.is_empty() {
        return RayLosses { radiance: zero(samples), tone: zero(samples), distance: zero(samples) };
    }
    let samples = samples.clone().narrow(0, first, rays.len());
    let (seen, truth) =
        (samples.clone().narrow(1, 0, 3), constant(rays.radiance.as_flattened().to_vec(), [rays.len(), 3], &samples));
    let radiance = seen.clone().log1p() - truth.clone().log1p();
    let tone = tone(seen) - tone(truth);
    let is_known = |d: f32| d.is_finite() && d > 0.0;
    let count = rays.distance_m.iter().filter(|d| is_known(**d)).count().max(1);
    let known: Vec<f32> = rays.distance_m.iter().map(|&d| f32::from(u8::from(is_known(d)))).collect();
    let expected: Vec<f32> = rays.distance_m.iter().map(|&d| if is_known(d) { d.ln_1p() } else { 0.0 }).collect();
    let distance = samples.clone().narrow(1, 3, 1).log1p() - constant(expected, [rays.len(), 1], &samples);
    let distance = distance * constant(known, [rays.len(), 1], &samples);
    RayLosses {
        radiance: radiance.square().mean(),
        tone: tone.square().mean(),
        distance: distance.square().sum() / count as f32,
    }
}
