use std::sync::Arc;

use burn::tensor::Tensor;
use lo_octree::{MAX_ALPHA, Octree};

use crate::host::{Kernel, Number, unary};
use crate::light::LightInput;
use crate::light::channels::{LIGHT_CHANNELS, MAX_RADIANCE, RAW_CHANNELS};

/// The regression module's outputs before anything is learned: the first guess, opaque by `ALPHA_LOGIT`, an error of 0.3, and a first guess of which the
/// single map has two fifths.
pub(crate) const RAW_BIAS: [f32; RAW_CHANNELS] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, -0.405];

/// Logit of the opacity of what nothing is known of: surfaces are opaque.
const ALPHA_LOGIT: f64 = 4.0;

/// Known radiance is corrected by a factor of at most e^this above the finest depth: there a node also holds what is not seen of it.
const COARSE_LOG_GAIN: f64 = 1.0;

/// What the photo says of nodes: linear RGB, logit of opacity, and how far to trust it (0 not at all, 1 wholly), one row a node.
#[derive(Debug)]
pub struct KnownLight {
    rows: Vec<[f32; 5]>,
    /// Logarithm of the ambient light, which what is not seen begins with.
    log_ambient: [f32; 3],
    /// Logarithm of what the single map shows in a node's direction, less that of the ambient light.
    log_map_ratio: Vec<[f32; 3]>,
    max_log_gain: f64,
}

impl KnownLight {
    /// Of the non-empty nodes of `depth` of `octree`, as far as `visible` has the same nodes; what `input` says is known.
    pub fn of_level(octree: &Octree, depth: u32, input: &LightInput) -> Arc<Self> {
        let visible = &input.visible;
        let level = &octree.levels()[depth as usize];
        let known = |key: u32| {
            let row = visible.row(depth, key)?;
            let [r, g, b, alpha] = visible.rgba[depth as usize][row];
            let alpha = alpha.clamp(1.0 - MAX_ALPHA, MAX_ALPHA);
            let trust = f32::from(visible.seen[depth as usize][row]) / 255.0;
            Some([r.min(MAX_RADIANCE), g.min(MAX_RADIANCE), b.min(MAX_RADIANCE), (alpha / (1.0 - alpha)).ln(), trust])
        };
        let rows = level.row_keys().map(|key| known(key).unwrap_or([0.0; 5])).collect();
        let middle_m = |key| lo_octree::node_middle_m(visible.cube, depth, key);
        let log_ambient = input.ambient.map(f32::ln);
        let log_map_ratio = |key| {
            let map = input.map_towards(middle_m(key));
            std::array::from_fn(|c| map[c].ln() - log_ambient[c])
        };
        let log_map_ratio = level.row_keys().map(log_map_ratio).collect();
        let max_log_gain = if depth == visible.octree.depth() { 0.0 } else { COARSE_LOG_GAIN };
        Arc::new(Self { rows, log_ambient, log_map_ratio, max_log_gain })
    }

    /// How far each node is known from the photo, 0 to 1.
    pub fn trust(&self) -> impl Iterator<Item = f32> + '_ {
        self.rows.iter().map(|row| row[4])
    }
}

/// From the regression module's `raw[nodes, 9]` to `[nodes, 5]`: linear RGB in [0, [`MAX_RADIANCE`]], opacity in
/// [0, 1], and the expected error of log(1 + radiance), at least 0.
///
/// What is known enters as a residual: `trust · known · e^gain + (1 − trust) · first guess · e^guess`, so that what the photo saw is right before
/// anything is learned, and stays so at the finest depth, where the gain is 0; and what it did not see begins with a first guess, in whose measure it is
/// learned: `ambient^(1 − share) · map^share`, the share a sigmoid of the last output.
#[derive(Clone, Debug)]
pub struct NodeLight(pub Arc<KnownLight>);

impl NodeLight {
    /// `raw[nodes, 9] → [nodes, 5]`.
    pub fn apply(self, raw: Tensor<2>) -> Tensor<2> {
        unary(raw, self)
    }

