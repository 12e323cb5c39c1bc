//! `lightoctree-lab dataset`: inspects, converts and previews datasets of any supported layout.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;
use lightoctree_cli::args::Global;
use lightoctree_cli::commands::environment::signed;
use lightoctree_cli::progress::{bar, seconds};
use lightoctree_cli::usage::Usage;
use lightoctree_cli::{interrupt, output, report};
use lo_dataset::{
    ContactSheet, CropModel, Dataset, DatasetError, DatasetLayout, Histogram, Loader, LoaderConfig, Sample, ShardCount,
    ShardFolder, Split, Summary, SummaryReport, convert_to_shards, evenly_spread,
};
use lo_imaging as imaging;
use lo_metrics::LightDistribution;
use serde_json::json;

use crate::stage_bar::StageBar;

/// Options of `dataset`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

/// Operations on a dataset.
#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Count samples, and print distributions of light, depth and lamps
    Inspect(InspectArgs),
    /// Convert a dataset to shards
    Convert(ConvertArgs),
    /// Write a contact sheet of photos and tone-mapped panoramas
    Preview(PreviewArgs),
}

/// Selects a dataset.
#[derive(Debug, clap::Args)]
struct DatasetArgs {
    /// Dataset folder, or a single shard (.tar)
    dataset: PathBuf,

    /// Layout of the files [default: detected]
    #[arg(long, value_name = "NAME")]
    layout: Option<LayoutName>,

    /// Photos to crop from each panorama, for datasets without photos
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    crops: u32,

    /// Folder of floor plans, NAME.json for panorama NAME.hdr; they provide depth
    #[arg(long, value_name = "DIR")]
    plans: Option<PathBuf>,
}

/// Names of layouts.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum LayoutName {
    /// WebDataset archives written by `lightoctree-lab synth` or `dataset convert`
    Shards,
    /// FutureHouse (Li et al. 2022)
    Futurehouse,
    /// Hypersim (Roberts et al. 2021), with metadata_camera_parameters.csv beside the scenes
    Hypersim,
    /// InteriorNet (Li et al. 2018)
    Interiornet,
    /// InteriorVerse (Zhu et al. 2022)
    Interiorverse,
    /// Test set of Lighthouse (Srinivasan et al. 2020)
    Lighthouse,
    /// Laval Indoor Spatially Varying HDR (Garon et al. 2019), with a scene.json in each folder
    LavalVarying,
    /// Equirectangular HDR panoramas
    Panoramas,
    /// Photos with measured depth, listed in a frames.json
    Frames,
}

impl From<LayoutName> for DatasetLayout {
    fn from(name: LayoutName) -> Self {
        match name {
            LayoutName::Shards => Self::Shards,
            LayoutName::Futurehouse => Self::FutureHouse,
            LayoutName::Hypersim => Self::Hypersim,
            LayoutName::Interiornet => Self::InteriorNet,
            LayoutName::Interiorverse => Self::InteriorVerse,
            LayoutName::Lighthouse => Self::Lighthouse,
            LayoutName::LavalVarying => Self::LavalVarying,
            LayoutName::Panoramas => Self::Panoramas,
            LayoutName::Frames => Self::Frames,
        }
    }
}

/// Names of the parts of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub(super) enum SplitName {
    /// One scene in ten
    Validation,
    /// The other nine in ten
    Train,
    /// Scenes that a published data set holds out for figures
    Test,
    /// All scenes, for data that was never used for training
    All,
}

impl SplitName {
    /// Returns the part; `None` for all.
    pub(super) fn part(self) -> Option<Split> {
        match self {
            Self::All => None,
            Self::Train => Some(Split::Train),
            Self::Validation => Some(Split::Validation),
            Self::Test => Some(Split::Test),
        }
    }
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree-lab dataset inspect rooms\n  \
    lightoctree-lab dataset inspect rooms --json | jq .summary.figures")]
struct InspectArgs {
    #[command(flatten)]
    source: DatasetArgs,

    /// Inspect at most this many samples, evenly spread
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    samples: Option<u32>,

    /// Print one JSON object instead of tables
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  lightoctree-lab dataset convert panoramas --crops 4 -o shards\n\n\
    To resume after a stop, run the same command again: finished shards are kept.")]
struct ConvertArgs {
    #[command(flatten)]
    source: DatasetArgs,

    /// Samples per shard
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    samples_per_shard: u32,

    /// Output folder
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,

    /// Write into a folder with other contents, and delete shards of another dataset or seed there
    #[arg(long)]
    force: bool,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  lightoctree-lab dataset preview rooms --photos 48 --panoramas 24 -o sheet.png")]
struct PreviewArgs {
    #[command(flatten)]
    source: DatasetArgs,

    /// Number of photos
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u32).range(0..=1000))]
    photos: u32,

    /// Number of panoramas
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(0..=1000))]
    panoramas: u32,

    /// Images per row
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=40))]
    columns: u32,

    /// Image to write: .png or .jpg
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,

    /// Overwrite any existing file
    #[arg(long)]
    force: bool,
}

