//! Progress of a run, as stored in its checkpoint.

use std::path::{Path, PathBuf};

use lo_dataset::LoaderState;
use lo_nets::checkpoint::{Checkpoint, Precision};
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::encoder_weights::EncoderOrigin;
use crate::error::TrainError;
use crate::learner::{Learner, LearnerState};

/// Key of the run's state in its checkpoint.
const STATE: &str = "training";

/// State of a run beside the weights.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct RunState {
    pub seed: u64,
    /// Current phase, from 0.
    pub phase: usize,
    /// Completed steps of the phase.
    pub step: u64,
    /// Completed steps of all phases.
    pub total_steps: u64,
    /// Rollbacks so far; they change the random choices that follow.
    pub setbacks: u64,
    /// Loader position of the next sample.
    pub position: LoaderState,
    /// Loader positions of samples that are buffered for a batch of their size.
    #[serde(default)]
    pub waiting: Vec<LoaderState>,
    /// Fingerprint of the dataset.
    pub fingerprint: u64,
    pub log_bytes: u64,
    pub learner: Option<LearnerState>,
    /// File of the initial encoder weights.
    #[serde(default)]
    pub encoder_origin: Option<EncoderOrigin>,
}

impl RunState {
    /// Returns the state of a new run.
    pub fn new(seed: u64, fingerprint: u64) -> Self {
        Self {
            seed,
            phase: 0,
            step: 0,
            total_steps: 0,
            setbacks: 0,
            position: LoaderState::default(),
            waiting: Vec::new(),
            fingerprint,
            log_bytes: 0,
            learner: None,
            encoder_origin: None,
        }
    }

    /// Writes the state, the networks and their optimisers atomically.
    pub fn write(&mut self, learner: &Learner, path: &Path) -> Result<(), TrainError> {
        let mut checkpoint = Checkpoint::default();
        self.learner = Some(learner.add_to(&mut checkpoint));
        checkpoint.state[STATE] = json!(self);
        Ok(checkpoint.write(path, Precision::Full)?)
    }

    /// Reads a run's checkpoint.
    ///
    /// # Errors
    /// Unreadable files; [`TrainError::NotThisRun`] for files without the state of a run.
    pub fn read(path: &Path) -> Result<(Learner, Self), TrainError> {
        let not_a_run = |reason: String| TrainError::NotThisRun { path: PathBuf::from(path), reason };
        let checkpoint = Checkpoint::read(path)?;
        let state: Self = serde_json::from_value(checkpoint.state[STATE].clone())
            .map_err(|error| not_a_run(format!("not the checkpoint of a training run: {error}")))?;
        let learner = state.learner.clone().ok_or_else(|| not_a_run("the checkpoint holds no networks".into()))?;
        Ok((Learner::from_checkpoint(checkpoint, &learner)?, state))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Reads the state of a checkpoint written before batches and `max_nodes`.
    #[test]
    fn the_state_of_a_former_checkpoint_is_read() {
        let header = r#"{"seed": 31, "phase": 1, "step": 40, "total_steps": 940, "setbacks": 2,
            "position": {"epoch": 3, "block": 7, "sample": 1}, "fingerprint": 81985529216486895, "log_bytes": 512,
            "learner": {"network": {"depth": 6, "full_depth": 4, "channels": 32, "max_channels": 256, "blocks": 2,
                "bottleneck": 4, "head_channels": 32, "channels_per_group": 4, "global_features": 64,
                "global_channels": 8, "lobes": false}, "averaged": [900, 40]}}"#;
        let state: RunState = serde_json::from_str(header).unwrap();
        assert_eq!((state.seed, state.phase, state.step, state.total_steps, state.setbacks), (31, 1, 40, 940, 2));
        assert_eq!((state.position.epoch, state.position.block), (3, 7));
        assert!(state.waiting.is_empty() && state.learner.is_some());
        // The keys are still the same.
        let written = serde_json::to_value(&state).unwrap();
        let former: serde_json::Value = serde_json::from_str(header).unwrap();
        for (name, value) in former.as_object().unwrap().iter().filter(|(name, _)| *name != "learner") {
            assert_eq!(&written[name], value, "{name}");
        }
        assert_eq!(written["learner"]["averaged"], former["learner"]["averaged"]);
    }
}
