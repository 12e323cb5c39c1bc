//! `lightoctree unwrap PHOTO…`: converts photos of a mirror ball to an HDR panorama.

use std::path::{Path, PathBuf};

use anyhow::Context;
use lo_geometry::{Camera, Orientation};
use lo_imaging as imaging;
use lo_imaging::{Image, Photo, PhotoFile};
use lo_mirror_ball::{self, BallCircle, BallDetection, BallError, BallLens, BallView, UnwrapOptions, UnwrappedBall};
use serde_json::json;

use super::environment::{self, PanoramaFileArgs};
use super::parse;
use crate::args::{Global, OutputArgs};
use crate::progress::{Stages, seconds};
use crate::usage::Usage;
use crate::{output, report};

/// Options of `unwrap`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    lightoctree unwrap ball.jpg -o room.hdr --preview\n  \
    lightoctree unwrap ball_1.jpg ball_2.jpg ball_3.jpg --exposures 0,-3,-6 --reflectance 0.55 -o room.exr\n  \
    lightoctree unwrap ball.tif --distance-m 1.5 --diameter-m 0.2 --circle 1204,980,612 -o room.hdr\n\n\
    The panorama's centre is the viewing direction of the camera. The region hidden by the ball is filled from its\n\
    surroundings. Use the panorama with `lightoctree estimate photo.jpg --panorama room.hdr`.")]
#[command(mut_arg("output", |output| output.help("Panorama to write: .exr, .hdr or .pfm")))]
pub struct Args {
    /// Photos of the ball from one position at different exposures: JPEG, HEIC, JPEG XL, PNG, TIFF, WebP, BMP, PNM
    /// (sRGB) or HDR, EXR, PFM (linear)
    #[arg(required = true, value_name = "PHOTO")]
    photos: Vec<PathBuf>,

    /// Relative exposure of each photo in stops; larger is brighter [default: from EXIF, else estimated from the
    /// photos]
    #[arg(long, value_name = "EV,EV,…", value_delimiter = ',', allow_hyphen_values = true)]
    exposures: Vec<f64>,

    /// Outline of the ball in pixels of the photo: centre and radius [default: detected]
    #[arg(long, value_name = "X,Y,R", value_parser = parse::circle, allow_hyphen_values = true)]
    circle: Option<[f64; 3]>,

    /// Horizontal field of view of the photo in degrees [default: from EXIF, else orthographic]
    #[arg(long, value_name = "A")]
    hfov_deg: Option<f64>,

    /// Distance from the camera to the ball's centre in metres, instead of a field of view
    #[arg(long, value_name = "METRES", value_parser = parse::positive, allow_hyphen_values = true, requires = "diameter_m", conflicts_with = "hfov_deg")]
    distance_m: Option<f64>,

    /// Diameter of the ball in metres
    #[arg(long, value_name = "METRES", value_parser = parse::positive, allow_hyphen_values = true, requires = "distance_m")]
    diameter_m: Option<f64>,

    /// Reflectance of the ball, above 0 and at most 1, as one value or R,G,B: chrome 0.55, silvered glass 0.9
    #[arg(long, value_name = "SHARE|R,G,B", default_value = "1", value_parser = parse::reflectance)]
    reflectance: [f32; 3],

    /// Angle in degrees from the camera's viewing direction to the panorama's centre, to the right
    #[arg(long, value_name = "A", default_value_t = 0.0, allow_hyphen_values = true)]
    yaw_deg: f32,

    /// Upward pitch of the camera in degrees, to make the panorama level
    #[arg(long, value_name = "A", default_value_t = 0.0, allow_hyphen_values = true)]
    pitch_deg: f32,

    /// Remove the camera and the photographer: half-angle in degrees of the cone to fill from its surroundings
    #[arg(long, value_name = "A", default_value_t = 0.0)]
    cut_out_camera_deg: f32,

    /// Width and height in pixels; the width is twice the height [default: as many pixels as the ball has]
    #[arg(long, value_name = "WxH", value_parser = parse::size)]
    size: Option<[usize; 2]>,

    #[command(flatten)]
    file: PanoramaFileArgs,

    /// Also write a mask: white where the ball shows the room, black where the panorama is filled
    #[arg(long, value_name = "FILE.png")]
    mask_out: Option<PathBuf>,

