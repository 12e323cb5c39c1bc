//! `lightoctree lights SCENE`: what gives light in a scene, and how it is to be changed.

use std::path::PathBuf;
use std::sync::Arc;

use lightoctree::geometry::Vec3;
use lightoctree::imaging::luminance;
use lightoctree::lights::{self, LightKind, LightOrigin, ListedLight, ShadowSupport};
use lightoctree::scene::{
    AnalyticLight, LightChange, LightColor, LightEdits, LightShape, MAX_LIGHT_EDITS, MAX_LIGHT_SCALE,
};
use lightoctree::{Document, Estimate, ShadowError};
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
    Changes lie beside the estimate in the scene file, which stays as it is. `insert`, `envmap`, `probes` and `export` use them. They change what a light \
    gives directly, not what the room reflects of it, and not the photo."
)]
pub struct Args {
    #[command(subcommand)]
    change: Option<Change>,

    /// A scene file
    #[arg(required = true)]
    scene: Option<PathBuf>,

    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// What is to be changed.
#[derive(Debug, clap::Subcommand)]
enum Change {
    /// Make a light brighter, dimmer, of another colour; turn it off or on; move it
    Set(SetArgs),
    /// Add a light
    #[command(subcommand)]
    Add(AddArgs),
    /// Take an added light away
    Remove(RemoveArgs),
    /// Forget the changes of a light, or all of them and the added lights
    Reset(ResetArgs),
}

/// Where the result goes.
#[derive(Debug, clap::Args)]
struct FileArgs {
    /// Write the scene to this file instead of in place
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,

    /// Replace an existing file of --output, whatever it is
    #[arg(long, requires = "output")]
    force: bool,

    /// Print the list of lights as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("what").required(true).multiple(true).args(["scale", "color", "off", "on", "at"])))]
struct SetArgs {
    /// A scene file
    scene: PathBuf,

    /// Its name in the list
    id: String,

    /// Factor of its light in the estimate, or as it was added
    #[arg(long, value_name = "S", value_parser = scale)]
    scale: Option<f32>,

    /// Its colour, at the same luminance: a temperature such as 3000K, or linear R,G,B
    #[arg(long, value_name = "KELVIN|R,G,B", value_parser = parse::light_color)]
    color: Option<LightColor>,

    /// Turn it off: what is left of an emitter looks as its surroundings do
    #[arg(long, conflicts_with = "on")]
    off: bool,

    /// Turn it on again
    #[arg(long)]
    on: bool,

    /// Move its middle there, in metres; a lamp of the estimate becomes an area light of its size
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true)]
    at: Option<Vec3>,

    #[command(flatten)]
    file: FileArgs,
}

/// Lights that can be added.
#[derive(Debug, clap::Subcommand)]
enum AddArgs {
    /// A disc at infinity. What the photo shows hides it, but for windows and lamps, and objects do; guessed walls do not. Without --strength, the photo's own sun
    Sun(SunArgs),
    /// A rectangle or a sphere. It is not seen in the photo, hides nothing and casts no shadow itself
    Area(AreaArgs),
}

#[derive(Debug, clap::Args)]
struct SunArgs {
    /// A scene file
    scene: PathBuf,

    /// Degrees to the right of where the camera looks, about the vertical
    #[arg(long, value_name = "A", value_parser = parse::angle_deg, allow_hyphen_values = true, requires = "elevation")]
    azimuth: Option<f64>,

    /// Degrees above the horizon
    #[arg(long, value_name = "E", value_parser = elevation, allow_hyphen_values = true, requires = "azimuth")]
    elevation: Option<f64>,

    /// Instead of the two: a pixel of the photo that shows a thing, such as the top of a chair or a corner of the window, and one that shows where its shadow falls. Without --strength, refused where the photo has no edges of a sun patch there
    #[arg(long, value_name = "U,V,U,V", value_parser = parse::pixels, conflicts_with = "azimuth", required_unless_present = "azimuth")]
    shadow: Option<[[f64; 2]; 2]>,

