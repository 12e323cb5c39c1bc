//! `lightoctree inspect SCENE`: prints the contents of a scene file.

use std::path::PathBuf;

use anyhow::Context;
use lightoctree::Document;
use lo_geometry::Vec3;
use lo_imaging::{GainMap, Photo, luminance};
use lo_octree::LightOctree;
use lo_scene::{Frame, LightEdits};
use serde::Serialize;

use super::light;
use crate::report;

/// Options of `inspect`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  lightoctree inspect room.scene\n  lightoctree inspect room.scene --json | jq .octree.levels"
)]
pub struct Args {
    /// Scene file
    scene: PathBuf,

    /// Print a JSON object instead of tables
    #[arg(long)]
    json: bool,
}

/// The object that `--json` prints. The order of the fields is part of the format.
#[derive(Serialize)]
struct Summary {
    format_version: u32,
    octree: OctreeSummary,
    camera: CameraSummary,
    photo: PhotoSummary,
    /// Origin of the camera's intrinsics, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    camera_source: Option<lightoctree::CameraSource>,
    exposure: f32,
    completion: lo_scene::Completion,
    room: Option<lo_scene::Room>,
    /// Expected error of the room's up direction in degrees, if the network predicted it.
    #[serde(skip_serializing_if = "Option::is_none")]
    up_deviation_deg: Option<f32>,
    sources: Vec<String>,
    bytes: u64,
    radiance: RadianceSummary,
    seen_share: f64,
    inferred_share: f64,
    predicted_depth: bool,
    /// Depth model that predicted the depth, unless it is the built-in network.
    #[serde(skip_serializing_if = "Option::is_none")]
    depth_model: Option<String>,
    /// The light network's confidence, from 0 to 1: mean over the leaves, weighted by area.
    mean_confidence: Option<f64>,
    /// The panorama of the room, if it was estimated with one.
    #[serde(skip_serializing_if = "Option::is_none")]
    panorama: Option<PanoramaSummary>,
    /// Photos after the first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    other_photos: Vec<lo_scene::OtherPhoto>,
    /// The user's light edits, which the other fields do not include.
    #[serde(skip_serializing_if = "LightEdits::is_empty")]
    light_edits: LightEdits,
    /// Inserted objects.
    #[serde(skip_serializing_if = "Option::is_none")]
    objects: Option<ObjectsSummary>,
}

#[derive(Serialize)]
struct ObjectsSummary {
    /// Names of the objects.
    names: Vec<String>,
    /// Mesh files in the scene file.
    files: Vec<String>,
    /// Size of these files.
    bytes: usize,
}

#[derive(Serialize)]
struct PanoramaSummary {
    #[serde(flatten)]
    source: lo_scene::PanoramaSource,
    /// Share of the leaves, by area, whose radiance comes from the panorama.
    share: f64,
}

#[derive(Serialize)]
struct OctreeSummary {
    depth: u32,
    full_depth: u32,
    origin_m: [f32; 3],
    edge_m: f32,
    levels: Vec<LevelSummary>,
}

#[derive(Serialize)]
struct LevelSummary {
    depth: u32,
    total: usize,
    nonempty: usize,
    split: usize,
}

#[derive(Serialize)]
struct CameraSummary {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: u32,
    height: u32,
    hfov_deg: f64,
}

#[derive(Serialize)]
struct PhotoSummary {
    width: usize,
    height: usize,
    depth_width: usize,
    depth_height: usize,
    depth_readings_share: f64,
    /// Name of the colour profile; sRGB if there is none.
    colour_profile: Option<String>,
    /// Largest gain of the gain map, stops.
    gain_map_stops: Option<f32>,
    /// Whether EXIF and XMP are kept for composites.
    exif: bool,
    xmp: bool,
}

