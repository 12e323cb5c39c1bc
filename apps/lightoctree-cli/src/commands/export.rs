//! `lightoctree export SCENE`: converts a scene for other programs.

use std::path::PathBuf;

use lightoctree::{Document, LightPurpose};
use lo_export as export;
use lo_export::{Content, Format, LightProbe, Options};
use lo_geometry::Vec3;
use lo_lights::ListedLight;
use serde_json::json;

use super::environment::{self, PanoramaRenderer};
use super::light::LightArgs;
use super::parse;
use crate::args::{Global, OutputArgs};
use crate::choice::{Choice, choice};
use crate::progress::Stages;
use crate::usage::Usage;
use crate::{output, report};

/// Options of `export`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree export room.scene --to glb -o room.glb\n  \
    lightoctree export room.scene --to usda --level -o room.usda\n  \
    lightoctree export room.scene --to usda --probe-at 0,-0.5,-2 -o room.usda\n  \
    lightoctree export room.scene --to web -o room\n\n\
    docs/blender.md shows the way from a photo to an image rendered in Blender.")]
#[command(mut_arg("output", |output| output.help("File to write, with --to web the folder")))]
pub struct Args {
    /// Scene file
    scene: PathBuf,

    /// File format
    #[arg(long, value_name = "FORMAT", value_parser = choice(&TARGETS))]
    to: Target,

    /// Part of the scene to export
    #[arg(long, value_name = "WHAT", default_value = "leaves", value_parser = choice(&CONTENTS))]
    content: Content,

    /// Also write the environment map at this point, in metres, as NAME_probe.exr (usda: as the dome light); may be
    /// repeated
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true)]
    probe_at: Vec<Vec3>,

    /// Rotate the scene upright: gravity points straight down, the floor is at height 0, the camera is above the origin
    ///
    /// Points of --probe-at remain in the camera's frame.
    #[arg(long)]
    level: bool,

    #[command(flatten)]
    light: LightArgs,

    #[command(flatten)]
    out: OutputArgs,
}

/// A file of a format, or a web page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Target {
    File(Format),
    Web,
}

/// Targets of a conversion.
static TARGETS: [Choice<Target>; 5] = [
    ("ply", Target::File(Format::Ply), "Point cloud: MeshLab, CloudCompare, Open3D, Blender"),
    ("glb", Target::File(Format::Glb), "glTF binary: Blender, three.js, any viewer"),
    ("usda", Target::File(Format::Usda), "USD: Houdini, Nuke, Omniverse, Blender"),
    ("usdz", Target::File(Format::Usdz), "USD package: AR Quick Look on iPhone and iPad"),
    ("web", Target::Web, "Folder with a web page that shows objects in the photo, for any browser"),
];

/// Parts of a scene.
static CONTENTS: [Choice<Content>; 2] = [
    (
        "leaves",
        Content::Leaves,
        "Leaves of the octree: the whole room. glb: an emissive mesh, lamps and camera; usda: also the observed surfaces \
         with their texture, and the photo",
    ),
    ("photo", Content::PhotoPoints, "Points of the photo's pixels with depth"),
];

/// Width of a probe in pixels; the height is half of it.
pub const PROBE_WIDTH: usize = 1024;
const COMMAND: &str = "export";
/// The page in the folder of `--to web`.
const PAGE: &str = "index.html";

/// Reads the scene and writes the files.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    match args.to {
        Target::File(format) => write_file(global, args, format),
        Target::Web => write_page(global, args),
    }
}

