//! Samples for training and evaluation, behind one interface: generated on the fly, in shards, or published by others.
//!
//! A [`Dataset`] gives samples by number; a [`Loader`] goes through one: shuffled, split by scene, made ahead by threads, resumable.

mod error;
#[cfg(test)]
mod fixture;
mod generated;
mod generator;
mod loader;
mod open;
mod order;
mod prefetch;
mod preview;
mod published;
mod record;
mod sample;
mod shard;
mod source;
mod summary;

pub use error::DatasetError;
pub use generated::Generated;
pub use generator::{Generator, GeneratorConfig};
pub use loader::{LoadError, Loader, LoaderConfig, LoaderState};
pub use open::Layout;
pub use preview::ContactSheet;
pub use published::{CropModel, FutureHouse, InteriorNet, LavalVarying, Panoramas};
pub use record::{Record, Shot};
pub use sample::{Metadata, NovelView, Sample, Split};
pub use shard::{FORMAT_VERSION, Shards, shard_name, write_shard};
pub use source::{Dataset, fingerprint};
pub use summary::{Distribution, Histogram, Summary, SummaryReport};
