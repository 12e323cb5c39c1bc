//! Export of scenes for other programs: PLY point clouds, glTF binaries, USD stages and packages, and web pages.
//!
//! Point clouds, glTF and USD stages contain the octree's leaves (or the photo's pixels) with their HDR radiance. The
//! axes are those of our world frame (right-handed, +Y up, the photo's camera at the origin looks along −Z, metres) or
//! of a levelled one.
//!
//! glTF and USD contain the leaves as an emissive mesh, the camera and the room's lamps. USD also contains the
//! observed surface, textured with the photo. Light probes are written as OpenEXR files beside the scene, oriented
//! for the format's readers.
//!
//! [`write_web`] writes a web page that shows objects in the photo.
//!
//! [`RoomFaces`] is the mesh of leaves for other uses.
//!
//! Radiance is relative: 1.0 is the photo's white. Mesh, lamps and probes have one scale.
//!
//! Output is deterministic.

mod atlas;
mod content;
mod error;
mod faces;
mod format;
mod free_space;
mod glb;
mod header;
mod lamps;
mod lit_side;
mod names;
mod photo_mesh;
mod ply;
mod points;
mod probe;
mod restored;
mod room_mesh;
mod shown_photo;
mod sibling_file;
#[cfg(test)]
mod test_scene;
mod usda;
mod usdz;
mod web;
mod world_frame;

use std::io::Write;
use std::path::{Path, PathBuf};

use lo_imaging::{ExrOptions, Photo, RadianceImage};
use lo_lights::ListedLight;
use lo_scene::LitScene;

pub use content::Content;
pub use error::ExportError;
pub use faces::RoomFaces;
pub use format::Format;
pub use probe::LightProbe;
pub use web::{WEB_PANORAMA_HEIGHT, WebGrid, WebProbe, WebReport, write_web};

use probe::ProbeFile;
use sibling_file::SiblingFile;
use world_frame::WorldFrame;

/// Options of an export.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// File format.
    pub format: Format,
    /// Exported part of the scene.
    pub content: Content,
    /// Whether the world is levelled, with gravity along −Y and the floor at height 0; otherwise it is the camera's
    /// frame.
    pub level: bool,
    /// Light probes; written as `<name>_probe.exr`, `<name>_probe2.exr`, … beside the scene.
    pub probes: &'a [LightProbe<'a>],
    /// The scene's lights, which lamps are named after. Other emitters remain in the mesh. Empty if unknown: lamps are
    /// numbered.
    pub lights: &'a [ListedLight],
}

/// Summary of an export.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The scene file, then the files beside it: probes, and textures of USD.
    pub files: Vec<PathBuf>,
    /// Size of the scene file in bytes.
    pub bytes: u64,
    /// Number of points (PLY, photo points) or of corners of the leaves' faces.
    pub points: usize,
    /// Number of quads of the leaves' visible faces (0 for points).
    pub faces: usize,
    /// Number of lamps from the brightest leaves and of added ones (0 for PLY).
    pub lamps: usize,
    /// For each of [`Options::lights`], the number of its lamps. Lights without lamps emit by their faces in the mesh.
    pub lamps_of_light: Vec<(String, usize)>,
}

