//! `lightoctree-lab train-baseline`: trains a system that the paper compares with.

use std::path::{Path, PathBuf};

use anyhow::Context;
use lightoctree_cli::args::Global;
use lightoctree_cli::report;
use lightoctree_cli::usage::Usage;
use lo_train::{BaselineConfig, BaselineRequest};

use super::train::{CONFIG, RunArgs, TrainProgress};
use crate::config::{self, ConfigArgs};

/// Options of `train-baseline`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree-lab train-baseline --config configs/baselines/garon2019.toml --data rooms -o run\n  \
    lightoctree-lab train-baseline --resume -o run\n  \
    lightoctree-lab eval rooms --baseline garon2019=run/weights.safetensors -o report\n\n\
    Files in the output folder:\n  \
    config.toml             the configuration\n  \
    checkpoint.safetensors  complete training state, for --resume\n  \
    weights.safetensors     averaged weights, for `eval --baseline`\n  \
    log.jsonl               losses and validation figures, one JSON object per line\n\n\
    Ctrl-C writes a checkpoint and stops. If the process is killed, --resume computes the same weights again.")]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    /// Dataset folder; overrides data.folder of the configuration
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,

    /// Weights whose depth network computes the image features; it is not trained [default: the built-in weights]
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,

    /// Folder of cached examples; runs of all systems on the same data and seed share them [default: OUTPUT/examples]
    #[arg(long, value_name = "DIR")]
    examples: Option<PathBuf>,

    #[command(flatten)]
    run: RunArgs,
}

const COMMAND: &str = "train-baseline";

/// Trains until all steps are complete or Ctrl-C is pressed.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    let Some(folder) = args.run.output.as_deref().filter(|_| !args.config.print_config) else {
        report::print(config::text(&read_config(args, None)?)?.trim_end());
        return Ok(());
    };
    let config = read_config(args, args.run.resumed(folder)?)?;
    if args.weights.is_none() && !cfg!(feature = "weights") {
        return Err(Usage("--weights FILE is required: this program has no built-in weights".into()).into());
    }
    let estimator = lightoctree_cli::commands::estimator(args.weights.as_deref())?;
    let networks = estimator.networks().context("the estimator has no networks")?;
    args.run.prepare(folder, &config, COMMAND)?;
    crate::memory::retain_freed_memory();
    let examples = args.examples.clone().unwrap_or_else(|| folder.join("examples"));
    let request = BaselineRequest { folder, examples: &examples, networks, resume: args.run.resume, seed: global.seed };
    let mut progress = TrainProgress::new(global.quiet, vec![config.stage()]);
    let outcome = lo_train::train_baseline(&config, &request, &mut |event| progress.handle_until_interrupted(event));
    progress.finish(outcome, folder, COMMAND, args.run.json)
}

/// Reads the configuration of `--config`, else of the run to resume, else the default.
fn read_config(args: &Args, run: Option<&Path>) -> anyhow::Result<BaselineConfig> {
    let of_run = run.map(|folder| folder.join(CONFIG));
    let mut config: BaselineConfig = args.config.read(of_run.as_deref())?;
    if let Some(data) = &args.data {
        config.data.folder = Some(data.clone());
    }
    config.validate().map_err(|error| args.config.invalid(of_run.as_deref(), error))?;
    Ok(config)
}
