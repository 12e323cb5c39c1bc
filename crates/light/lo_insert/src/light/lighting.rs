use lo_imaging::RadianceImage;

/// Source of the light on inserted objects.
#[derive(Clone, Debug, Default)]
pub enum Lighting {
    /// The scene's lighting octree.
    #[default]
    Octree,
    /// An equirectangular map at infinity, in this project's orientation and the photo's radiance units.
    EnvironmentMap(RadianceImage),
}