/// Writes `scene` to `path`, and its further files beside it.
///
/// Each file is written atomically and replaces an existing one.
///
/// # Errors
/// If the scene has no content or values that are not finite, if the result is too large for the format, if it is to
/// be levelled and gravity is unknown, or if a file cannot be written.
pub fn write(scene: &LitScene, options: &Options, path: impl AsRef<Path>) -> Result<Report, ExportError> {
    let path = path.as_ref();
    let Options { format, content, .. } = *options;
    let panorama = scene.panorama.as_ref();
    let leaves = free_space::leaves(&scene.light, panorama.map(|laid| &laid.share[..]));
    let mut points = match content {
        Content::Leaves => points::from_leaves(&leaves),
        Content::PhotoPoints => points::from_photo(&scene.frame),
    };
    if points.is_empty() {
        return Err(ExportError::Nothing(content));
    }
    for (index, point) in points.iter().enumerate() {
        if let Some(value) = point.non_finite() {
            return Err(ExportError::NotFinite { content, index, value });
        }
    }
    if format == Format::Usdz && content == Content::PhotoPoints {
        return Err(ExportError::NoPoints);
    }
    let is_level = options.level || (format == Format::Usdz && scene.room.is_some());
    let level = if is_level { WorldFrame::of(scene.room.as_ref())? } else { WorldFrame::CAMERA };
    let probe = |(index, probe): (usize, &LightProbe)| ProbeFile::beside(path, index, format, *probe, level);
    let probes: Vec<ProbeFile> = options.probes.iter().enumerate().map(probe).collect::<Result<_, _>>()?;
    let mut lamps = if format.has_lamps() {
        let places = lit_side::places(&scene.frame);
        lamps::find_lamps(&lit_side::lit_sides(&scene.light, &leaves, lamps::WHITE, &places))
    } else {
        Vec::new()
    };
    if format == Format::Glb {
        lamps.retain(glb::has_lamp);
    }
    if !options.lights.is_empty() {
        names::name_emitters(&mut lamps, options.lights);
    }
    let kept = lamps::face_emission(&leaves, &lamps);
    // Added lights have no leaves; their lamps have all of their light.
    if let Some(edited) = scene.edited.as_ref().filter(|_| format.has_lamps()) {
        let mut added = lamps::added_lamps(&edited.lights);
        names::name_added(&mut added, options.lights);
        lamps.extend(added);
    }
    let lamps_of_light = names::number(&mut lamps, options.lights);
    let room = (content == Content::Leaves && format != Format::Ply)
        .then(|| room_mesh::from_leaves(&leaves, &kept, &scene.light.cube, scene.light.octree.depth()));
    let mut report = Report {
        files: vec![path.to_owned()],
        bytes: 0,
        points: points.len(),
        faces: 0,
        lamps: lamps.len(),
        lamps_of_light,
    };
    if let Some(room) = &room {
        report.points = room.positions_m.len();
        report.faces = room.quads.len();
    }
    let camera = &scene.frame.camera;
    // Write the other files first: a scene must never refer to a missing texture.
    let bytes = match format {
        Format::Ply => {
            for point in &mut points {
                point.position_m = level.rotation * point.position_m + level.camera_m;
                point.normal = level.rotation * point.normal;
            }
            let frame = if options.level { header::LEVEL_FRAME } else { header::FRAME };
            ply::encode(&points, frame, &probes, panorama.is_some())
        }
        Format::Glb => {
            let shown = room.as_ref().map_or(glb::SceneGeometry::Points(&points), glb::SceneGeometry::Room);
            glb::encode(&shown, camera, level, &lamps, &probes)?
        }
        Format::Usda => match room {
            Some(room) => {
                let restored = restored::of_scene(scene, &leaves, &kept);
                let encode = |shown: &usda::SceneGeometry| usda::encode(shown, camera, level, &lamps, &probes);
                usda_room(scene, room, restored, path, encode, &mut report)?
            }
            None => {
                usda::encode(&usda::SceneGeometry::Points(&points, panorama.is_some()), camera, level, &lamps, &probes)
            }
        }
        .into_bytes(),
        Format::Usdz => usdz::encode(scene, room.ok_or(ExportError::NoPoints)?, level)?,
    };
    for probe in &probes {
        probe.write()?;
        report.files.push(probe.file.path.clone());
    }
    report.bytes = bytes.len() as u64;
    lo_imaging::write_atomically(path, |file| file.write_all(&bytes))?;
    Ok(report)
}

