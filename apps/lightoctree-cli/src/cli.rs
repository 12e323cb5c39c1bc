//! Everything that the command line understands.

use clap::{Parser, Subcommand};

use crate::args::Global;
use crate::commands;

/// Indoor lighting from one photo: a lighting octree, HDR panoramas at any point, objects in the picture.
#[derive(Debug, Parser)]
#[command(name = "lightoctree", version, propagate_version = true, max_term_width = 110)]
pub struct Cli {
    /// Options of every command.
    #[command(flatten)]
    pub global: Global,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the whole job on a photo that the program carries
    Demo(commands::demo::Args),
    /// Photo, with or without depth → scene file
    Estimate(commands::estimate::Args),
    /// Scene → HDR panorama at a point
    Envmap(commands::envmap::Args),
    /// Scene → many HDR panoramas with a manifest
    Probes(commands::probes::Args),
    /// Put a virtual object into the photo
    Insert(commands::insert::Args),
    /// Move objects and light about in a browser
    View(commands::view::Args),
    /// Say what a scene file holds
    Inspect(commands::inspect::Args),
    /// List what gives light in a scene, and change it
    Lights(commands::lights::Args),
    /// Scene → PLY, GLB or USD for other programs
    Export(commands::export::Args),
    /// Photos of a mirror ball → HDR panorama
    Unwrap(commands::unwrap::Args),
    /// Print a completion script for a shell
    Completions(commands::completions::Args),
}
