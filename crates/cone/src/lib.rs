//! Voxel cone tracing of a lighting octree: colour, expected distance and opacity, forward and exact backward (SPEC §3).

mod settings;

pub use settings::{Cone, Sample, SampleWeight, Sampling, Settings, StepRule};
