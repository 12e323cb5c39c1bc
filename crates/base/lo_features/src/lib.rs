//! Feature unification of shared dependencies; no code.
//!
//! Makes a build of one crate use the same dependency artifacts as a build of the whole workspace (see `Cargo.toml`).
