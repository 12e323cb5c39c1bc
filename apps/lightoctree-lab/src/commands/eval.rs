//! `lightoctree-lab eval`: evaluates methods and baselines on a dataset.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use clap::ValueEnum;
use lightoctree::Estimator;
use lightoctree_cli::args::Global;
use lightoctree_cli::commands::environment::write_json;
use lightoctree_cli::commands::parse;
use lightoctree_cli::progress::seconds;
use lightoctree_cli::usage::Usage;
use lightoctree_cli::{output, report};
use lo_baselines::{Baseline, System, UnknownSystem};
use lo_dataset::{CropModel, Generator, GeneratorConfig};
use lo_eval::{
    EvalError, Evaluation, External, InsertionEvaluation, InsertionMethod, Method, PhotoSelection, Profile,
    ProfileError, Protocol, Report, Tools, VIEWS_FILE,
};
use lo_imaging as imaging;
use lo_insert::Quality;
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
    lightoctree-lab eval panoramas --split all --write-views views\n  \
    lightoctree-lab eval panoramas --split all --external other=views -o report\n  \
    lightoctree-lab eval rooms --baseline garon2019=run/weights.safetensors -o report\n  \
    lightoctree-lab eval configs/insertion.toml --protocol insertion --seed 11 --samples 66 -o report\n\n\
    Files in the output folder:\n  \
    summary.md    tables of all figures\n  \
    summary.json  means, medians and quartiles of each method\n  \
    scenes.csv    figures of each photo and method\n  \
    costs.csv     time and memory of each photo and method\n  \
    sheet.png     photos with true and estimated panoramas\n  \
    objects.png   photos with objects in true and estimated light, with --objects\n\n\
    docs/evaluation.md explains the figures.")]
pub struct Args {
    /// Dataset folder or a single shard; for the protocol insertion, a configuration of rooms as for `synth --config`
    dataset: PathBuf,

    /// Layout of the files [default: detected]
    #[arg(long, value_name = "NAME")]
    layout: Option<LayoutName>,

    /// Evaluate by a protocol: a published one on a folder of panoramas, or objects in generated rooms
    ///
    /// Published protocols define their own crops and spheres.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["layout", "crops", "hfov_deg", "make_profile"])]
    protocol: Option<ProtocolName>,

    /// Photos to crop from each panorama, at evenly spaced headings, for datasets without photos
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    crops: u32,

    /// Range of the horizontal field of view of these crops, degrees
    #[arg(long, value_name = "A,B", default_value = "60,80", value_parser = parse::hfov_range_deg)]
    hfov_deg: [f32; 2],

    /// Folder of floor plans, NAME.json for panorama NAME.hdr; they provide depth
    #[arg(long, value_name = "DIR", conflicts_with = "protocol")]
    plans: Option<PathBuf>,

    /// Part of the dataset
    #[arg(long, value_name = "PART", default_value = "validation")]
    split: SplitName,

    /// Largest number of photos, evenly spread [default: all; 60 rooms for the protocol insertion]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    samples: Option<u32>,

    /// Methods, separated by commas [default: all basic methods that the options and the dataset allow]
    ///
    /// Basic methods: mean-colour, profile, fixed-shape, mirrored, single-map, network-cubed, shell-sensor, shell-true,
    /// network, network-sensor, network-true, true-octree.
    ///
    /// Expected and plausible light, and the photo's detail: network-expected, network-lamps, network-detail, each also
    /// with -sensor or -true.
    ///
    /// Known panorama: panorama-everywhere, panorama-prior, panorama-prior-found, panorama-prior-sensor,
    /// panorama-prior-true, panorama-of-another-room. With any of these, all methods are scored only on panoramas at
    /// least 0.7 m from the known one.
    ///
    /// Protocol insertion: no-lamp, overhead, fitted, each also with -sensor or -true; single-map, true-octree,
    /// true-panorama. All by default.
    ///
    /// The suffix -sensor stands for simulated sensor depth as input, -true for true depth; without a suffix, the input
    /// is the photo alone.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    methods: Vec<String>,