    #[command(flatten)]
    out: OutputArgs,
}

const COMMAND: &str = "unwrap";
/// Misalignment of photos above which a note is printed.
const MISALIGNED_PX: f64 = 3.0;
/// Difference in exposure below which two photos count as equally exposed.
const SAME_STOPS: f64 = 0.05;
/// Difference between given and measured exposure above which a note is printed.
const DOUBTFUL_STOPS: f64 = 0.3;

/// Reads and merges the photos, finds the ball, unwraps it and writes the panorama.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    let preview = args.file.preview.then(|| environment::preview_path(&args.out.output));
    let outputs =
        [(Some(&args.out.output), output::RADIANCE), (preview.as_ref(), &[]), (args.mask_out.as_ref(), output::MASK)];
    let checked: Vec<(&Path, &[&str])> =
        outputs.into_iter().filter_map(|(path, extensions)| Some((path?.as_path(), extensions))).collect();
    output::check_outputs(&checked, COMMAND, args.out.force)?;
    let outputs: Vec<&Path> = checked.iter().map(|&(path, _)| path).collect();
    if let Some(size) = args.size {
        environment::height(size)?;
    }
    if !args.exposures.is_empty() && args.exposures.len() != args.photos.len() {
        let (photos, exposures) = (args.photos.len(), args.exposures.len());
        return Err(Usage(format!("--exposures: {exposures} exposures for {photos} photos")).into());
    }
    let mut stages = Stages::new(global.quiet);
    let files = stages
        .stage("read photos", || args.photos.iter().map(imaging::read_photo).collect::<Result<Vec<PhotoFile>, _>>())?;
    stages.photo_notes(args.photos.iter().map(PathBuf::as_path).zip(&files));
    let lens = lens(args, &files[0], &mut stages)?;
    let shots: Vec<_> = files.iter().map(|file| file.exposure).collect();
    let photos: Vec<Photo> = files.into_iter().map(|file| file.photo).collect();
    let with_names = |error| with_photo_names(args, error);
    let (stops, source) = stops(args, &photos, &shots).map_err(with_names)?;
    let merged = stages.stage("merge", || lo_mirror_ball::merge_exposures(&photos, &stops)).map_err(with_names)?;
    if photos.len() > 1 {
        report_exposures(args, &photos, &stops, source, &mut stages).map_err(with_names)?;
    }
    let size = [photos[0].width(), photos[0].height()];
    drop(photos);
    let (view, confidence) = match args.circle {
        Some([x, y, radius_px]) => {
            let view = BallView::new(BallCircle { x, y, radius_px }, lens, size);
            (view.map_err(|error| Usage(format!("--circle: {error}")))?, None)
        }
        None => {
            let found = stages.stage("find ball", || lo_mirror_ball::find_ball(&merged.radiance, lens))?;
            let found = confident_detection(args, found)?;
            (found.view, Some(found.confidence))
        }
    };
    report_ball(&view, confidence, &stages);
    let options = UnwrapOptions {
        size: args.size,
        reflectance: args.reflectance,
        yaw_rad: args.yaw_deg.to_radians(),
        pitch_rad: args.pitch_deg.to_radians(),
        cut_out_camera_rad: args.cut_out_camera_deg.to_radians(),
    };
    let unwrapped = stages
        .stage("unwrap", || lo_mirror_ball::unwrap_ball(&merged, &view, &options))
        .map_err(|error| Usage(error.to_string()))?;
    report_gaps(&unwrapped, &stages);
    stages.stage("write", || write(args, &unwrapped))?;
    if args.out.json {
        let circle = view.circle();
        return report::print_json(&json!({
            "files": outputs,
            "size": [unwrapped.radiance.width(), unwrapped.radiance.height()],
            "circle_px": [circle.x, circle.y, circle.radius_px],
            "confidence": confidence,
            "hidden_half_angle_deg": view.hidden_half_angle_rad().to_degrees(),
            "exposures_ev": stops,
            "clipped_share": unwrapped.clipped_share,
            "filled_share": unwrapped.filled_share,
            "coarse_share": unwrapped.coarse_share,
            "seconds": stages.timings(),
        }));
    }
    report::print(&format!(
        "{}  {} × {}, in {}",
        args.out.output.display(),
        unwrapped.radiance.width(),
        unwrapped.radiance.height(),
        seconds(stages.total())
    ));
    outputs[1..].iter().for_each(|path| report::print(&path.display().to_string()));
    Ok(())
}

