//! Shape of a cluster of octree leaves.

use std::f32::consts::PI;

use lo_geometry::Vec3;

/// Least |Σ nA| / ΣA of a panel. Staircases of slanted walls have at least 0.9.
const MIN_FLATNESS: f32 = 0.8;

/// Surface of one leaf of a cluster.
#[derive(Clone, Copy, Debug)]
pub struct LeafSurface {
    /// Centre of the leaf in metres.
    pub centre_m: Vec3,
    /// Edge of the leaf in metres.
    pub edge_m: f32,
    /// Area in m² of the smooth surface that the leaf's faces represent.
    pub area_m2: f32,
    /// Sum of the faces' outward normals times their areas, m².
    pub vector_area_m2: Vec3,
    /// Luminance, which weights the cluster's centre.
    pub luminance: f32,
}

/// A cluster of leaves as one surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClusterSurface {
    /// Centre in metres: the mean of the leaves' centres weighted by area and luminance.
    pub centre_m: Vec3,
    /// Area in m².
    pub area_m2: f32,
    /// Shape.
    pub shape: ClusterShape,
}

/// Shape of a cluster of leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ClusterShape {
    /// A rectangle that emits to one side.
    Panel {
        /// Unit direction of emission.
        direction: Vec3,
        /// Unit direction of the width, perpendicular to `direction`.
        across: Vec3,
        /// Width and height in metres; their product is the area.
        size_m: [f32; 2],
    },
    /// A sphere that emits in all directions.
    Ball {
        /// Radius in metres.
        radius_m: f32,
    },
    /// A concave surface that emits towards its own inside, such as a bright corner of a room.
    Concave,
}

impl ClusterSurface {
    /// Fits a surface to the leaves of one cluster; `None` if they have no surface.
    pub fn of(leaves: &[LeafSurface]) -> Option<Self> {
        let area_m2: f32 = leaves.iter().map(|leaf| leaf.area_m2).sum();
        let vector_area_m2: Vec3 = leaves.iter().map(|leaf| leaf.vector_area_m2).sum();
        let weight = |leaf: &LeafSurface| leaf.luminance * leaf.area_m2;
        let total: f32 = leaves.iter().map(weight).sum();
        if !(area_m2 > 0.0 && total > 0.0) {
            return None;
        }
        let moment: Vec3 = leaves.iter().map(|leaf| leaf.centre_m * weight(leaf)).sum();
        let centre_m = moment / total;
        let flatness = vector_area_m2.length() / area_m2;
        let outward: f32 = leaves.iter().map(|leaf| leaf.vector_area_m2.dot(leaf.centre_m - centre_m)).sum();
        let shape = if flatness > MIN_FLATNESS {
            panel(leaves, centre_m, vector_area_m2.normalize(), area_m2)
        } else if leaves.len() == 1 || outward > 0.0 {
            ClusterShape::Ball { radius_m: 0.5 * (area_m2 / PI).sqrt() }
        } else {
            ClusterShape::Concave
        };
        Some(Self { centre_m, area_m2, shape })
    }
}

/// Returns the rectangle of this area whose second moments have the ratio and the axes of the leaves'.
fn panel(leaves: &[LeafSurface], centre_m: Vec3, direction: Vec3, area_m2: f32) -> ClusterShape {
    let basis = lo_geometry::orthonormal_basis(direction);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for leaf in leaves {
        let offset_m = leaf.centre_m - centre_m;
        let (x, y) = (offset_m.dot(basis.x_axis), offset_m.dot(basis.y_axis));
        let own = leaf.edge_m * leaf.edge_m / 12.0;
        xx += leaf.area_m2 * (x * x + own);
        xy += leaf.area_m2 * x * y;
        yy += leaf.area_m2 * (y * y + own);
    }
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
    let across = basis.x_axis * angle.cos() + basis.y_axis * angle.sin();
    let (mean, half_difference) = (0.5 * (xx + yy), (0.5 * (xx - yy)).hypot(xy));
    let ratio = ((mean + half_difference) / (mean - half_difference).max(1e-3 * mean)).sqrt();
    ClusterShape::Panel { direction, across, size_m: [(area_m2 * ratio).sqrt(), (area_m2 / ratio).sqrt()] }
}
