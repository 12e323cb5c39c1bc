//! Samples for training and evaluation, behind one interface: generated on the fly, in shards, or published by others.

mod sample;

pub use sample::{NovelView, Sample, Split};