    /// Irradiance on a surface that faces it: pi makes a white one as bright as the photo's white. Without it, it is the photo's own sun: it lights objects where the
    /// photo shows sun patches, and is as strong as these are bright beside the shade
    #[arg(long, value_name = "S", value_parser = parse::positive)]
    strength: Option<f64>,

    /// Degrees that it is wide; the larger, the softer its shadows
    #[arg(long, value_name = "D", value_parser = parse::positive, default_value_t = 0.53)]
    angle: f64,

    /// Its colour: a temperature such as 5500K, or linear R,G,B. White by default; the photo's own sun as the photo shows it
    #[arg(long, value_name = "KELVIN|R,G,B", value_parser = parse::light_color)]
    color: Option<LightColor>,

    #[command(flatten)]
    file: FileArgs,
}

#[derive(Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("shape").required(true).args(["size", "radius"])))]
#[command(group(clap::ArgGroup::new("light").required(true).args(["radiance", "power"])))]
struct AreaArgs {
    /// A scene file
    scene: PathBuf,

    /// Its middle, in metres: +X right, +Y up, the camera at 0,0,0 looks along -Z
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::point, allow_hyphen_values = true)]
    at: Vec3,

    /// Width and height of a rectangle, in metres
    #[arg(long, value_name = "W,H", value_parser = parse::extent, requires = "direction")]
    size: Option<[f32; 2]>,

    /// Radius of a sphere, in metres
    #[arg(long, value_name = "METRES", value_parser = parse::positive, conflicts_with_all = ["direction", "two_sided"])]
    radius: Option<f64>,

    /// Where a rectangle shines to
    #[arg(long, value_name = "X,Y,Z", value_parser = parse::direction, allow_hyphen_values = true)]
    direction: Option<Vec3>,

    /// Let a rectangle shine to both sides
    #[arg(long)]
    two_sided: bool,

    /// Luminance of its radiance; 1 is the photo's white
    #[arg(long, value_name = "L", value_parser = parse::positive)]
    radiance: Option<f64>,

    /// The same as pi times radiance times area: watts in Blender
    #[arg(long, value_name = "W", value_parser = parse::positive)]
    power: Option<f64>,

    /// Its colour: a temperature such as 3000K, or linear R,G,B
    #[arg(long, value_name = "KELVIN|R,G,B", value_parser = parse::light_color, default_value = "1,1,1")]
    color: LightColor,

    #[command(flatten)]
    file: FileArgs,
}

#[derive(Debug, clap::Args)]
struct RemoveArgs {
    /// A scene file
    scene: PathBuf,

    /// Its name in the list
    id: String,

    #[command(flatten)]
    file: FileArgs,
}

#[derive(Debug, clap::Args)]
struct ResetArgs {
    /// A scene file
    scene: PathBuf,

    /// Its name in the list [default: everything, added lights too]
    id: Option<String>,

    #[command(flatten)]
    file: FileArgs,
}

/// Scene files are `estimate`'s, whoever wrote them last: without edits the bytes are the same.
const SCENE_COMMAND: &str = "estimate";

/// Lists, or changes and lists.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    let (path, file) = match &args.change {
        None => {
            let path = args.scene.as_ref().ok_or_else(|| Usage("a scene is needed".into()))?;
            return say(&super::read_scene(path)?, args.json);
        }
        Some(Change::Set(args)) => (&args.scene, &args.file),
        Some(Change::Add(AddArgs::Sun(args))) => (&args.scene, &args.file),
        Some(Change::Add(AddArgs::Area(args))) => (&args.scene, &args.file),
        Some(Change::Remove(args)) => (&args.scene, &args.file),
        Some(Change::Reset(args)) => (&args.scene, &args.file),
    };
    let out = file.output.as_ref().unwrap_or(path);
    if let Some(output) = &file.output {
        output::check_replaceable(output, SCENE_COMMAND, file.force)?;
    }
    let mut document = super::read_scene(path)?;
    match &args.change {
        None => {}
        Some(Change::Set(args)) => set(&mut document, args)?,
        Some(Change::Add(AddArgs::Sun(args))) => {
            let sun = sun(&document.estimate, args, &Stages::new(global.quiet))?;
            add(&mut document, sun)?;
        }
        Some(Change::Add(AddArgs::Area(args))) => {
            let area = area(&document.estimate, args)?;
            add(&mut document, area)?;
        }
        Some(Change::Remove(args)) => remove(&mut document, &args.id)?,
        Some(Change::Reset(args)) => reset(&mut document, args.id.as_deref())?,
    }
    document.write(out, &output::signature(SCENE_COMMAND))?;
    say(&document, file.json)
}