    /// The same by burn's own operations, to check the kernel.
    #[cfg(test)]
    fn composed(&self, raw: Tensor<2>) -> Tensor<2> {
        use burn::tensor::{TensorData, activation};

        let nodes = self.0.rows.len();
        let flat = self.0.rows.as_flattened().to_vec();
        let known = Tensor::<2>::from_data(TensorData::new(flat, [nodes, 5]), (&raw.device(), raw.dtype()));
        let columns = |of: &Tensor<2>, from: usize, to: usize| of.clone().slice([0..nodes, from..to]);
        let trust = columns(&known, 4, 5);
        let doubt = trust.clone().neg() + 1.0;
        let constant = |flat: Vec<f32>, rows| {
            Tensor::<2>::from_data(TensorData::new(flat, [rows, 3]), (&raw.device(), raw.dtype()))
        };
        let ambient = constant(self.0.log_ambient.to_vec(), 1);
        let ratio = constant(self.0.log_map_ratio.as_flattened().to_vec(), nodes);
        let first_guess = ambient + activation::sigmoid(columns(&raw, 8, 9)) * ratio;
        let log = (columns(&raw, 0, 3) + first_guess).clamp_max(f64::from(MAX_RADIANCE).ln());
        let gain = columns(&raw, 3, 6).tanh() * self.0.max_log_gain;
        let radiance = trust.clone() * columns(&known, 0, 3) * gain.exp() + doubt.clone() * log.exp();
        let logit = columns(&raw, 6, 7) + doubt * ALPHA_LOGIT + trust * columns(&known, 3, 4);
        let alpha = activation::sigmoid(logit);
        Tensor::cat(
            vec![radiance.clamp_max(f64::from(MAX_RADIANCE)), alpha, activation::softplus(columns(&raw, 7, 8), 1.0)],
            1,
        )
    }
}

