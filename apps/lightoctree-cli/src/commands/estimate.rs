//! `lightoctree estimate PHOTO…`: estimates a scene from a photo, or from several photos of a room with depth.

use std::path::{Path, PathBuf};
#[cfg(feature = "depth-models")]
use std::sync::Arc;

use clap::ValueEnum;
use lightoctree::{
    DepthSource, Document, Estimate, EstimateError, EstimateOptions, Estimator, OnEvent, PanoramaPrior, PhotoRequest,
    ResolvedPhoto,
};
#[cfg(feature = "depth-models")]
use lo_depth_models::DepthModel;
use lo_geometry::{Camera, Vec3};
use lo_imaging as imaging;
use lo_imaging::{PhotoFile, SpecialProjection};
use lo_scene::{CameraSource, Completion};

#[cfg(feature = "depth-models")]
use super::depth_model::DepthModelArgs;
use super::known_length::KnownLengthArgs;
use super::lens::{GivenLens, LensArgs};
use super::panorama_prior::{self, PanoramaPriorArgs};
use super::parse;
use super::photos::{self, PhotosArgs};
use crate::args::{Global, OutputArgs};
use crate::choice::{Choice, choice};
use crate::depth_units::DepthUnits;
use crate::progress::{Stages, seconds};
use crate::usage::Usage;
use crate::{output, report};

/// Options of `estimate`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree estimate photo.jpg -o room.scene\n  \
    lightoctree estimate photo.jpg --depth lidar.png -o room.scene\n  \
    lightoctree estimate kinect.png --depth kinect_depth.png --depth-scale 5000 --intrinsics 525,525,319.5,239.5 -o desk.scene\n  \
    lightoctree estimate photo.jpg --known-length 812,240,812,1130,2.01 -o room.scene\n  \
    lightoctree estimate photo.jpg --depth depth/photo.npz --depth-is predicted -o room.scene\n  \
    lightoctree estimate photo.jpg --depth-model moge-2-vits-normal.onnx -o room.scene\n  \
    lightoctree estimate photo.jpg --depth-model other.onnx --depth-model-config other.toml -o room.scene\n  \
    lightoctree estimate photo.jpg --panorama theta.hdr --panorama-at 0.4,0.1,-1.5 -o room.scene\n  \
    lightoctree estimate a.jpg b.jpg c.jpg --depth a.png b.png c.png --poses poses.json -o room.scene\n  \
    lightoctree estimate photo.jpg --completion network --weights trained.safetensors -o room.scene")]
#[command(mut_arg("output", |output| output.help("Scene file to write").value_name("SCENE")))]
pub struct Args {
    /// Photo: JPEG, HEIC, JPEG XL, PNG, WebP, TIFF, BMP, GIF, PNM (sRGB, or by their colour profile) or HDR, EXR, PFM
    /// (linear); or several of one room, with --depth and --poses
    #[arg(required_unless_present = "depth")]
    photo: Vec<PathBuf>,

    /// Depth map of the same view, any resolution: 16-bit PNG, or EXR, PFM, TIFF, NPY, NPZ in metres [default:
    /// predicted by the built-in network]
    ///
    /// It comes from a phone's LiDAR (ARKit, Record3D), an RGB-D camera (Kinect, RealSense, Azure), or, with --depth-is
    /// predicted, from a program that predicts metric depth (Depth Anything, Depth Pro, MoGe, UniDepth). Of an NPZ's
    /// arrays the one named depth, depth_m, pred or arr_0 is read. For several photos, give one file per photo in the
    /// same order.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    #[cfg_attr(feature = "depth-models", arg(conflicts_with = "depth_model"))]
    depth: Vec<PathBuf>,

    #[command(flatten)]
    photos: PhotosArgs,

    /// Origin and kind of the depth map
    #[arg(long, value_name = "SOURCE", default_value = "measured", requires = "depth")]
    depth_is: DepthArg,

    #[cfg(feature = "depth-models")]
    #[command(flatten)]
    depth_model: DepthModelArgs,

    /// Units per metre of an integer depth map [default: 1000, millimetres]
    #[arg(long, value_name = "UNITS_PER_METRE", requires = "depth", value_parser = parse::positive, allow_hyphen_values = true)]
    depth_scale: Option<f64>,

    #[command(flatten)]
    lens: LensArgs,

