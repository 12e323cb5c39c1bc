//! Virtual objects in a photo: shading by cones of the lighting octree, differential rendering of their shadow, sequences.
//!
//! An [`Inserter`] holds everything of a scene that does not depend on the objects. [`Inserter::render`] then makes one picture of any number of
//! [`Instance`]s, which all rays of light meet alike (`objects`):
//!
//! 1. *Shadow, coarse*: what share of the light on real surfaces the objects take away (`shadow`).
//! 2. *Radiosity*: light on some hundred points of each object, which sees the floor in its shadow; twice, so that light also goes
//!    from one part of an object to another, and from one object to the next (`patches`, `radiosity`).
//! 3. *Shadow, fine*: with the light that the objects give back.
//! 4. *Visibility*: the camera's rays against the objects and the photo's depth (`visibility`), and where that ends the photo's
//!    colours (`matte`).
//! 5. *Shading*: glTF's metallic-roughness BSDF (`lo_bsdf`) under the light at each visible point (`gather`, `shade`).
//! 6. *Composite*: photo × ratio, with the objects' mirror image where their support is glossy (`gloss`), under the objects (`composite`).
//!
//! All sample patterns are fixed in the world, on an object or on the pixel grid; nothing is random, so a sequence does not flicker.

mod batches;
mod error;
mod inserter;
mod light;
mod matte;
mod objects;
mod pattern;
mod quality;
mod shade;
mod shadow;
mod surface;

pub use error::InsertError;
pub use inserter::Inserter;
pub use light::lighting::Lighting;
pub use objects::base::Base;
pub use objects::carried::Spot;
pub use objects::ground::Ground;
pub use objects::instance::Instance;
pub use objects::layout::{Layout, LayoutObject, PathSource};
pub use objects::path::{Interpolation, Keyframe, Path, Stance};
pub use objects::placement::{Align, Placement};
pub use quality::Quality;
pub use shade::composite::Composite;
pub use surface::seen_surfaces::{SeenSurfaces, surface_at_pixel};
