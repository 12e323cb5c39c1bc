//! Spheres under a panorama.
//!
//! What a sphere looks like is a linear function of the light around it: a [`Transport`] holds it for one object and one view, made once, and
//! shows the object under any panorama in milliseconds, always with the same error.

mod array;
mod material;
mod single;
mod transport;

pub use array::sphere_array;
pub use material::Material;
pub use single::{SphereView, single_sphere};
pub use transport::Transport;
