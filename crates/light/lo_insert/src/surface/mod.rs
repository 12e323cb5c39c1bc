//! Real surfaces from the depth map.

pub(crate) mod contact;
pub(crate) mod depth_steps;
pub(crate) mod holes;
pub(crate) mod observed_surfaces;
pub(crate) mod occluders;
pub(crate) mod receivers;
