//! Definition of the command line.

use clap::{Parser, Subcommand};
use lightoctree_cli::args::Global;
use lightoctree_cli::commands::completions;

use crate::commands;

/// Research and training tools for lightoctree: generate rooms with known light, train networks, evaluate methods
#[derive(Debug, Parser)]
#[command(name = "lightoctree-lab", version, propagate_version = true, max_term_width = 110)]
pub struct Cli {
    /// Global options.
    #[command(flatten)]
    pub global: Global,
    /// The command to run.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Generate procedural rooms with global illumination, as training data
    Synth(commands::synth::Args),
    /// Inspect, convert or preview a dataset
    Dataset(commands::dataset::Args),
    /// Train the networks
    Train(commands::train::Args),
    /// Train a system that the paper compares with
    TrainBaseline(commands::train_baseline::Args),
    /// Average, merge or inspect weights files
    Weights(commands::weights::Args),
    /// Evaluate methods and baselines on a dataset
    Eval(commands::eval::Args),
    /// Make a user study of inserted objects, or evaluate its answers
    Study(commands::study::Args),
    /// Benchmark this program on the input of the peers' kit
    Bench(commands::bench::Args),
    /// Print a shell completion script
    Completions(completions::Args),
}
