//! `lightoctree-lab study`: makes a user study of inserted objects, and evaluates its answers.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use lightoctree::Models;
use lightoctree_cli::args::Global;
use lightoctree_cli::commands::environment::write_json;
use lightoctree_cli::progress::seconds;
use lightoctree_cli::usage::Usage;
use lightoctree_cli::{output, report};
use lo_eval::Tools;
use lo_imaging as imaging;
use lo_insert::{Layout, LayoutObject};
use lo_study::{KEY_FILE, Key, PAGE_FILE, Results, Study, StudyConfig, StudyError, VIDEO_FOLDER, chart, read_answers};
use serde_json::json;

use crate::config;
use crate::stage_bar::StageBar;

/// Options of `study`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

/// Steps of a study.
#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Render pairs of videos of moving objects in generated rooms, and write the page that shows them
    Make(MakeArgs),
    /// Evaluate the answers that participants saved: shares, exact tests, bar chart
    Evaluate(EvaluateArgs),
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree-lab study make configs/study.toml -o study\n  \
    lightoctree-lab study make --print-config > mine.toml\n\n\
    Files in the output folder:\n  \
    index.html  the page; open it in a browser, also without a server\n  \
    videos      frames of all videos\n  \
    key.json    which side shows which method; for `study evaluate`, not for participants\n\n\
    To continue after Ctrl-C, run the same command again: finished frames are kept, and the page is written when all \
    are there. The videos depend only on the configuration, the mesh, the weights and the seed. docs/study.md describes \
    the design.")]
struct MakeArgs {
    /// Configuration: TOML with the fields of --print-config that differ from the defaults [default: the defaults]
    #[arg(value_name = "CONFIG.toml")]
    config: Option<PathBuf>,

    /// Print the configuration with all fields, and exit
    #[arg(long)]
    print_config: bool,

    /// Trained weights [default: the built-in weights]
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,

    /// Output folder
    #[arg(long, short, value_name = "DIR", required_unless_present = "print_config")]
    output: Option<PathBuf>,

    /// Write into a folder with other contents, and delete the videos of another study there
    #[arg(long)]
    force: bool,

