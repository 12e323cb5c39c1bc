use std::sync::Arc;

use lo_completion::PanoramaPrior;
use lo_geometry::Vec3;
use lo_scene::{CameraSource, Completion, DistortedPhoto};

/// Default of [`EstimateOptions::octree_depth`].
pub const DEFAULT_OCTREE_DEPTH: u32 = 7;

/// Options of [`Estimator::estimate`](crate::Estimator::estimate). The defaults are the command line's.
///
/// ```text
/// let options = EstimateOptions { completion: Some(Completion::Shell), ..EstimateOptions::default() };
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct EstimateOptions {
    /// Depth of the octree: leaves have 1/2^depth of the cube's edge.
    ///
    /// Default: [`DEFAULT_OCTREE_DEPTH`] (7), or the light network's depth if that is larger. Beyond the network's
    /// depth only observed regions are refined; inferred regions keep the network's leaf size.
    pub octree_depth: Option<u32>,
    /// Depth down to which the octree is full if no network builds it. Default: 4.
    pub full_depth: u32,
    /// Method that completes unobserved regions.
    ///
    /// Default: the light network, or the shell if the estimator has no networks.
    pub completion: Option<Completion>,
    /// Unit vector against gravity, in the first camera's axes. Default: estimated.
    ///
    /// Measured surfaces determine it, near the networks' prediction. For predicted depth it is the networks'
    /// prediction alone, or an estimate from the surfaces and typical camera poses if the networks do not predict it.
    pub up: Option<Vec3>,
    /// Seed of the random points that carry global light into unobserved regions. Default: 0.
    pub seed: u64,
    /// Names of the input files, stored in the estimate.
    pub sources: Vec<String>,
    /// Source of the camera as returned by [`Estimator::camera_of`](crate::Estimator::camera_of), stored in the
    /// estimate.
    pub camera_source: Option<CameraSource>,
    /// The photo before undistortion as returned by [`Estimator::resolve`](crate::Estimator::resolve), stored in the
    /// estimate, so that composites are distorted back.
    pub distorted: Option<Arc<DistortedPhoto>>,
    /// Captured panorama of the same room, whose light is applied to unobserved regions.
    ///
    /// It cannot be combined with [`Completion::None`].
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
            distorted: None,
            panorama: None,
        }
    }
}
