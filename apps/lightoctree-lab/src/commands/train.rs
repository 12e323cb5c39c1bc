//! `lightoctree-lab train`: trains the networks.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::Context;
use indicatif::ProgressBar;
use lightoctree_cli::args::Global;
use lightoctree_cli::progress::{bar, seconds};
use lightoctree_cli::usage::Usage;
use lightoctree_cli::{interrupt, output, report};
use lo_dataset::stages::READ_SAMPLES;
use lo_events::{Event, Figure, Stage};
use lo_train::{CHECKPOINT_FILE, InitialWeights, TrainConfig, TrainError, TrainRequest, stages};

use serde::Serialize;

use crate::config::{self, ConfigArgs};

/// Options of `train`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree-lab train --config configs/shipped.toml --data rooms -o run\n  \
    lightoctree-lab train --set light.0.steps=500 --data rooms -o run\n  \
    lightoctree-lab train --resume -o run\n  \
    lightoctree-lab train --print-config > mine.toml\n  \
    lightoctree estimate photo.jpg --completion network --weights run/weights.safetensors -o room.scene\n\n\
    Files in the output folder:\n  \
    config.toml             the configuration\n  \
    checkpoint.safetensors  complete training state, for --resume\n  \
    weights.safetensors     averaged weights, for `lightoctree estimate --weights`\n  \
    log.jsonl               losses and validation figures, one JSON object per line\n  \
    sheet.png               held-out photos: predicted and true panorama, depth and octree\n\n\
    Ctrl-C writes a checkpoint and stops. If the process is killed, the steps since the last checkpoint are lost; \
    --resume computes the same weights again.")]
pub struct Args {
    #[command(flatten)]
    config: ConfigArgs,

    /// Dataset folder; overrides data.folder of the configuration
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,

    /// Start from trained weights of all networks, in the format of `lightoctree estimate --weights`
    #[arg(long, value_name = "FILE", conflicts_with_all = ["resume", "depth_weights", "encoder_weights"])]
    weights: Option<PathBuf>,

    /// Start from the depth network of trained weights, skip the depth phases, and train the light network from scratch
    #[arg(long, value_name = "FILE", conflicts_with_all = ["resume", "encoder_weights"])]
    depth_weights: Option<PathBuf>,

    /// Start from published encoder weights: a .pth file, or .safetensors with the same tensor names
    #[arg(long, value_name = "FILE", conflicts_with = "resume")]
    encoder_weights: Option<PathBuf>,

    #[command(flatten)]
    run: RunArgs,
}

const COMMAND: &str = "train";
pub(super) const CONFIG: &str = "config.toml";

/// Trains until all phases are complete or Ctrl-C is pressed.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    let Some(folder) = args.run.output.as_deref().filter(|_| !args.config.print_config) else {
        report::print(config::text(&read_config(args, None)?)?.trim_end());
        return Ok(());
    };
    let config = read_config(args, args.run.resumed(folder)?)?;
    args.run.prepare(folder, &config, COMMAND)?;
    crate::memory::retain_freed_memory();
    let request = TrainRequest {
        folder,
        resume: args.run.resume,
        seed: global.seed,
        start: match (&args.weights, &args.depth_weights, &args.encoder_weights) {
            (Some(file), ..) => InitialWeights::Networks(file),
            (_, Some(file), _) => InitialWeights::DepthNetwork(file),
            (.., Some(file)) => InitialWeights::Encoder(file),
            (None, None, None) => InitialWeights::Random,
        },
    };
    let mut progress = TrainProgress::new(global.quiet, config.phase_stages());
    let outcome = lo_train::train(&config, &request, &mut |event| progress.handle_until_interrupted(event));
    progress.finish(outcome, folder, COMMAND, args.run.json)
}

/// Reads the configuration of `--config`, else of the run to resume, else the default.
fn read_config(args: &Args, run: Option<&Path>) -> anyhow::Result<TrainConfig> {
    let of_run = run.map(|folder| folder.join(CONFIG));
    let mut config: TrainConfig = args.config.read(of_run.as_deref())?;
    if let Some(data) = &args.data {
        config.data.folder = Some(data.clone());
    }
    if args.depth_weights.is_some() {
        config.depth.clear();
    }
    config.validate().map_err(|error| args.config.invalid(of_run.as_deref(), error))?;
    Ok(config)
}

/// Options of the folder of a run.
#[derive(Debug, clap::Args)]
pub(super) struct RunArgs {
    /// Continue from the checkpoint in the output folder, with its configuration or that of --config
    #[arg(long)]
    pub resume: bool,

    /// Output folder of the run
    #[arg(long, short, value_name = "DIR", required_unless_present = "print_config")]
    pub output: Option<PathBuf>,

    /// Start a new run in a folder that contains another run or other files
    #[arg(long, conflicts_with = "resume")]
    force: bool,

    /// Print a summary as JSON: completion, steps and the last validation
    #[arg(long)]
    pub json: bool,
}

