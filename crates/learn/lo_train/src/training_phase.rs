use std::fmt;

use lo_baselines::System;
use lo_events::Stage;

/// A phase of training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TrainingPhase {
    /// The networks that it trains.
    pub networks: TrainedNetworks,
    /// Number of the phase among those that train the same networks, from 1.
    pub number: usize,
    /// Number of phases that train the same networks.
    pub of: usize,
}

/// The networks that a training phase trains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TrainedNetworks {
    /// The depth network.
    Depth,
    /// The light network.
    Light,
    /// The depth and the light network together.
    Joint,
    /// The expected-light network.
    Expected,
    /// The network of a system that the paper compares with.
    Baseline(System),
}

impl TrainingPhase {
    /// Returns the stage that reports the phase's steps: photos or batches of them.
    pub fn stage(&self) -> Stage {
        self.to_string().into()
    }
}

/// The name used in logs and errors, and of the stage: `joint`, `light 2/3`.
impl fmt::Display for TrainingPhase {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self.networks {
            TrainedNetworks::Depth => "depth",
            TrainedNetworks::Light => "light",
            TrainedNetworks::Joint => "joint",
            TrainedNetworks::Expected => "expected light",
            TrainedNetworks::Baseline(system) => system.name(),
        })?;
        if self.of > 1 { write!(f, " {}/{}", self.number, self.of) } else { Ok(()) }
    }
}
