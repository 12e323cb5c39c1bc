//! Light transport in a room of triangles: direct and indirect light baked once into a surface cache, from which views and
//! octrees are made.

mod view;
mod world;

pub use view::{Pose, Rendering, View};
pub use world::{Outdoors, Portal, Sun, World};
