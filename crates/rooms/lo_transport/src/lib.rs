//! Global illumination for triangle meshes of rooms. Direct and indirect light is baked once into a surface cache.
//! Views and octrees are made from the cache.

mod bake;
mod baked;
mod components;
mod error;
mod exchange;
mod gather;
mod gbuffer;
mod light_sampler;
mod light_tree;
mod lights;
mod neighbourhoods;
mod neighbours;
mod pattern;
mod points;
mod reachability;
pub mod reference;
mod refinement;
mod render;
mod secondary_emitters;
mod settings;
mod shade;
mod sky;
mod surface_samples;
mod surfels;
mod traced_world;
mod transfer;
mod view;
mod world;

pub use baked::BakedWorld;
pub use error::TransportError;
pub use points::SurfacePoints;
pub use reference::PathTracer;
pub use settings::BakeSettings;
pub use view::{Pose, RenderedView, View};
pub use world::{Outdoors, Portal, Sun, World};
