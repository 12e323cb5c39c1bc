//! `lightoctree lights SCENE`: lists and edits the lights of a scene.

use std::path::PathBuf;
use std::sync::Arc;

use lightoctree::{Document, Estimate};
use lo_estimate::{ShadowError, sun_from_photo, supported_sun};
use lo_geometry::Vec3;
use lo_imaging::luminance;
use lo_lights::{LightKind, LightOrigin, ListedLight, ShadowSupport};
use lo_scene::{AnalyticLight, EmitterEdit, LightChange, LightColor, LightShape, MAX_LIGHT_EDITS, MAX_LIGHT_SCALE};
use serde_json::json;

use super::parse;
use crate::args::Global;
use crate::progress::Stages;
use crate::usage::Usage;
use crate::{output, report};

/// Options of `lights`.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  \
    lightoctree lights room.scene\n  \
    lightoctree lights set room.scene L1 --scale 2 --color 3000K\n  \
    lightoctree lights set room.scene L2 --off -o night.scene\n  \
    lightoctree lights add sun room.scene --azimuth -60 --elevation 35 --strength 8 --color 5500K\n  \
    lightoctree lights add sun room.scene --shadow 640,410,705,520\n  \
    lightoctree lights add area room.scene --at 0,1.5,-2 --direction 0,-1,0 --size 1.2,0.3 --radiance 20\n  \
    lightoctree lights reset room.scene\n\n\
    Edits are stored next to the estimate in the scene file, and used by `insert`, `envmap`, `probes` and `export`.\n\
    They change the direct light only: neither its reflections in the room nor the photo."
)]
pub struct Args {
    #[command(subcommand)]
    edit: Option<Edit>,

    /// Scene file
    #[arg(required = true)]
    scene: Option<PathBuf>,

    /// Print the lights as JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// An edit of the lights.
#[derive(Debug, clap::Subcommand)]
enum Edit {
    /// Change brightness or colour of a light, switch it off or on, or move it
    Set(SetArgs),
    /// Add a light
    #[command(subcommand)]
    Add(AddArgs),
    /// Remove an added light
    Remove(RemoveArgs),
    /// Undo the edits of one light, or all edits including added lights
    Reset(ResetArgs),
}

/// Options of the output.
#[derive(Debug, clap::Args)]
struct FileArgs {
    /// Scene file to write [default: the input file]
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Overwrite an existing file of any origin
    #[arg(long, requires = "output")]
    force: bool,

    /// Print the lights as JSON instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("what").required(true).multiple(true).args(["scale", "color", "off", "on", "at"])))]
struct SetArgs {
    /// Scene file
    scene: PathBuf,

    /// Name of the light in the list
    id: String,

    /// Brightness as a factor on the estimated or added light, 0 to 10000
    #[arg(long, value_name = "S", value_parser = scale)]
    scale: Option<f32>,

    /// Colour at the same luminance: a temperature such as 3000K, or linear R,G,B
    #[arg(long, value_name = "KELVIN|R,G,B", value_parser = parse::light_color)]
    color: Option<LightColor>,

    /// Switch the light off; an emitter then looks like its surroundings
    #[arg(long, conflicts_with = "on")]
    off: bool,

    /// Switch the light on again
    #[arg(long)]
    on: bool,

    /// New position of its centre, in metres; an estimated lamp becomes an area light of the same size
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true)]
    at: Option<Vec3>,

    #[command(flatten)]
    file: FileArgs,
}

/// Kinds of lights that can be added.
#[derive(Debug, clap::Subcommand)]
enum AddArgs {
    /// Add a sun: a disc at infinity
    ///
    /// Observed surfaces block it, except windows and lamps, and so do objects. Inferred walls do not. Without
    /// --strength it is the photo's own sun.
    Sun(SunArgs),
    /// Add an area light: a rectangle or a sphere
    ///
    /// It is not drawn in the photo, and does not block light.
    Area(AreaArgs),
}

