//! Generated rooms, shards and published datasets. A single binary, so that it is linked once.
#![allow(clippy::unwrap_used)]

mod consistency;
mod hypersim_layout;
mod layouts;
mod lighthouse_layout;
mod mattes;
mod published;
mod shards;
mod unchanged;
