//! Light transport in a room of triangles: direct and indirect light baked once into a surface cache, from which views and
//! octrees are made.

mod bake;
mod baked;
mod bright;
mod error;
mod exchange;
mod fineness;
mod gather;
mod gbuffer;
mod light_sampler;
mod light_tree;
mod lights;
mod neighbourhoods;
mod neighbours;
mod parts;
mod pattern;
mod places;
mod points;
mod reach;
pub mod reference;
mod render;
mod settings;
mod shade;
mod sky;
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
