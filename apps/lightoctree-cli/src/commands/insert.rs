//! `lightoctree insert SCENE`: inserts virtual objects into the photo.

mod footage;
mod map;
mod objects;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lightoctree::{Document, Estimate, Event, LightPurpose, LitScene, Models, Warning};
use lo_geometry::Vec3;
use lo_imaging as imaging;
use lo_imaging::{ExrOptions, Image, RadianceImage};
use lo_insert::{Composite, InsertError, InsertWarning, Inserter, Instance, Layout, Lighting, Placement, Quality};
use lo_mesh::{Material, PreparedModel};
use lo_scene::ObjectDisplay;
use serde_json::json;

use self::footage::{Footage, FootageArgs, PlateFiles};
use self::map::MapArgs;
use self::objects::ObjectArgs;
use super::known_length::KnownLengthArgs;
use super::light::LightArgs;
use super::parse;
use super::video::{self, Video};
use crate::args::Global;
use crate::choice::{Choice, choice};
use crate::numbered_name::NumberedName;
use crate::progress::{Stages, bar, seconds};
use crate::usage::Usage;
use crate::{interrupt, numbered_name, output, report};

/// Options of `insert`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree insert room.scene --mesh tea_set.gltf --pixel 1100,1150 -o composite.png\n  \
    lightoctree insert room.scene --mesh bunny.ply --height 0.3 --material gold --pixel 900,1200 --quality high -o gold.png\n  \
    lightoctree insert room.scene --mesh bunny.ply --pixel 900,1200 --height 0.3 --mesh tea_set.gltf --pixel 1100,1150 -o two.png\n  \
    lightoctree insert room.scene --layout objects.json -o several.png\n  \
    lightoctree insert room.scene -o as_saved.png\n  \
    lightoctree insert room.scene --mesh car.glb --path path.json --frames 48 -o frames/car_%04d.png\n  \
    lightoctree insert room.scene --mesh vase.glb --pixel 900,1200 --plate 'shot_%04d.jpg' --camera transforms.json \
    -o comp_%04d.png\n  \
    lightoctree insert room.scene --mesh car.glb --path path.json --frames 48 -o - | ffmpeg -i - \
    -colorspace bt709 -color_trc iec61966-2-1 -color_primaries bt709 -pix_fmt yuv420p car.mp4\n\n\
    --material NAME|JSON: a name listed by --list-materials, or an object such as\n  \
    '{\"base_color_texture\":\"cow.png\",\"roughness\":0.4}'")]
pub struct Args {
    /// Scene file
    #[arg(required_unless_present = "list_materials")]
    scene: Option<PathBuf>,

    /// Options of the objects.
    #[command(flatten)]
    objects: ObjectArgs,

    /// Print the names of the materials and exit
    #[arg(long)]
    list_materials: bool,

    #[command(flatten)]
    known_length: KnownLengthArgs,

    #[command(flatten)]
    footage: FootageArgs,

    /// Number of frames of paths and animations [default: as saved by the viewer with the scene's own objects]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000), conflicts_with = "plate")]
    frames: Option<u32>,

    /// Frames per second of videos and animations [default: 24, or as saved by the viewer with the scene's own
    /// objects]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    fps: Option<u32>,

    #[command(flatten)]
    map: MapArgs,

    #[command(flatten)]
    light: LightArgs,

    /// Do not add texture from the photo to unobserved surfaces in reflections
    #[arg(long)]
    no_detail: bool,

    /// Gloss of the surface under an object, from 0 to 1: above 0 it mirrors the objects like a clear coat of roughness
    /// 1 - G [default: 0, or as saved by the viewer with the scene's own objects]
    #[arg(long, value_name = "G", value_parser = parse::share, allow_hyphen_values = true)]
    floor_gloss: Option<f64>,

