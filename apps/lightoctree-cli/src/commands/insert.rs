//! `lightoctree insert SCENE`: virtual objects in the photo.

mod objects;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use lightoctree::geometry::{Orientation, Vec3};
use lightoctree::imaging::{self, ExrOptions, Image, RadianceImage};
use lightoctree::insert::{Composite, InsertError, Inserter, Instance, Layout, Lighting, Placement, Quality};
use lightoctree::mesh::Material;
use lightoctree::scene::ObjectsShown;
use lightoctree::{Event, LightPurpose, LitScene, Models, Warning};
use serde_json::json;

use self::objects::ObjectArgs;
use super::environment::ORIENTATIONS;
use super::light::LightArgs;
use super::parse;
use super::video::{self, Video};
use crate::args::Global;
use crate::choice::{Choice, choice};
use crate::progress::{Stages, bar, seconds};
use crate::usage::Usage;
use crate::{interrupt, output, report};

/// Options of `insert`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree insert room.scene --mesh tea_set.gltf --pixel 1100,1150 -o composite.png\n  \
    lightoctree insert room.scene --mesh bunny.ply --height 0.3 --material gold --pixel 900,1200 --quality high -o gold.png\n  \
    lightoctree insert room.scene --mesh bunny.ply --pixel 900,1200 --height 0.3 --mesh tea_set.gltf --pixel 1100,1150 -o two.png\n  \
    lightoctree insert room.scene --layout objects.json -o several.png\n  \
    lightoctree insert room.scene -o as_saved.png\n  \
    lightoctree insert room.scene --mesh car.glb --path path.json --frames 48 -o frames/car_%04d.png\n  \
    lightoctree insert room.scene --mesh car.glb --path path.json --frames 48 -o - | ffmpeg -i - \
    -colorspace bt709 -color_trc iec61966-2-1 -color_primaries bt709 -pix_fmt yuv420p car.mp4\n\n\
    --material NAME|JSON: a name of --list-materials, or an object such as\n  \
    '{\"base_color_texture\":\"cow.png\",\"roughness\":0.4}'")]
pub struct Args {
    /// A scene file
    #[arg(required_unless_present = "list_materials")]
    scene: Option<PathBuf>,

    /// The objects.
    #[command(flatten)]
    objects: ObjectArgs,

    /// Print the names of the materials and stop
    #[arg(long)]
    list_materials: bool,

    /// Number of frames along the paths
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,

    /// Frames per second of a video [default: 24, or the scene's own with its own objects]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    fps: Option<u32>,

    /// What lights the objects: `octree`, or `envmap:FILE` (an equirectangular .exr, .hdr or .pfm)
    #[arg(long, value_name = "octree|envmap:FILE", default_value = "octree")]
    lighting: String,

    /// Which program's convention the map of --lighting envmap:FILE follows [default: lightoctree]
    #[arg(long, value_name = "NAME", value_parser = choice(&ORIENTATIONS))]
    orientation: Option<Orientation>,

    #[command(flatten)]
    light: LightArgs,

    /// Keep reflections smooth where nothing was seen, instead of continuing the photo's texture
    #[arg(long)]
    no_detail: bool,

    /// How polished the floor or table under an object is: above 0 it mirrors the objects as a clear coat of roughness 1 - G does [default: 0, or the scene's own with its own
    /// objects]
    #[arg(long, value_name = "G", value_parser = parse::share)]
    floor_gloss: Option<f64>,

    /// Samples: draft for moving about, high for the final picture
    #[arg(long, value_name = "QUALITY", default_value = "normal", value_parser = choice(&QUALITIES))]
    quality: Quality,

    /// Seconds after which a picture of high quality is given up and one of normal quality written, as after a Ctrl-C
    #[arg(long, value_name = "S", value_parser = parse::positive, conflicts_with = "frames")]
    time_limit: Option<f64>,