    /// Trained weights, for all network methods and single-map [default: the built-in weights]
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,

    /// Mean vertical profile of the training set, for the methods profile and fixed-shape; see --make-profile
    #[arg(long, value_name = "FILE.json")]
    profile: Option<PathBuf>,

    /// Compute the profile from the training part of the dataset, write it to this file, and exit
    #[arg(long, value_name = "FILE.json", conflicts_with_all = ["output", "profile", "weights", "methods"])]
    make_profile: Option<PathBuf>,

    /// Write the photos, their cameras, depth and the positions of their panoramas for other programs, and exit
    ///
    /// The folder gets views.json, which names the panorama wanted for each photo and position.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["output", "profile", "weights", "methods", "make_profile", "external", "baseline", "panoramas", "objects"])]
    write_views: Option<PathBuf>,

    /// Also score the panoramas of another program, in a folder with views.json; may be repeated
    ///
    /// Where the panorama of a position is missing, the photo's one panorama is used.
    #[arg(long, value_name = "NAME=DIR", value_parser = external)]
    external: Vec<(String, PathBuf)>,

    /// Also score a trained system of the literature, as written by train-baseline; may be repeated
    ///
    /// Names: gardner2017, nir2019, deeplight2019, garon2019, li2020, lighthouse2020. It must have been trained on the
    /// features of the networks of --weights.
    #[arg(long, value_name = "NAME=FILE", value_parser = baseline)]
    baseline: Vec<(System, PathBuf)>,

    /// Also write each method's panoramas into DIR/METHOD, in the form that --external reads
    #[arg(long, value_name = "DIR")]
    panoramas: Option<PathBuf>,

    /// Also insert three spheres into each photo, lit by each method's first panorama, and compare them with those lit
    /// by the true one; writes objects.png; takes several seconds per photo and method
    #[arg(long)]
    objects: bool,

    /// Octree depth; networks use at least their own depth
    #[arg(long, value_name = "D", default_value_t = 7, value_parser = clap::value_parser!(u32).range(5..=9))]
    octree_depth: u32,

    /// Number of photos for which a probe moves one metre through the room, to measure steps and parallax
    #[arg(long, value_name = "N", default_value_t = 4)]
    walks: u32,

    /// Rows of sheet.png and objects.png; 0 for no sheets
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(0..=100))]
    rows: u32,

    /// Cache folder of path-traced references of the protocol insertion; use one per seed and configuration
    #[arg(long, value_name = "DIR")]
    truths: Option<PathBuf>,

    /// Output folder
    #[arg(long, short, value_name = "DIR", required_unless_present_any = ["make_profile", "write_views"])]
    output: Option<PathBuf>,

    /// Write into a folder with other contents, or overwrite another file
    #[arg(long)]
    force: bool,

    /// Print the summary as JSON instead of tables
    #[arg(long)]
    json: bool,
}

/// Names of protocols.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ProtocolName {
    /// StyleLight (Wang et al. 2022): one crop of 60 degrees per panorama, three spheres under tone-mapped panoramas
    ThreeSpheres,
    /// Editable indoor lighting (Weber et al. 2022): ten crops of 50 degrees per panorama, nine diffuse spheres on a
    /// plane
    SphereArray,
    /// Lighthouse (Srinivasan et al. 2020), on InteriorNet or its own test set: PSNR of a panorama ahead of the camera
    Interiornet,
    /// Spheres and a pole in generated rooms: shading and shadows against path tracing; about 30 seconds per room
    Insertion,
}

impl ProtocolName {
    /// Returns the published protocol, if it is one.
    fn published(self) -> Option<Protocol> {
        match self {
            Self::ThreeSpheres => Some(Protocol::ThreeSpheres),
            Self::SphereArray => Some(Protocol::SphereArray),
            Self::Interiornet | Self::Insertion => None,
        }
    }
}

