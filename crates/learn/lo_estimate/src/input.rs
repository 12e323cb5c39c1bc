use lo_geometry::{Camera, Vec3};
use lo_imaging::{Image, Photo};
use lo_scene::{Frame, PosedFrame};

/// What an estimate starts from.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// A photo alone, whose depth the depth network predicts.
    Photo {
        /// The photo, of at least 16 pixels.
        photo: Photo,
        /// The camera, in pixels of the photo.
        camera: Camera,
    },
    /// A photo with depth that a sensor measured: it is believed as it is.
    MeasuredDepth(Frame),
    /// A photo with depth in metres that another program's network predicted from it.
    ///
    /// As with the own network's, which way is up is guessed from the photo, and objects that are inserted into the scene are hidden only by
    /// what is well before them.
    PredictedDepth(PredictedDepth),
    /// Several photos of one room with measured depth, from cameras whose places are known.
    ///
    /// What all of them show goes into one octree, in the frame of the first one's camera. The scene keeps the first photo: objects are put into that one.
    Photos {
        /// At least one.
        photos: Vec<PosedFrame>,
        /// How brightly they show the same light.
        exposures: Exposures,
    },
}

/// A photo with depth in metres that a network predicted from it, and what else that network told.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictedDepth {
    /// The photo with its depth.
    pub frame: Frame,
    /// Unit normals of what the photo shows, towards the camera, of any resolution; zero where there is none. They have a say in which way is up, and
    /// the surfaces of what is seen have them.
    pub normals: Option<Image<Vec3>>,
    /// What people call the network; kept in the scene.
    pub model: Option<String>,
}

/// Of a network of which no more is known.
impl From<Frame> for PredictedDepth {
    fn from(frame: Frame) -> Self {
        Self { frame, normals: None, model: None }
    }
}

/// How brightly several photos show the same light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exposures {
    /// As the frames' [`exposure`](Frame::exposure) says: a photo's linear values times that are radiance.
    Known,
    /// As what two photos both show tells; where photos have nothing in common, by what is likely (`docs/method.md` §13).
    Matched,
}
