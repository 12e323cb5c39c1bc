//! Sharp where the photo knows: what a cone meets of a surface that the photo shows is looked up in the photo (`docs/method.md` §3.6).
//!
//! A leaf of the octree is the mean of all pixels that fall into it, a block of some centimetres. [`PhotoLookup`] follows a cone's axis through the
//! photo's depth map, as reflections in screen space do (McGuire and Mara, "Efficient GPU Screen-Space Ray Tracing", JCGT 2014), from
//! shortly before the distance at which the octree was met, and takes the photo's radiance there, averaged over what the cone covers.
//! [`PanoramaLookup`] does the same with a panorama of the room that somebody gave. [`SharpViewers`] makes panoramas of a scene with it.

mod before;
mod detail;
mod edges;
mod fade;
mod guided;
mod lookup;
mod map;
mod mirroring;
mod panorama;
mod photo;
mod ratio;
mod surface;
mod viewers;

pub use detail::Detail;
pub use lookup::PhotoLookup;
pub use map::RadianceMap;
pub use panorama::PanoramaLookup;
pub use viewers::SharpViewers;
