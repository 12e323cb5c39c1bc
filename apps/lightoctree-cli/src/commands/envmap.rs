//! `lightoctree envmap SCENE`: renders the HDR environment map at a point.

use std::path::{Path, PathBuf};

use lightoctree::{Document, LightPurpose};
use lo_cone::Rendering;
use lo_geometry::{Orientation, Vec3, is_position};
use lo_imaging as imaging;
use lo_imaging::{EnvironmentLayout, RadianceImage};
use lo_insert as insert;
use lo_lights::{LightEstimate, LightLayout};
use serde_json::json;

use super::environment::{self, EnvironmentArgs, PanoramaRenderer};
use super::level::OutputFrame;
use super::light::LightArgs;
use super::parse;
use crate::args::{Global, OutputArgs};
use crate::progress::Stages;
use crate::usage::Usage;
use crate::{output, report};

/// Options of `envmap`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree envmap room.scene --at 0,-0.5,-2 -o room.exr --preview\n  \
    lightoctree envmap room.scene --pixel 960,1100 --lift 0.2 --orientation blender --sh9 sh.json --main-light sun.json -o light.hdr\n  \
    lightoctree envmap room.scene --pixel 960,1100 --level -o light.exr\n  \
    lightoctree envmap room.scene --at 0,-0.5,-2 --cubemap --orientation unity --light-estimate unity:light.json -o light.hdr")]
#[command(group(clap::ArgGroup::new("place").required(true).args(["at", "pixel"])))]
#[command(mut_arg("output", |output| output.help("Environment map to write: .exr, .hdr or .pfm")))]
pub struct Args {
    /// Scene file
    scene: PathBuf,

    /// Position in metres: +X right, +Y up, the camera at 0,0,0 looks along -Z
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true)]
    at: Option<Vec3>,

    #[command(flatten)]
    light: LightArgs,

    /// Render only reflected light, without lamps, windows and added lights, to relight the scene with your own lights
    #[arg(long, conflicts_with_all = ["light", "lamp", "no_lamp", "contrast", "warmth", "white"])]
    without_emitters: bool,

    /// Add texture from the photo to unobserved surfaces; does not affect --sh9 and --main-light
    #[arg(long)]
    detail: bool,

    /// Position above the surface at this pixel of the photo; see --lift
    #[arg(long, value_name = "U,V", value_parser = parse::pixel, allow_hyphen_values = true)]
    pixel: Option<[f64; 2]>,

    /// Distance from the surface at --pixel, in metres [default: 0.1, more where that is inside of the octree's leaves]
    #[arg(long, value_name = "METRES", value_parser = parse::positive, allow_hyphen_values = true, conflicts_with = "at")]
    lift: Option<f64>,

    #[command(flatten)]
    panorama: EnvironmentArgs,

    /// Write a cubemap instead of an equirectangular map: six faces of H/2 pixels, stacked in OpenEXR's order, +X -X +Y
    /// -Y +Z -Z
    #[arg(long)]
    cubemap: bool,

    /// Also write distances: .exr, .pfm or .npy in metres, or .png in millimetres
    #[arg(long, value_name = "FILE")]
    depth_out: Option<PathBuf>,

    /// Also write nine spherical-harmonics coefficients per channel, in the camera's frame or, with --level, the level
    /// one
    #[arg(long, value_name = "FILE.json")]
    sh9: Option<PathBuf>,

    /// Also write direction, solid angle, colour and power of the main light, in the axes of the program of
    /// --orientation
    #[arg(long, value_name = "FILE.json")]
    main_light: Option<PathBuf>,

    /// Also write the light in the layout of an AR framework or engine: webxr, arkit or unity; may be repeated
    #[arg(long, value_name = "LAYOUT:FILE.json", value_parser = light_layout)]
    light_estimate: Vec<(LightLayout, PathBuf)>,

    #[command(flatten)]
    out: OutputArgs,
}

const COMMAND: &str = "envmap";

/// Parses `LAYOUT:FILE`.
fn light_layout(text: &str) -> Result<(LightLayout, PathBuf), String> {
    let named = text.split_once(':').filter(|(_, file)| !file.is_empty());
    named
        .and_then(|(name, file)| Some((LightLayout::ALL.iter().find(|(known, _)| *known == name)?.1, file.into())))
        .ok_or_else(|| "must be webxr:FILE.json, arkit:FILE.json or unity:FILE.json".into())
}

