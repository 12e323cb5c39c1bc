use lo_geometry::Vec3;

/// Radiance that leaves a surface point, as input to the lighting octree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiancePoint {
    /// World position in metres.
    pub position_m: Vec3,
    /// Linear RGB radiance.
    pub radiance: [f32; 3],
    /// Whether the photo saw this point, or it was inferred.
    pub provenance: Provenance,
}

/// Where the radiance of a point or a node comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Provenance {
    /// Completed by extrapolation or by a network.
    Inferred = 0,
    /// Measured in the photo.
    Seen = 1,
}
