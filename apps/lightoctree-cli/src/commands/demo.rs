//! `lightoctree demo`: runs all steps on a bundled photo.

use std::path::{Path, PathBuf};
use std::time::Instant;

use lightoctree::{Document, Estimate, EstimateOptions, Estimator, Input, LightPurpose, LitScene, SceneRenderer};
use lo_geometry::Camera;
use lo_imaging as imaging;
use lo_imaging::{EnvironmentLayout, ExrOptions, Photo, ToneCurve};
use lo_insert as insert;
use lo_insert::{Align, Base, Inserter, Instance, Lighting, PathPlacement, Placement, Quality};
use lo_mesh::{MaterialSpec, PreparedModel};
use lo_scene::Frame;
use serde_json::json;

use super::environment;
use crate::args::Global;
use crate::progress::{Stages, bar, seconds};
use crate::{interrupt, output, report};

/// Options of `demo`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  lightoctree demo --out demo")]
pub struct Args {
    /// Folder to write to
    #[arg(long, value_name = "DIR", default_value = "lightoctree-demo")]
    out: PathBuf,

    /// Write to a folder that contains other files
    #[arg(long)]
    force: bool,

    /// Print a summary as JSON
    #[arg(long)]
    json: bool,
}

const COMMAND: &str = "demo";
const MANIFEST: &str = "demo.json";
const FRAMES: usize = 12;

/// The photo.
pub const PHOTO: &[u8] = include_bytes!("../../assets/library_color.jpg");
/// Its measured depth.
pub const DEPTH: &[u8] = include_bytes!("../../assets/library_lidar_depth.png");
/// Intrinsics with which floor and shelf are perpendicular. The photo has no EXIF block.
pub const INTRINSICS: [f64; 4] = [1330.0, 1330.0, 960.0, 720.0];
/// Position of the object in the half-size photo, in pixels.
const PIXEL: [f64; 2] = [510.0, 570.0];
/// Height of the object in metres.
const HEIGHT_M: f32 = 0.5;
/// Keyframes of the moving object.
const PATH: &str = r#"{"interpolation": "catmull-rom", "keyframes": [
    {"time_s": 0, "pixel": [310, 530], "yaw_deg": 30},
    {"time_s": 1, "pixel": [510, 570], "yaw_deg": 0},
    {"time_s": 2, "pixel": [730, 545], "yaw_deg": -40}]}"#;

/// Estimates the scene, then renders a panorama and inserts objects.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    output::prepare_folder(&args.out, MANIFEST, COMMAND, args.force)?;
    let file = |name: &str| args.out.join(name);
    let mut files = Vec::new();
    let mut stages = Stages::new(global.quiet);

    let frame = stages.stage("read photo and depth", frame)?;
    let frame = stages.stage("resize photo", || half_size(frame));
    let estimator = match cfg!(feature = "weights") {
        true => stages.stage("read weights", || super::estimator(None))?,
        false => Estimator::without_networks(),
    };
    if estimator.networks().is_some() {
        stages.note("estimate from the photo alone");
        let alone = Input::Photo { photo: frame.photo.clone(), camera: frame.camera };
        let document = Document::new(estimate(&mut stages, alone, &estimator)?);
        let base = placement(&document.estimate)?;
        files.extend(write_panorama(&mut stages, &document, &base, &file("alone_panorama"))?);
        let gold = model("gold")?;
        let lit = lit_for(&document, &base, &mut stages)?;
        let inserter = Inserter::new(&lit, Lighting::Octree, Quality::Draft)?;
        let composite = stages.stage("insert gold object", || {
            inserter.render(&[Instance::new(&gold, base.scaled(scale(&gold)))], &mut |_| interrupt::control_flow())
        })?;
        imaging::write_photo(file("alone_object.png"), &composite.image, &output::signature(COMMAND))?;
        files.push(file("alone_object.png"));
        stages.note("estimate from photo and LiDAR depth");
    }
    let document = Document::new(estimate(&mut stages, Input::MeasuredDepth(frame), &estimator)?);
    stages.stage("write scene", || document.write(file("library.scene"), &output::signature(COMMAND)))?;
    imaging::write_photo(file("photo.png"), &document.estimate.frame.photo, &output::signature(COMMAND))?;
    files.extend([file("library.scene"), file("photo.png")]);
    let base = placement(&document.estimate)?;
    files.extend(write_panorama(&mut stages, &document, &base, &file("panorama"))?);
    let lit = lit_for(&document, &base, &mut stages)?;
    files.extend(insert_objects(global, &mut stages, &lit, &base, &args.out)?);
    finish(args, &files, &stages)
}

/// Returns the object's placement, without its scale.
fn placement(estimate: &Estimate) -> anyhow::Result<Placement> {
    let [u, v] = PIXEL;
    Ok(Placement::rest_on_pixel(estimate, u, v, Align::Gravity)?)
}

/// Applies the light for the inserted object.
fn lit_for(document: &Document, base: &Placement, stages: &mut Stages) -> anyhow::Result<LitScene> {
    super::light::lit(document, LightPurpose::Objects { at_m: base.position_m }, stages)
}

/// Returns metres per unit of the object.
fn scale(object: &PreparedModel) -> f32 {
    HEIGHT_M / object.bounds().size().y
}

