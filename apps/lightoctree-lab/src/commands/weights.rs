//! `lightoctree-lab weights`: files of weights on their way from training to use.

use std::path::PathBuf;

use lightoctree_cli::{output, report};
use lo_train::weight_files;

/// Options of `weights`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree-lab weights average run-1/weights.safetensors run-2/weights.safetensors -o mean.safetensors\n  \
    lightoctree-lab weights merge --depth depth/weights.safetensors --light light/weights.safetensors -o both.safetensors\n  \
    lightoctree-lab weights inspect both.safetensors\n\n\
    All of them also take a run's checkpoint.safetensors, of which the averaged weights count. What is written holds 16 bits a weight.")]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

/// What to do with files of weights.
#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Write the mean of networks of one shape, weight by weight
    Average {
        /// Files of weights
        #[arg(required = true, num_args = 2.., value_name = "FILE")]
        files: Vec<PathBuf>,
        #[command(flatten)]
        to: OutputFile,
    },
    /// Write the depth network of one file and the light network of another as one file
    Merge {
        /// The file with the depth network
        #[arg(long, value_name = "FILE")]
        depth: PathBuf,
        /// The file with the light network
        #[arg(long, value_name = "FILE")]
        light: PathBuf,
        #[command(flatten)]
        to: OutputFile,
    },
    /// Say what a file holds: SHA-256, size, number of weights, the light network's shape
    Inspect {
        /// A file of weights
        file: PathBuf,
        /// Print it as JSON
        #[arg(long)]
        json: bool,
    },
}

/// The file to write.
#[derive(Debug, clap::Args)]
struct OutputFile {
    /// The file to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

const COMMAND: &str = "weights";

/// Averages, merges or inspects.
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