/// Determines the lens from the options, else from EXIF, and reports the source.
fn lens(args: &Args, photo: &PhotoFile, stages: &mut Stages) -> anyhow::Result<BallLens> {
    let (width, height) = (photo.photo.width() as u32, photo.photo.height() as u32);
    if let Some((distance_m, diameter_m)) = args.distance_m.zip(args.diameter_m) {
        let radii = 2.0 * distance_m / diameter_m;
        if radii <= 1.0 {
            let text = format!(
                "--distance-m {distance_m}: the camera would be inside the ball with a diameter of {diameter_m} m"
            );
            return Err(Usage(text).into());
        }
        return Ok(BallLens::Distance { radii });
    }
    if let Some(hfov_deg) = args.hfov_deg {
        let camera = Camera::from_hfov_deg(hfov_deg, width, height);
        let camera = camera.map_err(|error| Usage(format!("--hfov-deg: {error}")))?;
        return Ok(BallLens::Focal { focal_px: camera.fx });
    }
    match photo.focal_px() {
        Some(focal_px) => {
            let hfov_deg = photo.hfov_deg().unwrap_or_default();
            stages.note(&format!("horizontal field of view {hfov_deg:.1}° (EXIF)"));
            Ok(BallLens::Focal { focal_px })
        }
        None => {
            stages.note(
                "the field of view is unknown, so the projection is assumed to be orthographic; set it with --hfov-deg, \
                 or with --distance-m and --diameter-m",
            );
            Ok(BallLens::Orthographic)
        }
    }
}

/// Determines the exposure of each photo in stops relative to the first, and names the source.
fn stops(
    args: &Args,
    photos: &[Photo],
    shots: &[imaging::PhotoExposure],
) -> Result<(Vec<f64>, &'static str), BallError> {
    if photos.len() == 1 {
        return Ok((vec![0.0], "one photo"));
    }
    if !args.exposures.is_empty() {
        return Ok((args.exposures.iter().map(|stop| stop - args.exposures[0]).collect(), "--exposures"));
    }
    match lo_mirror_ball::stops_from_exif(shots) {
        Some(stops) => Ok((stops, "EXIF")),
        None => Ok((lo_mirror_ball::estimate_stops(photos)?, ESTIMATED)),
    }
}

/// Source of exposures that are neither given nor in EXIF.
const ESTIMATED: &str = "estimated from pixels that are well exposed in two photos";

/// Replaces indices of photos in an error by their names.
fn with_photo_names(args: &Args, error: BallError) -> anyhow::Error {
    let name = |photo: usize| args.photos.get(photo).map_or_else(String::new, |path| path.display().to_string());
    match &error {
        BallError::Sizes { photo, size, first } => anyhow::anyhow!(
            "{}: {} × {} pixels, but {} has {} × {}; all photos must have the same size",
            name(*photo),
            size[0],
            size[1],
            name(0),
            first[0],
            first[1]
        ),
        BallError::NotFinite { photo, x, y } => {
            anyhow::anyhow!("{}: pixel ({x}, {y}) is not a finite number", name(*photo))
        }
        BallError::NothingInCommon { photos, pixels } => anyhow::anyhow!(
            "{} and {} have only {pixels} samples that are well exposed in both, too few to compare their exposures; \
             set them with --exposures",
            name(photos[0]),
            name(photos[1])
        ),
        BallError::Exposures { .. } => Usage(format!("--exposures: {error}")).into(),
        _ => error.into(),
    }
}