    /// Strength of shadows and bounced light on the photo, an exponent: 0 for none, 2 for twice as many stops
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = parse::shadow_strength, allow_hyphen_values = true)]
    shadow_strength: f64,

    /// Rendering quality
    #[arg(long, value_name = "QUALITY", default_value = "normal", value_parser = choice(&QUALITIES))]
    quality: Quality,

    /// Give the objects the photo's sharpness and grain; drafts never have them
    #[arg(long, value_name = "on|off", default_value = "on", action = clap::ArgAction::Set, value_parser = choice(&ON_OR_OFF))]
    match_look: bool,

    /// Seconds after which --quality high stops and an image of normal quality is written, as after Ctrl-C [default:
    /// none]
    #[arg(long, value_name = "S", value_parser = parse::positive, allow_hyphen_values = true, conflicts_with = "frames")]
    time_limit: Option<f64>,

    /// Also write the layers of the composite to an EXR file; a sequence requires %04d in the name
    ///
    /// They are the objects' light by kind (diffuse, specular, transmission, emission), alpha, shadow ratio, occlusion,
    /// albedo, normal, position, depth, motion, and cryptomattes of objects and materials (docs/layers.md).
    #[arg(long, value_name = "FILE.exr")]
    layers: Option<PathBuf>,

    /// Image to write: .png, .jpg, or .exr, .hdr, .pfm for linear photos. A sequence requires %04d in the name, or is
    /// written as video (YUV4MPEG2, 4:4:4, BT.709) to .y4m or, with `-`, to standard output
    #[arg(long, short, value_name = "FILE", required_unless_present = "list_materials")]
    output: Option<PathBuf>,

    /// Overwrite existing files of any origin
    #[arg(long)]
    force: bool,

    /// Print a summary as JSON
    #[arg(long)]
    json: bool,
}

/// Quality presets.
static QUALITIES: [Choice<Quality>; 3] = [
    ("draft", Quality::Draft, "Drafts: several images per second"),
    ("normal", Quality::Normal, "Several seconds"),
    ("high", Quality::High, "Final images: up to minutes for large photos"),
];

/// Values of `--match-look`.
static ON_OR_OFF: [Choice<bool>; 2] =
    [("on", true, "As sharp and as grainy as the photo"), ("off", false, "As rendered")];

const COMMAND: &str = "insert";

/// Reads the objects and the scene, places the objects, applies the light, renders and writes.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    if args.list_materials {
        Material::preset_names().for_each(report::print);
        return Ok(());
    }
    let (Some(scene), Some(output)) = (&args.scene, &args.output) else {
        return Err(Usage("SCENE and --output are required".into()).into());
    };
    let mut stages = Stages::new(global.quiet);
    let Request { layout, source, shown, frames, plates, map } = Request::read(args, scene, output, &stages)?;
    stages.name_objects(&names(&layout));
    let (mut document, models) = read(args, scene, &layout, source, &mut stages)?;
    let objects = Objects::place(&layout, &models, &document.estimate, frames.len())?;
    let (scene, lighting) = match map {
        None => {
            let purpose = LightPurpose::Objects { at_m: objects.centre_m() };
            (args.light.lit(&mut document, purpose, &mut stages)?, Lighting::Octree)
        }
        Some(map) => {
            let map = args.map.adapted(map, &document, objects.centre_m(), &mut stages)?;
            (LitScene::as_estimated(document.estimate), Lighting::EnvironmentMap(map))
        }
    };
    let floor_gloss = args.floor_gloss.map_or(shown.floor_gloss, |gloss| gloss as f32);
    let with_detail = !args.no_detail;
    let light = Light {
        scene: &scene,
        lighting,
        floor_gloss,
        with_detail,
        match_look: args.match_look,
        with_passes: args.layers.is_some(),
        shadow_strength: args.shadow_strength as f32,
    };
    let fallback = match &frames[..] {
        [_] if args.quality == Quality::High && plates.is_none() => {
            light.fallback(&objects, args.layers.is_some(), &mut stages)?
        }
        _ => None,
    };
    let inserter = stages.stage("prepare light", || light.inserter(args.quality))?;
    let mut footage = match &plates {
        Some(plates) => Some(args.footage.open(plates, &scene, &objects.positions_m(), &mut stages)?),
        None => None,
    };
    let size = match &footage {
        Some(footage) => footage.size()?,
        None => (scene.frame.photo.width(), scene.frame.photo.height()),
    };
    let fps = args.fps.unwrap_or(shown.fps);
    let video = Video::is_video(output).then(|| Video::create(output, size, fps)).transpose()?;
    let job = FrameJob {
        inserter: &inserter,
        objects: &objects,
        frames: &frames,
        frames_per_second: fps,
        time_limit_s: args.time_limit,
    };
    let (count, mut written) = job.render_and_write(fallback, footage.as_mut(), video, &mut stages)?;
    if Video::is_video(output) {
        written.push(output.clone());
    }
    if !video::is_stdout(output) {
        print_result(args, &written, &layout, &objects.placements, &stages)?;
    }
    if count < frames.len() {
        anyhow::bail!("stopped after {count} of {} frames; the written files are complete", frames.len());
    }
    Ok(())
}

