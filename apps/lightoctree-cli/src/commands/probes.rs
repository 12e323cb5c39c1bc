//! `lightoctree probes SCENE`: renders HDR environment maps at many points, with a manifest.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::builder::PossibleValuesParser;
use lightoctree::{Cancelled, Document, Estimate, LightPurpose};
use lo_cone::Rendering;
use lo_geometry::{MAX_COORDINATE_M, Vec3};
use lo_insert as insert;
use lo_insert::PathPlacement;
use serde_json::json;

use super::environment::{self, EnvironmentArgs};
use super::level::OutputFrame;
use super::light::LightArgs;
use super::parse;
use crate::args::Global;
use crate::progress::{Stages, seconds};
use crate::usage::Usage;
use crate::{output, report};

/// Options of `probes`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree probes room.scene --grid 4,2,4 -o probes\n  \
    lightoctree probes room.scene --points positions.csv --size 256x128 -o probes\n\n\
    FILE.csv: one point per line, x,y,z in metres and an optional name; the first line may be the header `x,y,z,name`.\n\
    FILE.json: keyframes as for `insert --path`.")]
#[command(group(clap::ArgGroup::new("place").required(true).args(["grid", "path", "points"])))]
pub struct Args {
    /// Scene file
    scene: PathBuf,

    #[command(flatten)]
    light: LightArgs,

    /// Render only reflected light, without lamps, windows and added lights, to relight the scene with your own lights
    #[arg(long, conflicts_with_all = ["light", "lamp", "no_lamp", "contrast", "warmth", "white"])]
    without_emitters: bool,

    /// Points of a regular grid inside the room
    #[arg(long, value_name = "NX,NY,NZ", value_parser = parse::counts)]
    grid: Option<[usize; 3]>,

    /// Points along a path of keyframes; see --frames
    #[arg(long, value_name = "FILE.json", requires = "frames")]
    path: Option<PathBuf>,

    /// Number of points along the path
    #[arg(long, value_name = "N", requires = "path", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,

    /// Points of a table
    #[arg(long, value_name = "FILE.csv")]
    points: Option<PathBuf>,

    #[command(flatten)]
    panorama: EnvironmentArgs,

    /// File format of the environment maps
    #[arg(long, value_name = "EXT", default_value = "exr", value_parser = PossibleValuesParser::new(output::RADIANCE))]
    format: String,

    /// Folder to write to
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,

    /// Write to a folder that contains other files
    #[arg(long)]
    force: bool,

    /// Print the manifest as JSON
    #[arg(long)]
    json: bool,
}

const COMMAND: &str = "probes";
const MANIFEST: &str = "manifest.json";
/// Maximum number of probes of one run.
const MAX_PROBES: usize = 100_000;

/// A position to render at, and the name of its file.
pub struct Probe {
    /// File name without extension.
    pub name: String,
    /// Position in metres, in the camera's frame.
    pub position_m: Vec3,
}

/// Renders and writes every probe, then writes the manifest.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    output::check_folder(&args.output, MANIFEST, COMMAND, args.force)?;
    let height = environment::height(args.panorama.size)?;
    let mut stages = Stages::new(global.quiet);
    let mut document = stages.stage("read scene", || Document::read(&args.scene))?;
    let purpose = if args.without_emitters { LightPurpose::IndirectOnly } else { LightPurpose::Panorama };
    let scene = args.light.lit(&mut document, purpose, &mut stages)?;
    let probes = probes(args, &scene)?;
    let frame = OutputFrame::new(&scene, args.panorama.frame)?;
    output::prepare_folder(&args.output, MANIFEST, COMMAND, args.force)?;
    let mut entries = Vec::with_capacity(probes.len());
    let points: Vec<Vec3> = probes.iter().map(|probe| probe.position_m).collect();
    let write = |index: usize, panorama: Rendering| -> anyhow::Result<()> {
        let probe = &probes[index];
        let file = format!("{}.{}", probe.name, args.format);
        let path = args.output.join(&file);
        let panorama = frame.panorama(panorama, height);
        let at = Some((probe.position_m, &frame));
        environment::write(&path, &panorama.radiance, at, &args.panorama.file, COMMAND)?;
        entries.push(json!({
            "name": probe.name,
            "file": file,
            "position_m": frame.point(probe.position_m).to_array(),
            "place": environment::unusual_position(&scene, probe.position_m).unwrap_or("free"),
        }));
        Ok(())
    };
    let rendered = lightoctree::render_probes(&scene, &points, frame.rendered_height(height), write, &mut |event| {
        stages.handle(event)
    });
    rendered.or_else(|error| if error.is::<Cancelled>() { Ok(()) } else { Err(error) })?;
    let manifest = json!({
        "size": args.panorama.size,
        "units": "linear Rec. 709; 1 is the photo's white",
        "frame": frame.description(),
        "camera": frame.camera(),
        "probes": entries,
    });
    environment::write_json(&args.output.join(MANIFEST), COMMAND, manifest.clone())?;
    if args.json {
        report::print_json(&manifest)?;
    } else {
        report::print(&format!("{}  {} probes in {}", args.output.display(), entries.len(), seconds(stages.total())));
    }
    if entries.len() < probes.len() {
        anyhow::bail!(
            "stopped after {} of {} probes; {} lists the finished ones",
            entries.len(),
            probes.len(),
            args.output.join(MANIFEST).display()
        );
    }
    Ok(())
}

