//! A network while it learns.

use burn::module::Module;
use burn::tensor::Gradients;
use lo_nets::Adam;

use crate::config::TrainConfig;
use crate::error::Fault;
use crate::weights::{averaged, first_not_finite, gradient_norm, scale_gradient};

/// Weights enter the average once in so many steps: it moves slowly, and each time costs as much as an optimiser's step.
const AVERAGE_EVERY: u64 = 8;

/// A network, its optimiser and the average of its weights.
#[derive(Debug)]
pub(crate) struct Trained<M> {
    pub net: M,
    pub average: M,
    pub adam: Adam,
    /// Steps since the average began.
    pub steps: u64,
}

impl<M: Module> Trained<M> {
    /// One step along a gradient, shortened to `clip`; each parameter goes `share` of the learning rate. Gives the norm.
    pub fn descend(
        &mut self,
        name: &str,
        gradients: &mut Gradients,
        learning_rate: f64,
        share: &dyn Fn(&str) -> f32,
        config: &TrainConfig,
    ) -> Result<f32, Fault> {
        let norm = gradient_norm(&self.net, gradients)
            .map_err(|layer| Fault::Gradient { parameter: format!("{name}.{layer}"), losses: Vec::new() })?;
        if norm > config.clip_norm {
            scale_gradient(&self.net, gradients, config.clip_norm / norm);
        }
        self.net = self.adam.step_by(self.net.clone(), gradients, learning_rate, share);
        // Running statistics wait for the next use on the same thread; the next step may be on another one.
        let _ = self.net.valid();
        self.steps += 1;
        if self.steps.is_multiple_of(AVERAGE_EVERY) {
            let times = (self.steps / AVERAGE_EVERY) as f64;
            let decay = config.ema_decay.powi(AVERAGE_EVERY as i32).min(times / (9.0 + times));
            self.average = averaged(self.average.clone(), &self.net, decay);
        }
        Ok(norm)
    }

    /// The first weight that is no number.
    pub fn check(&self, name: &str) -> Result<(), Fault> {
        first_not_finite(&self.net).map_or(Ok(()), |layer| Err(Fault::Weights { parameter: format!("{name}.{layer}") }))
    }
}