/// Everything that the command line asks for, validated before the slow steps.
struct Request {
    layout: Layout,
    source: ObjectSource,
    /// How the objects are shown, as saved in the scene.
    shown: ObjectDisplay,
    frames: Vec<FrameFiles>,
    /// Images of a moving camera, one for each frame.
    plates: Option<PlateFiles>,
    /// The map that lights the objects instead of the octree.
    map: Option<RadianceImage>,
}

/// Where the objects come from.
enum ObjectSource {
    /// The command line or a layout file; mesh paths are relative to this folder.
    Files(PathBuf),
    /// The scene, which contains them with their meshes.
    Scene(Box<Document>),
}

/// Output files of one frame.
struct FrameFiles {
    composite: PathBuf,
    layers: Option<PathBuf>,
}

impl Request {
    fn read(args: &Args, scene: &Path, output: &Path, stages: &Stages) -> anyhow::Result<Self> {
        if args.time_limit.is_some() && args.quality != Quality::High {
            return Err(Usage("--time-limit applies to --quality high only".into()).into());
        }
        let hidden = || Usage("nothing to insert: all objects are hidden".to_owned());
        let (layout, source, saved) = match args.objects.layout()? {
            Some((layout, folder)) => (layout.without_hidden().ok_or_else(hidden)?, ObjectSource::Files(folder), None),
            None => {
                let document = args.known_length.apply(Document::read(scene)?, stages)?;
                let Some(layout) = document.layout.clone() else {
                    let message =
                        format!("nothing to insert: give --mesh or --layout; {} has no objects", scene.display());
                    return Err(Usage(message).into());
                };
                let shown = document.shown;
                let layout = layout.without_hidden().ok_or_else(hidden)?;
                (layout, ObjectSource::Scene(Box::new(document)), Some(shown))
            }
        };
        let plates = args.footage.plates()?;
        let numbers: Vec<usize> = match &plates {
            Some(plates) => plates.numbers(),
            None => (0..frame_count(args, &layout, saved)?).collect(),
        };
        let frames = frame_files(args, output, &numbers, layout.moves() || plates.is_some())?;
        let map = args.map.read(stages)?;
        if map.is_some() && args.light.is_given() {
            let message =
                "--light, --contrast, --warmth and --white apply to the octree's light; --lighting replaces it";
            return Err(Usage(message.into()).into());
        }
        Ok(Self { layout, source, shown: saved.unwrap_or_default(), frames, plates, map })
    }
}

/// Returns the names of the objects.
fn names(layout: &Layout) -> Vec<String> {
    layout.objects().iter().map(|object| object.name().to_owned()).collect()
}

/// Reads the scene, unless it is read already, and the objects' meshes.
fn read(
    args: &Args,
    scene: &Path,
    layout: &Layout,
    source: ObjectSource,
    stages: &mut Stages,
) -> anyhow::Result<(Document, Models)> {
    let (document, folder) = match source {
        ObjectSource::Files(folder) => {
            let document = stages.stage("read scene", || Document::read(scene))?;
            (args.known_length.apply(document, stages)?, Some(folder))
        }
        ObjectSource::Scene(document) => (*document, None),
    };
    let label = if layout.objects().len() > 1 { "read meshes" } else { "read mesh" };
    let models = stages.stage(label, || match &folder {
        Some(folder) => Models::load(layout, folder),
        None => document.models(layout),
    })?;
    models.warnings().for_each(|warning| stages.note(&warning.to_string()));
    Ok((document, models))
}

/// The objects at their placements in each frame.
struct Objects<'a> {
    names: Vec<String>,
    models: &'a Models,
    /// Placement of each object in each frame.
    placements: Vec<Vec<Placement>>,
}

