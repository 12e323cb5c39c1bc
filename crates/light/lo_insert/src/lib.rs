//! Virtual objects in a photo: shading by cones of the lighting octree, differential rendering of their shadow,
//! sequences.
//!
//! An [`Inserter`] holds everything of a scene that does not depend on the objects. [`Inserter::render`] then renders
//! one image of any number of [`Instance`]s, which all light rays treat alike (`objects`):
//!
//! 1. *Shadow, coarse*: share of the light on real surfaces that the objects block (`shadow`).
//! 2. *Radiosity*: light on some hundred points of each object, including that of the shadowed floor. Two passes, so
//!    that light is also exchanged between parts of an object and between objects (`patches`, `radiosity`).
//! 3. *Shadow, fine*: with the light that the objects reflect.
//! 4. *Visibility*: the camera's rays against the objects and the photo's depth (`visibility`); along occlusion
//!    edges, the photo's colours (`matte`).
//! 5. *Shading*: glTF's metallic-roughness BSDF (`lo_bsdf`) under the light at each visible point (`gather`,
//!    `shade`).
//! 6. *Composite*: photo × ratio, with the objects' reflection in glossy supports (`gloss`), under the objects
//!    (`composite`), which may get the photo's sharpness and grain (`look`).
//!
//! [`Inserter::on_plate`] does the same in an image of a moving camera. Light and placements stay in the axes of the
//! scene (`environment`, `plate`); surfaces, shadow and image belong to the plate.
//!
//! All sample patterns are fixed in the world, on an object or on the pixel grid. Nothing is random, so sequences do
//! not flicker.

mod batches;
mod error;
mod inserter;
mod light;
mod look;
mod matte;
mod objects;
mod pattern;
mod placement_check;
mod plate;
mod quality;
mod shade;
mod shadow;
pub mod stages;
mod surface;
mod warning;

pub use error::InsertError;
pub use inserter::Inserter;
pub use light::lighting::Lighting;
pub use objects::base::Base;
pub use objects::carrier::Anchor;
pub use objects::ground::Ground;
pub use objects::instance::Instance;
pub use objects::layout::{Layout, LayoutObject, PathSource};
pub use objects::path::{Interpolation, Keyframe, Path, PathPlacement};
pub use objects::placement::{Align, Placement};
pub use objects::unit::Unit;
pub use plate::Plate;
pub use quality::Quality;
pub use shade::composite::Composite;
pub use shade::cryptomatte::Cryptomatte;
pub use shade::passes::Passes;
pub use surface::observed_surfaces::{ObservedSurfaces, surface_at_pixel};
pub use warning::InsertWarning;
