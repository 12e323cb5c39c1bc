//! Sharpens octree renderings where the photo shows the surface that a cone hits (`docs/method.md` §3.6).
//!
//! A leaf of the octree is the mean of all pixels that fall into it: a block of some centimetres. [`PhotoLookup`]
//! follows a cone's axis through the photo's depth map, as screen-space reflections do (McGuire and Mara, "Efficient
//! GPU Screen-Space Ray Tracing", JCGT 2014). It starts shortly before the octree's hit and reads the photo's radiance
//! at the crossing, averaged over the cone's footprint.
//!
//! [`PanoramaLookup`] does the same with a panorama of the room given by the user. [`SceneRenderer`] combines them to
//! render panoramas of a scene. [`LevelFrame`] rotates panoramas so that gravity points straight down.

mod before;
mod detail;
mod edges;
mod fade;
mod guided;
mod level_frame;
mod lookup;
mod map;
mod mirroring;
mod panorama;
mod photo;
mod ratio;
mod scene_renderer;
mod surface;

pub use detail::Detail;
pub use level_frame::LevelFrame;
pub use lookup::PhotoLookup;
pub use map::RadianceMap;
pub use panorama::PanoramaLookup;
pub use scene_renderer::SceneRenderer;
