//! `lightoctree insert SCENE`: a virtual object in the photo.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::ValueEnum;
use lightoctree::Event;
use lightoctree::geometry::Vec3;
use lightoctree::imaging::{self, ChannelGroup, ExrOptions, Image, RadianceImage};
use lightoctree::insert::{self, Align, Base, Composite, InsertError, Inserter, Lighting, Placement, Quality, Stance};
use lightoctree::mesh::{LoadOptions, Material, MaterialSpec, Model, PreparedModel};
use lightoctree::scene::Scene;
use serde_json::json;

use super::parse;
use super::video::{self, Video};
use crate::args::Global;
use crate::progress::{Stages, bar, seconds};
use crate::usage::Usage;
use crate::{interrupt, output, report};

/// Options of `insert`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree insert room.scene --mesh tea_set.gltf --pixel 1100,1150 -o composite.png\n  \
    lightoctree insert room.scene --mesh bunny.ply --height 0.3 --material gold --pixel 900,1200 --quality high -o gold.png\n  \
    lightoctree insert room.scene --mesh car.glb --path path.json --frames 48 -o frames/car_%04d.png\n  \
    lightoctree insert room.scene --mesh car.glb --path path.json --frames 48 -o - | ffmpeg -i - \
    -colorspace bt709 -color_trc iec61966-2-1 -color_primaries bt709 -pix_fmt yuv420p car.mp4\n\n\
    --material NAME|JSON: a name of --list-materials, or an object such as\n  \
    '{\"base_color_texture\":\"cow.png\",\"roughness\":0.4}'")]
#[command(group(clap::ArgGroup::new("place").args(["at", "pixel", "path"])))]
pub struct Args {
    /// A scene file
    #[arg(required_unless_present = "list_materials")]
    scene: Option<PathBuf>,

    /// The object: glTF, GLB, OBJ, PLY or STL
    #[arg(long, value_name = "FILE", required_unless_present = "list_materials")]
    mesh: Option<PathBuf>,

    /// Where the middle of its base stands, in metres
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true)]
    at: Option<Vec3>,

    /// Rest it on the surface seen at this pixel of the photo, upright (see --align)
    #[arg(long, value_name = "U,V", value_parser = parse::pixel)]
    pixel: Option<[f64; 2]>,

    /// Metres per unit of the mesh
    #[arg(long, value_name = "S", value_parser = parse::positive, conflicts_with = "height", default_value_t = 1.0)]
    scale: f64,

    /// Height of the object in metres, instead of a scale
    #[arg(long, value_name = "METRES", value_parser = parse::positive)]
    height: Option<f64>,

    /// Turn about the vertical, counter-clockwise seen from above
    #[arg(long, value_name = "A", default_value_t = 0.0, allow_hyphen_values = true)]
    yaw_deg: f32,

    /// Which way is up for the object
    #[arg(long, value_name = "UP", default_value = "gravity")]
    align: AlignArg,

    /// A material for the whole object: a name or a JSON object
    #[arg(long, value_name = "NAME|JSON")]
    material: Option<String>,

    /// Print the names of the materials and stop
    #[arg(long)]
    list_materials: bool,

    /// Move the object along keyframes; needs --frames, and a %04d in the output's name or a video
    #[arg(long, value_name = "FILE.json", requires = "frames")]
    path: Option<PathBuf>,

    /// Number of frames along the path
    #[arg(long, value_name = "N", requires = "path", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,

    /// Frames per second of a video
    #[arg(long, value_name = "N", requires = "path", default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..=1000))]
    fps: u32,

    /// What lights the object: `octree`, or `envmap:FILE` (an equirectangular .exr, .hdr or .pfm in our orientation)
    #[arg(long, value_name = "octree|envmap:FILE", default_value = "octree")]
    lighting: String,

    /// Light from the scene as it is, without the lamp above that is added where seen surfaces give more light than they get
    #[arg(long)]
    no_lamp: bool,

    /// How polished the floor or table under the object is: above 0 it mirrors the object as a clear coat of roughness 1 - G does
    #[arg(long, value_name = "G", value_parser = parse::share, default_value_t = 0.0)]
    floor_gloss: f64,

    /// Samples: draft for moving about, high for the final picture
    #[arg(long, value_name = "QUALITY", default_value = "normal")]
    quality: QualityArg,

    /// Seconds after which a picture of high quality is given up and one of normal quality written, as after a Ctrl-C
    #[arg(long, value_name = "S", value_parser = parse::positive, conflicts_with = "path")]
    time_limit: Option<f64>,

    /// Also write object, alpha, shadow ratio and occlusion as layers of an EXR (with %04d for a sequence)
    #[arg(long, value_name = "FILE.exr")]
    layers: Option<PathBuf>,

    /// The composite to write: .png, .jpg, or .exr, .hdr, .pfm for linear photos; of a sequence also .y4m, or `-` for such a
    /// video (YUV4MPEG2, 4:4:4, BT.709) on standard output
    #[arg(long, short, value_name = "FILE", required_unless_present = "list_materials")]
    output: Option<PathBuf>,

    /// Replace existing files, whatever they are
    #[arg(long)]
    force: bool,

    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// Quality presets.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum QualityArg {
    Draft,
    Normal,
    High,
}

