//! The `lightoctree-lab` command: generated rooms, training and evaluation.
//!
//! A separate program, so that builds of `lightoctree` stay small. Exit codes: 0 success, 1 failure, 2 usage error.

pub mod cli;
pub mod commands;
mod config;
mod memory;
mod stage_bar;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use cli::{Cli, Command};

/// Parses the command line, runs the command and returns the exit code.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    lightoctree_cli::program(&cli.global, || run(&cli))
}

fn run(cli: &Cli) -> anyhow::Result<()> {
    let global = &cli.global;
    match &cli.command {
        Command::Synth(args) => commands::synth::run(global, args),
        Command::Dataset(args) => commands::dataset::run(global, args),
        Command::Train(args) => commands::train::run(global, args),
        Command::TrainBaseline(args) => commands::train_baseline::run(global, args),
        Command::Weights(args) => commands::weights::run(args),
        Command::Eval(args) => commands::eval::run(global, args),
        Command::Study(args) => commands::study::run(global, args),
        Command::Bench(args) => commands::bench::run(global, args),
        Command::Completions(args) => lightoctree_cli::commands::completions::run(args, &mut Cli::command()),
    }
}