#[derive(Debug, clap::Args)]
struct SunArgs {
    /// Scene file
    scene: PathBuf,

    #[command(flatten)]
    sun: SunValues,

    #[command(flatten)]
    file: FileArgs,
}

/// A sun to add.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct SunValues {
    /// Horizontal angle in degrees, to the right of the camera's heading
    #[arg(long, value_name = "A", value_parser = parse::angle_deg, allow_hyphen_values = true, requires = "elevation")]
    pub azimuth: Option<f64>,

    /// Angle above the horizon in degrees, -90 to 90
    #[arg(long, value_name = "E", value_parser = parse::elevation_deg, allow_hyphen_values = true, requires = "azimuth")]
    pub elevation: Option<f64>,

    /// Direction by two pixels of the photo: a point that casts a shadow, such as a corner of the window, and its
    /// shadow
    ///
    /// Without --strength, the photo must show edges of a sun patch around the shadow.
    #[arg(long, value_name = "U,V,U,V", value_parser = parse::pixels, allow_hyphen_values = true, conflicts_with = "azimuth", required_unless_present = "azimuth")]
    pub shadow: Option<[[f64; 2]; 2]>,

    /// Irradiance on a surface that faces the sun; pi makes a white one as bright as the photo's white [default: the
    /// photo's own sun]
    ///
    /// The photo's own sun lights objects where the photo shows sun patches. Its strength follows from the brightness
    /// of the patches relative to the shade.
    #[arg(long, value_name = "S", value_parser = parse::positive, allow_hyphen_values = true)]
    pub strength: Option<f64>,

    /// Angular diameter in degrees; larger suns cast softer shadows
    #[arg(long, value_name = "D", value_parser = parse::positive, allow_hyphen_values = true, default_value_t = 0.53)]
    pub angle: f64,

    /// Colour: a temperature such as 5500K, or linear R,G,B [default: white; for the photo's own sun, its observed
    /// colour]
    #[arg(long, value_name = "KELVIN|R,G,B", value_parser = parse::light_color)]
    pub color: Option<LightColor>,
}

#[derive(Debug, clap::Args)]
struct AreaArgs {
    /// Scene file
    scene: PathBuf,

    #[command(flatten)]
    area: AreaValues,

    #[command(flatten)]
    file: FileArgs,
}

/// An area light to add.
#[derive(Clone, Copy, Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("shape").required(true).args(["size", "radius"])))]
#[command(group(clap::ArgGroup::new("light").required(true).args(["radiance", "power"])))]
pub struct AreaValues {
    /// Position of its centre in metres: +X right, +Y up, the camera at 0,0,0 looks along -Z
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true)]
    pub at: Vec3,

    /// Width and height of a rectangle, in metres
    #[arg(long, value_name = "W,H", value_parser = parse::extent, requires = "direction")]
    pub size: Option<[f32; 2]>,

    /// Radius of a sphere, in metres
    #[arg(long, value_name = "METRES", value_parser = parse::positive, allow_hyphen_values = true, conflicts_with_all = ["direction", "two_sided"])]
    pub radius: Option<f64>,

    /// Direction in which a rectangle emits
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true)]
    pub direction: Option<Vec3>,

    /// Let a rectangle emit from both sides
    #[arg(long)]
    pub two_sided: bool,

    /// Luminance of the radiance; 1 is the photo's white
    #[arg(long, value_name = "L", value_parser = parse::positive, allow_hyphen_values = true)]
    pub radiance: Option<f64>,

    /// Power instead of --radiance: pi times radiance times area, in watts as in Blender
    #[arg(long, value_name = "W", value_parser = parse::positive, allow_hyphen_values = true)]
    pub power: Option<f64>,

    /// Colour: a temperature such as 3000K, or linear R,G,B
    #[arg(long, value_name = "KELVIN|R,G,B", value_parser = parse::light_color, default_value = "1,1,1")]
    pub color: LightColor,
}

