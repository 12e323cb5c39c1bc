//! WebDataset shards: plain `.tar` archives in which the files of one room share a name up to the first dot.
//!
//! Everything opens in Python with `tarfile`, `numpy` and PIL alone. Arrays are `.npy` because they load without a library for half
//! floats, at the speed of the disk; an OpenEXR with ZIP takes two thirds of the space and forty times as long. `docs/data.md` describes every
//! member.

mod array;
mod folder;
mod header;
mod index;
mod pack;
mod read;
mod write;

pub use folder::ShardFolder;
pub use header::FORMAT_VERSION;
pub use read::Shards;
pub use write::{shard_name, write_shard};