/// Reports the exposures, their source and possible problems.
fn report_exposures(
    args: &Args,
    photos: &[Photo],
    stops: &[f64],
    source: &str,
    stages: &mut Stages,
) -> Result<(), BallError> {
    let list: Vec<String> = stops.iter().map(|stop| format!("{stop:+.2}")).collect();
    stages.note(&format!("exposures {} EV ({source}); the photos' tone curve is assumed to be sRGB", list.join(", ")));
    let name = |photo: usize| args.photos[photo].display();
    for (a, b) in (0..stops.len()).flat_map(|a| (a + 1..stops.len()).map(move |b| (a, b))) {
        if (stops[a] - stops[b]).abs() < SAME_STOPS {
            stages.note(&format!(
                "{} and {} have the same exposure, which does not extend the dynamic range",
                name(a),
                name(b)
            ));
        }
    }
    if source != ESTIMATED
        && let Ok(measured) = lo_mirror_ball::estimate_stops(photos)
    {
        let worst =
            (0..stops.len()).max_by(|&a, &b| (measured[a] - stops[a]).abs().total_cmp(&(measured[b] - stops[b]).abs()));
        if let Some(photo) = worst.filter(|&photo| (measured[photo] - stops[photo]).abs() > DOUBTFUL_STOPS) {
            stages.note(&format!(
                "{}: {:+.2} EV by {source}, but {:+.2} EV by its pixels; its tone curve may not be sRGB, or something moved",
                name(photo),
                stops[photo],
                measured[photo]
            ));
        }
    }
    let apart = stages.stage("compare photos", || lo_mirror_ball::misalignment_px(photos, stops))?;
    for (photo, pixels) in apart.into_iter().enumerate() {
        match pixels {
            Some(pixels) if pixels > MISALIGNED_PX => stages.note(&format!(
                "{} is shifted by about {pixels:.0} pixels against {}: the panorama will be blurred",
                name(photo),
                name(0)
            )),
            _ => {}
        }
    }
    Ok(())
}

/// Returns the detection if it is confident enough.
fn confident_detection(args: &Args, found: Option<BallDetection>) -> anyhow::Result<BallDetection> {
    let photo = args.photos[0].display();
    match found {
        Some(found) if found.confidence >= BallDetection::MIN_CONFIDENCE => Ok(found),
        Some(BallDetection { view, confidence }) => {
            let BallCircle { x, y, radius_px } = view.circle();
            anyhow::bail!(
                "{photo}: no ball was found; the best circle, at ({x:.0}, {y:.0}) with a radius of {radius_px:.0} pixels, \
                 has a confidence of only {confidence:.2}; set the outline with --circle X,Y,R"
            )
        }
        None => anyhow::bail!("{photo}: no ball was found; set the outline with --circle X,Y,R"),
    }
}

fn report_ball(view: &BallView, confidence: Option<f64>, stages: &Stages) {
    let BallCircle { x, y, radius_px } = view.circle();
    let found = match confidence {
        Some(confidence) => format!("detected, confidence {confidence:.2}"),
        None => "--circle".to_owned(),
    };
    let extent = match view.focal_px() {
        Some(_) => format!(", angular diameter {:.1}°", 2.0 * view.hidden_half_angle_rad().to_degrees()),
        None => String::new(),
    };
    stages.note(&format!("ball at ({x:.1}, {y:.1}) with a radius of {radius_px:.1} pixels ({found}){extent}"));
}

fn report_gaps(unwrapped: &UnwrappedBall, stages: &Stages) {
    let UnwrappedBall { filled_share, coarse_share, clipped_share, .. } = unwrapped;
    stages.note(&format!(
        "{:.1} % of the panorama is not visible in the ball and was filled; {:.1} % is near the rim, where resolution is low",
        100.0 * filled_share,
        100.0 * coarse_share
    ));
    if *clipped_share > 0.0 {
        stages.note(&format!(
            "{:.2} % of the ball is clipped in every photo, so its radiance is a lower bound; add a shorter exposure",
            100.0 * clipped_share
        ));
    }
}

fn write(args: &Args, unwrapped: &UnwrappedBall) -> anyhow::Result<()> {
    environment::write(&args.out.output, &unwrapped.radiance, None, &args.file, COMMAND)?;
    if let Some(path) = &args.mask_out {
        let mask = unwrapped.observed.map(|&observed| [observed; 3]);
        let turned = imaging::reorient(&mask, Orientation::Lightoctree, args.file.orientation);
        let grey: Image<[u8; 3]> = turned.map(|observed| observed.map(|v| (255.0 * v + 0.5) as u8));
        write_mask(path, &grey)?;
    }
    Ok(())
}

fn write_mask(path: &Path, mask: &Image<[u8; 3]>) -> anyhow::Result<()> {
    imaging::write_srgb8(path, mask, imaging::JPEG_QUALITY, &output::signature(COMMAND))
        .with_context(|| "--mask-out".to_owned())
}
