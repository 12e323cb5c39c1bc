//! `lightoctree view [SCENE|PHOTO]`: serves the viewer, a web page to move objects and edit lights.

use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use lo_imaging as imaging;
#[cfg(feature = "depth-models")]
use lo_viewer::ReadDepthModel;
use lo_viewer::{MakeEstimator, NamedFile, Options, PhotoSource, PublicOrigin, SceneSource};

#[cfg(feature = "depth-models")]
use super::depth_model::DepthModelArgs;
use super::token::TokenArgs;
use super::{parse, samples, state_folder};
use crate::args::Global;
use crate::usage::Usage;
use crate::warning_text::warning_text;
use crate::{interrupt, report};

/// Options of `view`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree view room.scene --open\n  \
    lightoctree view photo.jpg\n  \
    lightoctree view photo.jpg --depth depth.png\n  \
    lightoctree view photo.jpg --depth-model moge-2-vits-normal.onnx\n  \
    lightoctree view\n  \
    lightoctree view room.scene --bind 0.0.0.0 --port 8080\n  \
    lightoctree view room.scene --port 8080 --public-origin https://light.example\n\n\
    The page is served until Ctrl-C, only to this machine, at an address with a random token. docs/viewer.md describes it.")]
pub struct Args {
    /// Scene file, or photo to estimate [default: dropped into the page]
    input: Option<PathBuf>,

    /// Measured depth of the photo: 16-bit PNG in millimetres, or EXR, PFM, TIFF, NPY in metres
    #[arg(long, value_name = "FILE", requires = "input")]
    #[cfg_attr(feature = "depth-models", arg(conflicts_with = "depth_model"))]
    depth: Option<PathBuf>,

    #[cfg(feature = "depth-models")]
    #[command(flatten)]
    depth_model: DepthModelArgs,

    /// Equirectangular panorama of the room, which lights unobserved regions
    #[arg(long, value_name = "FILE", requires = "input")]
    panorama: Option<PathBuf>,

    /// Focal lengths and principal point in pixels of the photo [default: from EXIF, else estimated from the photo]
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = parse::intrinsics, allow_hyphen_values = true, requires = "input")]
    intrinsics: Option<[f64; 4]>,

    /// Open the page in the browser
    #[arg(long)]
    open: bool,

    /// Port [default: a free one]
    #[arg(long, value_name = "N")]
    port: Option<u16>,

    /// IP address to listen on, 0.0.0.0 for all; anyone who can reach it and has the token can use the page [default:
    /// this machine only]
    #[arg(long, value_name = "ADDRESS")]
    bind: Option<IpAddr>,

    /// Origin under which browsers reach the page, of a TLS proxy or a host name: scheme and host
    #[arg(long, value_name = "URL")]
    public_origin: Option<PublicOrigin>,

    #[command(flatten)]
    token: TokenArgs,

    /// Folder in which open rooms are saved automatically, and listed on the page [default: lightoctree/recent in the
    /// user's folder for application state]
    #[arg(long, value_name = "DIR", conflicts_with = "no_recent")]
    recent: Option<PathBuf>,

    /// Do not save open rooms automatically
    #[arg(long)]
    no_recent: bool,
}

/// Warning about `--bind` without a TLS proxy.
const NOT_ENCRYPTED: &str = "nothing is encrypted: anyone who sees the network traffic can read the address with its \
    token, the photo and all files, and take over the page; use a TLS proxy with --public-origin, or ssh -L (docs/viewer.md)";

