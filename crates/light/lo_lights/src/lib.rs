//! Lights of a room: found in the octree, edited and added by the user.
//!
//! - [`list`] lists the emitters of a scene (groups of leaves brighter than [`CAP`] times the mean) and the added
//!   lights.
//! - [`apply_edits`] applies [`LightEdits`](lo_scene::LightEdits) to the octree.
//! - [`ImageChange`] applies them to the photo and to panoramas, which show an emitter sharper than leaves do.
//! - [`AnalyticLights`] renders lights that are not in the octree.
//! - [`LightEstimate`] is the light of a panorama in the layouts of AR frameworks and game engines.
//! - [`split_octree`] splits an octree into light patches and the rest, for light sampling.
//!
//! Everything is linear in an emitter's light, at every position: twice the scale is twice the contribution.

mod analytic;
mod balance;
mod cap;
mod colour;
mod edit;
mod emitters;
mod face;
mod image_change;
mod kind;
mod leaves;
mod light_estimate;
mod list;
mod occlusion;
mod patch;
mod shape;
mod split;
mod sun;
mod sunlit;

pub use analytic::{AnalyticLights, rectangle};
pub use cap::{CAP, cap_luminance, cap_of, excess, luminance};
pub use colour::{color_temperature_k, rgb_from_color};
pub use edit::{LightsError, apply_edits, lost_edits, remove_emitters};
pub use emitters::{Emitter, emitters};
pub use image_change::ImageChange;
pub use kind::{LightKind, LightOrigin};
pub use light_estimate::{
    ArKitLightEstimate, EngineLight, LightEstimate, LightLayout, Point, UnityLightEstimate, WebXrLightEstimate,
};
pub use list::{ListedLight, list, list_emitters};
pub use occlusion::unoccluded_share;
pub use patch::{LightPatch, PatchShape};
pub use shape::{ClusterShape, ClusterSurface, LeafSurface};
pub use split::split_octree;
pub use sun::{sun_angles_deg, sun_direction, sun_from_shadow};
pub use sunlit::{ShadowSupport, SunEdge, Sunlit, shadow_support};