const CONVERT: &str = "dataset";
/// Prefix of the shards' file names.
const PREFIX: &str = "samples";

/// Runs the selected operation.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    match &args.action {
        Action::Inspect(args) => inspect(global, args),
        Action::Convert(args) => convert(global, args),
        Action::Preview(args) => preview(global, args),
    }
}

impl DatasetArgs {
    /// Opens the dataset; at least one sample.
    fn open(&self, global: &Global) -> anyhow::Result<(DatasetLayout, Arc<dyn Dataset>)> {
        let layout = match self.layout {
            Some(name) => name.into(),
            None => DatasetLayout::detect(&self.dataset)?,
        };
        let model = CropModel { crops: self.crops, seed: global.seed, ..CropModel::default() };
        let dataset: Arc<dyn Dataset> = layout.open_with_plans(&self.dataset, model, self.plans.as_deref())?.into();
        if dataset.is_empty() {
            return Err(DatasetError::Layout { folder: self.dataset.clone(), reason: "no samples found".into() }.into());
        }
        Ok((layout, dataset))
    }
}

/// Opens or resumes a folder of shards; refuses folders of other commands or inputs, unless `force`.
pub(super) fn shard_folder(
    path: &Path,
    prefix: &str,
    command: &str,
    manifest: serde_json::Value,
    force: bool,
) -> anyhow::Result<ShardFolder> {
    output::prepare_folder(path, ShardFolder::MANIFEST, command, force)?;
    ShardFolder::open(path, prefix, &signed(command, manifest), force).map_err(|error| match error {
        DatasetError::OtherManifest { .. } => {
            Usage(format!("{error}; repeat that command, or choose another folder")).into()
        }
        error => error.into(),
    })
}

fn threads(global: &Global) -> usize {
    global.threads.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from)
}

fn inspect(global: &Global, args: &InspectArgs) -> anyhow::Result<()> {
    let (layout, dataset) = args.source.open(global)?;
    let count = args.samples.map_or(dataset.len(), |most| dataset.len().min(most as usize));
    let progress = bar(global.quiet, count, "samples");
    let mut summary = Summary::default();
    let mut inspected = 0;
    let mut damaged: Vec<String> = Vec::new();
    let mut inspect = |index: usize, sample: anyhow::Result<Sample>| {
        match sample {
            Ok(sample) => {
                summary.add(&sample, dataset.split(index));
                add_light(&mut summary, &sample);
            }
            Err(error) => {
                let message = report::error_message(&error);
                progress.suspend(|| eprintln!("warning: {message}"));
                damaged.push(message);
            }
        }
        progress.inc(1);
        inspected += 1;
        !interrupt::requested()
    };
    if count == dataset.len() {
        let config = LoaderConfig { shuffle: false, threads: threads(global), ..LoaderConfig::default() };
        for (index, sample) in Loader::new(Arc::clone(&dataset), config).enumerate() {
            if !inspect(index, sample.map_err(anyhow::Error::from)) {
                break;
            }
        }
    } else {
        for index in evenly_spread(dataset.len(), count) {
            if !inspect(index, dataset.get(index).map_err(anyhow::Error::from)) {
                break;
            }
        }
    }
    progress.finish_and_clear();
    let found = summary.report();
    if args.json {
        let head = json!({ "layout": layout.name(), "samples_in_all": dataset.len(), "left_out": dataset.left_out(), "damaged": damaged, "summary": found });
        report::print_json(&head)?;
    } else {
        report::print(&text(layout, &dataset, &found));
    }
    if inspected < count {
        anyhow::bail!("stopped after {inspected} of {}", report::counted(count, "sample"));
    }
    if !damaged.is_empty() {
        anyhow::bail!("{} of {} cannot be read", damaged.len(), report::counted(count, "sample"));
    }
    Ok(())
}

/// Adds figures of the light distribution in a sample's first panorama.
fn add_light(summary: &mut Summary, sample: &Sample) {
    let Some(light) = sample.views.first().and_then(|view| LightDistribution::measure(&view.radiance)) else { return };
    let figures = [
        ("light: contrast of a matte sphere, stops", light.contrast_stops),
        ("light: anisotropy", light.anisotropy),
        ("light: upward component of its direction", light.upward),
        ("light: from the brightest 1 % of the sphere, share", light.brightest_hundredth),
        ("light: from the brightest 5 % of the sphere, share", light.brightest_twentieth),
    ];
    figures.iter().for_each(|&(name, value)| summary.figure(name, value as f32));
}

