//! `lightoctree-lab synth`: generates procedural rooms with global illumination, as shards.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use lightoctree_cli::args::Global;
use lightoctree_cli::commands::environment::signed;
use lightoctree_cli::commands::parse;
use lightoctree_cli::progress::seconds;
use lightoctree_cli::usage::Usage;
use lightoctree_cli::{output, report};
use lo_dataset::{
    FORMAT_VERSION, Generator, GeneratorConfig, ShardCount, ShardFolder, ShardPart, Split, generate_shards,
};
use serde_json::{Value, json};

use super::dataset::{SplitName, shard_folder};
use crate::config::{self, ConfigArgs};
use crate::stage_bar::StageBar;

/// Options of `synth`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree-lab synth --scenes 2000 --seed 1 -o rooms\n  \
    lightoctree-lab synth --scenes 2000 --seed 1 --shard $((SLURM_ARRAY_TASK_ID + 1))/16 -o rooms\n  \
    lightoctree-lab synth --scenes 8000 --seed 300 --config configs/photos.toml --pictures pictures -o photos\n  \
    lightoctree-lab synth --print-config > rooms.toml\n  \
    lightoctree-lab synth --glb 7 --seed 1 -o room.glb\n\n\
    To resume a stopped run, or to add rooms with a larger --scenes, run the same command again: finished shards are \
    kept. Rooms depend only on the seed and the configuration, not on --shard or --threads. Shards are WebDataset \
    archives; docs/data.md describes them.")]
pub struct Args {
    /// Number of rooms to generate
    #[arg(long, value_name = "N", required_unless_present_any = ["print_config", "glb"],
        value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    scenes: Option<u32>,

    /// Generate only part I of N, counted from 1: every N-th shard; for several machines or cluster jobs
    #[arg(long, value_name = "I/N", default_value = "1/1", value_parser = parse::part)]
    shard: [u32; 2],

    /// Generate only the rooms of this part, e.g. validation, to evaluate on rooms not used for training
    #[arg(long, value_name = "PART", default_value = "all")]
    split: SplitName,

    /// Rooms per shard
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    scenes_per_shard: u32,

    #[command(flatten)]
    config: ConfigArgs,

    /// Folder of images for posters, screens and book covers; repeatable
    ///
    /// Photos are used as they are. Equirectangular .hdr and .exr panoramas are cropped to views.
    #[arg(long, value_name = "DIR")]
    pictures: Vec<PathBuf>,

    /// Octree depth to generate enough surface points for [default: octree_depth of the configuration]
    #[arg(long, value_name = "D", value_parser = clap::value_parser!(u32).range(1..=10))]
    octree_depth: Option<u32>,

    /// Write only this room, counted from 0, as glTF; --output is then a .glb file
    ///
    /// The file contains a mesh per object, materials, lamps, sky, sun and the cameras of the photos.
    #[arg(long, value_name = "ROOM", conflicts_with_all = ["scenes", "shard"])]
    glb: Option<u32>,

    /// Output folder
    #[arg(long, short, value_name = "DIR", required_unless_present = "print_config")]
    output: Option<PathBuf>,

    /// Write into a folder with other contents, and delete shards of another seed or configuration there
    #[arg(long)]
    force: bool,

    /// Print a summary as JSON
    #[arg(long)]
    json: bool,
}

const COMMAND: &str = "synth";
/// Prefix of the shards' file names.
const PREFIX: &str = "rooms";

/// Generates the missing shards of this part.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    let config = read_config(args)?;
    if let (Some(room), Some(path)) = (args.glb, &args.output) {
        return write_glb(global, args, config, room, path);
    }
    let (Some(scenes), Some(folder), false) = (args.scenes, &args.output, args.config.print_config) else {
        report::print(config::text(&config)?.trim_end());
        return Ok(());
    };
    let generator = Generator::new(global.seed, config.clone()).map_err(|error| Usage(error.to_string()))?;
    let wanted = |room: &u64| args.split.part().is_none_or(|part| Split::of(&generator.scene_id(*room)) == part);
    let rooms: Vec<u64> = (0..scenes.into()).filter(wanted).collect();
    let per_shard = args.scenes_per_shard as usize;
    if rooms.is_empty() {
        return Err(Usage(format!("none of the {scenes} rooms is in the selected part; see --split")).into());
    }
    let manifest = manifest(global, args, scenes, &config)?;
    let full = |scenes| (0..scenes).filter(wanted).count() / per_shard;
    ShardFolder::grow(folder, PREFIX, &signed(COMMAND, manifest.clone()), "scenes", full)?;
    let shards = shard_folder(folder, PREFIX, COMMAND, manifest, args.force)?;

    crate::memory::retain_freed_memory();
    let begun = std::time::Instant::now();
    let [number, of] = args.shard;
    let part = ShardPart { index: number as usize - 1, count: of as usize };
    let mut bar = StageBar::new(global.quiet);
    let count = generate_shards(&shards, &generator, &rooms, per_shard, part, &mut |event| bar.handle(event))?;
    drop(bar);
    let ShardCount { total: mine, finished: done, written } = count;
    if args.json {
        report::print_json(&json!({
            "shards_of_this_part": mine,
            "shards_there": done,
            "shards_written": written,
            "seconds": begun.elapsed().as_secs_f64(),
        }))?;
    } else {
        let (shown, took) = (folder.display(), seconds(begun.elapsed()));
        report::print(&format!("{shown}  {written} shards written, {done} of {mine} complete, {took}"));
    }
    if done < mine {
        anyhow::bail!("stopped after {done} of {mine} shards; run the same command again to continue");
    }
    Ok(())
}

fn write_glb(global: &Global, args: &Args, config: GeneratorConfig, room: u32, path: &Path) -> anyhow::Result<()> {
    output::check_replaceable(path, COMMAND, args.force)?;
    let generator = Generator::new(global.seed, config).map_err(|error| Usage(error.to_string()))?;
    let interior = generator.interior(room.into())?;
    let cameras = interior.camera_poses(generator.config().shots as usize);
    let bytes = interior.to_glb(&output::signature(COMMAND), &cameras)?;
    lo_imaging::write_atomically(path, |out| out.write_all(&bytes))?;
    if args.json {
        let description = serde_json::to_value(&interior.description)?;
        report::print_json(&json!({ "id": interior.id, "bytes": bytes.len(), "description": description }))?;
    } else {
        report::print(&format!("{}  {}, {} bytes", path.display(), interior.id, bytes.len()));
    }
    Ok(())
}

fn read_config(args: &Args) -> anyhow::Result<GeneratorConfig> {
    let mut config: GeneratorConfig = args.config.read(None)?;
    config.room.picture_folders.extend(args.pictures.iter().cloned());
    if let Some(depth) = args.octree_depth {
        config.octree_depth = depth;
    }
    config.validate().map_err(|error| args.config.invalid(None, error))?;
    Ok(config)
}

/// Returns everything that the shards' contents depend on.
fn manifest(global: &Global, args: &Args, scenes: u32, config: &GeneratorConfig) -> anyhow::Result<Value> {
    Ok(json!({
        "format_version": FORMAT_VERSION,
        "program_version": env!("CARGO_PKG_VERSION"),
        "seed": global.seed,
        "scenes": scenes,
        "scenes_per_shard": args.scenes_per_shard,
        "split": args.split.to_possible_value().map(|name| name.get_name().to_owned()),
        "config": serde_json::to_value(config)?,
    }))
}
