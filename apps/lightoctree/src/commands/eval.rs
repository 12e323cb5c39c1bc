//! `lightoctree eval`: figures of methods and baselines on any dataset.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use clap::ValueEnum;
use dataset::{CropModel, Dataset, Layout, Sample};
use eval::{
    Cost, Method, Outcome, Profile, ProfileBuilder, Protocol, ProtocolCrops, ProtocolRenders, Scorer, Sheet, Summary,
    Tools, walk,
};
use lightoctree::imaging;
use serde_json::json;

use super::bench::memory;
use super::dataset::{LayoutName, SplitName, spread};
use super::environment::write_json;
use super::parse;
use crate::args::Global;
use crate::progress::{bar, seconds};
use crate::{Usage, interrupt, output, report};

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

    /// Methods, separated by commas [default: all that the options suffice for]
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
    let all = Method::ALL;
    let names = || all.map(Method::name).join(", ");
    all.into_iter().find(|method| method.name() == name).ok_or_else(|| format!("no method; there are {}", names()))
}

/// Evaluates, or makes a profile.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    if let Some(path) = &args.make_profile {
        return make_profile(global, args, path);
    }
    let folder = args.output.as_deref().ok_or_else(|| Usage("--output DIR is missing".into()))?;
    let profile = args.profile.as_deref().map(read_profile).transpose()?;
    let has_networks = args.weights.is_some() || cfg!(feature = "weights");
    let networks = has_networks.then(|| super::networks(args.weights.as_deref())).transpose()?;
    let tools = Tools {
        networks: networks.as_ref(),
        profile: profile.as_ref(),
        octree_depth: args.octree_depth,
        seed: global.seed,
    };
    check_tools(args, &tools)?;
    let dataset = open(global, args)?;
    let indices = indices(args, dataset.as_ref(), args.split, args.samples)?;
    let methods = methods(args, dataset.as_ref(), &indices, &tools)?;
    output::prepare_folder(folder, MANIFEST, COMMAND, args.force)?;

    let begun = Instant::now();
    let mut evaluation = Evaluation {
        scorer: Scorer::new(args.protocol.map(|name| ProtocolRenders::new(name.into()))),
        tools,
        methods,
        summary: Summary::default(),
        sheet: Sheet::default(),
        rows: spread(indices.len(), args.rows as usize).collect(),
        walks: spread(indices.len(), args.walks as usize).collect(),
    };
    let progress = bar(global.quiet, indices.len(), "photos");
    let (mut done, mut unreadable) = (0, None);
    for (position, &index) in indices.iter().enumerate() {
        if interrupt::asked() {
            break;
        }
        match dataset.get(index) {
            Ok(sample) => evaluation.add(position, &sample),
            // the figures so far are worth keeping
            Err(error) => {
                unreadable = Some(error);
                break;
            }
        }
        progress.inc(1);
        done += 1;
    }
    progress.finish_and_clear();
    let Evaluation { summary, sheet, methods, .. } = evaluation;
    write(args, folder, &summary, &sheet, &methods, done)?;
    if args.json {
        report::print_json(&summary.json())?;
    } else {
        report::print(&summary.markdown());
        report::print(&summary.cost_markdown());
        report::print(&format!("{}  {done} photos, {}", folder.display(), seconds(begun.elapsed())));
    }
    if let Some(error) = unreadable {
        return Err(error).with_context(|| format!("after {done} of {} photos", indices.len()));
    }
    if done < indices.len() {
        anyhow::bail!("stopped after {done} of {} photos; {} holds their figures", indices.len(), folder.display());
    }
    Ok(())
}

/// What goes on over all samples.
struct Evaluation<'a> {
    scorer: Scorer,
    tools: Tools<'a>,
    methods: Vec<Method>,
    summary: Summary,
    sheet: Sheet,
    /// Samples, by their position, that get a row of the sheet, and those with a walk.
    rows: Vec<usize>,
    walks: Vec<usize>,
}

