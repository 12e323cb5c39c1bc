use lo_geometry::Vec3;
use lo_imaging::{DepthMap, Image};

/// A depth network's prediction for a photo. All images have one size, which may differ from the photo's, and show its
/// whole field of view.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// Depth.
    pub geometry: Geometry,
    /// The photo's field of view, if the network predicts it and no camera was given.
    pub field_of_view: Option<FieldOfView>,
    /// Unit normals towards the camera, in this project's axes (+X right, +Y up, −Z forward); zero where there is none.
    pub normals: Option<Image<Vec3>>,
}

/// Depth of a photo, in the form that the network predicts.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// Metres along the optical axis; 0 where there is no reading (masked by the network, or not finite).
    Metric(DepthMap),
    /// `1 / z = a · d + b` with unknown `a` > 0 and `b`; NaN where there is no reading.
    AffineInverse(Image<f32>),
    /// `ln z = d + b` with unknown `b`; NaN where there is no reading.
    Log(Image<f32>),
}

/// Angles that a photo covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOfView {
    /// Horizontal angle in degrees.
    pub horizontal_deg: f64,
    /// Vertical angle in degrees.
    pub vertical_deg: f64,
}