impl RunArgs {
    /// Returns the folder of the run to resume; `None` for a new run.
    ///
    /// # Errors
    /// A run to resume without a checkpoint.
    pub fn resumed<'a>(&self, folder: &'a Path) -> anyhow::Result<Option<&'a Path>> {
        if self.resume && !folder.join(CHECKPOINT_FILE).exists() {
            return Err(Usage(format!("{} has no {CHECKPOINT_FILE} to resume from", folder.display())).into());
        }
        Ok(self.resume.then_some(folder))
    }

    /// Prepares the folder of a new run, and writes the configuration, signed by the command.
    ///
    /// # Errors
    /// Folders with another run or other files, unless `--force` is given; errors of the file system.
    pub fn prepare<T: Serialize>(&self, folder: &Path, config: &T, command: &str) -> anyhow::Result<()> {
        if !self.resume {
            output::prepare_folder(folder, CONFIG, command, self.force)?;
            if folder.join(CHECKPOINT_FILE).exists() && !self.force {
                let hint = "continue it with --resume, or replace it with --force";
                return Err(Usage(format!("{} contains a run: {hint}", folder.display())).into());
            }
        }
        let path = folder.join(CONFIG);
        let text = format!("# {}\n{}", output::signature(command), config::text(config)?);
        lo_imaging::write_atomically(&path, |out| std::io::Write::write_all(out, text.as_bytes()))
            .with_context(|| format!("cannot write {}", path.display()))
    }
}

/// Shows the events of a run as a progress bar and lines on stderr.
pub(super) struct TrainProgress {
    quiet: bool,
    /// Stages of the training phases.
    phases: Vec<Stage>,
    bar: ProgressBar,
    /// Steps of this invocation.
    steps: u64,
    /// Figures of the last validation.
    last: Vec<Figure>,
}

impl TrainProgress {
    /// Shows the steps of these stages.
    pub fn new(quiet: bool, phases: Vec<Stage>) -> Self {
        Self { quiet, phases, bar: ProgressBar::hidden(), steps: 0, last: Vec::new() }
    }

    /// Handles an event, and stops the run after Ctrl-C.
    pub fn handle_until_interrupted(&mut self, event: Event) -> ControlFlow<()> {
        self.handle(event);
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Reports the end of a run by `command`.
    ///
    /// # Errors
    /// The run's error, or that it was stopped.
    pub fn finish(
        self,
        outcome: Result<(), TrainError>,
        folder: &Path,
        command: &str,
        json: bool,
    ) -> anyhow::Result<()> {
        self.bar.finish_and_clear();
        let done = match outcome {
            Ok(()) => true,
            Err(TrainError::Cancelled(_)) => false,
            Err(error) => return Err(error.into()),
        };
        if json {
            // Figures have single precision; converting avoids spurious digits.
            let last: serde_json::Map<_, _> =
                self.last.iter().map(|figure| (figure.name.to_owned(), (figure.value as f32).into())).collect();
            let last = (!last.is_empty()).then_some(last);
            report::print_json(&serde_json::json!({ "done": done, "steps": self.steps, "validation": last }))?;
        } else {
            report::print(&format!("{}  {} steps{}", folder.display(), self.steps, figures(&self.last)));
        }
        if !done {
            anyhow::bail!("stopped; to continue: lightoctree-lab {command} --resume -o {}", folder.display());
        }
        Ok(())
    }

    fn handle(&mut self, event: Event) {
        match event {
            Event::Begun(stage) if self.phases.contains(&stage) => {
                self.bar.finish_and_clear();
                self.bar = bar(self.quiet, 0, stage.name());
            }
            Event::Progress { stage, done, total } if self.phases.contains(&stage) => {
                if self.bar.length() != Some(total) {
                    self.print(&format!("{stage}: {total} steps"));
                    self.bar.set_length(total);
                    self.bar.set_position(done);
                    self.bar.reset_eta();
                }
                self.bar.set_position(done);
            }
            Event::Figures { stage, figures: found } if stage == stages::VALIDATION => {
                self.print(&format!("validation{}", figures(&found)));
                self.last = found;
            }
            Event::Begun(stage) if stage == READ_SAMPLES => self.bar = bar(self.quiet, 0, stage.name()),
            Event::Progress { stage, done, total } if stage == READ_SAMPLES => {
                self.bar.set_length(total);
                self.bar.set_position(done);
            }
            Event::Figures { figures, .. } => {
                self.steps += 1;
                let losses = figures.iter().map(|loss| format!("{} {:.3}", loss.name, loss.value));
                self.bar.set_message(losses.collect::<Vec<_>>().join(", "));
            }
            Event::Done { stage, took } if stage == stages::CHECKPOINT => {
                tracing::debug!("{stage} written in {}", seconds(took));
            }
            Event::Warning(warning) => self.print(&format!("note: {warning}")),
            _ => {}
        }
    }

    fn print(&self, text: &str) {
        if !self.quiet {
            self.bar.suspend(|| eprintln!("  {text}"));
        }
    }
}

/// Formats the figures of a validation as one line.
fn figures(found: &[Figure]) -> String {
    let part = |&Figure { name, value }: &Figure| {
        let db = |what: &str| format!("  {what} {value:.2} dB");
        Some(match name {
            "depth_abs_rel" => format!("  depth abs-rel {value:.3}"),
            "depth_delta1" => format!("  δ1 {value:.3}"),
            "global_psnr_db" => db("single map"),
            "psnr_db" => db("panoramas"),
            "photo_alone_psnr_db" => db("photo alone"),
            "true_octree_psnr_db" => db("true octree"),
            "shell_psnr_db" => db("shell"),
            "contrast_stops" => format!("  contrast {value:.2} stops"),
            "unseen_irradiance_relative_si_rmse" => format!("  unseen irradiance {value:.3}"),
            "split_accuracy" => format!("  splits {:.1} %", 100.0 * value),
            _ => return None,
        })
    };
    found.iter().filter_map(part).collect()
}