    #[command(flatten)]
    known_length: KnownLengthArgs,

    #[command(flatten)]
    method: MethodArgs,

    /// Up direction in the camera's frame [default: from the surfaces; if depth is predicted, estimated from the photo]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true)]
    up: Option<Vec3>,

    #[command(flatten)]
    panorama: PanoramaPriorArgs,

    #[command(flatten)]
    out: OutputArgs,
}

/// Options of the method, shared with `batch`.
#[derive(Clone, Debug, clap::Args)]
pub struct MethodArgs {
    /// Depth of the octree, 5 to 9; leaves at depth 7 are 1/128 of the cube [default: 7]
    ///
    /// Only observed regions reach this depth. In inferred regions the depth is that of the light network, 6 for the
    /// built-in one.
    #[arg(long, value_name = "D", value_parser = clap::value_parser!(u32).range(5..=9))]
    pub octree_depth: Option<u32>,

    /// Method to complete unobserved regions of the room [default: network]
    #[arg(long, value_name = "HOW", value_parser = choice(&COMPLETIONS))]
    pub completion: Option<Completion>,

    /// File with trained weights of the networks [default: the built-in weights]
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,
}

/// Origin of a depth map.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum DepthArg {
    /// Sensor: used without correction
    Measured,
    /// Network of another program: the up direction is estimated from the photo, and only surfaces well in front of an
    /// object hide it
    Predicted,
    /// Inverse depth or disparity of another program, of any scale and offset; it is fitted to the built-in network's
    /// depth, then used as predicted
    #[cfg(feature = "depth-models")]
    #[value(alias = "disparity")]
    Inverse,
}

/// Methods to complete unobserved regions.
pub static COMPLETIONS: [Choice<Completion>; 3] = [
    ("network", Completion::Network, "Light network"),
    ("shell", Completion::Shell, "Planes fitted to the observed surfaces, with extrapolated radiance"),
    ("none", Completion::None, "No completion: only observed radiance"),
];

const COMMAND: &str = "estimate";

/// Reads the photos, estimates the scene and writes it.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    output::check_scene(&args.out.output, COMMAND, args.out.force)?;
    if !args.out.force {
        check_no_edits(&args.out.output)?;
    }
    let mut stages = Stages::new(global.quiet);
    let (photos, depths) = photos::files(&args.photo, &args.depth)?;
    #[cfg(feature = "depth-models")]
    let model = args.depth_model.read(&mut stages)?;
    #[cfg(feature = "depth-models")]
    let is_metric = model.as_ref().is_some_and(DepthModel::is_metric);
    #[cfg(not(feature = "depth-models"))]
    let is_metric = false;
    let estimator = estimator(args, is_metric, &mut stages)?;
    let panorama = args.panorama.read(&mut stages)?;
    let mut options = options(global, args, [photos, depths], panorama);
    let input = match (photos, depths) {
        ([path], depths @ ([] | [_])) => {
            args.photos.check_unused()?;
            let depth = depths.first();
            #[cfg(feature = "depth-models")]
            let depth = model.map_or(Depth::File(depth), |model| Depth::Model(Arc::new(model)));
            #[cfg(not(feature = "depth-models"))]
            let depth = Depth::File(depth);
            let resolved = photo(args, path, depth, &estimator, &mut stages)?;
            options.camera_source = resolved.camera_source;
            options.distorted = resolved.distorted;
            resolved.input
        }
        _ => {
            if !matches!(args.depth_is, DepthArg::Measured) {
                return Err(Usage(photos::PREDICTED.into()).into());
            }
            let photos = args.photos.read(photos, depths, args.depth_scale, &args.lens, &mut stages)?;
            options.up = options.up.or(photos.up);
            options.distorted = photos.distorted;
            photos.input
        }
    };
    let scene = estimator.estimate(input, &options, &mut |event| stages.handle(event)).map_err(estimate_error)?;
    if let Some(panorama) = &scene.panorama {
        stages.note(&panorama_prior::description(&panorama.source));
    }
    let document = args.known_length.apply(Document::new(scene), &stages)?;
    stages.stage("write", || document.write(&args.out.output, &output::signature(COMMAND)))?;
    print_result(args, &document.estimate, &stages)
}

