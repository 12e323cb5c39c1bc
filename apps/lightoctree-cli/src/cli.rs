//! The command line of `lightoctree`.

use clap::{Parser, Subcommand};

use crate::args::Global;
use crate::commands;

/// Estimates the lighting of a room from one photo, renders HDR panoramas at any point and inserts virtual objects
#[derive(Debug, Parser)]
#[command(name = "lightoctree", version, propagate_version = true, max_term_width = 110)]
pub struct Cli {
    /// Global options.
    #[command(flatten)]
    pub global: Global,
    /// Selected command.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run all steps on a bundled photo
    Demo(commands::demo::Args),
    /// Estimate a scene from a photo, with or without depth
    Estimate(commands::estimate::Args),
    /// Render an HDR environment map at a point of a scene
    Envmap(commands::envmap::Args),
    /// Render HDR environment maps at many points of a scene
    Probes(commands::probes::Args),
    /// Insert virtual objects into the photo of a scene
    Insert(commands::insert::Args),
    /// Move objects and edit lights in the browser
    View(commands::view::Args),
    /// Print the contents of a scene file
    Inspect(commands::inspect::Args),
    /// List and edit the lights of a scene
    Lights(commands::lights::Args),
    /// Convert a scene to PLY, glTF or USD
    Export(commands::export::Args),
    /// Convert photos of a mirror ball to an HDR panorama
    Unwrap(commands::unwrap::Args),
    /// Print a shell completion script
    Completions(commands::completions::Args),
}