    /// Also write objects, alpha, shadow ratio and occlusion as layers of an EXR (with %04d for a sequence)
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
static QUALITIES: [Choice<Quality>; 3] = [
    ("draft", Quality::Draft, "For moving objects: some frames a second"),
    ("normal", Quality::Normal, "Some seconds"),
    ("high", Quality::High, "Final images: up to minutes for large photos"),
];

const COMMAND: &str = "insert";

/// Loads, renders, writes.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    if args.list_materials {
        Material::preset_names().for_each(report::print);
        return Ok(());
    }
    let (Some(scene), Some(output)) = (&args.scene, &args.output) else {
        return Err(Usage("a scene and --output are needed".into()).into());
    };
    let given = args.objects.layout()?;
    // Without objects on the command line those of the scene are meant.
    let mut own = None;
    let (layout, folder) = match given {
        Some((layout, folder)) => (layout, Some(folder)),
        None => {
            let read = super::read_scene(scene)?;
            let nothing = || {
                Usage(format!("say what to insert: --mesh or --layout; nothing stands in {} itself", scene.display()))
            };
            let layout = read.layout.clone().ok_or_else(nothing)?;
            own = Some(read);
            (layout, None)
        }
    };
    let shown = own.as_ref().map(|document| document.shown).unwrap_or_default();
    let frames = frames(args, &layout, own.as_ref().map(|_| shown))?;
    let files = output_files(args, output, frames, layout.moves())?;
    let lighting = lighting(&args.lighting, args.orientation)?;
    let names: Vec<String> = layout.objects().iter().map(|object| object.name().to_owned()).collect();
    let mut stages = Stages::new(global.quiet);
    stages.name_objects(&names);
    let mut document = match own {
        Some(document) => document,
        None => stages.stage("read scene", || super::read_scene(scene))?,
    };
    let meshes = if names.len() > 1 { "read meshes" } else { "read mesh" };
    let models = stages.stage(meshes, || match &folder {
        Some(folder) => Models::load(&layout, folder),
        None => document.models(&layout),
    })?;
    models.warnings().for_each(|warning| stages.note(&warning.to_string()));
    let models = models.of_objects();
    let placements =
        layout.placements(&*document.estimate, &models, files.len()).map_err(|error| of_object(error, &names))?;
    let instances = |frame: usize| -> Vec<Instance> {
        models.iter().zip(&placements).map(|(model, places)| Instance::new(model, places[frame])).collect()
    };
    if args.time_limit.is_some() && args.quality != Quality::High {
        return Err(
            Usage("--time-limit: only a picture of --quality high can be given up for a lesser one".into()).into()
        );
    }
    let quality = args.quality;
    let middle = placements.iter().map(|places| places[0].position_m).sum::<Vec3>() / placements.len() as f32;
    let scene = match lighting {
        Lighting::Octree => args.light.lit(&mut document, LightPurpose::Objects { at_m: middle }, &mut stages)?,
        Lighting::EnvironmentMap(_) => LitScene::as_estimated(document.estimate),
    };
    let floor_gloss = args.floor_gloss.map_or(shown.floor_gloss, |gloss| gloss as f32);
    let inserter = |scene: &LitScene, lighting: Lighting, quality: Quality| -> Result<Inserter, InsertError> {
        let inserter = Inserter::new(scene, lighting, quality)?.with_floor_gloss(floor_gloss);
        Ok(if args.no_detail { inserter.without_detail() } else { inserter })
    };
    // What a high picture is replaced by when it is not waited for.
    let mut lesser = None;
    if quality == Quality::High && files.len() == 1 {
        lesser = stages
            .stage("picture of normal quality", || {
                let inserter = inserter(&scene, lighting.clone(), Quality::Normal)?;
                let mut warnings = Vec::new();
                let hear = &mut |event| {
                    if let Event::Warning(warning) = event {
                        warnings.push(warning);
                    }
                    interrupt::control_flow()
                };
                match inserter.render(&instances(0), hear) {
                    Err(InsertError::Cancelled(_)) => Ok(None),
                    composite => composite.map(|composite| Some((kept(composite, args.layers.is_some()), warnings))),
                }
            })
            .map_err(|error: InsertError| of_object(error, &names))?;
    }
    let inserter = stages.stage("prepare light", || inserter(&scene, lighting, quality))?;
    let progress = bar(global.quiet || files.len() == 1, files.len(), "frames");
    let size = (scene.frame.photo.width(), scene.frame.photo.height());
    let mut video =
        Video::is_asked(output).then(|| Video::create(output, size, args.fps.unwrap_or(shown.fps))).transpose()?;
    let (mut written, mut frames) = (Vec::new(), 0);
    // What is the same in all frames is said once.
    let mut met = Vec::new();
    for (file, layers) in &files {
        let first = frames == 0;
        let hear = &mut |event| match event {
            _ if args.time_limit.is_some_and(|limit| stages.total().as_secs_f64() > limit) => ControlFlow::Break(()),
            _ if files.len() == 1 => stages.handle(event),
            Event::Warning(warning @ Warning::ObjectsIntersect { objects }) if !met.contains(&objects) => {
                met.push(objects);
                stages.handle(Event::Warning(warning))
            }
            Event::Warning(warning) if first => stages.handle(Event::Warning(warning)),
            _ => interrupt::control_flow(),
        };
        let composite = match inserter.render(&instances(frames), hear) {
            Err(InsertError::Cancelled(_)) => {
                let Some((lesser, warnings)) = lesser.take() else { break };
                stages.clear_bar();
                warnings.iter().for_each(|warning| stages.warn(warning));
                stages.note("not waited for: this picture is of normal quality");
                lesser
            }
            composite => composite.map_err(|error| of_object(error, &names))?,
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
        say(args, &written, &layout, &placements, &stages)?;
    }
    if frames < files.len() {
        anyhow::bail!("stopped after {frames} of {} frames; the written ones are whole", files.len());
    }
    Ok(())
}

