use lo_imaging::RadianceImage;

/// What lights the object.
#[derive(Clone, Debug, Default)]
pub enum Lighting {
    /// The scene's lighting octree.
    #[default]
    Octree,
    /// An equirectangular map at infinity, in our orientation and the photo's radiance units.
    EnvironmentMap(RadianceImage),
}
