//! A network with its optimiser and its averaged weights.

use burn::module::Module;
use burn::tensor::Gradients;
use lo_nets::Adam;

use crate::error::StepError;
use crate::weights::{averaged, first_non_finite, gradient_norm, scale_gradient};

/// Steps between updates of the average. An update costs as much as an optimiser step, and the average moves slowly.
const AVERAGE_EVERY: u64 = 8;

/// Options of an optimiser's step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Descent {
    /// Norm to which the gradient is clipped.
    pub clip_norm: f32,
    /// Decay per step of the weights' average.
    pub ema_decay: f64,
}

/// A network, its optimiser, and the exponential moving average of its weights.
#[derive(Debug)]
pub(crate) struct NetTrainer<M> {
    pub net: M,
    pub average: M,
    pub adam: Adam,
    /// Steps since the average began.
    pub steps: u64,
}

impl<M: Module> NetTrainer<M> {
    /// Takes one optimiser step and returns the gradient's norm before clipping to `descent.clip_norm`.
    ///
    /// `share` scales the learning rate of each parameter by its name.
    ///
    /// # Errors
    /// [`StepError::Gradient`] if the gradient is NaN or infinite.
    pub fn descend(
        &mut self,
        name: &str,
        gradients: &mut Gradients,
        learning_rate: f64,
        share: &dyn Fn(&str) -> f32,
        descent: Descent,
    ) -> Result<f32, StepError> {
        let norm = gradient_norm(&self.net, gradients)
            .map_err(|layer| StepError::Gradient { parameter: format!("{name}.{layer}"), losses: Vec::new() })?;
        if norm > descent.clip_norm {
            scale_gradient(&self.net, gradients, descent.clip_norm / norm);
        }
        self.net = self.adam.step_by(self.net.clone(), gradients, learning_rate, share);
        // burn applies pending running statistics on the thread that next uses the module: force it on this thread.
        let _ = self.net.valid();
        self.steps += 1;
        if self.steps.is_multiple_of(AVERAGE_EVERY) {
            let times = (self.steps / AVERAGE_EVERY) as f64;
            let decay = descent.ema_decay.powi(AVERAGE_EVERY as i32).min(times / (9.0 + times));
            self.average = averaged(self.average.clone(), &self.net, decay);
        }
        Ok(norm)
    }

    /// Checks that all weights are finite.
    ///
    /// # Errors
    /// [`StepError::Weights`] with the first parameter that is not.
    pub fn check(&self, name: &str) -> Result<(), StepError> {
        first_non_finite(&self.net)
            .map_or(Ok(()), |layer| Err(StepError::Weights { parameter: format!("{name}.{layer}") }))
    }
}