/// Renders the environment map and writes it.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    let preview = args.panorama.file.preview.then(|| environment::preview_path(&args.out.output));
    let outputs = [
        (Some(&args.out.output), output::RADIANCE),
        (preview.as_ref(), &[]),
        (args.depth_out.as_ref(), output::DEPTH),
        (args.sh9.as_ref(), output::JSON),
        (args.main_light.as_ref(), output::JSON),
    ];
    let estimates = args.light_estimate.iter().map(|(_, path)| (Some(path), output::JSON));
    let outputs: Vec<(&Path, &[&str])> = outputs
        .into_iter()
        .chain(estimates)
        .filter_map(|(path, extensions)| Some((path?.as_path(), extensions)))
        .collect();
    output::check_outputs(&outputs, COMMAND, args.out.force)?;
    let mut stages = Stages::new(global.quiet);
    let mut document = stages.stage("read scene", || Document::read(&args.scene))?;
    let purpose = if args.without_emitters { LightPurpose::IndirectOnly } else { LightPurpose::Panorama };
    let scene = args.light.lit(&mut document, purpose, &mut stages)?;
    let at = match (args.at, args.pixel) {
        (Some(at), _) => at,
        (None, Some([u, v])) => {
            let (point, normal) = insert::surface_at_pixel(&scene, u, v)?;
            let lift = args.lift.unwrap_or_else(|| environment::free_lift(&scene, point, normal));
            if args.lift.is_none() && lift > environment::LIFT_M {
                stages.note(&format!(
                    "{lift:.2} m from the surface: leaves reach that far; set the distance with --lift"
                ));
            }
            point + normal * lift as f32
        }
        (None, None) => return Err(Usage("give the position with --at X,Y,Z or --pixel U,V".into()).into()),
    };
    if !is_position(at) {
        return Err(Usage("--lift places the map more than 10 km away".into()).into());
    }
    if let Some(position) = environment::unusual_position(&scene, at) {
        stages.note(&format!("({}, {}, {}) is {position}", at.x, at.y, at.z));
    }
    let frame = OutputFrame::new(&scene, args.panorama.frame)?;
    let height = environment::height(args.panorama.size)?;
    let rendered_height = frame.rendered_height(height);
    let renderer = PanoramaRenderer::new(&scene, [2 * rendered_height, rendered_height])?;
    let panorama = stages.stage("panorama", || frame.panorama(renderer.at(at), height));
    let detailed = args
        .detail
        .then(|| stages.stage("detail", || frame.panorama(renderer.with_detail(&scene).at(at), height).radiance));
    stages.stage("write", || write(args, at, &frame, &panorama, detailed.as_ref().unwrap_or(&panorama.radiance)))?;
    if args.out.json {
        return report::print_json(&json!({
            "position_m": frame.point(at).to_array(),
            "camera": frame.camera(),
            "files": outputs.iter().map(|(path, _)| path).collect::<Vec<_>>(),
            "seconds": stages.timings(),
        }));
    }
    outputs.iter().for_each(|(path, _)| report::print(&path.display().to_string()));
    Ok(())
}

/// Writes `shown` as the environment map. Distances, coefficients and the main light are those of `panorama`.
fn write(
    args: &Args,
    at: Vec3,
    frame: &OutputFrame,
    panorama: &Rendering,
    shown: &RadianceImage,
) -> anyhow::Result<()> {
    if args.cubemap {
        let (orientation, size) = (args.panorama.file.orientation, args.panorama.size[1] / 2);
        let cube = if orientation == Orientation::Unity {
            imaging::cubemap_from_equirectangular(shown, size).left_handed()
        } else {
            imaging::cubemap_from_equirectangular(
                &imaging::reorient(shown, Orientation::Lightoctree, orientation),
                size,
            )
        };
        let options =
            environment::exr_options(&args.panorama.file, Some((at, frame)), EnvironmentLayout::Cube, COMMAND);
        let strip = cube.strip();
        imaging::write_radiance(&args.out.output, &strip, &options)?;
        environment::write_preview(&args.out.output, &strip, &args.panorama.file, COMMAND)?;
    } else {
        environment::write(&args.out.output, shown, Some((at, frame)), &args.panorama.file, COMMAND)?;
    }
    if let Some(path) = &args.depth_out {
        imaging::write_depth(path, &panorama.distance_m, &output::signature(COMMAND))?;
    }
    let position_m = frame.point(at).to_array();
    if let Some(path) = &args.sh9 {
        let sh = imaging::Sh9::project(&panorama.radiance);
        environment::write_json(
            path,
            COMMAND,
            json!({ "position_m": position_m, "camera": frame.camera(), "sh9": sh }),
        )?;
    }
    if let Some(path) = &args.main_light {
        let orientation = args.panorama.file.orientation;
        let mut light = imaging::main_light(&panorama.radiance);
        if let Some(light) = &mut light {
            light.direction = (orientation.program_from_world() * Vec3::from(light.direction)).to_array();
        }
        let value = json!({
            "position_m": position_m, "camera": frame.camera(), "axes": orientation.axes(), "main_light": light,
        });
        environment::write_json(path, COMMAND, value)?;
    }
    if args.light_estimate.is_empty() {
        return Ok(());
    }
    let estimate = LightEstimate::of(&panorama.radiance);
    for (layout, path) in &args.light_estimate {
        let value = serde_json::to_value(estimate.in_layout(*layout))?;
        environment::write_json(path, COMMAND, value)?;
    }
    Ok(())
}
