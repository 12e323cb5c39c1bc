use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, Param};
use burn::tensor::{Gradients, Tensor, TensorData};
use rayon::prelude::*;

use crate::checkpoint::floats;
use crate::parameter_path::ParameterPath;

/// Adam optimiser (Kingma & Ba 2015) with PyTorch's defaults.
///
/// Moments are stored by parameter name, so that they can be saved and matched to the same weights when loaded. Each
/// parameter is updated in one pass, where burn's own optimiser runs a dozen tensor operations.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Decay rate of the mean gradient.
    pub beta1: f32,
    /// Decay rate of the mean squared gradient.
    pub beta2: f32,
    /// Added to the root of the mean squared gradient.
    pub epsilon: f32,
    /// Number of steps taken.
    pub(crate) steps: u64,
    pub(crate) moments: BTreeMap<String, AdamMoments>,
}

/// Mean gradient and mean squared gradient of a parameter's values.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct AdamMoments {
    pub first: Vec<f32>,
    pub second: Vec<f32>,
}

impl Default for Adam {
    fn default() -> Self {
        Self { beta1: 0.9, beta2: 0.999, epsilon: 1e-8, steps: 0, moments: BTreeMap::new() }
    }
}

impl Adam {
    /// Returns the module after one step. Parameters without a gradient do not change.
    pub fn step<M: Module>(&mut self, module: M, gradients: &Gradients, learning_rate: f64) -> M {
        self.step_by(module, gradients, learning_rate, &|_| 1.0)
    }

    /// Returns the module after one step, with the learning rate multiplied by `share` of each parameter's name.
    pub fn step_by<M: Module>(
        &mut self,
        module: M,
        gradients: &Gradients,
        learning_rate: f64,
        share: &dyn Fn(&str) -> f32,
    ) -> M {
        self.steps += 1;
        let steps = self.steps.min(i32::MAX as u64) as i32;
        let (first, second) = (1.0 - f64::from(self.beta1).powi(steps), 1.0 - f64::from(self.beta2).powi(steps));
        let update = UpdateRule {
            beta1: self.beta1,
            beta2: self.beta2,
            epsilon: self.epsilon,
            rate: (learning_rate / first) as f32,
            second_scale: (1.0 / second) as f32,
        };
        module.map(&mut StepMapper {
            update,
            share,
            moments: &mut self.moments,
            gradients,
            path: ParameterPath::default(),
        })
    }

    /// Returns the number of steps taken.
    pub fn steps(&self) -> u64 {
        self.steps
    }
}

/// Constants of one step.
struct UpdateRule {
    beta1: f32,
    beta2: f32,
    epsilon: f32,
    /// Learning rate with the bias correction of the mean gradient.
    rate: f32,
    /// Bias correction of the mean squared gradient.
    second_scale: f32,
}

impl UpdateRule {
    fn apply(&self, share: f32, values: &mut [f32], gradient: &[f32], moments: &mut AdamMoments) {
        const CHUNK: usize = 1 << 14;
        let rate = self.rate * share;
        let moments = moments.first.par_chunks_mut(CHUNK).zip(moments.second.par_chunks_mut(CHUNK));
        let chunks = values.par_chunks_mut(CHUNK).zip(gradient.par_chunks(CHUNK)).zip(moments);
        chunks.for_each(|((values, gradient), (first, second))| {
            for i in 0..values.len() {
                let g = gradient[i];
                first[i] = self.beta1 * first[i] + (1.0 - self.beta1) * g;
                second[i] = self.beta2 * second[i] + (1.0 - self.beta2) * g * g;
                values[i] -= rate * first[i] / ((second[i] * self.second_scale).sqrt() + self.epsilon);
            }
        });
    }
}

struct StepMapper<'a> {
    update: UpdateRule,
    share: &'a dyn Fn(&str) -> f32,
    moments: &'a mut BTreeMap<String, AdamMoments>,
    gradients: &'a Gradients,
    path: ParameterPath,
}

impl ModuleMapper for StepMapper<'_> {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.path.enter(name, container);
    }

    fn exit_module(&mut self, _: &str, container: &str) {
        self.path.leave(container);
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let Some(gradient) = param.val().grad(self.gradients) else { return param };
        let (id, tensor, mapper) = param.consume();
        let (device, dims) = (tensor.device(), tensor.dims());
        let mut values = floats(tensor.inner());
        let name = self.path.name();
        let share = (self.share)(&name);
        let moments = self.moments.entry(name).or_default();
        if moments.first.len() != values.len() {
            *moments = AdamMoments { first: vec![0.0; values.len()], second: vec![0.0; values.len()] };
        }
        self.update.apply(share, &mut values, &floats(gradient), moments);
        let tensor = Tensor::from_data(TensorData::new(values, dims), &device);
        Param::from_mapped_value(id, tensor.require_grad(), mapper)
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;

    use super::*;
    use crate::layers::Linear;

    #[test]
    fn it_steps_like_the_formula_in_f64() {
        let device = Device::flex().autodiff();
        let mut net = Linear::new([2, 1], &mut lo_random::stream(1, "test", 0), &device);
        let mut adam = Adam::default();
        let mut expected: Vec<f64> = floats(net.weights.val().inner()).into_iter().map(f64::from).collect();
        let (mut m, mut v) = ([0.0f64; 2], [0.0f64; 2]);
        for step in 1..=5 {
            let x = [0.3 * f64::from(step), -1.7];
            let input = Tensor::<2>::from_data(TensorData::new(x.to_vec(), [1, 2]), &device);
            let gradients = net.forward(input).square().sum().backward();
            net = adam.step(net, &gradients, 0.05);
            let y: f64 = (0..2).map(|i| x[i] * expected[i]).sum();
            for i in 0..2 {
                let g = 2.0 * y * x[i];
                m[i] = 0.9 * m[i] + 0.1 * g;
                v[i] = 0.999 * v[i] + 0.001 * g * g;
                let (m, v) = (m[i] / (1.0 - 0.9f64.powi(step)), v[i] / (1.0 - 0.999f64.powi(step)));
                expected[i] -= 0.05 * m / (v.sqrt() + 1e-8);
            }
        }
        let got = floats(net.weights.val().inner());
        assert!(got.iter().zip(expected).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-5), "{got:?}");
        assert_eq!(adam.moments.keys().collect::<Vec<_>>(), ["weights"]);
        // A learning rate of 0 changes nothing.
        let input = Tensor::<2>::from_data([[1.0, 2.0]], &device);
        let gradients = net.forward(input).square().sum().backward();
        let held = adam.step_by(net, &gradients, 0.05, &|name| if name == "weights" { 0.0 } else { 1.0 });
        assert_eq!(floats(held.weights.val().inner()), got);
    }
}
