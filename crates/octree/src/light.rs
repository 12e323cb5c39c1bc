use geometry::{Cube, Vec3};

use crate::Octree;

/// Radiance that leaves a surface point, as input to the lighting octree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadiancePoint {
    /// World position in metres.
    pub position_m: Vec3,
    /// Linear RGB radiance.
    pub radiance: [f32; 3],
    /// Whether the photo saw this point, or it was inferred.
    pub coverage: Coverage,
}

/// Where the radiance of a point or a node comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Coverage {
    /// Completed by extrapolation or by a network.
    Inferred = 0,
    /// Measured in the photo.
    Seen = 1,
}

/// An octree over a cube of the world whose non-empty nodes hold RGBα.
#[derive(Clone, Debug, PartialEq)]
pub struct LightOctree {
    /// Structure.
    pub octree: Octree,
    /// The part of the world that the root covers.
    pub cube: Cube,
    /// `rgba[d][row]`: linear RGB radiance and the opacity of one full crossing of the node, for each depth `d`.
    pub rgba: Vec<Vec<[f32; 4]>>,
    /// `seen[d][row]`: share in [0, 255] of the node's points that the photo saw, for each depth `d`.
    pub seen: Vec<Vec<u8>>,
}
