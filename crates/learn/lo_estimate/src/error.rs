use lo_completion::{ApplyPanoramaError, PanoramaError};
use lo_events::Cancelled;
use lo_nets::light::LightError;
use lo_octree::OctreeError;
use lo_scene::FrameError;

/// Why there is no scene.
#[derive(Debug, thiserror::Error)]
pub enum EstimateError {
    /// The octree's depths or cube are impossible.
    #[error(transparent)]
    Octree(#[from] OctreeError),
    /// No pixel has a depth that can be used.
    #[error("no depth reading is left after flying pixels at depth edges were dropped")]
    NothingSeen,
    /// An estimate from several photos was asked for without any.
    #[error("no photo was given")]
    NoPhotos,
    /// By their poses two photos show the same places, but their depths tell of different ones.
    #[error(
        "by their poses, photos {} and {} look at the same places, but their depths differ there by {:.0} %: the poses do not belong to these \
         photos, are not in metres, or have other axes", photos[0] + 1, photos[1] + 1, 100.0 * disagreement
    )]
    PosesDisagree {
        /// Their indices.
        photos: [usize; 2],
        /// Median difference of the depths, share of the depth.
        disagreement: f32,
    },
    /// Networks are needed for what was asked for, and none were given.
    #[error("{0} needs the weights of the networks")]
    NoNetworks(&'static str),
    /// The light network makes deeper octrees.
    #[error("the light network makes octrees of depth {own} at least, not {asked}")]
    OctreeDepth {
        /// What was asked for.
        asked: u32,
        /// The network's own depth.
        own: u32,
    },
    /// The depth network's output is no number: its weights are damaged.
    #[error("the depth network's output is not finite: its weights are damaged")]
    PredictedDepth,
    /// A depth model tells nothing of the photo.
    #[cfg(feature = "depth-models")]
    #[error(transparent)]
    DepthModel(#[from] lo_depth_models::ModelError),
    /// A depth model's relative depth does not become metres.
    #[cfg(feature = "depth-models")]
    #[error("relative depth does not become metres: {0}")]
    RelativeDepth(#[from] lo_depth_models::affine::FitError),
    /// Photo and predicted depth do not make a frame.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A panorama cannot be laid where nothing is completed.
    #[error("a panorama gives its light to the completed part of the room, and nothing is completed")]
    PanoramaWithoutRoom,
    /// The panorama's place, yaw or exposure are no numbers.
    #[error("the panorama: {0}")]
    Panorama(#[from] PanoramaError),
    /// The panorama cannot be laid onto the room.
    #[error(transparent)]
    Lay(#[from] ApplyPanoramaError),
    /// The handler of events asked for the end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The light network failed.
    #[error(transparent)]
    Light(#[from] LightError),
}
