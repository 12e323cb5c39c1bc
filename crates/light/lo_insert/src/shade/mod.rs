//! From visible fragments to the composite.

pub(crate) mod blocks;
pub(crate) mod composite;
pub(crate) mod cryptomatte;
pub(crate) mod fragment_material;
pub(crate) mod gloss;
pub(crate) mod passes;
pub(crate) mod redistortion;
pub(crate) mod refraction;
pub(crate) mod shader;
pub(crate) mod visibility;
