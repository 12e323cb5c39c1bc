//! Everything that the command line understands.

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};

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

/// Options of every command.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Options of every command")]
pub struct Global {
    /// Threads to use [default: one per core]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Seed of every random choice; only `synth`, `dataset`, `train`, `eval` and the networks of `estimate` make any, other results are always the same
    #[arg(long, global = true, value_name = "N", default_value_t = 0)]
    pub seed: u64,

    /// No progress and no notes, errors only
    #[arg(long, short, global = true)]
    pub quiet: bool,

    /// How much to say on stderr
    #[arg(long, global = true, value_name = "LEVEL", default_value = "warn")]
    pub log: LogLevel,
}

/// Options of commands whose result is a file.
#[derive(Debug, clap::Args)]
pub struct OutputArgs {
    /// The file to write
    #[arg(long, short, value_name = "FILE")]
    pub output: PathBuf,

    /// Replace existing files, whatever they are
    #[arg(long)]
    pub force: bool,

    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// How much to say on stderr.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum LogLevel {
    /// Failures only.
    Error,
    /// What may surprise too.
    Warn,
    /// What is done.
    Info,
    /// Details for developers.
    Debug,
    /// Everything.
    Trace,
}

impl LogLevel {
    /// What `tracing` calls it.
    pub fn level(self) -> tracing::Level {
        match self {
            Self::Error => tracing::Level::ERROR,
            Self::Warn => tracing::Level::WARN,
            Self::Info => tracing::Level::INFO,
            Self::Debug => tracing::Level::DEBUG,
            Self::Trace => tracing::Level::TRACE,
        }
    }
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
    /// Say what a scene file holds
    Inspect(commands::inspect::Args),
    /// Scene → PLY, GLB or USD for other programs
    Export(commands::export::Args),
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
            Self::Inspect(_) => "inspect",
            Self::Export(_) => "export",
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
