//! `lightoctree-lab weights`: averages, merges, splits, joins and inspects weights files.

use std::path::PathBuf;

use lightoctree_cli::{output, report};
use lo_train::weight_files;

/// Options of `weights`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree-lab weights average run-1/weights.safetensors run-2/weights.safetensors -o mean.safetensors\n  \
    lightoctree-lab weights merge --depth depth/weights.safetensors --light light/weights.safetensors -o both.safetensors\n  \
    lightoctree-lab weights split both.safetensors --encoder encoder.safetensors --heads heads.safetensors\n  \
    lightoctree-lab weights join encoder.safetensors heads.safetensors -o both.safetensors\n  \
    lightoctree-lab weights inspect both.safetensors\n\n\
    All commands also accept the checkpoint.safetensors of a run and use its averaged weights. Weights are written in 16 \
    bits.")]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

/// Operations on weights files.
#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Average the weights of networks of the same shape
    Average {
        /// Weights files or checkpoints, at least two
        #[arg(required = true, num_args = 2.., value_name = "FILE")]
        files: Vec<PathBuf>,
        #[command(flatten)]
        to: OutputFile,
    },
    /// Combine the depth network of one file with the light network of another
    Merge {
        /// File with the depth network
        #[arg(long, value_name = "FILE")]
        depth: PathBuf,
        /// File with the light network, and with the expected-light network if it has one
        #[arg(long, value_name = "FILE")]
        light: PathBuf,
        #[command(flatten)]
        to: OutputFile,
    },
    /// Write the two files that ship: the image encoder, and all other weights
    Split {
        /// Weights file or checkpoint
        file: PathBuf,
        /// Output file for the image encoder
        #[arg(long, value_name = "FILE")]
        encoder: PathBuf,
        /// Output file for all other weights
        #[arg(long, value_name = "FILE")]
        heads: PathBuf,
        /// Overwrite any existing files
        #[arg(long)]
        force: bool,
    },
    /// Combine the files that `split` wrote
    Join {
        /// Parts of the weights
        #[arg(required = true, num_args = 2.., value_name = "FILE")]
        parts: Vec<PathBuf>,
        #[command(flatten)]
        to: OutputFile,
    },
    /// Print SHA-256, size, number of weights, encoder, and shape of the light network
    Inspect {
        /// Weights file or checkpoint
        file: PathBuf,
        /// Print as JSON
        #[arg(long)]
        json: bool,
    },
}

/// Output file.
#[derive(Debug, clap::Args)]
struct OutputFile {
    /// File to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Overwrite any existing file
    #[arg(long)]
    force: bool,
}

const COMMAND: &str = "weights";

/// Runs the selected operation.
pub fn run(args: &Args) -> anyhow::Result<()> {
    match &args.action {
        Action::Average { files, to } => {
            output::check_replaceable(&to.output, COMMAND, to.force)?;
            weight_files::average(files, &to.output)?;
            report::print(&to.output.display().to_string());
        }
        Action::Merge { depth, light, to } => {
            output::check_replaceable(&to.output, COMMAND, to.force)?;
            weight_files::merge(depth, light, &to.output)?;
            report::print(&to.output.display().to_string());
        }
        Action::Split { file, encoder, heads, force } => {
            for output in [encoder, heads] {
                output::check_replaceable(output, COMMAND, *force)?;
            }
            weight_files::split(file, encoder, heads)?;
            for output in [encoder, heads] {
                report::print(&output.display().to_string());
            }
        }
        Action::Join { parts, to } => {
            output::check_replaceable(&to.output, COMMAND, to.force)?;
            weight_files::join(parts, &to.output)?;
            report::print(&to.output.display().to_string());
        }
        Action::Inspect { file, json } => {
            let found = weight_files::inspect(file)?;
            if *json {
                report::print_json(&found)?;
            } else {
                let rows = [
                    ("SHA-256", found.sha256.clone()),
                    ("size", report::bytes(found.bytes)),
                    ("depth network", format!("{} weights", found.depth_net_values)),
                    ("encoder", found.encoder.to_string()),
                    ("light network", format!("{} weights", found.light_net_values)),
                ];
                let rows: Vec<Vec<String>> = rows.map(|(what, value)| vec![what.to_owned(), value]).to_vec();
                report::print(&report::table(&["", ""], &rows));
                report::print(crate::config::text(&found.light_net)?.trim_end());
            }
        }
    }
    Ok(())
}
