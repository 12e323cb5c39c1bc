//! Where a run stands, in its checkpoint.

use std::path::{Path, PathBuf};

use lo_dataset::LoaderState;
use lo_nets::checkpoint::{Checkpoint, Precision};
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::encoder_weights::EncoderOrigin;
use crate::error::TrainError;
use crate::learner::{Learner, LearnerState};

/// Under which name a run's state is in its checkpoint.
const STATE: &str = "training";

/// Where a run stands, but for the weights.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct RunState {
    pub seed: u64,
    /// Which phase, counted from 0.
    pub phase: usize,
    /// Its steps that are done.
    pub step: u64,
    /// Steps of all phases that are done.
    pub total_steps: u64,
    /// How often the run went back; chance after it is another.
    pub setbacks: u64,
    /// Where the next sample stands, and in which dataset.
    pub position: LoaderState,
    /// Where samples before it stand that wait for others of their size.
    #[serde(default)]
    pub waiting: Vec<LoaderState>,
    pub fingerprint: u64,
    pub log_bytes: u64,
    pub learner: Option<LearnerState>,
    /// What the encoder began with.
    #[serde(default)]
    pub encoder_origin: Option<EncoderOrigin>,
}

impl RunState {
    /// At the beginning.
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

    /// Writes it with all that the networks need to go on, whole or not at all.
    pub fn write(&mut self, learner: &Learner, path: &Path) -> Result<(), TrainError> {
        let mut checkpoint = Checkpoint::default();
        self.learner = Some(learner.add_to(&mut checkpoint));
        checkpoint.state[STATE] = json!(self);
        Ok(checkpoint.write(path, Precision::Full)?)
    }

    /// Reads a run's checkpoint.
    pub fn read(path: &Path) -> Result<(Learner, Self), TrainError> {
        let not = |reason: String| TrainError::NotThisRun { path: PathBuf::from(path), reason };
        let checkpoint = Checkpoint::read(path)?;
        let state: Self = serde_json::from_value(checkpoint.state[STATE].clone())
            .map_err(|error| not(format!("its state is none of a run: {error}")))?;
        let learner = state.learner.clone().ok_or_else(|| not("its state has no networks".into()))?;
        Ok((Learner::from_checkpoint(checkpoint, &learner)?, state))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The state in the header of a checkpoint from before batches and `max_nodes`.
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
        // What is written has these names too.
        let written = serde_json::to_value(&state).unwrap();
        let former: serde_json::Value = serde_json::from_str(header).unwrap();
        for (name, value) in former.as_object().unwrap().iter().filter(|(name, _)| *name != "learner") {
            assert_eq!(&written[name], value, "{name}");
        }
        assert_eq!(written["learner"]["averaged"], former["learner"]["averaged"]);
    }
}
