//! A web page that shows objects in the photo, without a server: [`write_web`].

mod grid;

use std::io::Write;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use lo_geometry::Orientation;
use lo_imaging::{DepthMap, RadianceImage};
use lo_scene::LitScene;
use serde_json::json;

use crate::shown_photo::shown_photo;
use crate::{ExportError, header, photo_mesh};

pub use grid::WebGrid;

/// Height in pixels of the panoramas that the page interpolates.
pub const WEB_PANORAMA_HEIGHT: usize = 64;

/// The page itself. [`header::GENERATOR`] and the title are inserted.
const INDEX: &str = include_str!("index.html");
/// The page's program, with three.js inside: built by `npm run build` in `page`.
const PROGRAM: &str = include_str!("page.js");
const THREE_LICENSE: &str = include_str!("three-LICENSE.txt");

/// Summary of a written page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WebReport {
    /// The page, then the files that it needs.
    pub files: Vec<PathBuf>,
    /// Size of all files in bytes.
    pub bytes: u64,
    /// Number of light probes.
    pub probes: usize,
    /// Number of triangles of the photo's surfaces.
    pub triangles: usize,
}

/// The light at one point of a [`WebGrid`], in our orientation and of [`WEB_PANORAMA_HEIGHT`].
#[derive(Clone, Debug)]
pub struct WebProbe {
    /// The panorama.
    pub radiance: RadianceImage,
    /// Distances of what it shows, in metres.
    pub distance_m: DepthMap,
}

/// Writes a page to a folder, which is created: `index.html`, its program, the room, and the licence of three.js.
///
/// The page shows the photo with an object that can be moved over the surfaces that the photo shows. It interpolates
/// the light among `probes`, which are those of the scene at [`WebGrid::points`]. It is opened as a file or from any
/// web server, and needs WebGL 2.
///
/// # Errors
/// If no pixel of the photo has depth, or a file cannot be written.
///
/// # Panics
/// If the number or the size of `probes` is another one.
pub fn write_web(
    scene: &LitScene,
    title: &str,
    grid: &WebGrid,
    probes: &[WebProbe],
    folder: &Path,
) -> Result<WebReport, ExportError> {
    let points = grid.points();
    assert_eq!(points.len(), probes.len(), "one probe for each point of the grid");
    let frame = &scene.frame;
    let mesh = photo_mesh::of_scene(scene);
    if mesh.triangles.is_empty() {
        return Err(ExportError::Nothing(crate::Content::PhotoPoints));
    }
    let (mut radiance, mut distances) = (Halves::default(), Halves::default());
    for probe in probes {
        assert_eq!((probe.radiance.width(), probe.radiance.height()), (2 * WEB_PANORAMA_HEIGHT, WEB_PANORAMA_HEIGHT));
        // Textures begin with the lowest row.
        let turned = lo_imaging::reorient(&probe.radiance, Orientation::Lightoctree, Orientation::Threejs);
        turned.pixels().chunks(turned.width()).rev().for_each(|row| radiance.extend(row.as_flattened()));
        let turned = lo_imaging::reorient_depth(&probe.distance_m, Orientation::Lightoctree, Orientation::Threejs);
        turned.pixels().chunks(turned.width()).rev().for_each(|row| distances.extend(row));
    }
    let free: Vec<u8> = points.iter().map(|&point| u8::from(grid::is_free(scene, point))).collect();
    let photo = lo_imaging::encode_srgb8("photo.jpg", &shown_photo(frame), lo_imaging::JPEG_QUALITY, header::SOFTWARE)?;
    let camera = &frame.camera;
    let le_bytes = |values: &[f32]| BASE64.encode(bytemuck::cast_slice::<f32, u8>(values));
    let positions: Vec<f32> = mesh.positions_m.iter().flat_map(|point| point.to_array()).collect();
    let room = json!({
        "generator": header::GENERATOR,
        "photo": format!("data:image/jpeg;base64,{}", BASE64.encode(photo)),
        "camera": {
            "width": camera.width, "height": camera.height,
            "fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy,
        },
        "up": scene.up().to_array(),
        "mesh": {
            "positions": le_bytes(&positions),
            "triangles": BASE64.encode(bytemuck::cast_slice::<u32, u8>(mesh.triangles.as_flattened())),
        },
        "probes": {
            "axes": grid.axes.to_cols_array_2d(),
            "origin": grid.origin_m.to_array(),
            "spacing": grid.spacing_m.to_array(),
            "counts": grid.counts,
            "size": [2 * WEB_PANORAMA_HEIGHT, WEB_PANORAMA_HEIGHT],
            "free": BASE64.encode(&free),
            "radiance": BASE64.encode(&radiance.0),
            "distance": BASE64.encode(&distances.0),
        },
    });
    let index = INDEX.replace("{generator}", header::GENERATOR).replace("{title}", &escaped(title));
    let files = [
        ("page.js", PROGRAM.to_owned()),
        ("room.js", format!("lightoctreeRoom = {room};\n")),
        ("three-LICENSE.txt", THREE_LICENSE.to_owned()),
        // Last: whoever finds it finds the others.
        ("index.html", index),
    ];
    std::fs::create_dir_all(folder)?;
    let mut report = WebReport { files: Vec::new(), bytes: 0, probes: points.len(), triangles: mesh.triangles.len() };
    for (name, content) in files {
        let path = folder.join(name);
        lo_imaging::write_atomically(&path, |file| file.write_all(content.as_bytes()))?;
        report.bytes += content.len() as u64;
        report.files.push(path);
    }
    report.files.rotate_right(1);
    Ok(report)
}