/// Renders the panorama at the object's centre, and writes it as `.exr` and `.png` with this name.
fn write_panorama(
    stages: &mut Stages,
    document: &Document,
    base: &Placement,
    name: &Path,
) -> anyhow::Result<[PathBuf; 2]> {
    let at = base.position_m + base.up * (0.5 * HEIGHT_M);
    let lit = super::light::lit(document, LightPurpose::Panorama, stages)?;
    let renderer = stages.stage("prepare panoramas", || SceneRenderer::new(&lit));
    let panorama = stages.stage("panorama 512 × 256", || renderer.panorama(at, 512, 256));
    let options = ExrOptions {
        generator: output::signature(COMMAND),
        environment: Some(EnvironmentLayout::LatitudeLongitude),
        ..ExrOptions::default()
    };
    let files = ["exr", "png"].map(|extension| name.with_extension(extension));
    imaging::write_radiance(&files[0], &panorama.radiance, &options)?;
    imaging::write_tone_mapped(&files[1], &panorama.radiance, ToneCurve::Reinhard, 0.0, &output::signature(COMMAND))?;
    Ok(files)
}

/// Reads the bundled photo and depth, at full resolution.
pub fn frame() -> anyhow::Result<Frame> {
    let photo = imaging::photo_from_bytes(PHOTO, "library_color.jpg")?;
    let depth_m = imaging::depth_from_bytes(DEPTH, "library_lidar_depth.png", None)?;
    let [fx, fy, cx, cy] = INTRINSICS;
    let camera = Camera::new(fx, fy, cx, cy, photo.photo.width() as u32, photo.photo.height() as u32)?;
    Ok(Frame::new(photo.photo, depth_m, camera, 1.0)?)
}

/// Halves the photo's width and height, which takes a quarter of the time.
fn half_size(frame: Frame) -> Frame {
    let (width, height) = (frame.photo.width() / 2, frame.photo.height() / 2);
    let photo = imaging::resize(&frame.photo.radiance(), width, height).map(|rgb| rgb.map(imaging::srgb8_from_linear));
    Frame { camera: frame.camera.resized(width as u32, height as u32), photo: Photo::Srgb8(photo), ..frame }
}

/// Estimates the scene of the bundled photo: by networks, or without them by the shell.
pub fn estimate(stages: &mut Stages, input: Input, estimator: &Estimator) -> anyhow::Result<Estimate> {
    let mut sources = vec!["library_color.jpg".into()];
    sources.extend(matches!(input, Input::MeasuredDepth(_)).then(|| "library_lidar_depth.png".into()));
    let options = EstimateOptions { sources, ..EstimateOptions::default() };
    Ok(estimator.estimate(input, &options, &mut |event| stages.handle(event))?)
}

/// Reads the bundled object and gives it a preset material.
pub fn model(material: &str) -> anyhow::Result<PreparedModel> {
    let mut model = lightoctree::builtin_model("suzanne")?;
    model.override_material(&MaterialSpec::parse(material)?, Path::new("."))?;
    Ok(PreparedModel::new(model))
}

fn insert_objects(
    global: &Global,
    stages: &mut Stages,
    scene: &LitScene,
    base: &Placement,
    out: &Path,
) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let gold = stages.stage("read mesh", || model("gold"))?;
    let scale = scale(&gold);
    let object_base = Base::new(&gold);
    let place = base.scaled(scale).settled(scene, &object_base);
    let inserter = stages.stage("prepare light", || Inserter::new(scene, Lighting::Octree, Quality::Normal))?;
    let inserter = inserter.with_photo_look();
    for material in ["gold", "chrome", "matte-white"] {
        let object = model(material)?;
        let composite = stages.stage(&format!("insert {material} object"), || {
            inserter.render(&[Instance::new(&object, place)], &mut |_| interrupt::control_flow())
        })?;
        let file = out.join(format!("object_{}.png", material.replace('-', "_")));
        imaging::write_photo(&file, &composite.image, &output::signature(COMMAND))?;
        files.push(file);
    }
    let stance = PathPlacement { scale, base: Some(&object_base), ..PathPlacement::default() };
    let placements = insert::Path::from_json(PATH)?.placements(scene, &stance, FRAMES)?;
    let draft = stages.stage("prepare light for drafts", || Inserter::new(scene, Lighting::Octree, Quality::Draft))?;
    let start = Instant::now();
    let folder = out.join("moving");
    std::fs::create_dir_all(&folder)?;
    let progress = bar(global.quiet, FRAMES, "moving object");
    for (i, placement) in placements.iter().enumerate() {
        if interrupt::requested() {
            anyhow::bail!("stopped after {i} of {FRAMES} frames; the files in {} are complete", out.display());
        }
        let composite = draft.render(&[Instance::new(&gold, *placement)], &mut |_| interrupt::control_flow())?;
        let file = folder.join(format!("frame_{i:02}.jpg"));
        imaging::write_photo(&file, &composite.image, &output::signature(COMMAND))?;
        files.push(file);
        progress.inc(1);
    }
    progress.finish_and_clear();
    stages.note(&format!("moving object: {:.1} frames per second", FRAMES as f64 / start.elapsed().as_secs_f64()));
    Ok(files)
}

fn finish(args: &Args, files: &[PathBuf], stages: &Stages) -> anyhow::Result<()> {
    let result = json!({ "files": files, "seconds": stages.timings() });
    environment::write_json(&args.out.join(MANIFEST), COMMAND, result.clone())?;
    if args.json {
        return report::print_json(&result);
    }
    let sizes: Vec<Vec<String>> = files
        .iter()
        .filter(|file| file.parent() == Some(args.out.as_path()))
        .map(|file| {
            vec![
                file.display().to_string(),
                std::fs::metadata(file).map_or_else(|_| "-".into(), |m| report::bytes(m.len())),
            ]
        })
        .collect();
    report::print(&report::table(&["file", "size"], &sizes));
    report::print(&format!("{}  {FRAMES} frames of the moving object", args.out.join("moving").display()));
    report::print(&format!("finished in {}", seconds(stages.total())));
    Ok(())
}