/// Which way an object stands.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum AlignArg {
    /// Upright in the room, as far as it is known which way is up
    Gravity,
    /// Along the normal of the surface at the pixel, where that is tilted by 10 to 40°
    Surface,
    /// Up in the picture
    None,
}

impl AlignArg {
    fn align(self) -> Align {
        match self {
            Self::Gravity => Align::Gravity,
            Self::Surface => Align::Surface,
            Self::None => Align::None,
        }
    }
}

const COMMAND: &str = "insert";

/// Loads, renders, writes.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    if args.list_materials {
        Material::preset_names().for_each(report::print);
        return Ok(());
    }
    let (Some(scene), Some(mesh), Some(output)) = (&args.scene, &args.mesh, &args.output) else {
        return Err(Usage("a scene, --mesh and --output are needed".into()).into());
    };
    let mut stages = Stages::new(global.quiet);
    let mut scene = stages.stage("read scene", || super::read_scene(scene))?;
    let model = stages.stage("read mesh", || load_model(mesh, args.material.as_deref()))?;
    model.model().warnings.iter().for_each(|warning| stages.note(&warning.to_string()));
    let scale = scale(args, &model)?;
    let placements = placements(args, &scene, &model, scale)?;
    let files = output_files(args, output, placements.len())?;
    let lighting = lighting(&args.lighting)?;
    if args.time_limit.is_some() && !matches!(args.quality, QualityArg::High) {
        return Err(
            Usage("--time-limit: only a picture of --quality high can be given up for a lesser one".into()).into()
        );
    }
    let quality = match args.quality {
        QualityArg::Draft => Quality::Draft,
        QualityArg::Normal => Quality::Normal,
        QualityArg::High => Quality::High,
    };
    // Where light differs by direction, that which comes to the object counts.
    if let (Cow::Owned(seen), Lighting::Octree) = (scene.light.seen_from(placements[0].position_m), &lighting) {
        scene.light = seen;
    }
    if matches!(lighting, Lighting::Octree) {
        super::light_up(&mut scene, !args.no_lamp, &mut stages)?;
    }
    let floor_gloss = args.floor_gloss as f32;
    // What a high picture is replaced by when it is not waited for.
    let mut lesser = None;
    if quality == Quality::High && files.len() == 1 {
        lesser = stages.stage("picture of normal quality", || {
            let inserter = Inserter::new(&scene, lighting.clone(), Quality::Normal)?.with_floor_gloss(floor_gloss);
            let mut warnings = Vec::new();
            let hear = &mut |event| {
                if let Event::Warning(warning) = event {
                    warnings.push(warning);
                }
                interrupt::go_on()
            };
            match inserter.render(&model, &placements[0], hear) {
                Err(InsertError::Cancelled(_)) => Ok(None),
                composite => composite.map(|composite| Some((kept(composite, args.layers.is_some()), warnings))),
            }
        })?;
    }
    let inserter =
        stages.stage("prepare light", || Inserter::new(&scene, lighting, quality))?.with_floor_gloss(floor_gloss);
    let progress = bar(global.quiet || files.len() == 1, files.len(), "frames");
    let size = (scene.frame.photo.width(), scene.frame.photo.height());
    let mut video = Video::is_asked(output).then(|| Video::create(output, size, args.fps)).transpose()?;
    let (mut written, mut frames) = (Vec::new(), 0);
    for (placement, (file, layers)) in placements.iter().zip(&files) {
        let first = frames == 0;
        let hear = &mut |event| match event {
            _ if args.time_limit.is_some_and(|limit| stages.total().as_secs_f64() > limit) => ControlFlow::Break(()),
            _ if files.len() == 1 => stages.hear(event),
            // Frames are all alike.
            Event::Warning(warning) if first => stages.hear(Event::Warning(warning)),
            _ => interrupt::go_on(),
        };
        let composite = match inserter.render(&model, placement, hear) {
            Err(InsertError::Cancelled(_)) => {
                let Some((lesser, warnings)) = lesser.take() else { break };
                stages.clear_bar();
                warnings.iter().for_each(|warning| stages.warn(warning));
                stages.note("not waited for: this picture is of normal quality");
                lesser
            }
            composite => composite?,
        };
        match &mut video {
            Some(video) => video.add(&composite.image)?,
            None => {
                imaging::write_photo(file, &composite.image, &output::signature(COMMAND))?;
                written.push(file.clone());
            }
        }
        if let Some(layers) = layers {
            write_layers(layers, &composite)?;
            written.push(layers.clone());
        }
        frames += 1;
        progress.inc(1);
    }
    progress.finish_and_clear();
    if let Some(video) = video {
        video.finish()?;
        written.push(output.clone());
    }
    if !video::is_stdout(output) {
        say(args, &written, &placements, &stages)?;
    }
    if frames < files.len() {
        anyhow::bail!("stopped after {frames} of {} frames; the written ones are whole", files.len());
    }
    Ok(())
}