#[derive(Debug, clap::Args)]
struct RemoveArgs {
    /// Scene file
    scene: PathBuf,

    /// Name of the light in the list
    id: String,

    #[command(flatten)]
    file: FileArgs,
}

#[derive(Debug, clap::Args)]
struct ResetArgs {
    /// Scene file
    scene: PathBuf,

    /// Name of the light in the list [default: all edits and added lights]
    id: Option<String>,

    #[command(flatten)]
    file: FileArgs,
}

/// Command in the signature of scene files. Without edits, a scene file has the bytes that `estimate` wrote.
const SCENE_COMMAND: &str = "estimate";

/// Applies the edit, if there is one, and lists the lights.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    let (path, file) = match &args.edit {
        None => {
            let path = args.scene.as_ref().ok_or_else(|| Usage("SCENE is required".into()))?;
            return print_lights(&Document::read(path)?, args.json);
        }
        Some(Edit::Set(args)) => (&args.scene, &args.file),
        Some(Edit::Add(AddArgs::Sun(args))) => (&args.scene, &args.file),
        Some(Edit::Add(AddArgs::Area(args))) => (&args.scene, &args.file),
        Some(Edit::Remove(args)) => (&args.scene, &args.file),
        Some(Edit::Reset(args)) => (&args.scene, &args.file),
    };
    let out = file.output.as_ref().unwrap_or(path);
    if let Some(output) = &file.output {
        output::check_scene(output, SCENE_COMMAND, file.force)?;
    }
    let mut document = Document::read(path)?;
    match &args.edit {
        None => {}
        Some(Edit::Set(args)) => set(&mut document, args)?,
        Some(Edit::Add(AddArgs::Sun(args))) => {
            let (sun, note) = sun(&document.estimate, &args.sun)?;
            note.iter().for_each(|note| Stages::new(global.quiet).note(note));
            add(&mut document, sun)?;
        }
        Some(Edit::Add(AddArgs::Area(args))) => {
            let area = area(&document.estimate, &args.area)?;
            add(&mut document, area)?;
        }
        Some(Edit::Remove(args)) => remove(&mut document, &args.id)?,
        Some(Edit::Reset(args)) => document.reset_lights(args.id.as_deref())?,
    }
    document.write(out, &output::signature(SCENE_COMMAND))?;
    print_lights(&document, file.json)
}

fn set(document: &mut Document, args: &SetArgs) -> anyhow::Result<()> {
    let light = document.light(&args.id)?;
    let mut change = document.light_edits.change_of(&args.id);
    change.scale = args.scale.unwrap_or(change.scale);
    change.color = args.color.or(change.color);
    change.at_m = args.at.or(change.at_m);
    change.on = (change.on || args.on) && !args.off;
    if args.at.is_some() && light.kind == LightKind::Sun {
        return Err(Usage(format!("--at: {} is a sun, which has no position", args.id)).into());
    }
    check(change.invalid_field())?;
    let found_at_m = light.position_m.unwrap_or(Vec3::ZERO);
    if document.light_edits.change(&args.id, found_at_m, change) { Ok(()) } else { Err(full()) }
}

/// Adds a light and returns its name.
///
/// # Errors
/// A value is out of range, or the scene has the maximum of added lights.
pub fn add(document: &mut Document, light: AnalyticLight) -> anyhow::Result<String> {
    check(light.invalid_field())?;
    document.light_edits.add(light).ok_or_else(full)
}

/// Removes an added light.
///
/// # Errors
/// No added light has this name.
pub fn remove(document: &mut Document, id: &str) -> anyhow::Result<()> {
    if document.light_edits.remove(id) {
        return Ok(());
    }
    document.light(id)?;
    Err(Usage(format!("{id} is part of the estimate and cannot be removed; `lights set {id} --off` switches it off"))
        .into())
}

