//! The `lightoctree` command: indoor lighting from one photo.
//!
//! It is a library so that its options can be tested and fuzzed; `main.rs` only calls [`main`]. `lightoctree-lab`
//! shares its threads, log, Ctrl-C handler, progress and exit codes through [`program`].
//! Exit codes: 0 success, 1 the command failed, 2 wrong usage.

pub mod args;
pub mod choice;
pub mod cli;
pub mod commands;
mod depth_units;
pub mod interrupt;
mod numbered_name;
pub mod output;
pub mod progress;
pub mod report;
pub mod usage;
mod warning_text;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use args::Global;
use cli::{Cli, Command};
use usage::Usage;

/// Runs the program: parses the command line, runs the command and returns the exit code.
pub fn main() -> ExitCode {
    main_with(std::env::args_os()).into()
}

/// Like [`main`], for a given command line. Its first element is the name of the program.
pub fn main_with(args: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = Cli::parse_from(args);
    exit_code(&cli.global, || run(&cli))
}

/// Starts log, threads and the Ctrl-C handler, runs a job, prints its error and returns the exit code.
pub fn program(global: &Global, job: impl FnOnce() -> anyhow::Result<()>) -> ExitCode {
    exit_code(global, job).into()
}

fn exit_code(global: &Global, job: impl FnOnce() -> anyhow::Result<()>) -> u8 {
    start_log(global);
    if let Err(error) = start_threads(global.threads) {
        eprintln!("error: {error:#}");
        return 2;
    }
    interrupt::install();
    match job() {
        Ok(()) => 0,
        Err(error) => {
            eprintln!("error: {}", report::error_message(&error));
            if error.is::<Usage>() { 2 } else { 1 }
        }
    }
}

fn run(cli: &Cli) -> anyhow::Result<()> {
    let global = &cli.global;
    match &cli.command {
        Command::Demo(args) => commands::demo::run(global, args),
        Command::Estimate(args) => commands::estimate::run(global, args),
        Command::Batch(args) => commands::batch::run(global, args),
        Command::Envmap(args) => commands::envmap::run(global, args),
        Command::Probes(args) => commands::probes::run(global, args),
        Command::Insert(args) => commands::insert::run(global, args),
        Command::View(args) => commands::view::run(global, args),
        Command::Inspect(args) => commands::inspect::run(args),
        Command::Lights(args) => commands::lights::run(global, args),
        Command::Export(args) => commands::export::run(global, args),
        Command::Unwrap(args) => commands::unwrap::run(global, args),
        Command::Completions(args) => commands::completions::run(args, &mut Cli::command()),
        Command::Man(args) => commands::man::run(args, Cli::command()),
    }
}

fn start_log(global: &Global) {
    let level = if global.quiet { tracing::Level::ERROR } else { global.log.level() };
    tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(std::io::stderr)
        .without_time()
        .with_target(false)
        .init();
}

fn start_threads(threads: Option<u16>) -> anyhow::Result<()> {
    if let Some(threads) = threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global()?;
    }
    Ok(())
}
