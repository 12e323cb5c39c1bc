//! Real surfaces as the depth map shows them.

pub(crate) mod depth_steps;
pub(crate) mod holes;
pub(crate) mod occluders;
pub(crate) mod receivers;
pub(crate) mod seen_surfaces;
