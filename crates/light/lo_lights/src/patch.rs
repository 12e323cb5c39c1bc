use lo_geometry::Vec3;

/// A patch of light, from which light samples are drawn.
#[derive(Clone, Copy, Debug)]
pub struct LightPatch {
    /// Geometry of the patch.
    pub shape: PatchShape,
    /// Linear RGB radiance.
    pub radiance: Vec3,
    /// Area in m² or, at infinity, solid angle in steradians.
    pub extent: f32,
}

/// Geometry of a patch.
#[derive(Clone, Copy, Debug)]
pub enum PatchShape {
    /// A square of the octree's grid that emits to the side of `normal`.
    Square {
        /// Centre in metres.
        centre: Vec3,
        /// Unit normal.
        normal: Vec3,
        /// Edge in metres.
        edge_m: f32,
    },
    /// A rectangle that emits to the side of `normal`.
    Rectangle {
        /// Centre in metres.
        centre: Vec3,
        /// Unit normal.
        normal: Vec3,
        /// Edge vectors in metres.
        edges_m: [Vec3; 2],
    },
    /// A sphere that emits outwards.
    Sphere {
        /// Centre in metres.
        centre: Vec3,
        /// Radius in metres.
        radius_m: f32,
    },
    /// A disc at infinity.
    Disc {
        /// Unit direction towards its centre.
        direction: Vec3,
        /// Perpendicular tangents, as long as the tangent of the angular radius.
        radii: [Vec3; 2],
    },
    /// A patch at infinity, spanned by two tangents.
    Infinity {
        /// Unit direction towards the patch.
        direction: Vec3,
        /// Tangents, as long as the patch is wide.
        tangents: [Vec3; 2],
    },
}