const COMMAND: &str = "eval";
const MANIFEST: &str = "summary.json";

/// Longest name of another program.
const MAX_NAME: usize = 40;

/// Default number of rooms of the protocol insertion.
const INSERTION_ROOMS: usize = 60;

/// Finds methods by name.
///
/// # Errors
/// Unknown names; the message lists all methods.
fn methods_by_name<T: Copy>(names: &[String], all: &[T], name: impl Fn(T) -> &'static str) -> Result<Vec<T>, Usage> {
    let find = |wanted: &String| {
        all.iter().copied().find(|&method| name(method) == wanted).ok_or_else(|| {
            let available: Vec<&str> = all.iter().map(|&method| name(method)).collect();
            Usage(format!("--methods: unknown method \"{wanted}\"; available: {}", available.join(", ")))
        })
    };
    names.iter().map(find).collect()
}

/// Returns all methods that can be named.
fn all_methods() -> impl Iterator<Item = Method> {
    Method::ALL.into_iter().chain(Method::WITH_LAMPS).chain(Method::WITH_DETAIL).chain(Method::WITH_PANORAMA)
}

fn methods(args: &Args) -> Result<Vec<Method>, Usage> {
    methods_by_name(&args.methods, &all_methods().collect::<Vec<_>>(), Method::name)
}

/// Parses `NAME=DIR` of `--external`. Names become cells of tables.
fn external(text: &str) -> Result<(String, PathBuf), String> {
    let (name, folder) = text.split_once('=').ok_or("expected NAME=DIR")?;
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._+-".contains(c);
    if name.is_empty() || name.len() > MAX_NAME || !name.chars().all(is_plain) {
        return Err(format!("the name must have 1 to {MAX_NAME} letters, digits or any of . _ + -"));
    }
    let is_system = System::ALL.into_iter().any(|system| system.name() == name);
    if name == "truth" || is_system || all_methods().any(|method| method.name() == name) {
        return Err(format!("{name} has a meaning in the tables; choose another name"));
    }
    if folder.is_empty() {
        return Err("expected NAME=DIR".into());
    }
    Ok((name.to_owned(), folder.into()))
}

/// Parses `NAME=FILE` of `--baseline`.
fn baseline(text: &str) -> Result<(System, PathBuf), String> {
    let (name, file) = text.split_once('=').filter(|(_, file)| !file.is_empty()).ok_or("expected NAME=FILE")?;
    Ok((name.parse().map_err(|error: UnknownSystem| error.to_string())?, file.into()))
}

/// Runs the evaluation, or computes a profile.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    if let Some(path) = &args.make_profile {
        return make_profile(global, args, path);
    }
    if let Some(folder) = &args.write_views {
        return list_views(global, args, folder);
    }
    let folder = args.output.as_deref().ok_or_else(|| Usage("--output DIR is required".into()))?;
    let profile = args.profile.as_deref().map(read_profile).transpose()?;
    let has_networks = args.weights.is_some() || cfg!(feature = "weights");
    let estimator = if has_networks {
        lightoctree_cli::commands::estimator(args.weights.as_deref())?
    } else {
        Estimator::without_networks()
    };
    let baselines = baselines(args, &estimator)?;
    let tools = Tools {
        estimator: &estimator,
        profile: profile.as_ref(),
        octree_depth: args.octree_depth,
        seed: global.seed,
        known: None,
        foreign: None,
        baselines: &baselines,
    };
    let begun = Instant::now();
    let rows = args.rows as usize;
    let report = if matches!(args.protocol, Some(ProtocolName::Insertion)) {
        let evaluation = insertion(global, args, tools)?;
        output::prepare_folder(folder, MANIFEST, COMMAND, args.force)?;
        let mut bar = StageBar::new(global.quiet);
        evaluation.run(rows, &mut |event| bar.handle(event))
    } else {
        let methods = methods(args)?;
        check_tools(&methods, &tools)?;
        let externals = externals(args)?;
        let evaluation = Evaluation::open(&photos(global, args, args.split)?, &methods, tools).map_err(usage)?;
        let mut evaluation = evaluation.with_externals(externals).map_err(usage)?;
        if args.objects {
            check_objects(&tools)?;
            evaluation = evaluation.with_objects(Quality::Normal)?;
        }
        output::prepare_folder(folder, MANIFEST, COMMAND, args.force)?;
        if let Some(panoramas) = &args.panoramas {
            for method in evaluation.methods() {
                output::check_folder(&panoramas.join(method.name()), VIEWS_FILE, COMMAND, args.force)?;
            }
            evaluation = evaluation.keeping_panoramas(panoramas.clone(), output::signature(COMMAND));
        }
        let mut bar = StageBar::new(global.quiet);
        evaluation.run(rows, args.walks as usize, &mut |event| bar.handle(event))
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
    if let Some(error) = report.error {
        return Err(error).with_context(|| format!("after {done} of {asked} photos"));
    }
    if done < asked {
        anyhow::bail!("stopped after {done} of {asked} photos; {} has their figures", folder.display());
    }
    Ok(())
}

