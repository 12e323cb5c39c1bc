use lo_geometry::Cube;
use lo_octree::LightOctree;

use crate::{Settings, SettingsError, grid::Grid, local_cone::LocalCone, steps::StepTable};

/// Reasons why an octree cannot be traced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TracerError {
    /// A setting is out of range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The octree has directional lobes, so its radiance depends on the viewpoint.
    #[error(
        "the octree has directional lobes, so its radiance depends on the viewpoint: trace the result of \
         LightOctree::seen_from, or use cone::OctreeRenderer"
    )]
    Lobes,
}

/// Traces cones through one lighting octree.
///
/// Holds the octree in a format of its own, which takes some milliseconds to make. The octree itself may be dropped.
#[derive(Clone)]
pub struct ConeTracer {
    pub(crate) grid: Grid,
    pub(crate) cube: Cube,
    pub(crate) settings: Settings,
    /// Feature rows of each depth.
    pub(crate) rows: Vec<usize>,
}

impl ConeTracer {
    /// Prepares an octree for tracing.
    ///
    /// # Errors
    /// Settings out of range; nodes with lobes.
    pub fn new(light: &LightOctree, settings: Settings) -> Result<Self, TracerError> {
        settings.check()?;
        if light.lobes.is_some() {
            return Err(TracerError::Lobes);
        }
        let rows = light.rgba.iter().map(Vec::len).collect();
        Ok(Self { grid: Grid::new(light), cube: light.cube, settings, rows })
    }

    /// Returns the steps for a cone and for others near it.
    pub(crate) fn steps(&self, tan_half_angle: f32, cone: &LocalCone) -> StepTable {
        let side = self.grid.side() as f32;
        let near = (cone.near - side).max(0.0);
        let reach = if cone.near > 0.0 { 4.0 * side } else { 1.74 * side };
        StepTable::new(&self.settings, tan_half_angle, self.grid.max_level(), near, near + reach)
    }

    /// Returns the edge of the finest leaves in metres.
    pub fn leaf_edge_m(&self) -> f32 {
        self.cube.edge_m / self.grid.side() as f32
    }
}