fn say(args: &Args, written: &[PathBuf], placements: &[Placement], stages: &Stages) -> anyhow::Result<()> {
    if args.json {
        let positions: Vec<[f32; 3]> = placements.iter().map(|placement| placement.position_m.to_array()).collect();
        return report::print_json(&json!({ "files": written, "positions_m": positions, "seconds": stages.timings() }));
    }
    match written {
        [] => {}
        [one] => report::print(&one.display().to_string()),
        [first, .., last] => report::print(&format!(
            "{} … {}  {} files in {}",
            first.display(),
            last.display(),
            written.len(),
            seconds(stages.total())
        )),
    }
    Ok(())
}

/// A picture that waits, in large photos for minutes: without its layers, where nobody asked for them.
fn kept(composite: Composite, with_layers: bool) -> Composite {
    if with_layers {
        return composite;
    }
    let (nothing, none) = (RadianceImage::new(1, 1, vec![[0.0; 3]]), Image::new(1, 1, vec![0.0]));
    Composite {
        object: nothing.clone(),
        alpha: none.clone(),
        shadow_ratio: nothing,
        reflection: None,
        occlusion: none,
        image: composite.image,
    }
}

/// Reads a mesh and gives it the material, if one is wanted.
fn load_model(path: &Path, material: Option<&str>) -> anyhow::Result<PreparedModel> {
    let material =
        material.map(MaterialSpec::parse).transpose().map_err(|error| Usage(format!("--material: {error}")))?;
    let mut model = Model::load(path, &LoadOptions::default())?;
    if let Some(material) = material {
        model.override_material(&material, Path::new(".")).context("--material")?;
    }
    Ok(PreparedModel::new(model))
}

fn scale(args: &Args, model: &PreparedModel) -> anyhow::Result<f32> {
    let Some(height_m) = args.height else {
        return Ok(args.scale as f32);
    };
    let height = model.bounds().size().y;
    if height > 0.0 {
        Ok(height_m as f32 / height)
    } else {
        Err(Usage("--height: the mesh is flat and has no height; give --scale".into()).into())
    }
}

fn placements(args: &Args, scene: &Scene, model: &PreparedModel, scale: f32) -> anyhow::Result<Vec<Placement>> {
    let (base, align, yaw_rad) = (Base::new(model), args.align.align(), args.yaw_deg.to_radians());
    if let (Some(path), Some(frames)) = (&args.path, args.frames) {
        let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        let path_of_object = insert::Path::from_json(&text).with_context(|| format!("{}", path.display()))?;
        let stance = Stance { scale, align, base: Some(&base) };
        return Ok(path_of_object.placements(scene, &stance, frames as usize)?);
    }
    let placement = match (args.at, args.pixel) {
        (Some(at), _) => Placement::at(scene, at, align).scaled(scale).turned(yaw_rad),
        (None, Some([u, v])) => {
            Placement::rest_on_pixel(scene, u, v, align)?.scaled(scale).turned(yaw_rad).settled(scene, &base)
        }
        (None, None) => {
            return Err(Usage("say where: --at X,Y,Z, --pixel U,V, or --path FILE.json with --frames N".into()).into());
        }
    };
    Ok(vec![placement])
}

