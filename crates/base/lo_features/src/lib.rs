//! No code: the features of shared dependencies, so that each crate alone builds them as the whole workspace does (see `Cargo.toml`).