/// Serves the page until Ctrl-C.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    let estimator: Option<MakeEstimator> = cfg!(feature = "weights")
        .then(|| Arc::new(|| super::estimator(None).map_err(|error| format!("{error:#}"))) as MakeEstimator);
    if args.input.is_none() && has_depth_model(args) {
        let message = "--depth-model needs a photo on the command line; without one, drop the model into the page";
        return Err(Usage(message.into()).into());
    }
    let source = args.input.as_deref().map(|input| source(input, args, estimator.as_ref())).transpose()?;
    let options = Options {
        bind: args.bind.unwrap_or(Options::LOOPBACK),
        port: args.port.unwrap_or(0),
        token: args.token.token()?,
        warning_text,
        public_origin: args.public_origin.clone(),
        estimator,
        source,
        samples: samples::SAMPLES.to_vec(),
        recent: if args.no_recent { None } else { args.recent.clone().or_else(state_folder::recent_rooms) },
    };
    let (open, quiet) = (args.open, global.quiet);
    let is_encrypted = args.public_origin.as_ref().is_some_and(PublicOrigin::is_https);
    let is_exposed = !options.bind.is_loopback() && !is_encrypted;
    let ready = move |address: &str| {
        report::print(address);
        if is_exposed {
            eprintln!("  warning: {NOT_ENCRYPTED}");
        }
        if !quiet {
            eprintln!("  note: press Ctrl-C to stop the viewer");
        }
        if open && let Err(error) = open_in_browser(address) {
            eprintln!("  note: cannot open a browser: {error}");
        }
    };
    Ok(lo_viewer::run(options, ready, interrupt::requested)?)
}

/// Reads the scene or photo to open. Scenes are recognised by their content.
fn source(input: &Path, args: &Args, estimator: Option<&MakeEstimator>) -> anyhow::Result<SceneSource> {
    let bytes = read(input)?;
    if is_scene(&bytes) {
        let has_photo_options =
            args.depth.is_some() || has_depth_model(args) || args.panorama.is_some() || args.intrinsics.is_some();
        if has_photo_options {
            let message =
                "--depth, --depth-model, --panorama and --intrinsics apply to photos, but the input is a scene";
            return Err(Usage(message.into()).into());
        }
        return Ok(SceneSource::Scene { file: input.display().to_string(), bytes, is_saved: true });
    }
    let Some(estimator) = estimator else {
        return Err(Usage(
            "this program was built without weights (feature `weights`) and cannot estimate photos; open a scene"
                .into(),
        )
        .into());
    };
    let file = |path: &Path, bytes: Vec<u8>| NamedFile {
        name: path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned()),
        bytes,
    };
    let optional = |path: &Option<PathBuf>| {
        path.as_deref().map(|path| Ok::<_, anyhow::Error>(file(path, read(path)?))).transpose()
    };
    Ok(SceneSource::Photo(PhotoSource {
        photo: file(input, bytes),
        depth: optional(&args.depth)?,
        #[cfg(feature = "depth-models")]
        depth_model: depth_model(&args.depth_model),
        panorama: optional(&args.panorama)?,
        intrinsics: args.intrinsics,
        estimator: estimator.clone(),
    }))
}

#[cfg(feature = "depth-models")]
fn has_depth_model(args: &Args) -> bool {
    args.depth_model.path().is_some()
}

#[cfg(not(feature = "depth-models"))]
fn has_depth_model(_: &Args) -> bool {
    false
}

/// Returns name and reader of the model, if one is given.
#[cfg(feature = "depth-models")]
fn depth_model(args: &DepthModelArgs) -> Option<(String, ReadDepthModel)> {
    let (args, path) = (args.clone(), args.path()?.to_owned());
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Some((name, Box::new(move || args.model(&path).map_err(|error| format!("{error:#}")))))
}

fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    imaging::read_regular_file(path, MAX_FILE_BYTES).with_context(|| format!("cannot read {}", path.display()))
}

/// Longest scene, photo and panorama, bytes.
const MAX_FILE_BYTES: u64 = 1 << 33;

/// Whether a file is in safetensors format: 8 bytes of length, then a JSON object.
fn is_scene(bytes: &[u8]) -> bool {
    bytes.get(8) == Some(&b'{')
}

fn open_in_browser(address: &str) -> std::io::Result<()> {
    let mut command = if cfg!(target_os = "macos") {
        std::process::Command::new("open")
    } else if cfg!(windows) {
        let mut command = std::process::Command::new("cmd");
        command.args(["/C", "start", ""]);
        command
    } else {
        std::process::Command::new("xdg-open")
    };
    command.arg(address).spawn().map(|_| ())
}
