//! `lightoctree estimate PHOTO`: photo and depth → scene file.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::ValueEnum;
use lightoctree::EstimateOptions;
use lightoctree::geometry::{Camera, Vec3};
use lightoctree::imaging;
use lightoctree::scene::{Completion, Frame, Scene};

use super::parse;
use crate::args::{Global, OutputArgs};
use crate::progress::{Stages, seconds};
use crate::{Usage, output, report};

/// Options of `estimate`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree estimate photo.jpg --depth lidar.png -o room.scene\n  \
    lightoctree estimate kinect.png --depth kinect_depth.png --depth-scale 5000 --intrinsics 525,525,319.5,239.5 -o desk.scene")]
#[command(mut_arg("output", |output| output.help("The scene file to write").value_name("SCENE")))]
pub struct Args {
    /// The photo: PNG, JPEG, WebP, TIFF, BMP, PNM (sRGB) or HDR, EXR, PFM (linear)
    photo: PathBuf,

    /// Measured depth of the same view, any resolution: 16-bit PNG, or EXR, PFM, TIFF, NPY in metres
    #[arg(long, value_name = "FILE")]
    depth: Option<PathBuf>,

    /// What one metre is in an integer depth file [default: 1000, millimetres]
    #[arg(long, value_name = "UNITS_PER_METRE", requires = "depth", value_parser = parse::positive)]
    depth_scale: Option<f64>,

    /// Focal lengths and principal point in pixels of the photo [default: from EXIF, else 65 degrees across]
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = parse::intrinsics, conflicts_with = "hfov_deg")]
    intrinsics: Option<[f64; 4]>,

    /// Horizontal field of view in degrees, instead of intrinsics
    #[arg(long, value_name = "A")]
    hfov_deg: Option<f64>,

    /// Depth of the octree: 7 gives leaves of 1/128 of the cube
    #[arg(long, value_name = "D", default_value_t = 7, value_parser = clap::value_parser!(u32).range(5..=9))]
    octree_depth: u32,

    /// How the unseen part of the room is filled
    #[arg(long, value_name = "HOW", default_value = "shell")]
    completion: CompletionArg,

    /// The scene's upward direction [default: from the floor]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true)]
    up: Option<Vec3>,

    #[command(flatten)]
    out: OutputArgs,
}

/// How the unseen part of the room is filled.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum CompletionArg {
    /// By the networks (no weights are shipped yet)
    Network,
    /// By planes fitted to what is seen, with extrapolated radiance
    Shell,
    /// Not at all: what the photo saw, and nothing else
    None,
}

/// Reads, estimates, writes.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    let completion = match args.completion {
        CompletionArg::Network => {
            return Err(Usage(
                "--completion network needs trained weights, and this version ships none; \
                 `shell` (the default) closes the room without a network"
                    .into(),
            )
            .into());
        }
        CompletionArg::Shell => Completion::Shell,
        CompletionArg::None => Completion::None,
    };
    let Some(depth_path) = &args.depth else {
        return Err(Usage(format!(
            "{} comes without depth, and this version has no network to predict it: give --depth FILE.\n\
             Depth can come from a phone's LiDAR (ARKit, Record3D), an RGB-D camera (Kinect, RealSense, Azure), or a monocular network such as\n\
             Depth Anything run elsewhere: a 16-bit PNG in millimetres, or EXR, PFM, TIFF or NPY in metres, of the same view at any resolution.",
            args.photo.display()
        ))
        .into());
    };
    output::check_replaceable(&args.out.output, "estimate", args.out.force)?;
    let mut stages = Stages::new(global.quiet);
    let (photo, depth_m) = stages.stage("read photo and depth", || -> anyhow::Result<_> {
        let photo = imaging::read_photo(&args.photo)?;
        let depth_m = imaging::read_depth(depth_path, args.depth_scale)?;
        Ok((photo, depth_m))
    })?;
    let camera = camera(args, &photo, &mut stages)?;
    let frame = Frame::new(photo.photo, depth_m, camera, 1.0)
        .with_context(|| format!("{} and {} do not fit together", args.photo.display(), depth_path.display()))?;
    let file_name = |path: &Path| path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let options = EstimateOptions {
        octree_depth: args.octree_depth,
        completion,
        up: args.up,
        sources: vec![file_name(&args.photo), file_name(depth_path)],
        ..EstimateOptions::default()
    };
    let scene = lightoctree::estimate(frame, &options, &mut |message| stages.hear(message))?;
    stages.stage("write", || scene.write(&args.out.output))?;
    say(args, &scene, &stages)
}

/// The camera by the best source at hand; says which.
fn camera(args: &Args, photo: &imaging::PhotoFile, stages: &mut Stages) -> anyhow::Result<Camera> {
    let (width, height) = (photo.photo.width() as u32, photo.photo.height() as u32);
    let (camera, source) = if let Some([fx, fy, cx, cy]) = args.intrinsics {
        let camera = Camera::new(fx, fy, cx, cy, width, height);
        (camera.map_err(|error| Usage(format!("--intrinsics: {error}")))?, "--intrinsics".to_owned())
    } else if let Some(hfov_deg) = args.hfov_deg {
        let camera = Camera::from_hfov_deg(hfov_deg, width, height);
        (camera.map_err(|error| Usage(format!("--hfov-deg: {error}")))?, "--hfov-deg".to_owned())
    } else {
        let (camera, source) = lightoctree::camera_of_photo(photo)?;
        (camera, source.to_string())
    };
    stages.note(&format!("camera of {:.1} degrees across ({source})", camera.hfov_deg()));
    Ok(camera)
}

fn say(args: &Args, scene: &Scene, stages: &Stages) -> anyhow::Result<()> {
    let leaves = scene.light.rgba.last().map_or(0, Vec::len);
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
        "{}  {}, {leaves} leaves of {:.1} cm, in {}",
        args.out.output.display(),
        report::bytes(bytes),
        100.0 * scene.light.cube.node_edge_m(args.octree_depth),
        seconds(stages.total())
    ));
    Ok(())
}
