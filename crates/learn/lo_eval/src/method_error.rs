use lo_completion::PanoramaError;
use lo_estimate::EstimateError;
use lo_octree::OctreeError;
use lo_scene::FrameError;

/// Errors of a method on a sample.
#[derive(Debug, thiserror::Error)]
pub enum MethodError {
    /// The sample or the tools lack a required input.
    #[error("needs {0}")]
    Needs(&'static str),
    /// Photo and depth are inconsistent.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The estimate failed.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
    /// The octree cannot be built.
    #[error(transparent)]
    Octree(#[from] OctreeError),
    /// The known panorama is invalid.
    #[error(transparent)]
    Panorama(#[from] PanoramaError),
    /// An object cannot be inserted into the photo.
    #[error("{0}")]
    Insertion(String),
}