/// Names of the composite and of the layers of each frame, checked before any work is done.
fn output_files(args: &Args, output: &Path, frames: usize) -> anyhow::Result<Vec<(PathBuf, Option<PathBuf>)>> {
    let sequence = args.path.is_some();
    let video = Video::is_asked(output);
    if video && !sequence {
        return Err(Usage(format!("--output {}: a video needs --path and --frames", output.display())).into());
    }
    if video::is_stdout(output) && args.json {
        return Err(Usage("--json and a video cannot both go to standard output".into()).into());
    }
    (0..frames)
        .map(|frame| {
            let file = frame_name(output, "--output", sequence && !video, frame)?;
            let layers =
                args.layers.as_deref().map(|layers| frame_name(layers, "--layers", sequence, frame)).transpose()?;
            if !video::is_stdout(&file) {
                output::check_replaceable(&file, COMMAND, args.force)?;
            }
            if let Some(layers) = &layers {
                output::check_replaceable(layers, COMMAND, args.force)?;
            }
            Ok((file, layers))
        })
        .collect()
}

/// Puts the frame's number, from 0, in the place of `%d` or `%0Nd`.
fn frame_name(pattern: &Path, option: &str, sequence: bool, frame: usize) -> anyhow::Result<PathBuf> {
    let text = pattern.to_str().ok_or_else(|| Usage(format!("{option}: the name is not valid Unicode")))?;
    if !sequence {
        return Ok(pattern.to_owned());
    }
    let wrong = || Usage(format!("{option} {text}: a sequence needs one %d or %04d in the name"));
    let (before, rest) = text.split_once('%').ok_or_else(wrong)?;
    let (digits, after) = rest.split_once('d').ok_or_else(wrong)?;
    if after.contains('%') || !(digits.is_empty() || (digits.starts_with('0') && digits.len() == 2)) {
        return Err(wrong().into());
    }
    let width = digits.parse::<usize>().unwrap_or(0);
    Ok(PathBuf::from(format!("{before}{frame:0width$}{after}")))
}

fn lighting(text: &str) -> anyhow::Result<Lighting> {
    if text == "octree" {
        return Ok(Lighting::Octree);
    }
    let Some(path) = text.strip_prefix("envmap:") else {
        return Err(Usage(format!("--lighting {text}: must be `octree` or `envmap:FILE`")).into());
    };
    let map = imaging::read_radiance(path)?;
    if map.width() != 2 * map.height() {
        return Err(Usage(format!(
            "{path} is {} × {}: an equirectangular map is twice as wide as high",
            map.width(),
            map.height()
        ))
        .into());
    }
    Ok(Lighting::EnvironmentMap(map))
}

fn write_layers(path: &Path, composite: &Composite) -> anyhow::Result<()> {
    let groups = [
        ChannelGroup::rgb("object", &composite.object),
        ChannelGroup::single("object", "A", &composite.alpha),
        ChannelGroup::rgb("shadow_ratio", &composite.shadow_ratio),
        ChannelGroup::single("occlusion", "A", &composite.occlusion),
    ];
    let reflection = composite.reflection.as_ref().map(|reflection| ChannelGroup::rgb("reflection", reflection));
    let groups: Vec<_> = groups.into_iter().chain(reflection).collect();
    let size = (composite.alpha.width(), composite.alpha.height());
    let options = ExrOptions { generator: output::signature(COMMAND), ..ExrOptions::default() };
    Ok(imaging::write_exr(path, size, &groups, &options)?)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn frames_are_numbered_as_the_pattern_says() {
        let name = |pattern: &str, frame| {
            frame_name(Path::new(pattern), "-o", true, frame).map(|path| path.display().to_string())
        };
        assert_eq!(name("out/a_%04d.png", 7).unwrap(), "out/a_0007.png");
        assert_eq!(name("%d.png", 12).unwrap(), "12.png");
        for bad in ["a.png", "%4d.png", "%0x.png", "%04d_%04d.png", "%012d.png"] {
            assert!(name(bad, 0).unwrap_err().is::<Usage>(), "{bad}");
        }
        assert_eq!(frame_name(Path::new("50%.png"), "-o", false, 0).unwrap(), Path::new("50%.png"));
    }

    #[test]
    fn lighting_is_octree_or_a_map() {
        assert!(matches!(lighting("octree"), Ok(Lighting::Octree)));
        assert!(lighting("sun").err().unwrap().is::<Usage>());
        assert!(lighting("envmap:no/such.exr").is_err());
    }
}
