//! `lightoctree export SCENE`: for other programs.

use std::path::PathBuf;

use lightoctree::LightPurpose;
use lightoctree::export::{self, Content, Format, LightProbe, Options};
use lightoctree::geometry::Vec3;
use serde_json::json;

use super::environment::{self, Renderer};
use super::light::LightArgs;
use super::parse;
use crate::args::{Global, OutputArgs};
use crate::choice::{Choice, choice};
use crate::progress::Stages;
use crate::{output, report};

/// Options of `export`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree export room.scene --to glb -o room.glb\n  \
    lightoctree export room.scene --to usda --level -o room.usda\n  \
    lightoctree export room.scene --to usda --probe-at 0,-0.5,-2 -o room.usda\n\n\
    docs/blender.md goes from a photo to a picture rendered in Blender.")]
pub struct Args {
    /// A scene file
    scene: PathBuf,

    /// File format
    #[arg(long, value_name = "FORMAT", value_parser = choice(&FORMATS))]
    to: Format,

    /// Which part of the scene
    #[arg(long, value_name = "WHAT", default_value = "leaves", value_parser = choice(&CONTENTS))]
    content: Content,

    /// Also write the light at this point as a panorama beside it, NAME_probe.exr (usda: as the dome light). Repeat it for more points
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true)]
    probe_at: Vec<Vec3>,

    /// Stand the scene upright: gravity straight down, the floor at height 0, the photo's camera above the origin. Points of --probe-at stay in
    /// the camera's frame
    #[arg(long)]
    level: bool,

    #[command(flatten)]
    light: LightArgs,

    #[command(flatten)]
    out: OutputArgs,
}

/// File formats.
static FORMATS: [Choice<Format>; 3] = [
    ("ply", Format::Ply, "Point cloud: MeshLab, CloudCompare, Open3D, Blender"),
    ("glb", Format::Glb, "glTF binary: Blender, three.js, any viewer"),
    ("usda", Format::Usda, "USD: Houdini, Nuke, Omniverse, Blender"),
];

/// Parts of a scene.
static CONTENTS: [Choice<Content>; 2] = [
    (
        "leaves",
        Content::Leaves,
        "The octree's leaves: the whole room. glb: an emissive mesh, lamps, camera; usda: also the photo's surfaces, \
         textured, and the photo",
    ),
    ("photo", Content::PhotoPoints, "The photo's pixels with depth"),
];

/// Width of the probe; its height is half of it.
const PROBE_WIDTH: usize = 1024;
const COMMAND: &str = "export";

/// Reads and writes.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    output::check_replaceable(&args.out.output, COMMAND, args.out.force)?;
    let mut stages = Stages::new(global.quiet);
    let mut document = stages.stage("read scene", || super::read_scene(&args.scene))?;
    let scene = args.light.lit(&mut document, LightPurpose::Export, &mut stages)?;
    let renderer = Renderer::new(&scene, [PROBE_WIDTH, PROBE_WIDTH / 2])?;
    let mut panoramas = Vec::new();
    for &at in &args.probe_at {
        if let Some(odd) = environment::odd_place(&scene, at) {
            stages.note(&format!("--probe-at {},{},{} lies {odd}", at.x, at.y, at.z));
        }
        panoramas.push((stages.stage("probe", || renderer.at(at)), at));
    }
    let probes: Vec<LightProbe> =
        panoramas.iter().map(|(seen, at)| LightProbe { radiance: &seen.radiance, position_m: *at }).collect();
    let options = Options { format: args.to, content: args.content, level: args.level, probes: &probes };
    let written = stages.stage("write", || export::write(&scene, &options, &args.out.output))?;
    if args.out.json {
        return report::print_json(&json!({
            "files": written.files,
            "bytes": written.bytes,
            "points": written.points,
            "faces": written.faces,
            "lamps": written.lamps,
            "seconds": stages.timings(),
        }));
    }
    report::print(&format!(
        "{}  {}, {} points, {} faces, {} lamps",
        args.out.output.display(),
        report::bytes(written.bytes),
        written.points,
        written.faces,
        written.lamps
    ));
    written.files.iter().skip(1).for_each(|path| report::print(&path.display().to_string()));
    Ok(())
}