/// log(1 + eˣ) and its derivative.
fn softplus(x: f64) -> (f64, f64) {
    (x.max(0.0) + (-x.abs()).exp().ln_1p(), 1.0 / (1.0 + (-x).exp()))
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// The five outputs of a node, and their derivatives by the inputs that move one of them alone: three by the radiance's own guesses, three by the gains, one
/// by the opacity's, one by the error's. Then those of the three radiances by the map's share.
fn node_light(
    raw: [f64; RAW_CHANNELS],
    node: usize,
    light: &KnownLight,
) -> ([f64; LIGHT_CHANNELS], [f64; MOVES.len()], [f64; 3]) {
    let known = &light.rows[node];
    let (mut out, mut slope, mut by_share) = ([0.0; LIGHT_CHANNELS], [0.0; MOVES.len()], [0.0; 3]);
    let trust = f64::from(known[4]);
    let share = sigmoid(raw[8]);
    let (most, max_log_gain) = (f64::from(MAX_RADIANCE), light.max_log_gain);
    for c in 0..3 {
        let ratio = f64::from(light.log_map_ratio[node][c]);
        let log_guess = raw[c] + f64::from(light.log_ambient[c]) + share * ratio;
        let guessed = (1.0 - trust) * log_guess.min(most.ln()).exp();
        let squashed = raw[3 + c].tanh();
        let seen = trust * f64::from(known[c]) * (max_log_gain * squashed).exp();
        out[c] = seen + guessed;
        if out[c] >= most {
            out[c] = most;
        } else {
            slope[c] = guessed;
            slope[3 + c] = seen * max_log_gain * (1.0 - squashed * squashed);
            by_share[c] = guessed * ratio * share * (1.0 - share);
        }
    }
    let opacity = sigmoid(raw[6] + (1.0 - trust) * ALPHA_LOGIT + trust * f64::from(known[3]));
    out[3] = opacity;
    slope[6] = opacity * (1.0 - opacity);
    (out[4], slope[7]) = softplus(raw[7]);
    (out, slope, by_share)
}

/// Which output each of the inputs moves that move one alone.
const MOVES: [usize; RAW_CHANNELS - 1] = [0, 1, 2, 0, 1, 2, 3, 4];

fn row<T: Number>(raw: &[T]) -> [f64; RAW_CHANNELS] {
    std::array::from_fn(|c| raw[c].wide())
}

impl Kernel for NodeLight {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        assert_eq!(sizes[0], [self.0.rows.len(), RAW_CHANNELS], "nine values for each node");
        [sizes[0][0], LIGHT_CHANNELS]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        self.output_size(sizes);
        let rows = inputs[0].chunks_exact(RAW_CHANNELS).enumerate();
        rows.flat_map(|(node, raw)| node_light(row(raw), node, &self.0).0.map(T::of)).collect()
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], _: &[[usize; 2]], gradient: &[T], _: &[bool]) -> Vec<Vec<T>> {
        let rows = inputs[0].chunks_exact(RAW_CHANNELS).zip(gradient.chunks_exact(LIGHT_CHANNELS)).enumerate();
        let by_raw = rows.flat_map(|(node, (raw, gradient))| {
            let (_, slope, by_share) = node_light(row(raw), node, &self.0);
            let share = (0..3).map(|c| by_share[c] * gradient[c].wide()).sum();
            slope.into_iter().zip(MOVES).map(|(slope, output)| slope * gradient[output].wide()).chain([share]).map(T::of)
        });
        vec![by_raw.collect()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradients, assert_same_function};

    fn known(max_log_gain: f64) -> Arc<KnownLight> {
        let rows = (0..20).map(|i| [i as f32, 0.5, 0.0, 2.0, [0.0, 0.4, 1.0][i % 3]]).collect();
        let log_map_ratio = (0..20).map(|i| [0.5, 0.2 + 0.1 * i as f32, -1.5]).collect();
        Arc::new(KnownLight { rows, log_ambient: [-0.7, 0.1, 0.4], log_map_ratio, max_log_gain })
    }

    #[test]
    fn kernel_is_the_composition() {
        for light in [0.0, 0.7].map(|gain| NodeLight(known(gain))) {
            assert_same_function(&[[20, 9]], |[raw]| light.clone().apply(raw), |[raw]| light.composed(raw));
            assert_gradients(&[[20, 9]], |[raw]| light.clone().apply(raw));
        }
    }

    #[test]
    fn trusted_radiance_is_kept_and_nothing_is_infinite() {
        let raw = |gain, share| [500.0, -500.0, 2.0, gain, gain, gain, 900.0, 900.0, share];
        let told = |known: [f32; 5], max_log_gain| KnownLight {
            rows: vec![known],
            log_ambient: [0.5f32, 0.2, 1.5].map(f32::ln),
            log_map_ratio: vec![[0.0, 1.0, 3f32.ln()]],
            max_log_gain,
        };
        let seen = [2.0, 0.25, 0.0, 9.0, 1.0];
        assert_eq!(node_light(raw(0.0, 0.0), 0, &told(seen, 1.0)).0[..3], [2.0, 0.25, 0.0]);
        assert_eq!(node_light(raw(9.0, 5.0), 0, &told(seen, 0.0)).0[..3], [2.0, 0.25, 0.0]);
        assert!((node_light(raw(9.0, 0.0), 0, &told(seen, 1.0)).0[0] / 2.0 - 1f64.exp()).abs() < 1e-6);
        let (out, ..) = node_light(raw(0.0, 0.0), 0, &told([0.0; 5], 1.0));
        assert!((out[0] - f64::from(MAX_RADIANCE)).abs() < 0.1 && out[1] >= 0.0 && out[3] <= 1.0);
        // Half of the map's 4.5, half of the ambient 1.5, by logarithm.
        assert!((out[2] - 1.5 * 3f64.sqrt() * 2f64.exp()).abs() < 1e-5, "{}", out[2]);
        assert!(out.iter().all(|v| v.is_finite()));
    }
}
