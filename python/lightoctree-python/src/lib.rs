//! The native module of the Python package `lightoctree`; `python/src/lightoctree/_lightoctree.pyi` has its types.
//!
//! It converts between Python objects and the facade's types. Work runs on a thread of its own, without the
//! interpreter ([`job`]).

mod arrays;
mod choice;
mod composite;
mod data;
mod errors;
mod estimate;
mod export;
mod inputs;
mod insert;
mod job;
mod lights;
mod listener;
mod octree;
mod panorama;
mod preview;
mod render;
mod scene;

use std::ffi::OsString;

use pyo3::prelude::*;

/// As in the program.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// The name of the program with the names of its commands, as the command line writes it into files.
fn signature(command: &str) -> String {
    lightoctree_cli::output::signature(command)
}

/// Runs the program `lightoctree` with the arguments of the interpreter and returns its exit code.
#[pyfunction]
fn main(py: Python<'_>) -> PyResult<u8> {
    let args: Vec<OsString> = py.import("sys")?.getattr("argv")?.extract()?;
    Ok(py.detach(|| lightoctree_cli::main_with(args)))
}

#[pymodule]
mod _lightoctree {
    #[pymodule_export]
    use super::composite::Composite;
    #[pymodule_export]
    use super::data::{Samples, read, rooms};
    #[pymodule_export]
    use super::estimate::estimate;
    #[pymodule_export]
    use super::insert::Sequence;
    #[pymodule_export]
    use super::main;
    #[pymodule_export]
    use super::octree::{Octree, OctreeLevel};
    #[pymodule_export]
    use super::panorama::Panorama;
    #[pymodule_export]
    use super::render::{trace, trace_backward};
    #[pymodule_export]
    use super::scene::Scene;

    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
