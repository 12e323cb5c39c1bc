use lo_geometry::Vec3;
use lo_imaging::{DepthMap, Image};

/// What a depth network tells of a photo. All pictures are of one size, which need not be the photo's, and show its whole field of view.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// How far what the photo shows is.
    pub geometry: Geometry,
    /// The photo's field of view, where the network tells it and no camera was given.
    pub field_of_view: Option<FieldOfView>,
    /// Unit normals of what the photo shows, towards the camera, in this project's axes (+X right, +Y up, −Z forward); zero where there is none.
    pub normals: Option<Image<Vec3>>,
}

/// How far what a photo shows is.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// Metres along the optical axis; 0 where there is no reading (outside of the network's mask, or no number).
    Metric(DepthMap),
    /// `1 / z = a · d + b` with unknown `a` > 0 and `b`; NaN where there is no reading.
    AffineInverse(Image<f32>),
    /// `ln z = d + b` with unknown `b`; NaN where there is no reading.
    Log(Image<f32>),
}

/// Angles that a photo shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOfView {
    /// Horizontally, in degrees.
    pub horizontal_deg: f64,
    /// Vertically, in degrees.
    pub vertical_deg: f64,
}
