//! From visible fragments to the composite.

pub(crate) mod blocks;
pub(crate) mod composite;
pub(crate) mod gloss;
pub(crate) mod look;
pub(crate) mod shader;
pub(crate) mod visibility;