/// Half floats as little-endian bytes.
#[derive(Default)]
struct Halves(Vec<u8>);

impl Halves {
    /// Appends values; larger ones than halves can hold are clamped.
    fn extend(&mut self, values: &[f32]) {
        let halves = values.iter().map(|value| half::f16::from_f32(value.min(half::f16::MAX.to_f32())));
        self.0.extend(halves.flat_map(half::f16::to_le_bytes));
    }
}

/// Replaces the characters of a text that HTML reserves.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use serde_json::Value;

    use super::*;
    use crate::test_scene::box_room;

    #[test]
    fn the_page_has_the_rooms_numbers() {
        let scene = box_room();
        let grid = WebGrid::of(&scene).unwrap();
        let radiance = RadianceImage::from_fn(128, 64, |x, y| [x as f32, y as f32, 1e9]);
        let distance_m = DepthMap::from_fn(128, 64, |x, _| x as f32);
        let probes = vec![WebProbe { radiance, distance_m }; grid.points().len()];
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("new/page");
        let report = write_web(&scene, "<room> & \"co\"", &grid, &probes, &folder).unwrap();
        let index = std::fs::read_to_string(&report.files[0]).unwrap();
        assert!(
            index.contains("<title>&lt;room> &amp; &quot;co&quot;</title>") && index.contains("lightoctree export")
        );
        let text = std::fs::read_to_string(folder.join("room.js")).unwrap();
        let json = text.strip_prefix("lightoctreeRoom = ").unwrap().trim_end().strip_suffix(';').unwrap();
        let room: Value = serde_json::from_str(json).unwrap();
        let bytes = |value: &Value| BASE64.decode(value.as_str().unwrap()).unwrap();
        assert_eq!(bytes(&room["mesh"]["triangles"]).len(), 12 * report.triangles);
        assert_eq!(bytes(&room["probes"]["free"]).len(), report.probes);
        let halves = |name: &str| -> Vec<f32> {
            let bytes = bytes(&room["probes"][name]);
            bytes.chunks(2).map(|pair| half::f16::from_le_bytes([pair[0], pair[1]]).to_f32()).collect()
        };
        assert_eq!(halves("distance")[32], 64.0);
        let halves = halves("radiance");
        assert_eq!(halves.len(), report.probes * 128 * 64 * 3);
        // The lowest row first; the column of -Z, our 64, is that at a quarter in three.js.
        assert_eq!(halves[3 * 32..][..3], [64.0, 63.0, 65504.0]);
        assert_eq!(report.files.len(), 4);
        let total: u64 = report.files.iter().map(|file| file.metadata().unwrap().len()).sum();
        assert_eq!(report.bytes, total);
    }
}
