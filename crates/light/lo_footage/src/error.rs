use lo_cone::TracerError;
use lo_scene::FrameError;

/// Reasons why a shot cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShotError {
    /// A plate has no pose.
    #[error("the shot has {poses} poses; plate {index} (from 0) is not among them")]
    NoPose {
        /// Index of the plate.
        index: usize,
        /// Number of poses.
        poses: usize,
    },
    /// The octree cannot be traced.
    #[error(transparent)]
    Tracer(#[from] TracerError),
    /// Plate, depth and camera do not fit.
    #[error(transparent)]
    Frame(#[from] FrameError),
}