fn photos(global: &Global, args: &Args, part: SplitName) -> anyhow::Result<PhotoSelection> {
    let mut crops = CropModel { crops: args.crops, seed: global.seed, ..CropModel::default() };
    crops.hfov_deg = args.hfov_deg.try_into()?;
    Ok(PhotoSelection {
        dataset: args.dataset.clone(),
        layout: args.layout.map(Into::into),
        protocol: args.protocol.and_then(ProtocolName::published),
        as_lighthouse: matches!(args.protocol, Some(ProtocolName::Interiornet)),
        crops,
        plans: args.plans.clone(),
        part: part.part(),
        most: args.samples.map(|most| most as usize),
    })
}

/// Checks that objects can be placed.
fn check_objects(tools: &Tools) -> Result<(), Usage> {
    match tools.estimator.networks() {
        Some(_) => Ok(()),
        None => {
            Err(Usage("--objects requires --weights FILE: the networks estimate the surface under the objects".into()))
        }
    }
}

/// Opens the folders of `--external`.
fn externals(args: &Args) -> anyhow::Result<Vec<External>> {
    let mut externals: Vec<External> = Vec::new();
    for (name, folder) in &args.external {
        if externals.iter().any(|other| other.name() == name) {
            return Err(Usage(format!("--external: {name} is given twice")).into());
        }
        externals.push(External::open(name, folder).with_context(|| format!("--external {name}"))?);
    }
    Ok(externals)
}

/// Reads the files of `--baseline`.
fn baselines(args: &Args, estimator: &Estimator) -> anyhow::Result<Vec<Baseline>> {
    let mut baselines: Vec<Baseline> = Vec::new();
    for (system, path) in &args.baseline {
        if baselines.iter().any(|other| other.system() == *system) {
            return Err(Usage(format!("--baseline: {system} is given twice")).into());
        }
        if estimator.networks().is_none() {
            return Err(Usage("--baseline requires --weights FILE: baselines read their image features".into()).into());
        }
        baselines.push(Baseline::read(path, *system).with_context(|| format!("--baseline {system}"))?);
    }
    Ok(baselines)
}

/// Prepares the protocol insertion in the rooms of a configuration.
fn insertion<'a>(global: &Global, args: &Args, tools: Tools<'a>) -> anyhow::Result<InsertionEvaluation<'a>> {
    let methods = methods_by_name(&args.methods, &InsertionMethod::ALL, InsertionMethod::name)?;
    if !args.external.is_empty() || !args.baseline.is_empty() || args.panoramas.is_some() || args.objects {
        let message = "the protocol insertion has its own objects and light: remove --external, --baseline, \
            --panoramas and --objects";
        return Err(Usage(message.into()).into());
    }
    if tools.estimator.networks().is_none() {
        return Err(Usage("the protocol insertion requires --weights FILE".into()).into());
    }
    let config: GeneratorConfig = config::read(&args.dataset)?;
    let generator = Generator::new(global.seed, config).map_err(|error| Usage(error.to_string()))?;
    let rooms = args.samples.map_or(INSERTION_ROOMS, |rooms| rooms as usize);
    let evaluation = InsertionEvaluation::new(generator, global.seed, rooms, &methods, tools, Quality::Normal)?;
    let Some(folder) = &args.truths else { return Ok(evaluation) };
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    Ok(evaluation.with_truth_cache(folder.clone()))
}