fn check(wrong: Option<&'static str>) -> anyhow::Result<()> {
    wrong.map_or(Ok(()), |what| Err(Usage(format!("{what} is out of range")).into()))
}

fn full() -> anyhow::Error {
    Usage(format!("the scene already has the maximum of {MAX_LIGHT_EDITS} such lights")).into()
}

/// Returns a sun, and what is to be told about it.
///
/// # Errors
/// The direction is missing, or the photo does not support it.
pub fn sun(estimate: &Arc<Estimate>, args: &SunValues) -> anyhow::Result<(AnalyticLight, Option<String>)> {
    let direction = match (args.shadow, args.azimuth, args.elevation) {
        (Some(shadow), ..) => direction_from_shadow(estimate, shadow, args.strength.is_some())?,
        (None, Some(azimuth), Some(elevation)) => lo_lights::sun_direction(estimate, azimuth, elevation),
        _ => return Err(Usage("give the direction with --azimuth and --elevation, or with --shadow".into()).into()),
    };
    let angular_radius_deg = 0.5 * args.angle as f32;
    if let Some(strength) = args.strength {
        let shape = LightShape::Sun { direction, angular_radius_deg, of_photo: false };
        let color = args.color.unwrap_or(LightColor::Rgb([1.0; 3]));
        return Ok((light_with_luminance(shape, color, |extent| strength as f32 / extent), None));
    }
    let [azimuth, elevation] = lo_lights::sun_angles_deg(estimate, direction);
    let angles = format!("azimuth {azimuth:.0}°, elevation {elevation:.0}°");
    if elevation < 0.0 {
        let text =
            format!("the photo's own sun is above the horizon, not at {angles}; with --strength it may be below");
        return Err(Usage(text).into());
    }
    let found = sun_from_photo(estimate, direction, angular_radius_deg).ok_or_else(|| {
        Usage(format!(
            "the photo shows no sun patches with sharp edges on surfaces that face this sun ({angles}); with --strength it shines \
             in through all unobserved regions"
        ))
    })?;
    let own = luminance(found.light.radiance);
    let clipped = if found.clipped { " at least, because the photo is clipped there" } else { "" };
    let note = format!(
        "the photo's own sun: {angles}, strength {:.1}{clipped}; it shines on {:.1} % of the observed surfaces",
        own * found.light.extent(),
        100.0 * found.lit_share
    );
    let light = args.color.map_or(found.light, |color| light_with_luminance(found.light.shape, color, |_| own));
    Ok((light, Some(note)))
}

/// Computes the sun's direction from the pixels of an occluder and its shadow.
///
/// Unless `is_free`, the photo must show edges of a sun patch around the shadow.
fn direction_from_shadow(
    estimate: &Estimate,
    [occluder, shadow]: [[f64; 2]; 2],
    is_free: bool,
) -> anyhow::Result<Vec3> {
    let camera = &estimate.frame.camera;
    for [u, v] in [occluder, shadow] {
        if !camera.contains(u, v) {
            let (width, height) = (camera.width, camera.height);
            let message = format!("--shadow: {u},{v} is outside the photo, which has {width} × {height} pixels");
            return Err(Usage(message).into());
        }
    }
    let found = if is_free {
        lo_lights::sun_from_shadow(estimate, occluder, shadow).ok_or(ShadowError::NotBelow)
    } else {
        supported_sun(estimate, occluder, shadow)
    };
    found.map_err(|error| Usage(format!("--shadow: {}", shadow_error_text(estimate, shadow, error))).into())
}

