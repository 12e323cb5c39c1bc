use std::fmt;

use serde::Serialize;

/// A stage of a long job.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
#[non_exhaustive]
pub enum Stage {
    /// Reading input files.
    ReadInput,
    /// Reading the networks' weights.
    ReadWeights,
    /// Resizing the photo and its depth to the working resolution.
    WorkingResolution,
    /// Comparing several photos of one room: consistency of their poses, and their relative exposures.
    Photos,
    /// The depth network predicting depth together with global lighting.
    DepthAndGlobalLight,
    /// Reading a third-party depth model.
    ReadDepthModel,
    /// Preparing a third-party depth model for photos of one size.
    PrepareDepthModel,
    /// A third-party depth model predicting depth.
    DepthModel,
    /// The depth network predicting global lighting and camera orientation, without depth.
    GlobalLight,
    /// The light network predicting the octree of the whole room.
    LightNetwork,
    /// Completing the room without a network.
    Completion,
    /// Building the octree.
    Octree,
    /// Aligning a panorama of the room with the photo.
    PanoramaMatch,
    /// Projecting a panorama of the room onto unobserved regions.
    PanoramaLaying,
    /// Rendering the panoramas of many probes.
    Probes,
    /// Computing the object's coarse shadow on real surfaces, for the light that they reflect back to it.
    CoarseShadow,
    /// Computing the object's radiosity, for its light on itself and its surroundings.
    Radiosity,
    /// Computing the object's shadow on real surfaces, and the light that it reflects onto them.
    FineShadow,
    /// Computing which parts of the object the camera sees.
    Visibility,
    /// Shading the visible parts of the object.
    Shading,
    /// Compositing photo, shadow and object.
    Composite,
    /// Writing results.
    Write,
    /// Generating rooms.
    GenerateRooms,
    /// Reading samples of a dataset.
    ReadSamples,
    /// Evaluating all methods on the photos of a dataset.
    EvaluatePhotos,
    /// A training phase; its steps are photos or batches of them.
    Training(TrainingPhase),
    /// Evaluating on scenes held out of training.
    Validation,
    /// Writing a checkpoint.
    Checkpoint,
}

/// A phase of training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct TrainingPhase {
    /// The networks that it trains.
    pub networks: TrainedNetworks,
    /// Number of the phase among those that train the same networks, from 1.
    pub number: usize,
    /// Number of phases that train the same networks.
    pub of: usize,
}

/// The networks that a training phase trains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum TrainedNetworks {
    /// The depth network.
    Depth,
    /// The light network.
    Light,
    /// The depth and the light network together.
    Joint,
    /// The expected-light network.
    Expected,
}

/// The name used in logs and errors: `joint`, `light 2/3`.
impl fmt::Display for TrainingPhase {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self.networks {
            TrainedNetworks::Depth => "depth",
            TrainedNetworks::Light => "light",
            TrainedNetworks::Joint => "joint",
            TrainedNetworks::Expected => "expected light",
        })?;
        if self.of > 1 { write!(f, " {}/{}", self.number, self.of) } else { Ok(()) }
    }
}
