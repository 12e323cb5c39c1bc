//! WebDataset shards: plain `.tar` archives in which the files of one room share a name up to the first dot.
//!
//! All members open in Python with `tarfile`, `numpy` and PIL alone. Arrays are `.npy`: they load without a half-float
//! library, at the speed of the disk. An OpenEXR with ZIP takes two thirds of the space and forty times as long.
//! `docs/data.md` describes every member.

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
