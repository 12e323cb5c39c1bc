use lo_completion::PanoramaPrior;
use lo_geometry::Vec3;
use lo_scene::{CameraSource, Completion};

/// Depth of the octree where none is asked for.
pub const DEFAULT_OCTREE_DEPTH: u32 = 7;

/// Choices of an estimate. The defaults are those of the command line.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimateOptions {
    /// Depth of the octree: leaves have 1/2^depth of the cube's edge. 7 by default, or the network's own where that is more. Deeper than a
    /// network's own, what the photo shows is that fine, and what it does not is as coarse as the network makes it.
    pub octree_depth: Option<u32>,
    /// Depth down to which the octree is full where no network makes it. 4 by default.
    pub full_depth: u32,
    /// How the unseen part of the room is filled. By default by the light network; by the shell where the estimator has no networks.
    pub completion: Option<Completion>,
    /// Unit vector against gravity. Where it is not given: from the surfaces, near to what the network tells from the photo; where depth is predicted, as the network tells it
    /// alone, or without one that has learned it, from the surfaces and how cameras are held.
    pub up: Option<Vec3>,
    /// Seed of the places of the points that carry the global light into what the network has not seen.
    pub seed: u64,
    /// Names of the input files, kept in the scene.
    pub sources: Vec<String>,
    /// Where the camera comes from, as [`Estimator::camera_of`](crate::Estimator::camera_of) says it; kept in the scene.
    pub camera_source: Option<CameraSource>,
    /// A panorama of the room that somebody has: its light is laid onto what the photo does not show, unless nothing is completed.
    pub panorama: Option<PanoramaPrior>,
}

impl Default for EstimateOptions {
    fn default() -> Self {
        Self {
            octree_depth: None,
            full_depth: 4,
            completion: None,
            up: None,
            seed: 0,
            sources: Vec::new(),
            camera_source: None,
            panorama: None,
        }
    }
}
