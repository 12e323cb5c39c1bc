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
    /// Make procedural rooms with global light for training
    Synth(commands::synth::Args),
    /// Look at, convert or preview a dataset
    Dataset(commands::dataset::Args),
    /// Train the networks
    Train(commands::train::Args),
    /// Average, merge or inspect files of trained weights
    Weights(commands::weights::Args),
    /// Measure methods and baselines on a dataset
    Eval(commands::eval::Args),
    /// Time this program on the input of the peers' kit
    Bench(commands::bench::Args),
    /// Print a completion script for a shell
    Completions(commands::completions::Args),
}

impl Command {
    /// The word on the command line.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Demo(_) => "demo",
            Self::Estimate(_) => "estimate",
            Self::Envmap(_) => "envmap",
            Self::Probes(_) => "probes",
            Self::Insert(_) => "insert",
            Self::View(_) => "view",
            Self::Inspect(_) => "inspect",
            Self::Lights(_) => "lights",
            Self::Export(_) => "export",
            Self::Unwrap(_) => "unwrap",
            Self::Synth(_) => "synth",
            Self::Dataset(_) => "dataset",
            Self::Train(_) => "train",
            Self::Weights(_) => "weights",
            Self::Eval(_) => "eval",
            Self::Bench(_) => "bench",
            Self::Completions(_) => "completions",
        }
    }
}
