//! What gives light in a room: found in the octree, edited, added.
//!
//! [`list`] names the emitters of a scene: groups of leaves brighter than [`CAP`] times the mean, and lights that somebody added.
//! [`apply_edits`] carries out what [`LightEdits`](lo_scene::LightEdits) say of them; [`PictureChange`] does the same to the photo and to panoramas, where
//! they show an emitter sharper than leaves do, and [`AnalyticLights`] shows lights that no octree holds. [`split_octree`] parts an octree into patches of
//! light and the rest, for who samples lights.
//!
//! All of it is linear in an emitter's light, at every place: twice the scale is twice the contribution.

mod analytic;
mod cap;
mod colour;
mod edit;
mod emitters;
mod free;
mod kind;
mod leaves;
mod list;
mod patch;
mod picture;
mod shape;
mod split;
mod sun;
mod sunlit;

pub use analytic::{AnalyticLights, rectangle};
pub use cap::{CAP, cap_luminance, cap_of, excess, luminance};
pub use colour::{color_temperature_k, rgb_of_color};
pub use edit::{LightsError, apply_edits, remove_emitters};
pub use emitters::{Emitter, emitters};
pub use free::free_share;
pub use kind::{Kind, Origin};
pub use list::{ListedLight, list, listed};
pub use patch::{LightPatch, PatchShape};
pub use picture::PictureChange;
pub use shape::{ClusterShape, ClusterSurface, LeafSurface};
pub use split::split_octree;
pub use sun::{sun_angles_deg, sun_direction, sun_of_shadow};
pub use sunlit::{ShadowSupport, SunEdge, Sunlit, shadow_support};
