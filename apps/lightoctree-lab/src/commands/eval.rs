//! `lightoctree-lab eval`: figures of methods and baselines on any dataset.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use clap::ValueEnum;
use lightoctree::insert::Quality;
use lightoctree::{Estimator, imaging};
use lightoctree_cli::args::Global;
use lightoctree_cli::commands::environment::write_json;
use lightoctree_cli::commands::parse;
use lightoctree_cli::progress::seconds;
use lightoctree_cli::usage::Usage;
use lightoctree_cli::{output, report};
use lo_dataset::{CropModel, Generator, GeneratorConfig};
use lo_eval::{
    EvalError, Evaluation, InsertionEvaluation, InsertionMethod, Method, PhotoSelection, Profile, ProfileError,
    Protocol, Report, Tools,
};
use serde_json::json;

use super::dataset::{LayoutName, SplitName};
use crate::config;
use crate::stage_bar::StageBar;

/// Options of `eval`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree-lab eval rooms --make-profile profile.json\n  \
    lightoctree-lab eval rooms --profile profile.json --weights trained.safetensors -o report\n  \
    lightoctree-lab eval panoramas --split all --profile profile.json -o report\n  \
    lightoctree-lab eval panoramas --split all --protocol three-spheres -o report\n  \
    lightoctree-lab eval configs/insertion.toml --protocol insertion --seed 11 --samples 66 -o report\n\n\
    docs/evaluation.md says what each figure means. DIR gets scenes.csv, summary.md, summary.json, costs.csv and sheet.png.")]
pub struct Args {
    /// A folder in one of the layouts, or a shard; for the protocol insertion the configuration of rooms, as of `synth --config`
    dataset: PathBuf,

    /// How its files are laid out [default: found out]
    #[arg(long, value_name = "NAME")]
    layout: Option<LayoutName>,

    /// A published protocol, with its own crops of a folder of panoramas and its own spheres; or objects in generated rooms
    #[arg(long, value_name = "NAME", conflicts_with_all = ["layout", "crops", "hfov_deg", "make_profile"])]
    protocol: Option<ProtocolName>,

    /// PhotoSelection to cut out of each panorama, evenly around, where there are no photos
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    crops: u32,

    /// Their horizontal field of view in degrees, from the least to the largest
    #[arg(long, value_name = "A,B", default_value = "60,80", value_parser = parse::hfov_range_deg)]
    hfov_deg: [f32; 2],

    /// Plans of the panoramas' rooms, NAME.json of NAME.hdr: depth is known by them
    #[arg(long, value_name = "DIR", conflicts_with = "protocol")]
    plans: Option<PathBuf>,

    /// The part of the dataset
    #[arg(long, value_name = "PART", default_value = "validation")]
    split: SplitName,

    /// No more photos than this, evenly spread
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    samples: Option<u32>,

    /// Methods, separated by commas [default: all that the options suffice for, but for network-expected, network-lamps, network-detail and panorama-…; the protocol insertion has its own]
    ///
    /// With one that knows a panorama of the room, every method is scored on the panoramas 0.7 m or more from it alone.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    methods: Vec<String>,

    /// Trained weights, for network, network-sensor, network-true, network-cubed and single-map [default: those of the program]
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,

    /// The training set's mean vertical profile, for profile and fixed-shape
    #[arg(long, value_name = "FILE.json")]
    profile: Option<PathBuf>,

    /// Compute that profile from the training part of the dataset, write it and stop
    #[arg(long, value_name = "FILE.json", conflicts_with_all = ["output", "profile", "weights", "methods"])]
    make_profile: Option<PathBuf>,

    /// Depth of octrees; those of the networks are at least as deep as they are
    #[arg(long, value_name = "D", default_value_t = 7, value_parser = clap::value_parser!(u32).range(5..=9))]
    octree_depth: u32,

    /// PhotoSelection in whose rooms a probe walks a metre
    #[arg(long, value_name = "N", default_value_t = 4)]
    walks: u32,

    /// Rows of sheet.png
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(0..=100))]
    rows: u32,

    /// Of the protocol insertion: keep path-traced truths here, and take those that are there already
    #[arg(long, value_name = "DIR")]
    truths: Option<PathBuf>,

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
    /// Spheres and a pole in generated rooms, their light and shadows against path tracing; half a minute a room
    Insertion,
}

impl ProtocolName {
    /// The protocols of panoramas.
    fn of_panoramas(self) -> Option<Protocol> {
        match self {
            Self::ThreeSpheres => Some(Protocol::ThreeSpheres),
            Self::SphereArray => Some(Protocol::SphereArray),
            Self::Insertion => None,
        }
    }
}

const COMMAND: &str = "eval";
const MANIFEST: &str = "summary.json";

/// Rooms of the protocol insertion where no number is given.
const INSERTION_ROOMS: usize = 60;