/// Writes the scene as a web page.
fn write_page(global: &Global, args: &Args) -> anyhow::Result<()> {
    let only_files = [
        (args.content != Content::Leaves, "--content"),
        (!args.probe_at.is_empty(), "--probe-at"),
        (args.level, "--level"),
    ];
    if let Some((_, option)) = only_files.iter().find(|(given, _)| *given) {
        return Err(Usage(format!("{option} has no effect with --to web")).into());
    }
    let folder = &args.out.output;
    output::check_folder(folder, PAGE, COMMAND, args.out.force)?;
    let mut stages = Stages::new(global.quiet);
    let mut document = stages.stage("read scene", || Document::read(&args.scene))?;
    let scene = args.light.lit(&mut document, LightPurpose::Export, &mut stages)?;
    let title = args.scene.file_stem().unwrap_or_default().to_string_lossy();
    let written = lightoctree::export_web(&scene, &title, folder, &mut |event| stages.handle(event))?;
    if args.out.json {
        return report::print_json(&json!({
            "files": written.files,
            "bytes": written.bytes,
            "probes": written.probes,
            "triangles": written.triangles,
            "seconds": stages.timings(),
        }));
    }
    let size = report::bytes(written.bytes);
    report::print(&format!(
        "{}  {size} in {}, {}, {}",
        folder.join(PAGE).display(),
        report::counted(written.files.len(), "file"),
        report::counted(written.probes, "probe"),
        report::counted(written.triangles, "triangle")
    ));
    Ok(())
}

/// Writes the scene as a file, and those beside it.
fn write_file(global: &Global, args: &Args, format: Format) -> anyhow::Result<()> {
    let extensions: &[&str] = match format {
        Format::Ply => &["ply"],
        Format::Glb => &["glb"],
        Format::Usda => &["usda", "usd"],
        Format::Usdz => &["usdz"],
    };
    if format == Format::Usdz && !args.probe_at.is_empty() {
        return Err(Usage("--probe-at has no effect with --to usdz".into()).into());
    }
    output::check_outputs(&[(&args.out.output, extensions)], COMMAND, args.out.force)?;
    let mut stages = Stages::new(global.quiet);
    let mut document = stages.stage("read scene", || Document::read(&args.scene))?;
    let scene = args.light.lit(&mut document, LightPurpose::Export, &mut stages)?;
    let lights = if format.has_lamps() { document.lights() } else { Vec::new() };
    let renderer = PanoramaRenderer::new(&scene, [PROBE_WIDTH, PROBE_WIDTH / 2])?;
    let mut panoramas = Vec::new();
    for &at in &args.probe_at {
        if let Some(position) = environment::unusual_position(&scene, at) {
            stages.note(&format!("--probe-at {},{},{} is {position}", at.x, at.y, at.z));
        }
        panoramas.push((stages.stage("probe", || renderer.at(at)), at));
    }
    let probes: Vec<LightProbe> =
        panoramas.iter().map(|(panorama, at)| LightProbe { radiance: &panorama.radiance, position_m: *at }).collect();
    let options = Options { format, content: args.content, level: args.level, probes: &probes, lights: &lights };
    let written = stages.stage("write", || export::write(&scene, &options, &args.out.output))?;
    if args.out.json {
        return report::print_json(&json!({
            "files": written.files,
            "bytes": written.bytes,
            "points": written.points,
            "faces": written.faces,
            "lamps": written.lamps,
            "lights": written
                .lamps_of_light
                .iter()
                .map(|(id, lamps)| json!({ "id": id, "lamps": lamps }))
                .collect::<Vec<_>>(),
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
    if !lights.is_empty() {
        report::print(&lights_text(&lights, &written.lamps_of_light));
    }
    written.files.iter().skip(1).for_each(|path| report::print(&path.display().to_string()));
    Ok(())
}

/// Formats how each light of `lights` is exported.
fn lights_text(lights: &[ListedLight], lamps: &[(String, usize)]) -> String {
    let of_light = |(light, (id, lamps)): (&ListedLight, &(String, usize))| match lamps {
        0 if light.change.is_some_and(|change| !change.on || change.scale == 0.0) => format!("{id} (off)"),
        0 => format!("{id} (faces of the mesh)"),
        1 => format!("{id} (lamp)"),
        lamps => format!("{id} ({lamps} lamps)"),
    };
    let texts: Vec<String> = lights.iter().zip(lamps).map(of_light).collect();
    format!("lights: {}", texts.join(", "))
}