fn set(document: &mut Document, args: &SetArgs) -> anyhow::Result<()> {
    let lights = document.lights();
    let light = find(&lights, &args.id)?;
    let mut change = document.light_edits.change_of(&args.id);
    change.scale = args.scale.unwrap_or(change.scale);
    change.color = args.color.or(change.color);
    change.at_m = args.at.or(change.at_m);
    change.on = (change.on || args.on) && !args.off;
    if args.at.is_some() && light.kind == LightKind::Sun {
        return Err(Usage(format!("--at: {} is a sun, which is infinitely far away", args.id)).into());
    }
    check(change.invalid_field())?;
    let found_at_m = light.position_m.unwrap_or(Vec3::ZERO);
    if document.light_edits.change(&args.id, found_at_m, change) { Ok(()) } else { Err(full()) }
}

fn add(document: &mut Document, light: AnalyticLight) -> anyhow::Result<()> {
    check(light.invalid_field())?;
    document.light_edits.add(light).map(|_| ()).ok_or_else(full)
}

fn remove(document: &mut Document, id: &str) -> anyhow::Result<()> {
    if document.light_edits.remove(id) {
        return Ok(());
    }
    find(&document.lights(), id)?;
    Err(Usage(format!("{id} was not added, it is of the estimate; `lights set {id} --off` turns it off")).into())
}

fn reset(document: &mut Document, id: Option<&str>) -> anyhow::Result<()> {
    let Some(id) = id else {
        document.light_edits = LightEdits::default();
        return Ok(());
    };
    // A light that is no longer there can be reset all the same.
    if !document.light_edits.emitters.iter().any(|edit| edit.id == id) {
        find(&document.lights(), id)?;
    }
    let _ = document.light_edits.change(id, Vec3::ZERO, LightChange::NONE);
    Ok(())
}

fn find<'a>(lights: &'a [ListedLight], id: &str) -> Result<&'a ListedLight, lights::LightsError> {
    lights.iter().find(|light| light.id == id).ok_or_else(|| lights::LightsError::Unknown {
        id: id.to_owned(),
        known: lights.iter().map(|light| light.id.clone()).collect(),
    })
}

fn check(wrong: Option<&'static str>) -> anyhow::Result<()> {
    wrong.map_or(Ok(()), |what| Err(Usage(format!("{what} is out of range")).into()))
}

fn full() -> anyhow::Error {
    Usage(format!("the scene has {MAX_LIGHT_EDITS} such lights already, and no more are kept")).into()
}