impl PhotoSummary {
    fn new(frame: &Frame) -> Self {
        let depth_m = &frame.depth_m;
        let readings = depth_m.pixels().iter().filter(|z| **z > 0.0).count();
        let encoding = match &frame.photo {
            Photo::Encoded8(photo) => Some(&photo.encoding),
            _ => None,
        };
        let gain = |map: &GainMap| map.parameters.max_log2.into_iter().fold(0.0, f32::max);
        Self {
            width: frame.photo.width(),
            height: frame.photo.height(),
            depth_width: depth_m.width(),
            depth_height: depth_m.height(),
            depth_readings_share: readings as f64 / depth_m.pixels().len().max(1) as f64,
            colour_profile: encoding.and_then(|e| e.profile.as_ref()).map(|profile| profile.name().to_owned()),
            gain_map_stops: encoding.and_then(|e| e.gain_map.as_ref()).map(gain),
            exif: encoding.is_some_and(|e| !e.exif.is_empty()),
            xmp: encoding.is_some_and(|e| !e.xmp.is_empty()),
        }
    }

    /// Describes its encoding, as the end of a line.
    fn encoding(&self) -> String {
        let profile = self.colour_profile.as_ref().map(|name| format!("colour profile {name}"));
        let gain = self.gain_map_stops.map(|stops| format!("gain map, highlights up to {stops:.1} stops above white"));
        let kept = match (self.exif, self.xmp) {
            (true, true) => Some("EXIF and XMP".to_owned()),
            (true, false) => Some("EXIF".to_owned()),
            (false, true) => Some("XMP".to_owned()),
            (false, false) => None,
        };
        [profile, gain, kept].into_iter().flatten().map(|part| format!("; {part}")).collect()
    }
}

/// Percentiles of the leaves' luminance; the photo's white is 1.
#[derive(Serialize)]
struct RadianceSummary {
    min: f32,
    p05: f32,
    median: f32,
    p95: f32,
    p99: f32,
    max: f32,
}

/// Reads the scene and prints its contents.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let document = Document::read(&args.scene)?;
    let bytes = std::fs::metadata(&args.scene).with_context(|| format!("{}", args.scene.display()))?.len();
    let summary = summarise(&document, bytes);
    if args.json {
        return report::print_json(&summary);
    }
    print_tables(&summary);
    Ok(())
}

/// Summarises the inserted objects, if there are any.
fn objects_summary(document: &Document) -> Option<ObjectsSummary> {
    let files = &document.meshes;
    document.layout.as_ref().map(|layout| ObjectsSummary {
        names: layout.objects().iter().map(|object| object.name().to_owned()).collect(),
        files: files.keys().cloned().collect(),
        bytes: files.values().map(|bytes| bytes.len()).sum(),
    })
}

fn summarise(document: &Document, bytes: u64) -> Summary {
    let (scene, origin) = (&document.estimate, &document.estimate.origin);
    let light = &scene.light;
    let levels = light.octree.levels().iter().enumerate().map(|(depth, level)| LevelSummary {
        depth: depth as u32,
        total: level.keys.len(),
        nonempty: level.nonempty,
        split: level.children.iter().filter(|child| **child >= 0).count(),
    });
    let seen_share = mean_share(light, &light.seen);
    let panorama = scene.panorama.as_ref();
    let panorama = panorama
        .map(|panorama| PanoramaSummary { source: panorama.source.clone(), share: mean_share(light, &panorama.share) });
    let known_share = seen_share + panorama.as_ref().map_or(0.0, |panorama| panorama.share);
    let camera = scene.frame.camera;
    Summary {
        format_version: lo_scene::FORMAT_VERSION,
        octree: OctreeSummary {
            depth: light.octree.depth(),
            full_depth: light.octree.full_depth(),
            origin_m: light.cube.origin_m.to_array(),
            edge_m: light.cube.edge_m,
            levels: levels.collect(),
        },
        camera: CameraSummary {
            fx: camera.fx,
            fy: camera.fy,
            cx: camera.cx,
            cy: camera.cy,
            width: camera.width,
            height: camera.height,
            hfov_deg: camera.hfov_deg(),
        },
        photo: PhotoSummary::new(&scene.frame),
        camera_source: origin.camera_source,
        up_deviation_deg: origin.up_deviation_deg,
        exposure: scene.frame.exposure,
        completion: origin.completion,
        room: scene.room.clone(),
        sources: origin.sources.clone(),
        bytes,
        radiance: percentiles(light),
        seen_share,
        inferred_share: if light.leaves().next().is_some() { 1.0 - known_share } else { 0.0 },
        predicted_depth: origin.predicted_depth,
        depth_model: origin.depth_model.clone(),
        other_photos: scene.other_photos.clone(),
        light_edits: document.light_edits.clone(),
        objects: objects_summary(document),
        mean_confidence: scene.confidence.as_ref().map(|confidence| mean_share(light, confidence)),
        panorama,
    }
}

