//! Options shared by the commands of both programs.

use std::path::PathBuf;

use clap::ValueEnum;

/// Options of every command.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Global options")]
pub struct Global {
    /// Number of threads [default: one per CPU core]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Seed of random numbers; commands without randomness ignore it
    #[arg(long, global = true, value_name = "N", default_value_t = 0)]
    pub seed: u64,

    /// Print only results and errors, without progress and notes
    #[arg(long, short, global = true)]
    pub quiet: bool,

    /// Log level on stderr
    #[arg(long, global = true, value_name = "LEVEL", default_value = "warn")]
    pub log: LogLevel,
}

/// Options of commands that write a file.
#[derive(Debug, clap::Args)]
pub struct OutputArgs {
    /// Output file
    #[arg(long, short, value_name = "FILE")]
    pub output: PathBuf,

    /// Overwrite existing files of any origin
    #[arg(long)]
    pub force: bool,

    /// Print a summary as JSON
    #[arg(long)]
    pub json: bool,
}

/// Log level of messages on stderr.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum LogLevel {
    /// Errors.
    Error,
    /// Also warnings.
    Warn,
    /// Also what is being done.
    Info,
    /// Also details for developers.
    Debug,
    /// Everything.
    Trace,
}

impl LogLevel {
    /// Converts it to the type of `tracing`.
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