impl Evaluation<'_> {
    fn add(&mut self, position: usize, sample: &Sample) {
        let mut shown = Vec::new();
        for &method in &self.methods {
            memory::restart_peak();
            let begun = Instant::now();
            let estimate = method.estimate(sample, &self.tools);
            let mut cost = Cost { estimate_s: begun.elapsed().as_secs_f64(), ..Cost::default() };
            let scores = estimate.map(|estimate| {
                let begun = Instant::now();
                let panoramas = Scorer::panoramas(sample, &estimate);
                cost.panorama_s = begun.elapsed().as_secs_f64() / panoramas.len().max(1) as f64;
                cost.peak_mib = memory::peak_mib();
                let mut scores = self.scorer.score(sample, &estimate, &panoramas);
                if self.walks.contains(&position)
                    && let Some(found) = walk(sample, &estimate)
                {
                    scores.add("walk_step_ratio", found.largest_step_ratio);
                    scores.add("walk_parallax_px", found.parallax_px);
                }
                shown.push(panoramas.into_iter().next());
                scores
            });
            if scores.is_err() {
                shown.push(None);
            }
            self.summary.add(Outcome {
                sample: sample.id.clone(),
                scene: sample.scene_id.clone(),
                method: method.name(),
                scores: scores.map_err(|error| error.to_string()),
                cost,
            });
        }
        if self.rows.contains(&position) {
            self.sheet.add(sample, &shown);
        }
    }
}

fn open(global: &Global, args: &Args) -> anyhow::Result<Box<dyn Dataset>> {
    if let Some(protocol) = args.protocol {
        return Ok(Box::new(ProtocolCrops::open(&args.dataset, protocol.into())?));
    }
    let layout = match args.layout {
        Some(name) => name.into(),
        None => Layout::detect(&args.dataset)?,
    };
    let mut model = CropModel { crops: args.crops, seed: global.seed, ..CropModel::default() };
    model.hfov_deg = args.hfov_deg.try_into()?;
    Ok(layout.open(&args.dataset, model)?)
}

/// The samples of a part, evenly thinned out.
fn indices(args: &Args, dataset: &dyn Dataset, part: SplitName, most: Option<u32>) -> anyhow::Result<Vec<usize>> {
    let all: Vec<usize> = (0..dataset.len()).filter(|&index| part.holds(dataset.split(index))).collect();
    if all.is_empty() {
        let shown = args.dataset.display();
        return Err(Usage(format!("{shown}: none of {} photos is in that part; see --split", dataset.len())).into());
    }
    let count = most.map_or(all.len(), |most| most as usize);
    Ok(spread(all.len(), count).map(|i| all[i]).collect())
}

/// Whether all methods that were asked for have what they need.
fn check_tools(args: &Args, tools: &Tools) -> Result<(), Usage> {
    let lacking = args.methods.iter().find(|method| !method.has_tools(tools));
    lacking.map_or(Ok(()), |method| {
        let needed = if *method == Method::Profile { "--profile FILE.json" } else { "--weights FILE" };
        Err(Usage(format!("the method {} needs {needed}", method.name())))
    })
}

/// Those that were asked for, or those that the tools and the first sample suffice for.
fn methods(args: &Args, dataset: &dyn Dataset, indices: &[usize], tools: &Tools) -> anyhow::Result<Vec<Method>> {
    if !args.methods.is_empty() {
        return Ok(args.methods.clone());
    }
    let first = dataset.get(indices[0])?;
    let able = |method: &Method| method.has_tools(tools) && method.takes(&first);
    Ok(Method::ALL.into_iter().filter(able).collect())
}

