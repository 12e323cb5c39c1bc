//! What `envmap` and `probes` share, rendering a panorama, and both with `unwrap`: writing it.

use std::path::Path;

use anyhow::Context;
use lightoctree::cone::Rendering;
use lightoctree::geometry::{Orientation, Vec3};
use lightoctree::imaging::{self, EnvironmentLayout, ExrOptions, RadianceImage, ToneCurve};
use lightoctree::{LitScene, SceneRenderer};

use super::level::{Level, LevelArgs};
use crate::choice::{Choice, choice, name_of};
use crate::output::signature;

/// Conventions of programs for equirectangular maps.
pub static ORIENTATIONS: [Choice<Orientation>; 4] = [
    ("lightoctree", Orientation::Lightoctree, "Centre −Z, +X right (also skylibs)"),
    ("openexr", Orientation::Openexr, "OpenEXR latitude-longitude, Mitsuba, USD dome light"),
    ("threejs", Orientation::Threejs, "three.js"),
    ("blender", Orientation::Blender, "Blender Cycles"),
];

/// Tone curves of previews.
static TONE_CURVES: [Choice<ToneCurve>; 3] = [
    ("clip", ToneCurve::Clip, "Clipped at the photo's white"),
    ("reinhard", ToneCurve::Reinhard, "Reinhard, white two stops above"),
    ("aces", ToneCurve::Aces, "ACES fit"),
];

/// Options of the panorama itself.
#[derive(Clone, Debug, clap::Args)]
pub struct PanoramaArgs {
    /// Width and height; equirectangular maps are twice as wide as high
    #[arg(long, value_name = "WxH", default_value = "512x256", value_parser = super::parse::size)]
    pub size: [usize; 2],

    /// The frame.
    #[command(flatten)]
    pub level: LevelArgs,

    /// The file.
    #[command(flatten)]
    pub file: PanoramaFileArgs,
}

/// How a panorama is written.
#[derive(Clone, Debug, clap::Args)]
pub struct PanoramaFileArgs {
    /// Which program's convention the map follows
    #[arg(long, value_name = "NAME", default_value = "lightoctree", value_parser = choice(&ORIENTATIONS))]
    pub orientation: Orientation,

    /// Write EXR as 16-bit half instead of 32-bit float
    #[arg(long)]
    pub half: bool,

    /// Also write a tone-mapped PNG beside the panorama
    #[arg(long)]
    pub preview: bool,

    /// Tone curve of the preview
    #[arg(long, value_name = "CURVE", default_value = "reinhard", requires = "preview", value_parser = choice(&TONE_CURVES))]
    pub tone: ToneCurve,

    /// Exposure of the preview in stops
    #[arg(long, value_name = "EV", default_value_t = 0.0, requires = "preview", allow_hyphen_values = true)]
    pub preview_ev: f32,
}

/// The scene, made ready for panoramas.
pub struct Renderer {
    viewers: SceneRenderer,
    height: usize,
}

impl Renderer {
    /// # Errors
    /// A size that is no equirectangular map's.
    pub fn new(scene: &LitScene, size: [usize; 2]) -> anyhow::Result<Self> {
        Ok(Self { viewers: SceneRenderer::new(scene), height: height(size)? })
    }

    /// Adds the photo's detail where nothing was seen.
    pub fn with_detail(self, scene: &LitScene) -> Self {
        Self { viewers: self.viewers.with_detail(scene), ..self }
    }

    /// The panorama at `point`, in our own orientation.
    pub fn at(&self, point: Vec3) -> Rendering {
        self.viewers.panorama(point, 2 * self.height, self.height)
    }
}

/// Of an equirectangular map of this width and height.
pub fn height([width, height]: [usize; 2]) -> anyhow::Result<usize> {
    if width != 2 * height {
        let text = format!("--size {width}x{height}: an equirectangular map is twice as wide as high");
        return Err(crate::usage::Usage(text).into());
    }
    Ok(height)
}

/// Whether a point lies inside of a surface's leaf or outside of the cube; both give a panorama, but hardly the one wanted.
pub fn odd_place(scene: &LitScene, point: Vec3) -> Option<&'static str> {
    let light = &scene.light;
    if !light.cube.contains(point) {
        return Some("outside of the octree's cube");
    }
    let (depth, node) = light.locate(point, light.octree.depth())?;
    light.octree.levels()[depth as usize].rows[node].ge(&0).then_some("inside of a surface")
}

/// Writes the panorama of a command in the wanted orientation and, on request, its preview. `at` is where in the scene it was made, and
/// in which frame.
pub fn write(
    path: &Path,
    radiance: &RadianceImage,
    at: Option<(Vec3, &Level)>,
    args: &PanoramaFileArgs,
    command: &str,
) -> anyhow::Result<()> {
    let turned = imaging::reorient(radiance, Orientation::Lightoctree, args.orientation);
    imaging::write_radiance(path, &turned, &exr_options(args, at, EnvironmentLayout::LatitudeLongitude, command))?;
    if args.preview {
        imaging::write_tone_mapped(preview_path(path), &turned, args.tone, args.preview_ev, &signature(command))?;
    }
    Ok(())
}

/// Attributes of an EXR environment map.
pub fn exr_options(
    args: &PanoramaFileArgs,
    at: Option<(Vec3, &Level)>,
    layout: EnvironmentLayout,
    command: &str,
) -> ExrOptions {
    let place = at.into_iter().flat_map(|(at, level)| {
        let at = level.point(at);
        let position = ("lightoctree.position_m".into(), format!("{} {} {}", at.x, at.y, at.z));
        level.metadata().into_iter().chain([position])
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
        metadata: place.chain(others).collect(),
        ..ExrOptions::default()
    }
}

/// `room.exr` → `room.png`.
pub fn preview_path(path: &Path) -> std::path::PathBuf {
    path.with_extension("png")
}

/// Writes a value as readable JSON that names this program.
pub fn write_json(path: &Path, command: &str, value: serde_json::Value) -> anyhow::Result<()> {
    let text = format!("{:#}", signed(command, value));
    imaging::write_atomically(path, |out| std::io::Write::write_all(out, text.as_bytes()))
        .with_context(|| format!("cannot write {}", path.display()))
}

/// An object that names the command that made it.
pub fn signed(command: &str, value: serde_json::Value) -> serde_json::Value {
    let mut object = serde_json::Map::new();
    object.insert("generator".into(), signature(command).into());
    if let serde_json::Value::Object(fields) = value {
        object.extend(fields);
    }
    object.into()
}