fn sun(estimate: &Arc<Estimate>, args: &SunArgs, stages: &Stages) -> anyhow::Result<AnalyticLight> {
    let direction = match (args.shadow, args.azimuth, args.elevation) {
        (Some(shadow), ..) => by_shadow(estimate, shadow, args.strength.is_some())?,
        (None, Some(azimuth), Some(elevation)) => lights::sun_direction(estimate, azimuth, elevation),
        _ => return Err(Usage("give --azimuth and --elevation, or --shadow".into()).into()),
    };
    let angular_radius_deg = 0.5 * args.angle as f32;
    if let Some(strength) = args.strength {
        let shape = LightShape::Sun { direction, angular_radius_deg, of_photo: false };
        let color = args.color.unwrap_or(LightColor::Rgb([1.0; 3]));
        return Ok(of_luminance(shape, color, |extent| strength as f32 / extent));
    }
    let [azimuth, elevation] = lights::sun_angles_deg(estimate, direction);
    let place = format!("azimuth {azimuth:.0}°, elevation {elevation:.0}°");
    let found = lightoctree::sun_from_photo(estimate, direction, angular_radius_deg).ok_or_else(|| {
        Usage(format!(
            "the photo shows no sun patches with sharp edges on what faces this sun ({place}); with --strength it shines in through all that the photo does not show"
        ))
    })?;
    let own = luminance(found.light.radiance);
    let clipped = if found.clipped { " at the least, since the photo is clipped there" } else { "" };
    stages.note(&format!(
        "the photo's own sun: {place}, strength {:.1}{clipped}; it shines on {:.1} % of what the photo shows",
        own * found.light.extent(),
        100.0 * found.lit_share
    ));
    Ok(args.color.map_or(found.light, |color| of_luminance(found.light.shape, color, |_| own)))
}

/// The direction of the sun that casts the shadow of the thing at one pixel to another one.
///
/// The photo need not support a free sun.
fn by_shadow(estimate: &Estimate, [thing, shadow]: [[f64; 2]; 2], is_free: bool) -> anyhow::Result<Vec3> {
    let camera = &estimate.frame.camera;
    for [u, v] in [thing, shadow] {
        if !camera.contains(u, v) {
            let (width, height) = (camera.width, camera.height);
            let message = format!("--shadow: {u},{v} lies outside of the photo, which has {width} × {height} pixels");
            return Err(Usage(message).into());
        }
    }
    let found = if is_free {
        lights::sun_from_shadow(estimate, thing, shadow).ok_or(ShadowError::NotBelow)
    } else {
        lightoctree::supported_sun(estimate, thing, shadow)
    };
    found.map_err(|error| Usage(format!("--shadow: {}", no_shadow(estimate, shadow, error))).into())
}

/// Why a shadow gives no sun, and what can be done.
fn no_shadow(estimate: &Estimate, [u, v]: [f64; 2], error: ShadowError) -> String {
    let ShadowError::Unsupported { direction, support } = error else {
        return format!("{error}; name the thing's pixel first, then the shadow's");
    };
    let [azimuth, elevation] = lights::sun_angles_deg(estimate, direction);
    let ShadowSupport { edges, sunny, explained, against, measured } = support;
    let (least, share) = (ShadowSupport::MIN_SUNNY, 100.0 * ShadowSupport::MIN_SUNNY_SHARE);
    let hidden = if measured {
        format!("; by the measured depth, {explained} could be a shadow's in this sun and {against} could not")
    } else {
        String::new()
    };
    format!(
        "no edge of a sun patch supports this sun (azimuth {azimuth:.0}°, elevation {elevation:.0}°). \
         Sharp edges on surfaces that face it, around {u},{v}: {edges} pixels, {sunny} of them with the colour of \
         sunlight; {least} and {share:.0} % are needed{hidden}. Name a shadow's edge beside a sun patch, give \
         --azimuth and --elevation if the sun is known, or --strength to add it whatever the photo shows"
    )
}

fn area(estimate: &Estimate, args: &AreaArgs) -> anyhow::Result<AnalyticLight> {
    let up = estimate.up();
    let shape = match (args.size, args.direction, args.radius) {
        (Some(size_m), Some(direction), _) => lights::rectangle(args.at, direction, up, size_m, args.two_sided),
        (_, _, Some(radius)) => LightShape::Sphere { centre_m: args.at, radius_m: radius as f32 },
        _ => return Err(Usage("give --size with --direction, or --radius".into()).into()),
    };
    let luminance = |extent: f32| match (args.radiance, args.power) {
        (Some(radiance), _) => radiance as f32,
        (None, power) => power.unwrap_or(0.0) as f32 / (std::f32::consts::PI * extent),
    };
    Ok(of_luminance(shape, args.color, luminance))
}

