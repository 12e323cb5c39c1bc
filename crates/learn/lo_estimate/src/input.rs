use lo_geometry::{Camera, Vec3};
use lo_imaging::{Image, Photo};
use lo_scene::{Frame, PosedFrame};

/// The photos, depth and cameras that [`Estimator::estimate`](crate::Estimator::estimate) starts from.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Input {
    /// A photo without depth. The depth network predicts it.
    Photo {
        /// The photo, of at least 16 pixels.
        photo: Photo,
        /// The camera, in pixels of the photo.
        camera: Camera,
    },
    /// A photo with depth from a sensor. It is used without correction.
    MeasuredDepth(Frame),
    /// A photo with depth in metres that another network predicted from it.
    ///
    /// As with the own depth network, up is estimated from the photo, and inserted objects are occluded only by
    /// surfaces well in front of them.
    PredictedDepth(PredictedDepth),
    /// Several photos of one room with measured depth and known camera poses.
    ///
    /// All photos contribute to one octree, in the first camera's frame. The estimate keeps the first photo, into which
    /// objects are inserted.
    Photos {
        /// The photos with their poses, at least one. Poses may be relative to any common frame in metres.
        photos: Vec<PosedFrame>,
        /// How the photos' brightness is related.
        exposures: Exposures,
    },
}

/// A photo with depth in metres predicted by a network, and that network's other output.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictedDepth {
    /// The photo with its depth.
    pub frame: Frame,
    /// Unit surface normals, pointing towards the camera, at any resolution; zero where there is none.
    ///
    /// They contribute to the estimate of up and become the observed surfaces' normals.
    pub normals: Option<Image<Vec3>>,
    /// Display name of the network, stored in the estimate.
    pub model: Option<String>,
}

/// Wraps depth from an unspecified network, without normals.
impl From<Frame> for PredictedDepth {
    fn from(frame: Frame) -> Self {
        Self { frame, normals: None, model: None }
    }
}

/// How the brightness of several photos is related.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Exposures {
    /// Known: linear photo values times [`Frame::exposure`] are radiance.
    Known,
    /// Estimated from the photos' overlaps. Photos without overlap are matched by their average brightness
    /// (`docs/method.md` §13).
    Matched,
}