/// Encodes the room's stage with `encode` and writes its textures. `restored` is the photo's radiance with restored
/// highlights, if it differs from the photo.
fn usda_room(
    scene: &LitScene,
    mut room: room_mesh::RoomMesh,
    restored: Option<RadianceImage>,
    path: &Path,
    encode: impl Fn(&usda::SceneGeometry) -> String,
    report: &mut Report,
) -> Result<String, ExportError> {
    let frame = &scene.frame;
    room.move_behind_photo(scene.surface());
    let photo = photo_mesh::of_scene(scene);

    let options = ExrOptions { generator: header::SOFTWARE.to_owned(), half: true, ..ExrOptions::default() };
    let mut texture = |ending: &str, radiance: &RadianceImage| -> Result<usda::Texture, ExportError> {
        let file = SiblingFile::new(path, ending)?;
        lo_imaging::write_radiance(&file.path, radiance, &options)?;
        report.files.push(file.path);
        Ok(usda::Texture { file: file.name, space: "raw" })
    };
    let room_texture = texture("room.exr", &room.texture())?;
    let seen = restored.map(|radiance| texture("seen.exr", &radiance)).transpose()?;
    let shown_as_is = match &frame.photo {
        Photo::Srgb8(_) => true,
        Photo::Encoded8(photo) => photo.encoding.gain_map.is_none(),
        Photo::Linear(_) => false,
    };
    let photo_texture = if shown_as_is && frame.exposure == 1.0 {
        let file = SiblingFile::new(path, "photo.png")?;
        // renderers ignore the profiles of textures
        lo_imaging::write_srgb8(&file.path, &frame.photo.srgb8(), lo_imaging::JPEG_QUALITY, header::SOFTWARE)?;
        report.files.push(file.path);
        usda::Texture { file: file.name, space: "sRGB" }
    } else {
        texture("photo.exr", &frame.radiance())?
    };
    let meshes = usda::Meshes {
        room: &room,
        room_texture: &room_texture,
        photo: &photo,
        photo_texture: &photo_texture,
        seen_texture: seen.as_ref().unwrap_or(&photo_texture),
        beyond_m: 2.0 * scene.light.cube.edge_m,
    };
    Ok(encode(&usda::SceneGeometry::Room(meshes)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use lo_geometry::Vec3;
    use lo_imaging::RadianceImage;
    use lo_scene::{AnalyticLight, EmitterEdit, LightChange, LightEdits, LightShape};

    use super::*;
    use crate::test_scene::box_room;

    #[test]
    fn formats_have_names() {
        for format in Format::ALL {
            assert_eq!(format.to_string().to_uppercase().parse::<Format>().unwrap(), format);
        }
        let error = "obj".parse::<Format>().unwrap_err().to_string();
        assert_eq!(error, "unknown export format \"obj\"; supported are ply, glb, usda and usdz");
    }

    #[test]
    fn every_format_and_content_is_written_twice_the_same() {
        let scene = box_room();
        let folder = tempfile::tempdir().unwrap();
        let panorama = RadianceImage::new(8, 4, vec![[1.0; 3]; 32]);
        for format in [Format::Ply, Format::Glb, Format::Usda] {
            for (content, points) in [(Content::Leaves, 296), (Content::PhotoPoints, 47)] {
                for probes in [0, 2] {
                    let probes = &[LightProbe { radiance: &panorama, position_m: Vec3::ONE }; 2][..probes];
                    let path = folder.path().join(format!("room.{format}"));
                    let options = Options { format, content, level: false, probes, lights: &[] };
                    let report = write(&scene, &options, &path).unwrap();
                    let bytes = fs::read(&path).unwrap();
                    assert_eq!(report.bytes, bytes.len() as u64);
                    let meshes = content == Content::Leaves && format != Format::Ply;
                    let textures = if meshes && format == Format::Usda { 2 } else { 0 };
                    assert_eq!(report.files.len(), 1 + textures + probes.len());
                    assert!(report.files.iter().all(|file| file.is_file()));
                    let faces = if meshes { 216 } else { 0 };
                    assert_eq!(report.faces, faces);
                    assert_eq!(report.points, if faces > 0 { 218 } else { points });
                    assert_eq!(report.lamps, usize::from(format != Format::Ply));
                    write(&scene, &options, &path).unwrap();
                    assert!(fs::read(&path).unwrap() == bytes, "{options:?}");
                    // The program looks for this before it replaces a file.
                    assert!(bytes[..bytes.len().min(16_384)].windows(18).any(|w| w == b"lightoctree export"));
                }
            }
        }
    }

    #[test]
    fn edited_and_added_lights_are_written() {
        let folder = tempfile::tempdir().unwrap();
        let text = |scene: &LitScene, format: Format| {
            let path = folder.path().join(format!("room.{format}"));
            let options = Options { format, content: Content::Leaves, level: false, probes: &[], lights: &[] };
            let report = write(scene, &options, &path).unwrap();
            (report.lamps, fs::read(&path).unwrap())
        };
        let edited = |light_edits: LightEdits| {
            let mut scene = box_room();
            let found = lo_lights::emitters(&scene);
            lo_lights::apply_edits(&mut scene, &light_edits, &found).unwrap();
            scene
        };
        let of_lamp = |change: LightChange| {
            let edit = EmitterEdit { id: "L1".to_owned(), found_at_m: Vec3::new(0.0, 1.75, 0.0), change };
            edited(LightEdits { emitters: vec![edit], ..LightEdits::default() })
        };
        let off = of_lamp(LightChange { on: false, ..LightChange::NONE });
        assert_eq!(text(&off, Format::Usda).0, 0);
        // (10, 8, 6) on walls of 0.5 becomes (19.5, 15.5, 11.5), of which the faces keep the part up to white: 1 of
        // 19.5.
        let two = text(&of_lamp(LightChange { scale: 2.0, ..LightChange::NONE }), Format::Usda);
        let usda = String::from_utf8(two.1).unwrap();
        let number = |after: &str, what: &str| -> f32 {
            let (_, rest) = usda.split_once(after).unwrap();
            let (_, rest) = rest.split_once(&format!("{what} = ")).unwrap();
            rest.lines().next().unwrap().parse().unwrap()
        };
        assert!((number("def RectLight", "inputs:intensity") / 18.5 - 1.0).abs() < 1e-3);

        let mut edits = LightEdits::default();
        let rectangle = LightShape::Rectangle {
            centre_m: Vec3::ZERO,
            direction: Vec3::NEG_Y,
            across: Vec3::X,
            size_m: [0.5, 0.25],
            two_sided: true,
        };
        let sun = LightShape::Sun { direction: Vec3::new(0.6, 0.8, 0.0), angular_radius_deg: 0.25, of_photo: false };
        let extent = AnalyticLight { shape: sun, radiance: [0.0; 3] }.extent();
        for (shape, radiance) in [(rectangle, 8.0), (sun, 3.0 / extent)] {
            edits.add(AnalyticLight { shape, radiance: [radiance; 3] }).unwrap();
        }
        let scene = edited(edits);
        let (lamps, usda) = text(&scene, Format::Usda);
        let usda = String::from_utf8(usda).unwrap();
        // The lamp in the ceiling, each side of the rectangle, the sun.
        assert_eq!((lamps, usda.matches("def RectLight").count(), usda.matches("def DistantLight").count()), (4, 3, 1));
        let (_, sun) = usda.split_once("def DistantLight").unwrap();
        assert!(sun.contains("float inputs:angle = 0.5\n"), "{sun}");
        let (_, intensity) = sun.split_once("inputs:intensity = ").unwrap();
        let intensity: f32 = intensity.lines().next().unwrap().parse().unwrap();
        assert!((intensity / 3.0 - 1.0).abs() < 1e-4, "{intensity}");
        let (lamps, glb) = text(&scene, Format::Glb);
        let gltf = gltf::Gltf::from_slice(&glb).unwrap();
        let sun = gltf.lights().unwrap().last().unwrap();
        assert!(lamps == 4 && matches!(sun.kind(), gltf::khr_lights_punctual::Kind::Directional));
        assert!((sun.intensity() / (683.0 * 3.0) - 1.0).abs() < 1e-4);
        // It shines along its node's −Z, away from its position.
        let node = gltf.nodes().filter(|node| node.light().is_some()).last().unwrap();
        let axis = Vec3::from_slice(&node.transform().matrix()[2][..3]);
        assert!((axis - Vec3::new(0.6, 0.8, 0.0)).length() < 1e-6, "{axis}");
    }

    #[test]
    fn what_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.ply");
        let options = Options { format: Format::Ply, content: Content::Leaves, level: false, probes: &[], lights: &[] };
        let mut scene = box_room();
        let finest = scene.light.rgba.len() - 1;
        scene.light.rgba[finest][7][1] = f32::NAN;
        let error = write(&scene, &options, &path).unwrap_err().to_string();
        assert_eq!(error, "the radiance of leaf 7 is not finite; the scene is damaged");
        scene.light = crate::test_scene::light_of(&[], scene.light.cube, 3);
        assert!(matches!(write(&scene, &options, &path), Err(ExportError::Nothing(Content::Leaves))));
        let missing = folder.path().join("missing").join("room.ply");
        let error = write(&box_room(), &options, &missing).unwrap_err().to_string();
        assert!(error.contains("missing"), "{error}");
        let square = RadianceImage::new(2, 2, vec![[1.0; 3]; 4]);
        let probes = [LightProbe { radiance: &square, position_m: Vec3::ZERO }];
        let options = Options { probes: &probes, ..options };
        assert!(matches!(write(&box_room(), &options, &path), Err(ExportError::ProbeSize { width: 2, height: 2 })));
        let options = Options { level: true, probes: &[], ..options };
        assert!(matches!(write(&box_room(), &options, &path), Err(ExportError::NoGravity)));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
