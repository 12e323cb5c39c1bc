use lo_geometry::Camera;
use lo_imaging::Photo;
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
    /// As with the own network's, how cameras are held has a say in which way is up, and objects that are inserted into the scene are hidden only by
    /// what is well before them.
    PredictedDepth(Frame),
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

/// How brightly several photos show the same light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exposures {
    /// As the frames' [`exposure`](Frame::exposure) says: a photo's linear values times that are radiance.
    Known,
    /// As what two photos both show tells; where photos have nothing in common, by what is likely (`docs/method.md` §13).
    Matched,
}
