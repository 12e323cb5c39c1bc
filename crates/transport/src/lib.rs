//! Light transport in a room of triangles: direct and indirect light baked once into a surface cache, from which views and
//! octrees are made.

mod bake;
mod baked;
mod bright;
mod bsdf;
mod error;
mod exchange;
mod fineness;
mod gather;
mod gbuffer;
mod light_tree;
mod lighting;
mod lights;
mod neighbours;
mod parts;
mod pattern;
mod places;
mod points;
mod reach;
pub mod reference;
mod render;
mod scene;
mod settings;
mod shade;
mod sky;
mod surfels;
mod transfer;
mod view;
mod world;

pub use baked::BakedWorld;
pub use error::TransportError;
pub use points::SurfacePoints;
pub use reference::PathTracer;
pub use settings::BakeSettings;
pub use view::{Pose, Rendering, View};
pub use world::{Outdoors, Portal, Sun, World};