/// Of this shape and colour, and the luminance by its extent.
fn of_luminance(shape: LightShape, color: LightColor, luminance: impl Fn(f32) -> f32) -> AnalyticLight {
    let dark = AnalyticLight { shape, radiance: [0.0; 3] };
    let radiance = lights::rgb_from_color(color) * luminance(dark.extent());
    AnalyticLight { radiance: radiance.to_array(), ..dark }
}

fn say(document: &Document, as_json: bool) -> anyhow::Result<()> {
    let lights = document.lights();
    if as_json {
        return report::print_json(&json!({ "lights": lights }));
    }
    if lights.is_empty() {
        report::print(&format!(
            "no lights: nothing in this scene is brighter than {} times the mean of its surfaces",
            lights::CAP
        ));
        return Ok(());
    }
    let head = [
        "light",
        "what",
        "known by",
        "middle, m",
        "shines to",
        "size, m",
        "radiance",
        "colour",
        "share",
        "sure",
        "changed",
    ];
    let rows: Vec<Vec<String>> = lights.iter().map(row).collect();
    report::print(&report::table(&head, &rows));
    Ok(())
}

/// One line of the table.
fn row(light: &ListedLight) -> Vec<String> {
    let point = |p: Vec3| format!("{:.2},{:.2},{:.2}", p.x, p.y, p.z);
    let direction = match (light.direction, light.kind) {
        // Towards it, as it was added.
        (Some(direction), LightKind::Sun) => point(-direction),
        (Some(direction), _) => point(direction),
        (None, _) => "all around".to_owned(),
    };
    let size = match (light.size_m, light.radius_m, light.angular_radius_deg, light.area_m2) {
        (Some([width, height]), ..) => format!("{width:.2} x {height:.2}"),
        (_, Some(radius), ..) => format!("radius {radius:.2}"),
        (_, _, Some(radius), _) => format!("{:.2} deg", 2.0 * radius),
        (.., Some(area)) => format!("{area:.2} m2"),
        _ => String::new(),
    };
    let luminance = lightoctree::imaging::luminance(light.radiance);
    let radiance =
        light.irradiance.map_or_else(|| short(luminance), |strength| format!("strength {}", short(strength)));
    let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    vec![
        light.id.clone(),
        kind(light.kind).to_owned(),
        known_by(light.origin).to_owned(),
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
        or_none(light.change.map(changed)),
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

fn known_by(origin: LightOrigin) -> &'static str {
    match origin {
        LightOrigin::Observed => "photo",
        LightOrigin::Panorama => "panorama",
        LightOrigin::Inferred => "guess",
        LightOrigin::Added => "you",
    }
}

fn changed(change: LightChange) -> String {
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

/// Three digits.
fn short(value: f32) -> String {
    let digits = (2 - value.abs().max(1e-3).log10().floor() as i32).clamp(0, 3) as usize;
    format!("{value:.digits$}")
}

fn scale(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(scale) if (0.0..=MAX_LIGHT_SCALE).contains(&scale) => Ok(scale),
        _ => Err(format!("must be a number from 0 to {MAX_LIGHT_SCALE}")),
    }
}

fn elevation(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(angle) if (-90.0..=90.0).contains(&angle) => Ok(angle),
        _ => Err("must be a number of degrees from -90 to 90".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_said_in_short() {
        let change =
            LightChange { on: false, scale: 2.5, color: Some(LightColor::Kelvin(3000.0)), at_m: Some(Vec3::Y) };
        assert_eq!(changed(change), "off; x 2.5; 3000 K; at 0,1,0");
        assert_eq!(
            changed(LightChange { color: Some(LightColor::Rgb([1.0, 0.5, 0.0])), ..LightChange::NONE }),
            "rgb 1,0.5,0"
        );
        assert_eq!([0.01234, 1.234, 12.34, 1234.0].map(short), ["0.012", "1.23", "12.3", "1234"]);
    }
}
