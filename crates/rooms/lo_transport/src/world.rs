use lo_geometry::Vec3;
use lo_imaging::RadianceImage;
use lo_mesh::Model;

/// Everything that light meets: a model in metres (Y up) and what lies beyond its windows.
#[derive(Clone, Debug)]
pub struct World {
    /// Triangles with materials. A lamp is a triangle whose material emits; a window pane is a thin sheet with
    /// [`lo_mesh::Material::transmission`]; curtains and lamp shades have [`lo_mesh::Material::diffuse_transmission`].
    pub model: Model,
    /// What a ray sees that meets no triangle.
    pub outdoors: Outdoors,
    /// Openings through which light comes in from outdoors and the outdoors are seen. Where there are any, nothing comes in
    /// elsewhere: gaps in the building are dark, and so is its outside. Without any, the world lies open.
    pub portals: Vec<Portal>,
}

/// Light from infinitely far away.
#[derive(Clone, Debug)]
pub struct Outdoors {
    /// Equirectangular radiance in world directions (sky, ground, houses), without the sun's disc.
    pub radiance: RadianceImage,
    /// The sun's disc, where it shines.
    pub sun: Option<Sun>,
}

/// A disc in the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit direction towards its centre.
    pub direction: Vec3,
    /// Angular radius (the real one has 0.00465).
    pub angular_radius_rad: f32,
    /// Linear RGB radiance of the disc.
    pub radiance: [f32; 3],
}

/// A parallelogram in a wall: `corner + a·edges[0] + b·edges[1]` with `a`, `b` in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Portal {
    /// One corner, metres.
    pub corner: Vec3,
    /// The two edges from there; their cross product points into the room.
    pub edges: [Vec3; 2],
}
