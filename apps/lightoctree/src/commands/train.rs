//! `lightoctree train`: the networks, from rooms with known light.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use anyhow::Context;
use indicatif::ProgressBar;
use train::{CHECKPOINT_FILE, Message, Outcome, Request, TrainConfig, ValidationReport};

use crate::args::Global;
use crate::progress::{bar, seconds};
use crate::{Usage, config, interrupt, output, report};

/// Options of `train`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree train --config configs/two-cores.toml --data rooms -o run\n  \
    lightoctree train --resume -o run\n  \
    lightoctree train --print-config > mine.toml\n  \
    lightoctree estimate photo.jpg --completion network --weights run/weights.safetensors -o room.scene\n\n\
    The folder holds config.toml, checkpoint.safetensors (all that is needed to go on), weights.safetensors (what `estimate` takes), \
    log.jsonl and sheet.png (held-out photos; predicted and true panorama, depth and octree). Files are replaced, not piled up. Ctrl-C writes a \
    checkpoint and stops; a run that was killed loses what came after its last checkpoint, and --resume computes the same again.")]
pub struct Args {
    /// What is trained, on what and how long: TOML with the fields that --print-config shows, as many as differ
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,

    /// The folder of training data, instead of the configuration's
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,

    /// Trained weights to begin with, as `estimate --weights` takes them
    #[arg(long, value_name = "FILE", conflicts_with_all = ["resume", "encoder_weights"])]
    weights: Option<PathBuf>,

    /// Weights of torchvision's densenet121 (.safetensors) to begin with
    #[arg(long, value_name = "FILE", conflicts_with = "resume")]
    encoder_weights: Option<PathBuf>,

    /// Go on from the folder's checkpoint, with the configuration there or that of --config
    #[arg(long)]
    resume: bool,

    /// Print the configuration with all of its fields and stop
    #[arg(long)]
    print_config: bool,

    /// The run's folder
    #[arg(long, short, value_name = "DIR", required_unless_present = "print_config")]
    output: Option<PathBuf>,

    /// Begin a new run in a folder that holds another one, or other things
    #[arg(long, conflicts_with = "resume")]
    force: bool,

    /// Print how the run ended as JSON
    #[arg(long)]
    json: bool,
}

const COMMAND: &str = "train";
const CONFIG: &str = "config.toml";

/// Trains until all phases are done or Ctrl-C is pressed.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    let Some(folder) = args.output.as_deref().filter(|_| !args.print_config) else {
        report::print(config::text(&read_config(args, None)?)?.trim_end());
        return Ok(());
    };
    if args.resume && !folder.join(CHECKPOINT_FILE).exists() {
        return Err(Usage(format!("{} holds no {CHECKPOINT_FILE} to go on from", folder.display())).into());
    }
    let config = read_config(args, args.resume.then_some(folder))?;
    if !args.resume {
        output::prepare_folder(folder, CONFIG, COMMAND, args.force)?;
        if folder.join(CHECKPOINT_FILE).exists() && !args.force {
            let told = "go on with --resume, or begin anew with --force";
            return Err(Usage(format!("{} holds a run: {told}", folder.display())).into());
        }
    }
    write_config(&folder.join(CONFIG), &config)?;
    crate::memory::keep_what_is_freed();
    let request = Request {
        folder,
        resume: args.resume,
        seed: global.seed,
        weights: args.weights.as_deref(),
        encoder_weights: args.encoder_weights.as_deref(),
    };
    let teller = RefCell::new(Teller { quiet: global.quiet, bar: ProgressBar::hidden(), steps: 0, last: None });
    let outcome = train::train(&config, &request, &interrupt::asked, &mut |message| teller.borrow_mut().hear(message));
    let teller = teller.into_inner();
    teller.bar.finish_and_clear();
    let outcome = outcome?;
    if args.json {
        let done = outcome == Outcome::Done;
        report::print_json(&serde_json::json!({ "done": done, "steps": teller.steps, "validation": teller.last }))?;
    } else {
        let figures = teller.last.as_ref().map(figures).unwrap_or_default();
        report::print(&format!("{}  {} steps{figures}", folder.display(), teller.steps));
    }
    if outcome == Outcome::Stopped {
        anyhow::bail!("stopped; `lightoctree train --resume -o {}` goes on", folder.display());
    }
    Ok(())
}

/// The configuration of `--config`, else that of the run to go on with, else the default.
fn read_config(args: &Args, run: Option<&Path>) -> anyhow::Result<TrainConfig> {
    let path = args.config.clone().or_else(|| run.map(|folder| folder.join(CONFIG)));
    let mut config: TrainConfig =
        path.as_ref().map_or_else(|| Ok(TrainConfig::default()), |path| config::read(path))?;
    if let Some(data) = &args.data {
        config.data.folder = Some(data.clone());
    }
    config.validate().map_err(|reason| match &path {
        Some(path) => Usage(format!("{}: {reason}", path.display())),
        None => Usage(reason),
    })?;
    Ok(config)
}

fn write_config(path: &Path, config: &TrainConfig) -> anyhow::Result<()> {
    let text = format!("# {}\n{}", output::signature(COMMAND), config::text(config)?);
    lightoctree::imaging::write_atomically(path, |out| std::io::Write::write_all(out, text.as_bytes()))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Turns a run's messages into a bar and lines on stderr.
struct Teller {
    quiet: bool,
    bar: ProgressBar,
    /// Steps of this call.
    steps: u64,
    last: Option<ValidationReport>,
}

impl Teller {
    fn hear(&mut self, message: Message) {
        match message {
            Message::Phase { name, steps, done } => {
                self.bar.finish_and_clear();
                self.say(&format!("{name}: {steps} steps"));
                self.bar = bar(self.quiet, steps as usize, &name);
                self.bar.set_position(done);
                self.bar.reset_eta();
            }
            Message::Step { done, losses } => {
                self.steps += 1;
                self.bar.set_position(done);
                let losses = losses.iter().map(|(name, value)| format!("{name} {value:.3}"));
                self.bar.set_message(losses.collect::<Vec<_>>().join(", "));
            }
            Message::Validation(report) => {
                self.say(&format!("held out{}", figures(&report)));
                self.last = Some(report);
            }
            Message::Saved { path, took } => {
                tracing::debug!("{} written in {}", path.display(), seconds(took));
            }
            Message::Note(text) => self.say(&format!("note: {text}")),
        }
    }

    fn say(&self, text: &str) {
        if !self.quiet {
            self.bar.suspend(|| eprintln!("  {text}"));
        }
    }
}

/// What a validation found, in one line.
fn figures(report: &ValidationReport) -> String {
    let db = |name: &str, value: Option<f32>| value.map(|value| format!("{name} {value:.2} dB"));
    let parts = [
        report.depth_abs_rel.map(|value| format!("depth abs-rel {value:.3}")),
        report.depth_delta1.map(|value| format!("δ1 {value:.3}")),
        db("single map", report.global_psnr_db),
        db("panoramas", report.psnr_db),
        db("photo alone", report.photo_alone_psnr_db),
        db("true octree", report.true_octree_psnr_db),
        db("shell", report.shell_psnr_db),
        report.split_accuracy.map(|value| format!("splits {:.1} %", 100.0 * value)),
    ];
    parts.into_iter().flatten().map(|part| format!("  {part}")).collect()
}