/// Checks that an existing scene file has no edits or objects, which a new estimate would not contain.
///
/// # Errors
/// [`Usage`] that lists them.
fn check_no_edits(path: &Path) -> anyhow::Result<()> {
    // A missing or damaged file has none.
    let Ok(document) = Document::read(path) else { return Ok(()) };
    let edits = &document.light_edits;
    let objects = document.layout.as_ref().map_or(0, |layout| layout.objects().len());
    let counted = |count: usize, one: &str| match count {
        0 => None,
        1 => Some(format!("1 {one}")),
        count => Some(format!("{count} {one}s")),
    };
    let contents: Vec<String> = [
        counted(edits.emitters.len(), "edited light"),
        counted(edits.added.len(), "added light"),
        edits.inferred.is_some().then(|| "a choice of light".to_owned()),
        counted(objects, "object"),
    ]
    .into_iter()
    .flatten()
    .collect();
    if contents.is_empty() {
        return Ok(());
    }
    let contents = contents.join(", ");
    let message = format!(
        "{} has {contents}, which a new estimate would not have; choose another name, or overwrite it with --force",
        path.display()
    );
    Err(Usage(message).into())
}

/// Source of a photo's depth.
enum Depth<'a> {
    File(Option<&'a PathBuf>),
    #[cfg(feature = "depth-models")]
    Model(Arc<DepthModel>),
}

/// Reads a photo and its depth, and resolves its camera.
fn photo(
    args: &Args,
    path: &Path,
    depth: Depth<'_>,
    estimator: &Estimator,
    stages: &mut Stages,
) -> anyhow::Result<ResolvedPhoto> {
    let photo = stages.stage("read photo", || imaging::read_photo(path))?;
    let given = args.lens.of(path, &photo)?;
    let mut files = path.display().to_string();
    let depth = match depth {
        Depth::File(None) => DepthSource::Network,
        Depth::File(Some(file)) => {
            files = format!("{files} and {}", file.display());
            read_depth(args, file, stages)?
        }
        #[cfg(feature = "depth-models")]
        Depth::Model(model) => DepthSource::Model(model),
    };
    let bars = imaging::BlackBars::of(&photo.photo);
    let is_cropped = photo.focal.is_cropped(photo.photo.width() as u32, photo.photo.height() as u32);
    let on_event = &mut |event| stages.handle(event);
    let resolved = resolve(estimator, path, photo, &given, depth, &files, on_event)?;
    let given = given.camera.map(|(_, option)| option);
    let source = match (given.clone(), resolved.camera_source) {
        (Some(option), _) => option,
        (None, Some(CameraSource::Exif)) if is_cropped => format!("{} of the uncropped photo", CameraSource::Exif),
        (None, source) => source.map(|source| source.to_string()).unwrap_or_default(),
    };
    let camera = bars.filter(|_| given.is_none()).and_then(|bars| bars.camera_of_picture(&resolved.camera));
    note_camera(&camera.unwrap_or(resolved.camera), &source, stages);
    Ok(resolved)
}

/// Resolves camera and depth of a photo. `files` names the inputs in errors.
pub fn resolve(
    estimator: &Estimator,
    path: &Path,
    photo: PhotoFile,
    given: &GivenLens,
    depth: DepthSource,
    files: &str,
    on_event: OnEvent<'_>,
) -> anyhow::Result<ResolvedPhoto> {
    let camera = given.camera.as_ref().map(|(camera, _)| *camera);
    let request = PhotoRequest { photo, camera, distortion: given.distortion, depth };
    estimator.resolve(request, on_event).map_err(|error| match error {
        EstimateError::Projection(projection) => projection_error(path, projection, error),
        EstimateError::Undistortion(error) => anyhow::Error::from(error).context("--distortion"),
        EstimateError::Frame(error) => anyhow::Error::from(error).context(format!("{files} cannot be used together")),
        #[cfg(feature = "depth-models")]
        EstimateError::RelativeDepth(_) => anyhow::Error::from(error).context(files.to_owned()),
        error => error.into(),
    })
}

/// Adds hints at options to an error of the estimate.
pub fn estimate_error(error: EstimateError) -> anyhow::Error {
    match error {
        EstimateError::OctreeDepth { .. } => {
            Usage(format!("--octree-depth: {error}; omit it or choose another --completion")).into()
        }
        EstimateError::PanoramaWithoutRoom => Usage(format!("--panorama: {error}; choose another --completion")).into(),
        error => error.into(),
    }
}