fn probes(args: &Args, estimate: &Estimate) -> anyhow::Result<Vec<Probe>> {
    let numbered = |points: Vec<Vec3>| {
        points
            .into_iter()
            .enumerate()
            .map(|(i, position_m)| Probe { name: format!("probe_{i:04}"), position_m })
            .collect()
    };
    let probes: Vec<Probe> = if let Some(counts) = args.grid {
        let total = counts.iter().product::<usize>();
        check_count(total)?;
        numbered(lightoctree::probe_grid(estimate, counts))
    } else if let (Some(path), Some(frames)) = (&args.path, args.frames) {
        let text = super::read_text(path)?;
        let path = insert::Path::from_json(&text).with_context(|| format!("{}", path.display()))?;
        let placements = path.placements(estimate, &PathPlacement::default(), frames as usize)?;
        numbered(placements.into_iter().map(|placement| placement.position_m).collect())
    } else if let Some(path) = &args.points {
        read_points(path)?
    } else {
        return Err(Usage("give the points with --grid, --path or --points".into()).into());
    };
    check_count(probes.len())?;
    Ok(probes)
}

fn check_count(count: usize) -> anyhow::Result<()> {
    if (1..=MAX_PROBES).contains(&count) {
        Ok(())
    } else {
        Err(Usage(format!("{count} probes: a run renders 1 to {MAX_PROBES}")).into())
    }
}

fn read_points(path: &Path) -> anyhow::Result<Vec<Probe>> {
    let text = super::read_text(path)?;
    points_from_csv(&text).with_context(|| format!("{}", path.display()))
}

/// Parses a table of points: x, y, z in metres and an optional name, with or without a header line.
///
/// # Errors
/// Malformed lines, by number; duplicate names and names that cannot be file names.
pub fn points_from_csv(text: &str) -> anyhow::Result<Vec<Probe>> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let mut probes: Vec<Probe> = Vec::new();
    let mut names = HashSet::new();
    for (index, record) in reader.records().enumerate() {
        let record = record?;
        let line = record.position().map_or(index as u64 + 1, csv::Position::line);
        if index == 0 && record.get(0).is_some_and(|cell| cell.eq_ignore_ascii_case("x")) {
            continue;
        }
        if !(3..=4).contains(&record.len()) {
            anyhow::bail!("line {line}: expected x,y,z and an optional name, got {} cells", record.len());
        }
        let mut xyz = [0.0f32; 3];
        for (value, (cell, axis)) in xyz.iter_mut().zip(record.iter().zip(["x", "y", "z"])) {
            *value = cell.parse().ok().filter(|v: &f32| v.abs() <= MAX_COORDINATE_M).with_context(|| {
                format!("line {line}: {axis} is `{cell}`, not a number within ± {MAX_COORDINATE_M}")
            })?;
        }
        let name = record
            .get(3)
            .filter(|name| !name.is_empty())
            .map_or_else(|| format!("probe_{:04}", probes.len()), str::to_owned);
        if name.contains(['/', '\\', '\0']) || name.starts_with('.') {
            anyhow::bail!("line {line}: `{name}` cannot be a file name");
        }
        if !names.insert(name.clone()) {
            anyhow::bail!("line {line}: duplicate name `{name}`");
        }
        probes.push(Probe { name, position_m: Vec3::from_array(xyz) });
    }
    Ok(probes)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn tables_with_and_without_header() {
        let probes = points_from_csv("x,y,z,name\n# a comment\n0, -0.5, -2, desk\n1,0,-1\n").unwrap();
        assert_eq!(probes.len(), 2);
        assert_eq!((probes[0].name.as_str(), probes[0].position_m), ("desk", Vec3::new(0.0, -0.5, -2.0)));
        assert_eq!(probes[1].name, "probe_0001");
    }

    #[test]
    fn bad_lines_are_named() {
        let message = |text: &str| points_from_csv(text).err().unwrap().to_string();
        assert_eq!(message("1,2\n"), "line 1: expected x,y,z and an optional name, got 2 cells");
        assert_eq!(message("0,0,0\n1,inf,2\n"), "line 2: y is `inf`, not a number within ± 10000");
        assert_eq!(message("0,0,0,../a\n"), "line 1: `../a` cannot be a file name");
        assert_eq!(message("0,0,0,a\n0,0,0,a\n"), "line 2: duplicate name `a`");
    }
}