/// Formats the summary as text.
fn text(layout: DatasetLayout, dataset: &Arc<dyn Dataset>, found: &SummaryReport) -> String {
    let split = |name: &str, i: usize| {
        vec![name.to_owned(), found.scenes_by_split[i].to_string(), found.samples_by_split[i].to_string()]
    };
    let mut rows = vec![split("train", 0), split("validation", 1)];
    if found.samples_by_split[2] > 0 {
        rows.push(split("test", 2));
    }
    rows.push(vec!["all".to_owned(), found.scenes.to_string(), found.samples.to_string()]);
    let figures: Vec<Vec<String>> = found
        .figures
        .iter()
        .map(|figure| {
            let numbers = figure.percentiles.iter().chain([&figure.mean]).map(|value| format!("{value:.3}"));
            std::iter::once(figure.name.to_owned()).chain(numbers).collect()
        })
        .collect();
    let left_out = match dataset.left_out() {
        0 => String::new(),
        count => format!("; {count} more are excluded by their authors or cannot be represented"),
    };
    [
        format!(
            "{}: {}, {} inspected, with {} and {}{left_out}",
            layout.name(),
            report::counted(dataset.len(), "sample"),
            found.samples,
            report::counted(found.views, "panorama"),
            report::counted(found.points, "surface point")
        ),
        report::table(&["", "scenes", "samples"], &rows),
        report::table(&["per sample", "5 %", "25 %", "50 %", "75 %", "95 %", "mean"], &figures),
        chart("light, stops above the photo's white", &found.log2_luminance),
        chart("depth, m", &found.depth_m),
    ]
    .join("\n\n")
}

/// Formats a histogram as a bar chart, without empty bins at the ends.
fn chart(title: &str, histogram: &Histogram) -> String {
    let used = |share: &f32| *share > 0.0;
    let shares = &histogram.shares;
    let Some((first, last)) = shares.iter().position(used).zip(shares.iter().rposition(used)) else {
        return format!("{title}: none");
    };
    let largest = shares.iter().copied().fold(0.0, f32::max);
    let line = |i: usize| {
        let width = (40.0 * shares[i] / largest).round() as usize;
        let low = histogram.first + i as f32 * histogram.step;
        format!("{low:>6.1}  {:>5.1} %  {}", 100.0 * shares[i], "#".repeat(width))
    };
    std::iter::once(title.to_owned()).chain((first..=last).map(line)).collect::<Vec<_>>().join("\n")
}

fn convert(global: &Global, args: &ConvertArgs) -> anyhow::Result<()> {
    let begun = std::time::Instant::now();
    let (layout, dataset) = args.source.open(global)?;
    // Everything that the shards' contents depend on.
    let mut manifest = json!({
        "format_version": lo_dataset::FORMAT_VERSION,
        "program_version": env!("CARGO_PKG_VERSION"),
        "layout": layout.name(),
        "seed": global.seed,
        "crops": args.source.crops,
        "samples": dataset.len(),
        "scene_ids_fnv1a": format!("{:016x}", lo_dataset::fingerprint(dataset.as_ref())),
        "samples_per_shard": args.samples_per_shard,
    });
    if let Some(plans) = &args.source.plans {
        manifest["plans"] = json!(plans);
    }
    let shards = shard_folder(&args.output, PREFIX, CONVERT, manifest, args.force)?;
    let mut bar = StageBar::new(global.quiet);
    let (per_shard, threads) = (args.samples_per_shard as usize, threads(global));
    let count = convert_to_shards(&shards, &dataset, per_shard, threads, &mut |event| bar.handle(event))?;
    drop(bar);
    let ShardCount { total: all, finished: done, written } = count;
    report::print(&format!(
        "{}  {written} shards written, {done} of {all} complete, {} samples in total, {}",
        args.output.display(),
        dataset.len(),
        seconds(begun.elapsed())
    ));
    if done < all {
        anyhow::bail!("stopped after {done} of {all} shards; run the same command again to continue");
    }
    Ok(())
}

fn preview(global: &Global, args: &PreviewArgs) -> anyhow::Result<()> {
    check_picture(&args.output)?;
    output::check_replaceable(&args.output, CONVERT, args.force)?;
    let (_, dataset) = args.source.open(global)?;
    let mut sheet = ContactSheet::new(args.columns as usize);
    let count = args.photos.max(args.panoramas) as usize;
    let progress = bar(global.quiet, count.min(dataset.len()), "samples");
    let (mut photos, mut panoramas) = (0, 0);
    for index in evenly_spread(dataset.len(), count) {
        if interrupt::requested() {
            anyhow::bail!("stopped before the contact sheet was complete");
        }
        let sample = dataset.get(index)?;
        if photos < args.photos {
            sheet.add_photo(&sample);
            photos += 1;
        }
        if let (Some(view), true) = (sample.views.first(), panoramas < args.panoramas) {
            sheet.add_panorama(&view.radiance);
            panoramas += 1;
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    imaging::write_srgb8(&args.output, &sheet.image(), imaging::JPEG_QUALITY, &output::signature(CONVERT))?;
    report::print(&format!("{}  {photos} photos, {panoramas} panoramas", args.output.display()));
    Ok(())
}

fn check_picture(path: &Path) -> anyhow::Result<()> {
    let known = path.extension().is_some_and(|e| ["png", "jpg", "jpeg"].iter().any(|k| e.eq_ignore_ascii_case(k)));
    if known {
        Ok(())
    } else {
        Err(Usage(format!("{}: unsupported image format; use .png or .jpg", path.display())).into())
    }
}
