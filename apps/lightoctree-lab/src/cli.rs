//! Everything that the command line understands.

use clap::{Parser, Subcommand};
use lightoctree_cli::args::Global;
use lightoctree_cli::commands::completions;

use crate::commands;

/// Rooms with known light, training and evaluation: the workshop of `lightoctree`.
#[derive(Debug, Parser)]
#[command(name = "lightoctree-lab", version, propagate_version = true, max_term_width = 110)]
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
    Completions(completions::Args),
}
