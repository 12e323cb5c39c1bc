//! Voxel cone tracing of a lighting octree: colour, expected distance and opacity, forward and exact backward (SPEC §3).

mod gradient;
mod grid;
mod march;
mod reconstruction;
mod settings;
mod steps;
mod tracer;

pub use gradient::{Gradients, SampleGradient};
pub use settings::{Cone, Rendering, Sample, SampleWeight, Sampling, Settings, SettingsError, StepRule};
pub use tracer::ConeTracer;
