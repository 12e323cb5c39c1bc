use lo_geometry::Camera;
use lo_imaging::Photo;
use lo_scene::Frame;

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
}