impl<'a> Objects<'a> {
    fn place(layout: &Layout, models: &'a Models, estimate: &Estimate, frames: usize) -> anyhow::Result<Self> {
        let names = names(layout);
        let placements = layout
            .placements(estimate, &models.per_object(), frames)
            .map_err(|error| with_object_name(error, &names))?;
        Ok(Self { names, models, placements })
    }

    /// Returns the objects of a frame, with their models there.
    fn instances<'b>(&'b self, models: &[&'b PreparedModel], frame: usize) -> Vec<Instance<'b>> {
        let placed = models.iter().zip(&self.placements).zip(&self.names);
        placed.map(|((model, placements), name)| Instance::in_sequence(model, placements, frame).named(name)).collect()
    }

    /// Returns the positions in the first frame.
    fn positions_m(&self) -> Vec<Vec3> {
        self.placements.iter().map(|placements| placements[0].position_m).collect()
    }

    /// Returns the mean position in the first frame.
    fn centre_m(&self) -> Vec3 {
        self.positions_m().into_iter().sum::<Vec3>() / self.placements.len() as f32
    }
}

/// Light and surfaces that the objects are rendered with.
struct Light<'a> {
    scene: &'a LitScene,
    lighting: Lighting,
    floor_gloss: f32,
    with_detail: bool,
    match_look: bool,
    with_passes: bool,
    shadow_strength: f32,
}

/// A finished image that replaces one that takes too long, with its warnings.
type Fallback = (Composite, Vec<Arc<dyn Warning>>);

impl Light<'_> {
    fn inserter(&self, quality: Quality) -> Result<Inserter, InsertError> {
        let inserter = Inserter::new(self.scene, self.lighting.clone(), quality)?
            .with_floor_gloss(self.floor_gloss)
            .with_shadow_strength(self.shadow_strength);
        let inserter = if self.with_detail { inserter } else { inserter.without_detail() };
        let inserter = if self.with_passes { inserter.with_passes() } else { inserter };
        Ok(if self.match_look { inserter.with_photo_look() } else { inserter })
    }

    /// Renders the image of normal quality that is written if rendering at high quality is cancelled.
    ///
    /// `None` if this is cancelled, too.
    fn fallback(
        &self,
        objects: &Objects<'_>,
        keep_layers: bool,
        stages: &mut Stages,
    ) -> anyhow::Result<Option<Fallback>> {
        let render = || {
            let mut warnings = Vec::new();
            let on_event = &mut |event| {
                if let Event::Warning(warning) = event {
                    warnings.push(warning);
                }
                interrupt::control_flow()
            };
            match self.inserter(Quality::Normal)?.render(&objects.instances(&objects.models.per_object(), 0), on_event)
            {
                Err(InsertError::Cancelled(_)) => Ok(None),
                Ok(composite) if keep_layers => Ok(Some((composite, warnings))),
                Ok(composite) => Ok(Some((without_layers(composite), warnings))),
                Err(error) => Err(error),
            }
        };
        stages.stage("image of normal quality", render).map_err(|error| with_object_name(error, &objects.names))
    }
}

/// Renders the frames and writes their files.
struct FrameJob<'a> {
    inserter: &'a Inserter,
    objects: &'a Objects<'a>,
    frames: &'a [FrameFiles],
    frames_per_second: u32,
    time_limit_s: Option<f64>,
}