fn say(
    args: &Args,
    written: &[PathBuf],
    layout: &Layout,
    placements: &[Vec<Placement>],
    stages: &Stages,
) -> anyhow::Result<()> {
    if args.json {
        let objects: Vec<_> = layout
            .objects()
            .iter()
            .zip(placements)
            .map(|(object, places)| {
                let positions: Vec<[f32; 3]> = places.iter().map(|place| place.position_m.to_array()).collect();
                let yaws: Vec<f32> = places.iter().map(|place| place.yaw_rad.to_degrees()).collect();
                json!({
                    "name": object.name(),
                    "mesh": object.mesh,
                    "scale": places.first().map(|place| place.scale),
                    "positions_m": positions,
                    "yaws_deg": yaws,
                })
            })
            .collect();
        return report::print_json(&json!({ "files": written, "objects": objects, "seconds": stages.timings() }));
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

/// Number of pictures.
fn frames(args: &Args, layout: &Layout, own: Option<ObjectsShown>) -> anyhow::Result<usize> {
    // A scene's own objects bring theirs.
    let own = own.zip(layout.span_s()?).map(|(shown, span_s)| shown.frames_between(span_s));
    match (args.frames.or(own), layout.objects().iter().find(|object| object.path.is_some())) {
        (Some(frames), Some(_)) => Ok(frames as usize),
        (None, None) => Ok(1),
        (None, Some(moving)) => {
            Err(Usage(format!("{} moves along a path: --frames N says in how many pictures", moving.name())).into())
        }
        (Some(_), None) => Err(Usage("--frames: nothing moves; give --path FILE.json".into()).into()),
    }
}

/// An error with the name of the object, where there are several.
fn of_object(error: InsertError, names: &[String]) -> anyhow::Error {
    match error {
        InsertError::Object { source, .. } if names.len() == 1 => (*source).into(),
        InsertError::Object { object, source } => anyhow::Error::from(*source).context(names[object].clone()),
        error => error.into(),
    }
}

/// Names of the composite and of the layers of each frame, checked before any work is done.
fn output_files(
    args: &Args,
    output: &Path,
    frames: usize,
    sequence: bool,
) -> anyhow::Result<Vec<(PathBuf, Option<PathBuf>)>> {
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

fn lighting(text: &str, orientation: Option<Orientation>) -> anyhow::Result<Lighting> {
    if text == "octree" {
        return match orientation {
            None => Ok(Lighting::Octree),
            Some(_) => {
                Err(Usage("--orientation: it tells how the map of --lighting envmap:FILE is held".into()).into())
            }
        };
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
    let from = orientation.unwrap_or(Orientation::Lightoctree);
    Ok(Lighting::EnvironmentMap(imaging::reorient(&map, from, Orientation::Lightoctree)))
}

fn write_layers(path: &Path, composite: &Composite) -> anyhow::Result<()> {
    let size = (composite.alpha.width(), composite.alpha.height());
    let options = ExrOptions { generator: output::signature(COMMAND), ..ExrOptions::default() };
    Ok(imaging::write_exr(path, size, &composite.channels(), &options)?)
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
        assert!(matches!(lighting("octree", None), Ok(Lighting::Octree)));
        assert!(lighting("octree", Some(Orientation::Blender)).err().unwrap().is::<Usage>());
        assert!(lighting("sun", None).err().unwrap().is::<Usage>());
        assert!(lighting("envmap:no/such.exr", None).is_err());
    }

    #[test]
    fn maps_of_other_programs_are_turned() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("map.hdr");
        // One bright column where the other program has what lies to our right (+X).
        for (orientation, column) in [
            (Orientation::Lightoctree, 12),
            (Orientation::Openexr, 4),
            (Orientation::Threejs, 8),
            (Orientation::Blender, 8),
        ] {
            let map = RadianceImage::from_fn(16, 8, |x, _| [if x == column { 8.0 } else { 0.25 }; 3]);
            imaging::write_radiance(&file, &map, &ExrOptions::default()).unwrap();
            let Ok(Lighting::EnvironmentMap(read)) = lighting(&format!("envmap:{}", file.display()), Some(orientation))
            else {
                panic!("{orientation:?}")
            };
            let right = lightoctree::geometry::uv_from_direction(Vec3::new(1.0, 0.0, 0.01).normalize()).x * 16.0;
            assert_eq!(read[(right as usize, 4)], [8.0; 3], "{orientation:?}");
        }
    }
}
