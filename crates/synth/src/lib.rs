//! Procedural indoor scenes and the samples rendered from them.