impl FrameJob<'_> {
    /// Renders the frames and writes each to its files, or to the video.
    ///
    /// Returns the number of frames, fewer than all if cancelled, and the files written except the video.
    fn render_and_write(
        &self,
        mut fallback: Option<Fallback>,
        mut footage: Option<&mut Footage<'_>>,
        mut video: Option<Video>,
        stages: &mut Stages,
    ) -> anyhow::Result<(usize, Vec<PathBuf>)> {
        let (mut written, mut count) = (Vec::new(), 0);
        let mut reported = Reported::default();
        let progress = bar(stages.is_quiet() || self.frames.len() == 1, self.frames.len(), "frames");
        for FrameFiles { composite: file, layers } in self.frames {
            let on_plate = match &mut footage {
                Some(footage) => Some(self.inserter.on_plate(&footage.plate(count)?)),
                None => None,
            };
            let composite = self.render(on_plate.as_ref(), count, &mut fallback, &mut reported, stages)?;
            let Some(composite) = composite else { break };
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
            count += 1;
            progress.inc(1);
        }
        progress.finish_and_clear();
        if let Some(video) = video {
            video.finish()?;
        }
        Ok((count, written))
    }

    /// Renders a frame. If that is cancelled, by Ctrl-C or the time limit, returns the fallback.
    fn render(
        &self,
        on_plate: Option<&Inserter>,
        frame: usize,
        fallback: &mut Option<Fallback>,
        reported: &mut Reported,
        stages: &mut Stages,
    ) -> anyhow::Result<Option<Composite>> {
        let is_single = self.frames.len() == 1;
        let (inserter, on_plate) = (on_plate.unwrap_or(self.inserter), on_plate.is_some());
        let on_event = &mut |event| match event {
            _ if self.time_limit_s.is_some_and(|limit_s| stages.total().as_secs_f64() > limit_s) => {
                ControlFlow::Break(())
            }
            _ if is_single => stages.handle(event),
            Event::Warning(warning) if reported.is_new(&*warning, frame, on_plate) => {
                stages.handle(Event::Warning(warning))
            }
            _ => interrupt::control_flow(),
        };
        let posed = self.objects.models.at(frame as f32 / self.frames_per_second as f32)?;
        match inserter.render(&self.objects.instances(&posed.per_object(), frame), on_event) {
            Err(InsertError::Cancelled(_)) => {
                let Some((composite, warnings)) = fallback.take() else { return Ok(None) };
                stages.clear_bar();
                warnings.iter().for_each(|warning| stages.warn(&**warning));
                stages.note("rendering at high quality was stopped: this image is of normal quality");
                Ok(Some(composite))
            }
            composite => composite.map(Some).map_err(|error| with_object_name(error, &self.objects.names)),
        }
    }
}

/// Warnings of a sequence that were printed, so that they are not repeated for each frame.
#[derive(Default)]
struct Reported {
    /// Pairs of objects that intersect.
    intersections: Vec<[usize; 2]>,
}

impl Reported {
    /// Whether to print a warning: those of the first frame or of the scene's photo, and each pair of intersecting
    /// objects once.
    fn is_new(&mut self, warning: &dyn Warning, frame: usize, on_plate: bool) -> bool {
        match warning.downcast_ref() {
            Some(InsertWarning::ObjectsIntersect { objects }) if !self.intersections.contains(objects) => {
                self.intersections.push(*objects);
                true
            }
            // Of plates, only the scene's own photo has others.
            _ => frame == 0 || on_plate,
        }
    }
}