/// The methods of these names.
fn named<T: Copy>(names: &[String], all: &[T], name: impl Fn(T) -> &'static str) -> Result<Vec<T>, Usage> {
    let of_name = |wanted: &String| {
        all.iter().copied().find(|&method| name(method) == wanted).ok_or_else(|| {
            let known: Vec<&str> = all.iter().map(|&method| name(method)).collect();
            Usage(format!("--methods: no method {wanted}; there are {}", known.join(", ")))
        })
    };
    names.iter().map(of_name).collect()
}

fn methods(args: &Args) -> Result<Vec<Method>, Usage> {
    let all: Vec<Method> = Method::ALL
        .into_iter()
        .chain(Method::WITH_LAMPS)
        .chain(Method::WITH_DETAIL)
        .chain(Method::WITH_PANORAMA)
        .collect();
    named(&args.methods, &all, Method::name)
}

/// Evaluates, or makes a profile.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    if let Some(path) = &args.make_profile {
        return make_profile(global, args, path);
    }
    let folder = args.output.as_deref().ok_or_else(|| Usage("--output DIR is missing".into()))?;
    let profile = args.profile.as_deref().map(read_profile).transpose()?;
    let has_networks = args.weights.is_some() || cfg!(feature = "weights");
    let estimator = if has_networks {
        lightoctree_cli::commands::estimator(args.weights.as_deref())?
    } else {
        Estimator::without_networks()
    };
    let tools = Tools {
        estimator: &estimator,
        profile: profile.as_ref(),
        octree_depth: args.octree_depth,
        seed: global.seed,
        known: None,
        foreign: None,
    };
    let begun = Instant::now();
    let rows = args.rows as usize;
    let report = if matches!(args.protocol, Some(ProtocolName::Insertion)) {
        let evaluation = insertion(global, args, tools)?;
        output::prepare_folder(folder, MANIFEST, COMMAND, args.force)?;
        let mut bar = StageBar::new(global.quiet);
        evaluation.run(rows, &mut |event| bar.hear(event))
    } else {
        let methods = methods(args)?;
        check_tools(&methods, &tools)?;
        let evaluation = Evaluation::open(&photos(global, args, args.split)?, &methods, tools).map_err(usage)?;
        output::prepare_folder(folder, MANIFEST, COMMAND, args.force)?;
        let mut bar = StageBar::new(global.quiet);
        evaluation.run(rows, args.walks as usize, &mut |event| bar.hear(event))
    };
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

fn photos(global: &Global, args: &Args, part: SplitName) -> anyhow::Result<PhotoSelection> {
    let mut crops = CropModel { crops: args.crops, seed: global.seed, ..CropModel::default() };
    crops.hfov_deg = args.hfov_deg.try_into()?;
    Ok(PhotoSelection {
        dataset: args.dataset.clone(),
        layout: args.layout.map(Into::into),
        protocol: args.protocol.and_then(ProtocolName::of_panoramas),
        crops,
        plans: args.plans.clone(),
        part: part.part(),
        most: args.samples.map(|most| most as usize),
    })
}

/// Objects in the rooms of a configuration.
fn insertion<'a>(global: &Global, args: &Args, tools: Tools<'a>) -> anyhow::Result<InsertionEvaluation<'a>> {
    let methods = named(&args.methods, &InsertionMethod::ALL, InsertionMethod::name)?;
    if tools.estimator.networks().is_none() {
        return Err(Usage("the protocol insertion needs --weights FILE".into()).into());
    }
    let config: GeneratorConfig = config::read(&args.dataset)?;
    let generator = Generator::new(global.seed, config).map_err(|error| Usage(error.to_string()))?;
    let rooms = args.samples.map_or(INSERTION_ROOMS, |rooms| rooms as usize);
    let evaluation = InsertionEvaluation::new(generator, global.seed, rooms, &methods, tools, Quality::Normal)?;
    let Some(folder) = &args.truths else { return Ok(evaluation) };
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    Ok(evaluation.keeping_truths(folder.clone()))
}

/// What the user can help by other options.
fn usage(error: EvalError) -> anyhow::Error {
    match error {
        EvalError::NoPhotos { .. } => Usage(format!("{error}; see --split")).into(),
        error => error.into(),
    }
}

/// Whether all methods that were asked for have what they need.
fn check_tools(methods: &[Method], tools: &Tools) -> Result<(), Usage> {
    let lacking = methods.iter().find(|method| !method.has_tools(tools));
    lacking.map_or(Ok(()), |method| {
        let is_profile = matches!(method, Method::Profile | Method::FixedShape);
        let needed = if is_profile { "--profile FILE.json" } else { "--weights FILE" };
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
    let profile = Profile::from_dataset(dataset.as_ref(), &indices, &name, &mut |event| bar.hear(event));
    drop(bar);
    let profile = profile.map_err(|error| match error {
        ProfileError::Cancelled(_) => anyhow::anyhow!("stopped; no profile was written"),
        error => error.into(),
    })?;
    write_json(path, COMMAND, json!(profile))?;
    report::print(&format!("{}  mean of {} photos", path.display(), profile.samples()));
    Ok(())
}