    /// Print a summary as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  \
    lightoctree-lab study evaluate answers/*.csv --study study -o preference.svg")]
struct EvaluateArgs {
    /// Files of answers, as the page saves them
    #[arg(required = true, value_name = "ANSWERS.csv")]
    answers: Vec<PathBuf>,

    /// Folder of the study, or at least its key.json
    #[arg(long, value_name = "DIR")]
    study: PathBuf,

    /// Bar chart to write
    #[arg(long, short, value_name = "FILE.svg")]
    output: Option<PathBuf>,

    /// Overwrite existing files of any origin
    #[arg(long)]
    force: bool,

    /// Print the results as JSON instead of tables
    #[arg(long)]
    json: bool,
}

const COMMAND: &str = "study";

/// Makes or evaluates a study.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    match &args.action {
        Action::Make(args) => make(global, args),
        Action::Evaluate(args) => evaluate(global, args),
    }
}

fn make(global: &Global, args: &MakeArgs) -> anyhow::Result<()> {
    let config: StudyConfig = args.config.as_deref().map_or_else(|| Ok(StudyConfig::default()), config::read)?;
    let Some(folder) = args.output.as_deref().filter(|_| !args.print_config) else {
        report::print(config::text(&config)?.trim_end());
        return Ok(());
    };
    let invalid = |error: StudyError| invalid(args, error);
    config.validate().map_err(|error| invalid(error.into()))?;
    output::check_folder(folder, KEY_FILE, COMMAND, args.force)?;
    let models = models(args, &config)?;
    let [left, right] = models.per_object()[..] else { unreachable!("a layout of two objects has two models") };
    let estimator = lightoctree_cli::commands::estimator(args.weights.as_deref())?;
    let begun = Instant::now();
    let mut bar = StageBar::new(global.quiet);
    let octree_depth = config.generator.octree_depth;
    let study = Study::plan(config, global.seed, [left, right], &networks(args)?, &mut |event| bar.handle(event));
    let Some(study) = study.map_err(invalid)? else {
        anyhow::bail!("stopped before the first frame; nothing was written");
    };
    claim(folder, study.key(), args.force)?;
    write_json(&folder.join(KEY_FILE), COMMAND, serde_json::to_value(study.key())?)?;
    let tools = Tools {
        estimator: &estimator,
        profile: None,
        octree_depth,
        seed: global.seed,
        known: None,
        foreign: None,
        baselines: &[],
    };
    let made = study.make(folder, &tools, &output::signature(COMMAND), &mut |event| bar.handle(event))?;
    drop(bar);
    let (key, shown) = (study.key(), folder.display());
    if args.json {
        report::print_json(&json!({
            "study": key.study,
            "pairs": key.pairs.len(),
            "videos": key.videos.len(),
            "frames": made.frames,
            "frames_written": made.written,
            "complete": made.is_complete(),
            "seconds": begun.elapsed().as_secs_f64(),
        }))?;
    } else {
        let (pairs, written, took) = (key.pairs.len(), made.written, seconds(begun.elapsed()));
        let there = made.kept + written;
        report::print(&format!(
            "{shown}  {pairs} pairs, {written} frames written, {there} of {} there, {took}",
            made.frames
        ));
    }
    if !made.is_complete() {
        let there = made.kept + made.written;
        anyhow::bail!("stopped after {there} of {} frames; run the same command again to continue", made.frames);
    }
    Ok(())
}

/// Marks errors that another configuration solves as usage errors that name the file.
fn invalid(args: &MakeArgs, error: StudyError) -> anyhow::Error {
    let is_of_config =
        matches!(error, StudyError::Config(_) | StudyError::Generator(_) | StudyError::TooFewRooms { .. });
    match &args.config {
        Some(path) if is_of_config => Usage(format!("{}: {error}", path.display())).into(),
        None if is_of_config => Usage(error.to_string()).into(),
        _ => error.into(),
    }
}

/// Loads the mesh in both materials; files are relative to the configuration's folder.
fn models(args: &MakeArgs, config: &StudyConfig) -> anyhow::Result<Models> {
    let folder = args.config.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
    let objects = config.materials()?.into_iter().zip(["left", "right"]).map(|(material, name)| LayoutObject {
        mesh: PathBuf::from(&config.mesh),
        name: Some(name.to_owned()),
        position_m: Some([0.0; 3]),
        material: Some(material),
        ..LayoutObject::default()
    });
    let layout = Layout::new(objects.collect())?;
    Models::load(&layout, folder).with_context(|| format!("mesh {}", config.mesh))
}

/// Returns an identifier of the weights.
fn networks(args: &MakeArgs) -> anyhow::Result<String> {
    let Some(path) = &args.weights else { return Ok("built-in".to_owned()) };
    let bytes = std::fs::read(path).with_context(|| format!("--weights {}", path.display()))?;
    Ok(format!("{:016x}", lo_random::hash(&bytes)))
}

/// Prepares a folder for a study. With `force`, deletes the videos and the page of another one.
fn claim(folder: &Path, key: &Key, force: bool) -> anyhow::Result<()> {
    output::prepare_folder(folder, KEY_FILE, COMMAND, force)?;
    let shown = folder.display();
    match Key::read(folder) {
        Ok(existing) if existing.study == key.study => return Ok(()),
        Ok(existing) if !force => {
            let (before, now) = (&existing.study, &key.study);
            return Err(Usage(format!(
                "{shown} contains the study {before}, not {now}: configuration, mesh, weights or seed differ; choose \
                 another folder, or replace it with --force"
            ))
            .into());
        }
        Ok(_) => {}
        // Not a study's folder: its contents are not ours to delete.
        Err(_) => return Ok(()),
    }
    let remove = |removed: std::io::Result<()>| match removed {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    };
    remove(std::fs::remove_file(folder.join(PAGE_FILE)))
        .and_then(|()| remove(std::fs::remove_dir_all(folder.join(VIDEO_FOLDER))))
        .with_context(|| format!("cannot delete the former study in {shown}"))
}

fn evaluate(global: &Global, args: &EvaluateArgs) -> anyhow::Result<()> {
    if let Some(path) = &args.output {
        output::check_outputs(&[(path, &["svg"])], COMMAND, args.force)?;
    }
    let key = Key::read(&args.study)?;
    let answers = read_answers(&key, &args.answers)?;
    if answers.is_empty() {
        anyhow::bail!("the files contain no answers");
    }
    let results = Results::new(&key, &answers);
    if !global.quiet {
        for (participant, count) in &results.incomplete {
            eprintln!("  note: {participant} answered {count} of {} pairs", key.pairs.len());
        }
    }
    if args.json {
        report::print_json(&results)?;
    } else {
        print_tables(&results);
    }
    let Some(path) = &args.output else { return Ok(()) };
    let svg = chart(&results, &output::signature(COMMAND))?;
    imaging::write_atomically(path, |out| out.write_all(svg.as_bytes()))
        .with_context(|| format!("cannot write {}", path.display()))
}

fn print_tables(results: &Results) {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let ours = format!("{} against", results.ours);
    let of_answers = results.comparisons.iter().map(|comparison| {
        let [low, high] = comparison.interval.map(|share| format!("{:.1}", 100.0 * share));
        let share = |share: fn(f64) -> f64| comparison.share.map_or_else(|| "–".to_owned(), |s| percent(share(s)));
        vec![
            comparison.other.clone(),
            comparison.answers.to_string(),
            share(|ours| ours),
            share(|ours| 1.0 - ours),
            format!("{low} to {high} %"),
            p_text(comparison.p),
            p_text(comparison.p_holm),
        ]
    });
    let head = [ours.as_str(), "answers", "ours", "other", "95 % of ours", "p", "p, Holm"];
    report::print(&report::table(&head, &of_answers.collect::<Vec<_>>()));
    let of_participants = results.comparisons.iter().map(|comparison| {
        let votes = &comparison.by_participant;
        let counts = [votes.ours, votes.other, votes.ties].map(|count| count.to_string());
        let p = [votes.p, votes.p_holm].map(p_text);
        std::iter::once(comparison.other.clone()).chain(counts).chain(p).collect()
    });
    let head = ["participants, more often for", "ours", "other", "equal", "p", "p, Holm"];
    report::print(&format!("\n{}", report::table(&head, &of_participants.collect::<Vec<_>>())));
    let left = percent(results.left_chosen as f64 / results.answers.max(1) as f64);
    report::print(&format!(
        "\nparticipants: {}, answers: {}; left side: {left} (p {})",
        results.participants,
        results.answers,
        p_text(results.left_p)
    ));
}

/// Formats a p-value as in the paper.
fn p_text(p: f64) -> String {
    if p < 0.001 { "< 0.001".to_owned() } else { format!("{p:.3}") }
}
