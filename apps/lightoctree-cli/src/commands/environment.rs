//! Renders panoramas for `envmap`, `probes` and `export`, and writes them, also for `unwrap`.

use std::path::Path;

use anyhow::Context;
use lightoctree::{LitScene, SceneRenderer};
use lo_cone::Rendering;
use lo_geometry::{Orientation, Vec3};
use lo_imaging as imaging;
use lo_imaging::{EnvironmentLayout, ExrOptions, RadianceImage, ToneCurve};

use super::level::{LevelArgs, OutputFrame};
use crate::choice::{Choice, choice, name_of};
use crate::output::signature;

/// Orientations of equirectangular maps, named after programs that use them.
pub static ORIENTATIONS: [Choice<Orientation>; 5] = [
    ("lightoctree", Orientation::Lightoctree, "Centre −Z, +X right (also skylibs)"),
    ("openexr", Orientation::Openexr, "OpenEXR latitude-longitude, Mitsuba, USD dome light"),
    ("threejs", Orientation::Threejs, "three.js"),
    ("blender", Orientation::Blender, "Blender Cycles"),
    ("unity", Orientation::Unity, "Unity, Skybox/Panoramic"),
];

/// Tone curves for previews.
static TONE_CURVES: [Choice<ToneCurve>; 3] = [
    ("clip", ToneCurve::Clip, "Clip at the photo's white"),
    ("reinhard", ToneCurve::Reinhard, "Reinhard with white two stops above the photo's"),
    ("aces", ToneCurve::Aces, "ACES fit"),
];

/// Options of a rendered panorama.
#[derive(Clone, Debug, clap::Args)]
pub struct EnvironmentArgs {
    /// Width and height in pixels; the width is twice the height
    #[arg(long, value_name = "WxH", default_value = "512x256", value_parser = super::parse::size)]
    pub size: [usize; 2],

    /// Frame of the output.
    #[command(flatten)]
    pub frame: LevelArgs,

    /// Format of the file.
    #[command(flatten)]
    pub file: PanoramaFileArgs,
}

/// Options of writing a panorama.
#[derive(Clone, Debug, clap::Args)]
pub struct PanoramaFileArgs {
    /// Orientation of the map, named after a program that uses it
    #[arg(long, value_name = "NAME", default_value = "lightoctree", value_parser = choice(&ORIENTATIONS))]
    pub orientation: Orientation,

    /// Write EXR with 16-bit half floats instead of 32-bit floats
    #[arg(long)]
    pub half: bool,

    /// Also write a tone-mapped PNG next to the output file
    #[arg(long)]
    pub preview: bool,

    /// Tone curve of the preview
    #[arg(long, value_name = "CURVE", default_value = "reinhard", requires = "preview", value_parser = choice(&TONE_CURVES))]
    pub tone: ToneCurve,

    /// Exposure of the preview, in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, requires = "preview", allow_hyphen_values = true)]
    pub preview_ev: f32,
}

/// Renders panoramas of one size.
pub struct PanoramaRenderer {
    scene: SceneRenderer,
    height: usize,
}

impl PanoramaRenderer {
    /// Prepares a scene for panoramas of `size` pixels.
    ///
    /// # Errors
    /// The width is not twice the height.
    pub fn new(scene: &LitScene, size: [usize; 2]) -> anyhow::Result<Self> {
        Ok(Self { scene: SceneRenderer::new(scene), height: height(size)? })
    }

    /// Adds texture synthesized from the photo to unobserved surfaces.
    pub fn with_detail(self, scene: &LitScene) -> Self {
        Self { scene: self.scene.with_detail(scene), ..self }
    }

    /// Renders the panorama at `point`, in metres in the camera's frame, with [`Orientation::Lightoctree`].
    pub fn at(&self, point: Vec3) -> Rendering {
        self.scene.panorama(point, 2 * self.height, self.height)
    }
}

/// Returns the height of an equirectangular map.
///
/// # Errors
/// The width is not twice the height.
pub fn height([width, height]: [usize; 2]) -> anyhow::Result<usize> {
    if width != 2 * height {
        let text = format!("--size {width}x{height}: the width of an equirectangular map must be twice its height");
        return Err(crate::usage::Usage(text).into());
    }
    Ok(height)
}

