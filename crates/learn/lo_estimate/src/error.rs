use lo_completion::{ApplyPanoramaError, PanoramaError};
use lo_events::Cancelled;
use lo_imaging::SpecialProjection;
use lo_nets::light::LightError;
use lo_octree::OctreeError;
use lo_scene::{FrameError, UndistortionError};

/// An error that prevents an estimate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EstimateError {
    /// The depths of the octree are out of range, or its cube is invalid.
    #[error(transparent)]
    Octree(#[from] OctreeError),
    /// No pixel has a usable depth reading.
    #[error("no depth reading is left after flying pixels at depth edges were dropped")]
    NoUsableDepth,
    /// [`Input::Photos`](crate::Input::Photos) holds no photo.
    #[error("no photo was given")]
    NoPhotos,
    /// Two photos view the same region according to their poses, but their depths differ there.
    #[error(
        "by their poses, photos {} and {} look at the same places, but their depths differ there by {:.0} %: the \
         poses do not belong to these photos, are not in metres, or have other axes",
        photos[0] + 1, photos[1] + 1, 100.0 * disagreement
    )]
    PosesDisagree {
        /// Indices of the two photos, from 0.
        photos: [usize; 2],
        /// Median difference of the depths, as a share of the depth.
        disagreement: f32,
    },
    /// The request needs networks, and the estimator has none.
    #[error("{0} needs the weights of the networks")]
    NoNetworks(&'static str),
    /// The requested octree is shallower than the light network's.
    #[error("the light network makes octrees of depth {own} or more, not {asked}")]
    OctreeDepth {
        /// The requested depth.
        asked: u32,
        /// Depth of the network's octree.
        own: u32,
    },
    /// The depth network's output is NaN or infinite, so its weights are damaged.
    #[error("the depth network's output is not finite: its weights are damaged")]
    NonFiniteDepth,
    /// A depth model failed on the photo.
    #[cfg(feature = "depth-models")]
    #[error(transparent)]
    DepthModel(#[from] lo_depth_models::ModelError),
    /// A depth model's relative depth cannot be converted to metres.
    #[cfg(feature = "depth-models")]
    #[error("relative depth cannot be converted to metres: {0}")]
    RelativeDepth(#[from] lo_depth_models::affine::FitError),
    /// Photo, depth and camera do not form a [`Frame`](lo_scene::Frame).
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// A panorama was given with [`Completion::None`](lo_scene::Completion::None).
    #[error("a panorama lights the completed part of the room, and nothing is completed")]
    PanoramaWithoutRoom,
    /// The panorama's position, yaw or exposure is invalid.
    #[error("the panorama: {0}")]
    Panorama(#[from] PanoramaError),
    /// The panorama cannot be applied to the room.
    #[error(transparent)]
    ApplyPanorama(#[from] ApplyPanoramaError),
    /// No pinhole camera takes such a photo.
    #[error("{}", projection_text(.0))]
    Projection(SpecialProjection),
    /// The lens distortion cannot be undone.
    #[error(transparent)]
    Undistortion(#[from] UndistortionError),
    /// The event handler cancelled the job.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The light network failed.
    #[error(transparent)]
    Light(#[from] LightError),
}

fn projection_text(projection: &SpecialProjection) -> &'static str {
    match projection {
        SpecialProjection::Equirectangular => {
            "the photo is an equirectangular panorama (2:1, its sides join): give an ordinary photo of the room, and the \
             panorama beside it"
        }
        SpecialProjection::Panorama => {
            "the photo is a panorama of a turning camera (one side is more than three times the other): crop it to a part \
             of at most 90 degrees and give its field of view"
        }
        SpecialProjection::Fisheye => {
            "the photo is that of a circular fisheye (a disc in black): convert it to a rectilinear photo first"
        }
        SpecialProjection::DualFisheye => {
            "the photo is the raw image of a 360-degree camera (two discs in black): have its program stitch it to an \
             equirectangular panorama, and give that beside an ordinary photo of the room"
        }
    }
}
