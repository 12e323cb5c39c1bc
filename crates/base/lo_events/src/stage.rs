use std::fmt;

use serde::Serialize;

/// A part of a job that takes a while.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
#[non_exhaustive]
pub enum Stage {
    /// Files of the input are read.
    ReadInput,
    /// Weights of the networks are read.
    ReadWeights,
    /// The photo and its depth are brought to the working resolution.
    WorkingResolution,
    /// Several photos of one room are compared: whether their poses fit, and how brightly each shows the same light.
    Photos,
    /// The depth network predicts depth, and with it what the photo tells of the light outside of it.
    DepthAndGlobalLight,
    /// A depth network of others is read from its file.
    ReadDepthModel,
    /// A depth network of others is made ready for photos of one size.
    PrepareDepthModel,
    /// A depth network of others predicts depth.
    DepthModel,
    /// The depth network tells what the photo says of the light outside of it, and how the camera was held.
    GlobalLight,
    /// The light network makes the octree of the whole room.
    LightNetwork,
    /// The room is completed without a network.
    Completion,
    /// The octree is built.
    Octree,
    /// A panorama of the room is compared with what the photo shows.
    PanoramaMatch,
    /// A panorama of the room is laid onto what the photo does not show.
    PanoramaLaying,
    /// The panoramas of many places are rendered.
    Probes,
    /// The object's shadow on real surfaces, coarsely: for the light that they send back to it.
    CoarseShadow,
    /// Light on the object, for what it gives off to itself and to what is around.
    Radiosity,
    /// The object's shadow on real surfaces, and the light that it sends to them.
    FineShadow,
    /// What the camera sees of the object.
    Visibility,
    /// The light that the seen parts of the object send to the camera.
    Shading,
    /// Photo, shadow and object are put together.
    Composite,
    /// Results are written.
    Write,
    /// Rooms are generated.
    GenerateRooms,
    /// Samples of a data set are read.
    ReadSamples,
    /// Photos of a data set are evaluated by every method.
    EvaluatePhotos,
    /// A phase of training; its steps are photos or batches of them.
    Training(TrainingPhase),
    /// Figures on scenes that are held out of training.
    Validation,
    /// What a run needs to go on is written.
    Checkpoint,
}

/// A phase of training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct TrainingPhase {
    /// What it trains.
    pub networks: TrainedNetworks,
    /// Which of the phases that train the same, from 1.
    pub number: usize,
    /// How many of these there are.
    pub of: usize,
}

/// What a phase of training trains.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum TrainedNetworks {
    /// The depth network.
    Depth,
    /// The light network.
    Light,
    /// Both together.
    Joint,
    /// The network of expected light.
    Expected,
}

/// `joint`, `light 2/3`: what logs and errors call it.
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
