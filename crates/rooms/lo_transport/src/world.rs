use lo_geometry::Vec3;
use lo_imaging::RadianceImage;
use lo_mesh::Model;

/// Scene to be lit: a model in metres (+Y up) and the outdoors beyond its windows.
#[derive(Clone, Debug)]
pub struct World {
    /// Triangles with materials. A lamp is a triangle with an emissive material. A window pane is a thin sheet with
    /// [`lo_mesh::Material::transmission`]. Curtains and lamp shades have [`lo_mesh::Material::diffuse_transmission`].
    pub model: Model,
    /// Environment seen by rays that hit no triangle.
    pub outdoors: Outdoors,
    /// Openings through which outdoor light enters and the outdoors are visible. If there are any, gaps in the building
    /// let no light in, and the building's outside is dark. Without portals the scene is open to the outdoors on all
    /// sides.
    pub portals: Vec<Portal>,
}

/// Environment light from infinitely far away.
#[derive(Clone, Debug)]
pub struct Outdoors {
    /// Equirectangular radiance in world directions (sky, ground, houses), without the sun's disc.
    pub radiance: RadianceImage,
    /// The sun's disc, or `None` without direct sun.
    pub sun: Option<Sun>,
}

/// Sun as a disc of constant radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit direction towards the disc's centre.
    pub direction: Vec3,
    /// Angular radius in radians (the real sun: 0.00465).
    pub angular_radius_rad: f32,
    /// Linear RGB radiance of the disc.
    pub radiance: [f32; 3],
}

/// Parallelogram in a wall: `corner + a·edges[0] + b·edges[1]` with `a`, `b` in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Portal {
    /// One corner, in metres.
    pub corner: Vec3,
    /// The two edges from the corner. Their cross product points into the room.
    pub edges: [Vec3; 2],
}
