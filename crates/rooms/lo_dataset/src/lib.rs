//! Samples for training and evaluation behind one interface: generated on the fly, read from shards, or from published
//! datasets.
//!
//! A [`Dataset`] returns samples by index. A [`Loader`] iterates over it: shuffled, split by scene, prefetched by
//! threads, resumable.

mod concat;
mod dataset;
mod error;
mod fill;
#[cfg(test)]
mod fixture;
mod generated;
mod generator;
mod layout;
mod loader;
mod loading;
mod observed;
mod order;
mod prefetch;
mod preview;
mod published;
mod record;
mod sample;
mod shard;
pub mod stages;
mod summary;
mod truth;

pub use concat::ConcatDataset;
pub use dataset::{Dataset, evenly_spread, fingerprint, indices_of};
pub use error::DatasetError;
pub use fill::{FillError, ShardCount, ShardPart, convert_to_shards, generate_shards};
pub use generated::GeneratedDataset;
pub use generator::{Generator, GeneratorConfig, GeneratorError};
pub use layout::DatasetLayout;
pub use loader::Loader;
pub use loading::{LoadError, LoaderConfig, LoaderState};
pub use observed::observed_mask;
pub use preview::ContactSheet;
pub use published::{
    CropModel, Frames, FutureHouse, Hypersim, InteriorNet, InteriorVerse, LavalVarying, Lighthouse, Panoramas, RoomPlan,
};
pub use record::{Record, Shot};
pub use sample::{Metadata, NovelView, Sample, Split};
pub use shard::{FORMAT_VERSION, ShardFolder, Shards, shard_name, write_shard};
pub use summary::{Distribution, Histogram, Summary, SummaryReport};
pub use truth::{TrueLeaves, true_octree};
