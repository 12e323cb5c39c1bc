//! A baseline in training, and its checkpoint.

use std::path::{Path, PathBuf};

use burn::module::Module;
use burn::tensor::Device;
use lo_baselines::{Baseline, BaselineExample, BaselineNet, FeatureShape, System};
use lo_nets::Adam;
use lo_nets::checkpoint::{Checkpoint, Precision};
use lo_nets::conv::in_pool;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::error::{StepError, TrainError};
use crate::learner::Progress;
use crate::net_trainer::{Descent, NetTrainer};

/// Name of the trained weights in a checkpoint, and of the run's state in the checkpoint's state. The averages are
/// stored as a baseline's file has them, so that a checkpoint is also a weights file.
const TRAINING: &str = "training";
const ADAM: &str = "training.adam";

/// State of a run beside the weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BaselineState {
    pub system: System,
    pub features: FeatureShape,
    /// [`fingerprint`](lo_baselines::fingerprint) of the depth network.
    pub depth_net: String,
    pub seed: u64,
    /// Completed steps.
    pub step: u64,
    /// Steps since the average began.
    pub averaged: u64,
    /// Rollbacks so far; they change the random choices that follow.
    pub setbacks: u64,
    /// Key of the examples, hexadecimal.
    pub examples: String,
    pub log_bytes: u64,
}

/// A baseline's network with its optimiser and average, and the run's state.
pub(super) struct BaselineTrainer {
    pub net: NetTrainer<BaselineNet>,
    pub state: BaselineState,
}

fn recording() -> Device {
    Device::flex().autodiff()
}

impl BaselineTrainer {
    /// Creates an untrained network.
    pub fn new(state: BaselineState) -> Self {
        let BaselineState { system, features, seed, .. } = state;
        let [net, average] =
            [recording(), Device::flex()].map(|device| BaselineNet::new(system, features, seed, &device));
        Self { net: NetTrainer { net, average, adam: Adam::default(), steps: 0 }, state }
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// Unreadable files, and files that are not the checkpoint of a baseline's run.
    pub fn read(path: &Path) -> Result<Self, TrainError> {
        let file = Checkpoint::read(path)?;
        let state: BaselineState = serde_json::from_value(file.state[TRAINING].clone()).map_err(|error| {
            let reason = format!("not the checkpoint of a baseline's run: {error}");
            TrainError::NotThisRun { path: PathBuf::from(path), reason }
        })?;
        let blank = || BaselineNet::new(state.system, state.features, 0, &Device::flex());
        let net = file.load_module(TRAINING_NET, blank())?.train();
        let average = file.load_module(lo_baselines::BASELINE, blank())?;
        let net = NetTrainer { net, average, adam: file.load_adam(ADAM)?, steps: state.averaged };
        Ok(Self { net, state })
    }

    /// Writes the checkpoint atomically.
    pub fn write(&mut self, path: &Path) -> Result<(), TrainError> {
        let mut file = Checkpoint::default();
        self.exported().add_to(&mut file);
        file.add_module(TRAINING_NET, &self.net.net);
        file.add_adam(ADAM, &self.net.adam);
        self.state.averaged = self.net.steps;
        file.state[TRAINING] = json!(self.state);
        Ok(file.write(path, Precision::Full)?)
    }

    /// Returns the averaged network as a baseline.
    pub fn exported(&self) -> Baseline {
        let BaselineState { system, features, ref depth_net, .. } = self.state;
        Baseline::new(system, self.net.average.clone(), features, depth_net.clone())
    }

    /// Takes one step. `progress` is the share of training that is done.
    ///
    /// # Errors
    /// Gradients that are not finite.
    pub fn step(
        &mut self,
        batch: &[&BaselineExample],
        progress: f32,
        learning_rate: f64,
        descent: Descent,
    ) -> Result<Progress, StepError> {
        in_pool(|| {
            let losses = self.net.net.losses(batch, progress, &recording());
            let mut gradients = losses.total().backward();
            let name = self.state.system.name();
            let norm = self.net.descend(name, &mut gradients, learning_rate, &|_| 1.0, descent)?;
            Ok(Progress { losses: losses.values(), norms: vec![("gradient", norm)] })
        })
    }
}

const TRAINING_NET: &str = "training.net";