/// Returns the mean over the leaves, weighted by the area of their faces, of `shares[depth][row] / 255`.
fn mean_share(light: &LightOctree, shares: &[Vec<u8>]) -> f64 {
    let (mut sum, mut areas) = (0.0, 0.0);
    for (depth, row) in light.leaves() {
        let area = 0.25f64.powi(depth as i32);
        sum += area * f64::from(shares[depth][row]) / 255.0;
        areas += area;
    }
    if areas > 0.0 { sum / areas } else { 0.0 }
}

fn percentiles(light: &LightOctree) -> RadianceSummary {
    let leaf_luminance = |(depth, row): (usize, usize)| {
        let [r, g, b, _] = light.rgba[depth][row];
        luminance([r, g, b])
    };
    let mut values: Vec<f32> = light.leaves().map(leaf_luminance).collect();
    values.sort_by(f32::total_cmp);
    let at =
        |share: f64| values.get(((values.len().max(1) - 1) as f64 * share).round() as usize).copied().unwrap_or(0.0);
    RadianceSummary { min: at(0.0), p05: at(0.05), median: at(0.5), p95: at(0.95), p99: at(0.99), max: at(1.0) }
}

fn print_tables(summary: &Summary) {
    let octree = &summary.octree;
    let rows: Vec<Vec<String>> = octree
        .levels
        .iter()
        .map(|level| [level.depth as usize, level.total, level.nonempty, level.split].map(|n| n.to_string()).to_vec())
        .collect();
    let leaf_cm = 100.0 * octree.edge_m / (1u32 << octree.depth) as f32;
    let [x, y, z] = octree.origin_m;
    report::print(&format!(
        "octree   depth {}, full to {}; cube of {:.2} m at ({x:.2}, {y:.2}, {z:.2}); leaves of {leaf_cm:.1} cm",
        octree.depth, octree.full_depth, octree.edge_m
    ));
    report::print(&report::table(&["depth", "total", "non-empty", "split"], &rows));
    let (camera, photo) = (&summary.camera, &summary.photo);
    report::print(&format!(
        "camera   fx {:.1}  fy {:.1}  cx {:.1}  cy {:.1}  {} × {}  field of view {:.1}°{}",
        camera.fx,
        camera.fy,
        camera.cx,
        camera.cy,
        camera.width,
        camera.height,
        camera.hfov_deg,
        summary.camera_source.map(|source| format!(" ({source})")).unwrap_or_default()
    ));
    report::print(&format!("photo    {} × {}{}", photo.width, photo.height, photo.encoding()));
    if let Some(room) = &summary.room {
        let [right, above, back] = room.up.to_array();
        let error = summary.up_deviation_deg.map(|deg| format!(" (estimated from the photo, ± {deg:.0}°)"));
        report::print(&format!("up       ({right:+.3}, {above:+.3}, {back:+.3}){}", error.unwrap_or_default()));
    }
    report::print(&format!(
        "depth    {}{}, {} × {}, readings in {:.1} % of the pixels",
        if summary.predicted_depth { "predicted" } else { "measured" },
        summary.depth_model.as_ref().map(|model| format!(" by {model}")).unwrap_or_default(),
        photo.depth_width,
        photo.depth_height,
        100.0 * photo.depth_readings_share
    ));
    for (index, photo) in summary.other_photos.iter().enumerate() {
        let (position, view) = (photo.first_from_camera.translation_m, photo.first_from_camera.direction(Vec3::NEG_Z));
        report::print(&format!(
            "photo {}  at ({:.2}, {:.2}, {:.2}), looks along ({:+.2}, {:+.2}, {:+.2})  field of view {:.1}°  \
             exposure {:+.2} EV",
            index + 2,
            position.x,
            position.y,
            position.z,
            view.x,
            view.y,
            view.z,
            photo.camera.hfov_deg(),
            -photo.exposure.log2()
        ));
    }
    let radiance = &summary.radiance;
    report::print(&format!(
        "radiance luminance of the leaves: min {:.3}  5 % {:.3}  median {:.3}  95 % {:.3}  99 % {:.3}  max {:.3}",
        radiance.min, radiance.p05, radiance.median, radiance.p95, radiance.p99, radiance.max
    ));
    let confidence = summary.mean_confidence.map(|mean| format!(", mean confidence {mean:.2}")).unwrap_or_default();
    let panorama = summary.panorama.as_ref();
    let panorama = panorama.map(|panorama| format!("{:.1} % from the panorama, ", 100.0 * panorama.share));
    let panorama = panorama.unwrap_or_default();
    report::print(&format!(
        "leaves   {:.1} % observed, {panorama}{:.1} % inferred, by area{confidence}",
        100.0 * summary.seen_share,
        100.0 * summary.inferred_share
    ));
    let LightEdits { emitters, added, inferred } = &summary.light_edits;
    if let Some(inferred) = inferred {
        report::print(&format!("light    {}, chosen in the viewer", light::description(inferred)));
    }
    if summary.light_edits.has_lights() {
        let names = |ids: Vec<&str>| if ids.is_empty() { "none".to_owned() } else { ids.join(", ") };
        report::print(&format!(
            "lights   edited: {}; added: {} (details: `lightoctree lights`; the lines above describe the estimate)",
            names(emitters.iter().map(|edit| &edit.id[..]).collect()),
            names(added.iter().map(|light| &light.id[..]).collect())
        ));
    }
    if let Some(ObjectsSummary { names, files, bytes }) = &summary.objects {
        let mesh_files = if files.is_empty() {
            String::new()
        } else {
            format!("; mesh files: {}, {}", files.join(", "), report::bytes(*bytes as u64))
        };
        report::print(&format!(
            "objects  {}{mesh_files} (`lightoctree insert` without --mesh inserts them)",
            names.join(", ")
        ));
    }
    if let Some(PanoramaSummary { source, .. }) = &summary.panorama {
        let [x, y, z] = source.position_m.to_array();
        report::print(&format!(
            "panorama {} at ({x:.2}, {y:.2}, {z:.2}); yaw {:.1}°, pitch {:+.1}°, roll {:+.1}°; {:+.2} EV; confidence {:.2}{}",
            source.file,
            source.yaw_deg,
            source.pitch_deg,
            source.roll_deg,
            source.exposure_ev,
            source.confidence,
            if source.clipped { "; clipped" } else { "" }
        ));
    }
    if let Some(room) = &summary.room {
        for plane in &room.planes {
            let n = plane.plane.normal;
            report::print(&format!(
                "plane    {:<8} normal ({:+.3}, {:+.3}, {:+.3})  offset {:+.2} m  {}",
                format!("{:?}", plane.side).to_lowercase(),
                n.x,
                n.y,
                n.z,
                plane.plane.offset_m,
                if plane.measured { "measured" } else { "assumed" }
            ));
        }
    }
    report::print(&format!("file     {}, from {}", report::bytes(summary.bytes), summary.sources.join(" and ")));
}