/// Marks errors that other options can solve as usage errors.
fn usage(error: EvalError) -> anyhow::Error {
    match error {
        EvalError::NoPhotos { .. } => Usage(format!("{error}; see --split")).into(),
        EvalError::NotInteriorNet { .. } => Usage(format!("--protocol: {error}")).into(),
        EvalError::Baseline(error) => Usage(format!("--baseline: {error} (--weights)")).into(),
        EvalError::External(error) => Usage(error.to_string()).into(),
        error => error.into(),
    }
}

/// Checks that the tools suffice for all requested methods.
fn check_tools(methods: &[Method], tools: &Tools) -> Result<(), Usage> {
    let lacking = methods.iter().find(|method| !method.has_tools(tools));
    lacking.map_or(Ok(()), |method| {
        let is_profile = matches!(method, Method::Profile | Method::FixedShape);
        let option = if is_profile { "--profile FILE.json" } else { "--weights FILE" };
        Err(Usage(format!("the method {} requires {option}", method.name())))
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
    for (name, sheet) in [("sheet.png", &report.sheet), ("objects.png", &report.objects)] {
        if !sheet.is_empty() {
            let signature = output::signature(COMMAND);
            imaging::write_srgb8(folder.join(name), &sheet.picture(), imaging::JPEG_QUALITY, &signature)?;
        }
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

/// Writes the photos and the list of their views for other programs.
fn list_views(global: &Global, args: &Args, folder: &Path) -> anyhow::Result<()> {
    if matches!(args.protocol, Some(ProtocolName::Insertion)) {
        return Err(Usage("--write-views: the protocol insertion scores objects, no panoramas".into()).into());
    }
    let list = folder.join(VIEWS_FILE);
    if list.exists() && !args.force {
        return Err(Usage(format!(
            "{} exists, and panoramas beside it may belong to it; choose another folder, or replace it with --force",
            list.display()
        ))
        .into());
    }
    output::check_folder(folder, VIEWS_FILE, COMMAND, args.force)?;
    let selection = photos(global, args, args.split)?;
    let mut bar = StageBar::new(global.quiet);
    let written = selection.write_views(folder, &output::signature(COMMAND), &mut |event| bar.handle(event));
    drop(bar);
    let photos = written.map_err(|error| match error {
        EvalError::Cancelled(_) => anyhow::anyhow!("stopped; {} was not written", list.display()),
        error => usage(error),
    })?;
    report::print(&format!("{}  photos: {photos}", list.display()));
    Ok(())
}

fn make_profile(global: &Global, args: &Args, path: &Path) -> anyhow::Result<()> {
    output::check_replaceable(path, COMMAND, args.force)?;
    let (dataset, indices) = photos(global, args, SplitName::Train)?.open().map_err(usage)?;
    let name = args.dataset.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let mut bar = StageBar::new(global.quiet);
    let profile = Profile::from_dataset(dataset.as_ref(), &indices, &name, &mut |event| bar.handle(event));
    drop(bar);
    let profile = profile.map_err(|error| match error {
        ProfileError::Cancelled(_) => anyhow::anyhow!("stopped; no profile was written"),
        error => error.into(),
    })?;
    write_json(path, COMMAND, json!(profile))?;
    report::print(&format!("{}  mean of {} photos", path.display(), profile.samples()));
    Ok(())
}
