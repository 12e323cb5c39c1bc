//! `lightoctree eval`: figures of methods and baselines on any dataset.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use clap::ValueEnum;
use lightoctree::{Estimator, imaging};
use lo_dataset::CropModel;
use lo_eval::{EvalError, Evaluation, Method, Photos, Profile, ProfileError, Protocol, Report, Tools};
use serde_json::json;

use super::dataset::{LayoutName, SplitName};
use super::environment::write_json;
use super::parse;
use crate::args::Global;
use crate::progress::{StageBar, seconds};
use crate::usage::Usage;
use crate::{output, report};

/// Options of `eval`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree eval rooms --make-profile profile.json\n  \
    lightoctree eval rooms --profile profile.json --weights trained.safetensors -o report\n  \
    lightoctree eval panoramas --split all --profile profile.json -o report\n  \
    lightoctree eval panoramas --split all --protocol three-spheres -o report\n\n\
    docs/evaluation.md says what each figure means. DIR gets scenes.csv, summary.md, summary.json, costs.csv and sheet.png.")]
pub struct Args {
    /// A folder in one of the layouts, or a shard
    dataset: PathBuf,

    /// How its files are laid out [default: found out]
    #[arg(long, value_name = "NAME")]
    layout: Option<LayoutName>,

    /// A published protocol, with its own crops of a folder of panoramas and its own spheres
    #[arg(long, value_name = "NAME", conflicts_with_all = ["layout", "crops", "hfov_deg", "make_profile"])]
    protocol: Option<ProtocolName>,

    /// Photos to cut out of each panorama, evenly around, where there are no photos
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    crops: u32,

    /// Their horizontal field of view in degrees, from the least to the largest
    #[arg(long, value_name = "A,B", default_value = "60,80", value_parser = parse::hfov_range_deg)]
    hfov_deg: [f32; 2],

    /// The part of the dataset
    #[arg(long, value_name = "PART", default_value = "validation")]
    split: SplitName,

    /// No more photos than this, evenly spread
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    samples: Option<u32>,

    /// Methods, separated by commas [default: all that the options suffice for, but for panorama-…]
    ///
    /// With one that knows a panorama of the room, every method is scored on the panoramas 0.7 m or more from it alone.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = method)]
    methods: Vec<Method>,

    /// Trained weights, for network, network-sensor, network-true and single-map [default: those of the program]
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,

    /// The training set's mean vertical profile, for profile
    #[arg(long, value_name = "FILE.json")]
    profile: Option<PathBuf>,

    /// Compute that profile from the training part of the dataset, write it and stop
    #[arg(long, value_name = "FILE.json", conflicts_with_all = ["output", "profile", "weights", "methods"])]
    make_profile: Option<PathBuf>,

    /// Depth of octrees; those of the networks are at least as deep as they are
    #[arg(long, value_name = "D", default_value_t = 7, value_parser = clap::value_parser!(u32).range(5..=9))]
    octree_depth: u32,

    /// Photos in whose rooms a probe walks a metre
    #[arg(long, value_name = "N", default_value_t = 4)]
    walks: u32,

    /// Rows of sheet.png
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(0..=100))]
    rows: u32,

    /// The folder to write into
    #[arg(long, short, value_name = "DIR", required_unless_present = "make_profile")]
    output: Option<PathBuf>,

    /// Write into a folder that holds other things, or over another file
    #[arg(long)]
    force: bool,

    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

/// Published protocols on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ProtocolName {
    /// StyleLight (Wang et al. 2022): one crop of 60 degrees, three spheres under tone-mapped panoramas
    ThreeSpheres,
    /// Editable indoor lighting (Weber et al. 2022): ten crops of 50 degrees, nine diffuse spheres on a plane
    SphereArray,
}

impl From<ProtocolName> for Protocol {
    fn from(name: ProtocolName) -> Self {
        match name {
            ProtocolName::ThreeSpheres => Self::ThreeSpheres,
            ProtocolName::SphereArray => Self::SphereArray,
        }
    }
}

const COMMAND: &str = "eval";
const MANIFEST: &str = "summary.json";

fn method(name: &str) -> Result<Method, String> {
    let all = || Method::ALL.into_iter().chain(Method::WITH_PANORAMA);
    let names = || all().map(Method::name).collect::<Vec<_>>().join(", ");
    all().find(|method| method.name() == name).ok_or_else(|| format!("no method; there are {}", names()))
}