fn print_result(
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
            .map(|(object, placements)| {
                let positions: Vec<[f32; 3]> =
                    placements.iter().map(|placement| placement.position_m.to_array()).collect();
                let yaws: Vec<f32> = placements.iter().map(|placement| placement.yaw_rad.to_degrees()).collect();
                json!({
                    "name": object.name(),
                    "mesh": object.mesh,
                    "scale": placements.first().map(|placement| placement.scale),
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

/// Replaces the layers of a composite by empty ones, because it is kept in memory for minutes.
fn without_layers(composite: Composite) -> Composite {
    let (black, zero) = (RadianceImage::new(1, 1, vec![[0.0; 3]]), Image::new(1, 1, vec![0.0]));
    Composite {
        object: black.clone(),
        alpha: zero.clone(),
        shadow_ratio: black,
        reflection: None,
        grain: None,
        occlusion: zero,
        passes: None,
        image: composite.image,
    }
}

/// Determines the number of frames; `saved` is how the scene's own objects are shown.
fn frame_count(args: &Args, layout: &Layout, saved: Option<ObjectDisplay>) -> anyhow::Result<usize> {
    let saved = saved.zip(layout.span_s()?).map(|(shown, span_s)| shown.frames_between(span_s));
    match (
        args.frames.or(saved),
        layout.objects().iter().find(|object| object.path.is_some() || object.animation.is_some()),
    ) {
        (Some(frames), Some(_)) => Ok(frames as usize),
        (None, None) => Ok(1),
        (None, Some(moving)) => {
            Err(Usage(format!("{} moves: give the number of frames with --frames N", moving.name())).into())
        }
        (Some(_), None) => {
            Err(Usage("--frames: no object moves; give --path FILE.json or --animation NAME".into()).into())
        }
    }
}

/// Adds the name of the object to an error, if there are several objects, and what to do about it by options.
fn with_object_name(error: InsertError, names: &[String]) -> anyhow::Error {
    match error {
        InsertError::Object { source, .. } if names.len() == 1 => with_hint(*source),
        InsertError::Object { object, source } => with_hint(*source).context(names[object].clone()),
        error => with_hint(error),
    }
}

fn with_hint(error: InsertError) -> anyhow::Error {
    let InsertError::Steep { below_m, below_pixel, .. } = &error else { return error.into() };
    let stand = match (below_pixel, below_m) {
        (Some([u, v]), _) => format!("place it there with --pixel {u},{v}, or "),
        (None, Some(at)) => format!("place it there with --at {:.2},{:.2},{:.2}, or ", at.x, at.y, at.z),
        (None, None) => String::new(),
    };
    anyhow::anyhow!("{error}; {stand}attach its base to the tilted surface with --align surface")
}

/// Determines the output files of each frame, and checks that they can be written.
fn frame_files(args: &Args, output: &Path, numbers: &[usize], is_sequence: bool) -> anyhow::Result<Vec<FrameFiles>> {
    let is_video = Video::is_video(output);
    if is_video && !is_sequence {
        return Err(
            Usage(format!("--output {}: a video requires --path and --frames, or --plate", output.display())).into()
        );
    }
    if video::is_stdout(output) && args.json {
        return Err(Usage("--json and a video cannot both go to standard output".into()).into());
    }
    (numbers.iter())
        .map(|&frame| {
            let name = |path: &Path, option: &str, numbered: bool| match numbered {
                true => frame_name(path, option, frame),
                false => single_name(path, option),
            };
            let composite = name(output, "--output", is_sequence && !is_video)?;
            let layers = args.layers.as_deref().map(|layers| name(layers, "--layers", is_sequence)).transpose()?;
            let is_stdout = video::is_stdout(&composite);
            let composite_extensions = if is_video { &[][..] } else { output::PHOTO };
            let image = (!is_stdout).then_some((composite.as_path(), composite_extensions));
            let layers_file = layers.as_deref().map(|layers| (layers, output::LAYERS));
            let outputs: Vec<(&Path, &[&str])> = image.into_iter().chain(layers_file).collect();
            output::check_outputs(&outputs, COMMAND, args.force)?;
            Ok(FrameFiles { composite, layers })
        })
        .collect()
}

/// Returns the file name of a single image or video, which contains no `%d` or `%0Nd`.
fn single_name(path: &Path, option: &str) -> anyhow::Result<PathBuf> {
    let text = numbered_name::unicode(path, option)?;
    if text.contains("%d") || text.contains("%0") {
        let reason = "one image needs no frame number; give --path or --plate for several";
        return Err(Usage(format!("{option} {text}: {reason}")).into());
    }
    Ok(path.to_owned())
}

/// Replaces `%d` or `%0Nd` by the frame's number.
fn frame_name(pattern: &Path, option: &str, frame: usize) -> anyhow::Result<PathBuf> {
    Ok(NumberedName::parse(pattern, option)?.name(frame))
}

fn write_layers(path: &Path, composite: &Composite) -> anyhow::Result<()> {
    let size = (composite.alpha.width(), composite.alpha.height());
    let (generator, metadata) = (output::signature(COMMAND), composite.metadata());
    let options = ExrOptions { generator, metadata, ..ExrOptions::default() };
    Ok(imaging::write_exr(path, size, &composite.channels(), &options)?)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn frames_are_numbered_by_the_pattern() {
        let name =
            |pattern: &str, frame| frame_name(Path::new(pattern), "-o", frame).map(|path| path.display().to_string());
        assert_eq!(name("out/a_%04d.png", 7).unwrap(), "out/a_0007.png");
        assert_eq!(name("%d.png", 12).unwrap(), "12.png");
        for bad in ["a.png", "%4d.png", "%0x.png", "%04d_%04d.png", "%012d.png"] {
            assert!(name(bad, 0).unwrap_err().is::<Usage>(), "{bad}");
        }
        assert_eq!(single_name(Path::new("50%.png"), "-o").unwrap(), Path::new("50%.png"));
        assert!(single_name(Path::new("a_%04d.png"), "-o").unwrap_err().is::<Usage>());
    }
}