fn write(
    args: &Args,
    folder: &Path,
    summary: &Summary,
    sheet: &Sheet,
    methods: &[Method],
    photos: usize,
) -> anyhow::Result<()> {
    let names: Vec<&str> = methods.iter().map(|method| method.name()).collect();
    let mut object = summary.json();
    object["dataset"] = json!(args.dataset);
    object["photos"] = json!(photos);
    object["program_version"] = json!(env!("CARGO_PKG_VERSION"));
    write_json(&folder.join(MANIFEST), COMMAND, object)?;
    write_bytes(&folder.join("scenes.csv"), &scenes_csv(summary)?)?;
    write_bytes(&folder.join("costs.csv"), &costs_csv(summary)?)?;
    let order = format!("sheet.png, from left to right: photo, true panorama, {}\n\n", names.join(", "));
    write_bytes(&folder.join("summary.md"), (order + &summary.markdown() + &summary.cost_markdown()).as_bytes())?;
    if !sheet.is_empty() {
        imaging::write_srgb8(folder.join("sheet.png"), &sheet.picture(), imaging::JPEG_QUALITY)?;
    }
    Ok(())
}

/// A line for each photo and method; what cannot be said stays empty.
fn scenes_csv(summary: &Summary) -> anyhow::Result<Vec<u8>> {
    let figures = summary.figures();
    let mut table = csv::Writer::from_writer(Vec::new());
    let head = ["scene", "photo", "method", "not_possible"].into_iter().chain(figures.iter().map(String::as_str));
    table.write_record(head)?;
    for outcome in summary.outcomes() {
        let (scores, reason) = match &outcome.scores {
            Ok(scores) => (Some(scores), ""),
            Err(reason) => (None, &reason[..]),
        };
        let value = |figure: &String| scores.and_then(|scores| scores.get(figure)).map(|v| format!("{v:.6}"));
        let start = [&outcome.scene, &outcome.sample, outcome.method, reason].map(str::to_owned);
        table.write_record(start.into_iter().chain(figures.iter().map(|figure| value(figure).unwrap_or_default())))?;
    }
    Ok(table.into_inner()?)
}

fn costs_csv(summary: &Summary) -> anyhow::Result<Vec<u8>> {
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(["photo", "method", "estimate_s", "panorama_s", "peak_mib"])?;
    for outcome in summary.outcomes().iter().filter(|outcome| outcome.scores.is_ok()) {
        let Cost { estimate_s, panorama_s, peak_mib } = outcome.cost;
        let peak = peak_mib.map_or_else(String::new, |mib| format!("{mib:.1}"));
        let numbers = [format!("{estimate_s:.6}"), format!("{panorama_s:.6}"), peak];
        table.write_record([outcome.sample.clone(), outcome.method.to_owned()].into_iter().chain(numbers))?;
    }
    Ok(table.into_inner()?)
}

fn write_bytes(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    imaging::write_atomically(path, |out| out.write_all(bytes))
        .with_context(|| format!("cannot write {}", path.display()))
}

fn read_profile(path: &Path) -> anyhow::Result<Profile> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    // it names the command that wrote it, which is not part of the profile
    let named = || format!("--profile {}", path.display());
    let mut object: serde_json::Value = serde_json::from_slice(&bytes).with_context(named)?;
    object.as_object_mut().map(|fields| fields.remove("generator"));
    Profile::from_json(object.to_string().as_bytes()).with_context(named)
}

fn make_profile(global: &Global, args: &Args, path: &Path) -> anyhow::Result<()> {
    output::check_replaceable(path, COMMAND, args.force)?;
    let dataset = open(global, args)?;
    let indices = indices(args, dataset.as_ref(), SplitName::Train, args.samples)?;
    let progress = bar(global.quiet, indices.len(), "photos");
    let mut builder = ProfileBuilder::default();
    for index in indices {
        if interrupt::asked() {
            anyhow::bail!("stopped; no profile was written");
        }
        builder.add(&dataset.get(index)?);
        progress.inc(1);
    }
    progress.finish_and_clear();
    let name = args.dataset.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let profile = builder.finish(&name).context("no panorama in the training part")?;
    write_json(path, COMMAND, json!(profile))?;
    report::print(&format!("{}  mean of {} photos", path.display(), profile.samples()));
    Ok(())
}
