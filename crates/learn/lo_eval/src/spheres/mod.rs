//! Spheres lit by a panorama.
//!
//! The image of a sphere is a linear function of distant light. A [`Transport`] stores this function for one object and
//! view. It is computed once and renders the object under any panorama in milliseconds.

mod array;
mod material;
mod single;
mod transport;

pub use array::sphere_array;
pub use material::Material;
pub use single::{SphereView, single_sphere};
pub use transport::Transport;