/// Evaluates, or makes a profile.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    if let Some(path) = &args.make_profile {
        return make_profile(global, args, path);
    }
    let folder = args.output.as_deref().ok_or_else(|| Usage("--output DIR is missing".into()))?;
    let profile = args.profile.as_deref().map(read_profile).transpose()?;
    let has_networks = args.weights.is_some() || cfg!(feature = "weights");
    let estimator =
        if has_networks { super::estimator(args.weights.as_deref())? } else { Estimator::without_networks() };
    let tools = Tools {
        estimator: &estimator,
        profile: profile.as_ref(),
        octree_depth: args.octree_depth,
        seed: global.seed,
        known: None,
        foreign: None,
    };
    check_tools(args, &tools)?;
    let evaluation = Evaluation::open(&photos(global, args, args.split)?, &args.methods, tools).map_err(usage)?;
    output::prepare_folder(folder, MANIFEST, COMMAND, args.force)?;

    let begun = Instant::now();
    let mut bar = StageBar::new(global.quiet);
    let report = evaluation.run(args.rows as usize, args.walks as usize, &mut |event| bar.hear(event));
    drop(bar);
    write(args, folder, &report)?;
    let Report { photos: done, asked, .. } = report;
    if args.json {
        report::print_json(&report.summary.json())?;
    } else {
        report::print(&report.summary.markdown());
        report::print(&report.summary.cost_markdown());
        report::print(&format!("{}  {done} photos, {}", folder.display(), seconds(begun.elapsed())));
    }
    if let Some(error) = report.unreadable {
        return Err(error).with_context(|| format!("after {done} of {asked} photos"));
    }
    if done < asked {
        anyhow::bail!("stopped after {done} of {asked} photos; {} holds their figures", folder.display());
    }
    Ok(())
}

fn photos(global: &Global, args: &Args, part: SplitName) -> anyhow::Result<Photos> {
    let mut crops = CropModel { crops: args.crops, seed: global.seed, ..CropModel::default() };
    crops.hfov_deg = args.hfov_deg.try_into()?;
    Ok(Photos {
        dataset: args.dataset.clone(),
        layout: args.layout.map(Into::into),
        protocol: args.protocol.map(Into::into),
        crops,
        part: part.part(),
        most: args.samples.map(|most| most as usize),
    })
}

/// What the user can help by other options.
fn usage(error: EvalError) -> anyhow::Error {
    match error {
        EvalError::NoPhotos { .. } => Usage(format!("{error}; see --split")).into(),
        error => error.into(),
    }
}

/// Whether all methods that were asked for have what they need.
fn check_tools(args: &Args, tools: &Tools) -> Result<(), Usage> {
    let lacking = args.methods.iter().find(|method| !method.has_tools(tools));
    lacking.map_or(Ok(()), |method| {
        let needed = if *method == Method::Profile { "--profile FILE.json" } else { "--weights FILE" };
        Err(Usage(format!("the method {} needs {needed}", method.name())))
    })
}

fn write(args: &Args, folder: &Path, report: &Report) -> anyhow::Result<()> {
    let mut object = report.summary.json();
    object["dataset"] = json!(args.dataset);
    object["photos"] = json!(report.photos);
    object["program_version"] = json!(env!("CARGO_PKG_VERSION"));
    write_json(&folder.join(MANIFEST), COMMAND, object)?;
    write_text(&folder.join("scenes.csv"), &report.scenes_csv())?;
    write_text(&folder.join("costs.csv"), &report.costs_csv())?;
    write_text(&folder.join("summary.md"), &report.markdown())?;
    if !report.sheet.is_empty() {
        imaging::write_srgb8(
            folder.join("sheet.png"),
            &report.sheet.picture(),
            imaging::JPEG_QUALITY,
            &output::signature(COMMAND),
        )?;
    }
    Ok(())
}

fn write_text(path: &Path, text: &str) -> anyhow::Result<()> {
    imaging::write_atomically(path, |out| out.write_all(text.as_bytes()))
        .with_context(|| format!("cannot write {}", path.display()))
}

fn read_profile(path: &Path) -> anyhow::Result<Profile> {
    Profile::read(path).with_context(|| format!("--profile {}", path.display()))
}

fn make_profile(global: &Global, args: &Args, path: &Path) -> anyhow::Result<()> {
    output::check_replaceable(path, COMMAND, args.force)?;
    let (dataset, indices) = photos(global, args, SplitName::Train)?.open().map_err(usage)?;
    let name = args.dataset.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let mut bar = StageBar::new(global.quiet);
    let profile = Profile::of(dataset.as_ref(), &indices, &name, &mut |event| bar.hear(event));
    drop(bar);
    let profile = profile.map_err(|error| match error {
        ProfileError::Cancelled(_) => anyhow::anyhow!("stopped; no profile was written"),
        error => error.into(),
    })?;
    write_json(path, COMMAND, json!(profile))?;
    report::print(&format!("{}  mean of {} photos", path.display(), profile.samples()));
    Ok(())
}