/// Returns the error of a photo that no pinhole camera takes, with hints at options.
fn projection_error(path: &Path, projection: SpecialProjection, error: EstimateError) -> anyhow::Error {
    let hint = match projection {
        SpecialProjection::Equirectangular | SpecialProjection::DualFisheye => " (--panorama)",
        SpecialProjection::Panorama | SpecialProjection::Fisheye => "",
    };
    let ordinary = "If it is an ordinary photo, set --hfov-deg or --intrinsics";
    anyhow::anyhow!("{}: {error}{hint}. {ordinary}", path.display())
}

/// Reads a depth map as `--depth-is` and `--depth-scale` say.
fn read_depth(args: &Args, file: &Path, stages: &mut Stages) -> anyhow::Result<DepthSource> {
    #[cfg(feature = "depth-models")]
    if matches!(args.depth_is, DepthArg::Inverse) {
        if args.depth_scale.is_some() {
            return Err(Usage("--depth-scale has no effect on inverse depth, whose scale is fitted".into()).into());
        }
        return Ok(DepthSource::Inverse(stages.stage("read depth", || imaging::read_inverse_depth(file))?));
    }
    let depth = stages.stage("read depth", || imaging::read_depth_file(file, args.depth_scale))?;
    stages.set_depth_units(DepthUnits::of(&depth));
    Ok(match args.depth_is {
        DepthArg::Measured => DepthSource::Measured(depth.depth_m),
        _ => DepthSource::Predicted(depth.depth_m),
    })
}

/// Whether depth is relative and needs the built-in network's for its scale.
fn is_relative(args: &Args) -> bool {
    match args.depth_is {
        DepthArg::Measured | DepthArg::Predicted => false,
        #[cfg(feature = "depth-models")]
        DepthArg::Inverse => true,
    }
}

/// Creates an estimator, with networks if depth or completion needs them. `is_metric`: a depth model gives metric
/// depth.
fn estimator(args: &Args, is_metric: bool, stages: &mut Stages) -> anyhow::Result<Estimator> {
    let network_completes = match args.method.completion {
        Some(completion) => completion == Completion::Network,
        // A program without weights can still complete without a network.
        None => cfg!(feature = "weights") || args.method.weights.is_some(),
    };
    if !network_completes && ((!args.depth.is_empty() && !is_relative(args)) || is_metric) {
        return match args.method.weights {
            Some(_) => {
                Err(Usage("--weights has no effect: with given depth, only --completion network uses networks".into())
                    .into())
            }
            None => Ok(Estimator::without_networks()),
        };
    }
    stages.stage("read weights", || super::estimator(args.method.weights.as_deref()))
}

fn options(global: &Global, args: &Args, files: [&[PathBuf]; 2], panorama: Option<PanoramaPrior>) -> EstimateOptions {
    let file_name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
    #[cfg(feature = "depth-models")]
    let model = args.depth_model.path();
    #[cfg(not(feature = "depth-models"))]
    let model = None;
    let inputs = files.into_iter().flatten().chain(&args.photos.poses).map(PathBuf::as_path);
    let sources = inputs.chain(model).chain(args.panorama.panorama.as_deref()).filter_map(file_name).collect();
    EstimateOptions {
        octree_depth: args.method.octree_depth,
        completion: args.method.completion,
        up: args.up,
        seed: global.seed,
        sources,
        panorama,
        ..EstimateOptions::default()
    }
}

fn note_camera(camera: &Camera, source: &str, stages: &mut Stages) {
    stages.note(&format!("horizontal field of view {:.1}° ({source})", camera.hfov_deg()));
}

fn print_result(args: &Args, scene: &Estimate, stages: &Stages) -> anyhow::Result<()> {
    let leaves = scene.light.leaves().count();
    let bytes = std::fs::metadata(&args.out.output).map_or(0, |metadata| metadata.len());
    if args.out.json {
        return report::print_json(&serde_json::json!({
            "scene": args.out.output,
            "bytes": bytes,
            "leaves": leaves,
            "seconds": stages.timings(),
        }));
    }
    report::print(&format!(
        "{}  {}, {leaves} leaves, the smallest {:.1} cm, in {}",
        args.out.output.display(),
        report::bytes(bytes),
        100.0 * scene.light.cube.node_edge_m(scene.light.octree.depth()),
        seconds(stages.total())
    ));
    Ok(())
}