/// Explains why a shadow gives no direction, and what to do.
fn shadow_error_text(estimate: &Estimate, [u, v]: [f64; 2], error: ShadowError) -> String {
    let ShadowError::Unsupported { direction, support } = error else {
        return format!("{error}; give the occluder's pixel first, then the shadow's");
    };
    let [azimuth, elevation] = lo_lights::sun_angles_deg(estimate, direction);
    let ShadowSupport { edges, sunny, explained, against, measured } = support;
    let (least, share) = (ShadowSupport::MIN_SUNNY, 100.0 * ShadowSupport::MIN_SUNNY_SHARE);
    let occlusion = if measured {
        format!(
            "; measured depth agrees with a shadow of this sun at {explained} of them and contradicts it at {against}"
        )
    } else {
        String::new()
    };
    format!(
        "no edge of a sun patch supports this sun (azimuth {azimuth:.0}°, elevation {elevation:.0}°). \
         Sharp edges on surfaces that face it, around {u},{v}: {edges} pixels, {sunny} of them with the colour of \
         sunlight; {least} and {share:.0} % are needed{occlusion}. Choose the edge of a shadow next to a \
         sun patch, give --azimuth and --elevation if you know them, or --strength to skip this check"
    )
}

/// Returns an area light.
///
/// # Errors
/// Shape or direction are missing.
pub fn area(estimate: &Estimate, args: &AreaValues) -> anyhow::Result<AnalyticLight> {
    let up = estimate.up();
    let shape = match (args.size, args.direction, args.radius) {
        (Some(size_m), Some(direction), _) => lo_lights::rectangle(args.at, direction, up, size_m, args.two_sided),
        (_, _, Some(radius)) => LightShape::Sphere { centre_m: args.at, radius_m: radius as f32 },
        _ => return Err(Usage("give --size with --direction, or --radius".into()).into()),
    };
    let luminance = |extent: f32| match (args.radiance, args.power) {
        (Some(radiance), _) => radiance as f32,
        (None, power) => power.unwrap_or(0.0) as f32 / (std::f32::consts::PI * extent),
    };
    Ok(light_with_luminance(shape, args.color, luminance))
}

/// Creates a light of a shape and colour; `luminance` computes its luminance from its extent.
fn light_with_luminance(shape: LightShape, color: LightColor, luminance: impl Fn(f32) -> f32) -> AnalyticLight {
    let dark = AnalyticLight { shape, radiance: [0.0; 3] };
    let radiance = lo_lights::rgb_from_color(color) * luminance(dark.extent());
    AnalyticLight { radiance: radiance.to_array(), ..dark }
}

fn print_lights(document: &Document, as_json: bool) -> anyhow::Result<()> {
    let (lights, lost) = (document.lights(), document.lost_light_edits());
    if as_json {
        let mut value = json!({ "lights": lights });
        if !lost.is_empty() {
            value["edits_without_light"] = json!(lost);
        }
        return report::print_json(&value);
    }
    if lights.is_empty() && lost.is_empty() {
        report::print(&format!(
            "no lights: nothing in this scene is brighter than {} times the mean of its surfaces",
            lo_lights::CAP
        ));
        return Ok(());
    }
    let head = [
        "light",
        "kind",
        "source",
        "centre, m",
        "direction",
        "size, m",
        "radiance",
        "colour",
        "share",
        "certainty",
        "edited",
    ];
    let rows: Vec<Vec<String>> = lights.iter().map(row).chain(lost.iter().map(lost_row)).collect();
    report::print(&report::table(&head, &rows));
    Ok(())
}

/// Formats a row of an edit whose light does not exist.
fn lost_row(edit: &EmitterEdit) -> Vec<String> {
    let at = edit.found_at_m;
    let unknown = || "-".to_owned();
    vec![
        edit.id.clone(),
        "missing".to_owned(),
        unknown(),
        format!("{:.2},{:.2},{:.2}", at.x, at.y, at.z),
        unknown(),
        unknown(),
        unknown(),
        unknown(),
        unknown(),
        unknown(),
        format!("{} (no such light: `lights reset SCENE {}`)", edits(edit.change), edit.id),
    ]
}