/// Default distance of a panorama from the surface at a pixel, in metres.
pub const LIFT_M: f64 = 0.1;

/// Greatest distance to which it is raised, in metres.
const MAX_LIFT_M: f64 = 1.0;

/// Returns the least distance from a surface, of at least [`LIFT_M`], at which a panorama is outside of the octree's
/// leaves; [`LIFT_M`] if that is too far.
pub fn free_lift(scene: &LitScene, surface: Vec3, normal: Vec3) -> f64 {
    let step = f64::from(scene.light.cube.node_edge_m(scene.light.octree.depth())) / 4.0;
    let steps = ((MAX_LIFT_M - LIFT_M) / step) as u32;
    let lifts = (0..=steps).map(|index| LIFT_M + f64::from(index) * step);
    let is_free = |lift: &f64| unusual_position(scene, surface + normal * *lift as f32).is_none();
    lifts.into_iter().find(is_free).unwrap_or(LIFT_M)
}

/// Describes a position at which a panorama is rarely useful: inside a surface's leaf, or outside the cube.
pub fn unusual_position(scene: &LitScene, point: Vec3) -> Option<&'static str> {
    let light = &scene.light;
    if !light.cube.contains(point) {
        return Some("outside of the octree's cube");
    }
    let (depth, node) = light.locate(point, light.octree.depth())?;
    light.octree.levels()[depth as usize].rows[node].ge(&0).then_some("inside of a surface")
}

/// Writes the panorama of a command with the requested orientation and, if requested, its preview.
///
/// `at` is the position at which it was rendered, and the frame of the output.
pub fn write(
    path: &Path,
    radiance: &RadianceImage,
    at: Option<(Vec3, &OutputFrame)>,
    args: &PanoramaFileArgs,
    command: &str,
) -> anyhow::Result<()> {
    let turned = imaging::reorient(radiance, Orientation::Lightoctree, args.orientation);
    imaging::write_radiance(path, &turned, &exr_options(args, at, EnvironmentLayout::LatitudeLongitude, command))?;
    write_preview(path, &turned, args, command)
}

/// Writes the preview of an image beside it, if it is requested.
pub fn write_preview(
    path: &Path,
    radiance: &RadianceImage,
    args: &PanoramaFileArgs,
    command: &str,
) -> anyhow::Result<()> {
    if args.preview {
        imaging::write_tone_mapped(preview_path(path), radiance, args.tone, args.preview_ev, &signature(command))?;
    }
    Ok(())
}

/// Returns the attributes of an EXR environment map.
pub fn exr_options(
    args: &PanoramaFileArgs,
    at: Option<(Vec3, &OutputFrame)>,
    layout: EnvironmentLayout,
    command: &str,
) -> ExrOptions {
    let position = at.into_iter().flat_map(|(at, frame)| {
        let at = frame.point(at);
        let position = ("lightoctree.position_m".into(), format!("{} {} {}", at.x, at.y, at.z));
        frame.metadata().into_iter().chain([position])
    });
    let orientation = name_of(&ORIENTATIONS, args.orientation).to_owned();
    let others = [
        ("lightoctree.orientation".into(), orientation),
        ("lightoctree.units".into(), "linear Rec. 709; 1 is the photo's white".into()),
    ];
    ExrOptions {
        generator: signature(command),
        half: args.half,
        environment: Some(layout),
        metadata: position.chain(others).collect(),
        ..ExrOptions::default()
    }
}

/// Returns the path of a preview: `room.exr` → `room.png`.
pub fn preview_path(path: &Path) -> std::path::PathBuf {
    path.with_extension("png")
}

/// Writes an object as indented JSON with the signature of a command.
pub fn write_json(path: &Path, command: &str, value: serde_json::Value) -> anyhow::Result<()> {
    let text = format!("{:#}", signed(command, value));
    imaging::write_atomically(path, |out| std::io::Write::write_all(out, text.as_bytes()))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Adds the signature of a command to an object, as its first field `generator`.
pub fn signed(command: &str, value: serde_json::Value) -> serde_json::Value {
    let mut object = serde_json::Map::new();
    object.insert("generator".into(), signature(command).into());
    if let serde_json::Value::Object(fields) = value {
        object.extend(fields);
    }
    object.into()
}
