use lo_geometry::Vec3;

/// A patch of light, before light samples are drawn from it.
#[derive(Clone, Copy, Debug)]
pub struct LightPatch {
    /// Where it is.
    pub shape: PatchShape,
    /// Linear RGB radiance.
    pub radiance: Vec3,
    /// Area in m² or, at infinity, solid angle in steradians.
    pub extent: f32,
}

/// Where the light of a patch comes from.
#[derive(Clone, Copy, Debug)]
pub enum PatchShape {
    /// A square of the octree's grid that radiates to the side of `normal`.
    Square {
        /// Middle, metres.
        centre: Vec3,
        /// Unit normal.
        normal: Vec3,
        /// Edge in metres.
        edge_m: f32,
    },
    /// A rectangle that radiates to the side of `normal`.
    Rectangle {
        /// Middle, metres.
        centre: Vec3,
        /// Unit normal.
        normal: Vec3,
        /// Its edges, metres.
        edges_m: [Vec3; 2],
    },
    /// A sphere that radiates outwards.
    Sphere {
        /// Middle, metres.
        centre: Vec3,
        /// Radius in metres.
        radius_m: f32,
    },
    /// A disc at infinity.
    Disc {
        /// Unit direction towards its middle.
        direction: Vec3,
        /// Perpendicular tangents, as long as the tangent of its angular radius.
        radii: [Vec3; 2],
    },
    /// A direction at infinity with two tangents that span the patch.
    Infinity {
        /// Unit direction towards it.
        direction: Vec3,
        /// Tangents, as long as the patch is wide.
        tangents: [Vec3; 2],
    },
}