/// Formats a row of the table.
fn row(light: &ListedLight) -> Vec<String> {
    let point = |p: Vec3| format!("{:.2},{:.2},{:.2}", p.x, p.y, p.z);
    let direction = match (light.direction, light.kind) {
        // Towards the sun, as the options give it.
        (Some(direction), LightKind::Sun) => point(-direction),
        (Some(direction), _) => point(direction),
        (None, _) => "all".to_owned(),
    };
    let size = match (light.size_m, light.radius_m, light.angular_radius_deg, light.area_m2) {
        (Some([width, height]), ..) => format!("{width:.2} x {height:.2}"),
        (_, Some(radius), ..) => format!("radius {radius:.2}"),
        (_, _, Some(radius), _) => format!("{:.2} deg", 2.0 * radius),
        (.., Some(area)) => format!("{area:.2} m2"),
        _ => String::new(),
    };
    let luminance = lo_imaging::luminance(light.radiance);
    let radiance = light
        .irradiance
        .map_or_else(|| three_digits(luminance), |strength| format!("strength {}", three_digits(strength)));
    let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    vec![
        light.id.clone(),
        kind(light.kind).to_owned(),
        source(light.origin).to_owned(),
        or_none(light.position_m.map(point)),
        direction,
        size,
        radiance,
        or_none(light.color_temperature_k.map(|kelvin| format!("{:.0} K", (kelvin / 10.0).round() * 10.0))),
        or_none(light.flux_share.map(|share| {
            let digits = if share < 1e-3 { 2 } else { 1 };
            format!("{:.digits$} %", 100.0 * share)
        })),
        or_none(light.certainty.map(|certainty| format!("{certainty:.2}"))),
        or_none(light.change.map(edits)),
    ]
}

fn kind(kind: LightKind) -> &'static str {
    match kind {
        LightKind::Lamp => "lamp",
        LightKind::Window => "window",
        LightKind::BrightSurface => "bright surface",
        LightKind::Area => "area",
        LightKind::Sun => "sun",
    }
}

fn source(origin: LightOrigin) -> &'static str {
    match origin {
        LightOrigin::Observed => "photo",
        LightOrigin::Panorama => "panorama",
        LightOrigin::Inferred => "inferred",
        LightOrigin::Added => "added",
    }
}

fn edits(change: LightChange) -> String {
    let LightChange { on, scale, color, at_m } = change;
    let color = color.map(|color| match color {
        LightColor::Kelvin(kelvin) => format!("{kelvin:.0} K"),
        LightColor::Rgb([r, g, b]) => format!("rgb {r},{g},{b}"),
    });
    let parts = [
        (!on).then(|| "off".to_owned()),
        (scale != 1.0).then(|| format!("x {scale}")),
        color,
        at_m.map(|at| format!("at {},{},{}", at.x, at.y, at.z)),
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
}

/// Formats a value with three digits.
fn three_digits(value: f32) -> String {
    let digits = (2 - value.abs().max(1e-3).log10().floor() as i32).clamp(0, 3) as usize;
    format!("{value:.digits$}")
}

fn scale(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(scale) if (0.0..=MAX_LIGHT_SCALE).contains(&scale) => Ok(scale),
        _ => Err(format!("must be a number from 0 to {MAX_LIGHT_SCALE}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_are_formatted_briefly() {
        let change =
            LightChange { on: false, scale: 2.5, color: Some(LightColor::Kelvin(3000.0)), at_m: Some(Vec3::Y) };
        assert_eq!(edits(change), "off; x 2.5; 3000 K; at 0,1,0");
        assert_eq!(
            edits(LightChange { color: Some(LightColor::Rgb([1.0, 0.5, 0.0])), ..LightChange::NONE }),
            "rgb 1,0.5,0"
        );
        assert_eq!([0.01234, 1.234, 12.34, 1234.0].map(three_digits), ["0.012", "1.23", "12.3", "1234"]);
    }
}
