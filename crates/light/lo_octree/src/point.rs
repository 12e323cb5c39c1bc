use lo_geometry::Vec3;

/// Radiance leaving a surface point: input to the lighting octree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiancePoint {
    /// World position in metres.
    pub position_m: Vec3,
    /// Linear RGB radiance.
    pub radiance: [f32; 3],
    /// Whether the radiance is observed in the photo or inferred.
    pub provenance: Provenance,
}

/// Origin of the radiance of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Provenance {
    /// Completed by extrapolation or by a network.
    Inferred = 0,
    /// Measured in the photo.
    Observed = 1,
}
