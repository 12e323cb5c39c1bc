//! Scenes for other programs: PLY point clouds, glTF binaries and USD stages.
//!
//! All three hold the octree's leaves (or the photo's pixels) with their HDR radiance, in our world frame: right-handed, +Y up,
//! the photo's camera at the origin looks along −Z, metres. glTF and USD hold the camera and the room's lamps, too. A light
//! probe is written as an OpenEXR file beside the scene, turned as the format's readers expect it.
//!
//! Radiance is relative: 1.0 is the photo's white. Lamps take it as 1 cd/m², so the other program's exposure (or a factor on all
//! lamps: the luminance of the photo's white in cd/m²) sets the absolute scale.
//!
//! The same scene gives the same bytes.

mod content;
mod error;
mod format;
mod free_space;
mod glb;
mod header;
mod mesh;
mod ply;
mod points;
mod probe;
mod sources;
#[cfg(test)]
mod test_scene;
mod usda;

use std::io::Write;
use std::path::{Path, PathBuf};

use lo_scene::Scene;

pub use content::Content;
pub use error::ExportError;
pub use format::Format;
pub use probe::LightProbe;

use probe::ProbeFile;

/// How to write a scene.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// File format.
    pub format: Format,
    /// Which part of the scene.
    pub content: Content,
    /// A panorama of the light at one point; written as `<name>_probe.exr` beside the scene.
    pub probe: Option<LightProbe<'a>>,
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The scene file, then the probe's file where there is one.
    pub files: Vec<PathBuf>,
    /// Size of the scene file in bytes.
    pub bytes: u64,
    /// Points (PLY, USD, photo points) or vertices (glTF of the leaves).
    pub points: usize,
    /// Quads of the leaves' visible faces (glTF of the leaves; 0 otherwise).
    pub faces: usize,
    /// Lamps made from the brightest leaves (0 for PLY).
    pub lamps: usize,
}

/// Writes `scene` to `path`, and the probe beside it.
///
/// Each file appears whole or not at all; an existing one is replaced.
///
/// # Errors
/// Where the scene has nothing to show or holds values that are not finite, where the result is too large for the format, or
/// where a file cannot be written.
pub fn write(scene: &Scene, options: &Options, path: &Path) -> Result<Report, ExportError> {
    let panorama = scene.panorama.as_ref();
    let leaves = free_space::leaves(&scene.light, panorama.map(|laid| &laid.share[..]));
    let points = match options.content {
        Content::Leaves => points::from_leaves(&leaves),
        Content::PhotoPoints => points::from_photo(&scene.frame),
    };
    if points.is_empty() {
        return Err(ExportError::Nothing(options.content));
    }
    for (index, point) in points.iter().enumerate() {
        if let Some(value) = point.non_finite() {
            return Err(ExportError::NotFinite { content: options.content, index, value });
        }
    }
    let probe = options.probe.map(|probe| ProbeFile::beside(path, options.format, probe)).transpose()?;
    let mut report = Report { files: vec![path.to_owned()], bytes: 0, points: points.len(), faces: 0, lamps: 0 };
    let bytes = match options.format {
        Format::Ply => ply::encode(&points, probe.as_ref(), panorama.is_some()),
        Format::Glb => {
            let geometry = match options.content {
                Content::Leaves => mesh::from_leaves(&leaves, &scene.light.cube, scene.light.octree.depth()),
                Content::PhotoPoints => mesh::from_points(&points),
            };
            let lamps = sources::sources(&leaves);
            report.points = geometry.positions_m.len();
            report.faces = geometry.indices.len() / 6;
            report.lamps = lamps.len();
            glb::encode(&geometry, &scene.frame.camera, &lamps, probe.as_ref())?
        }
        Format::Usda => {
            let lamps = sources::sources(&leaves);
            report.lamps = lamps.len();
            usda::encode(&points, &scene.frame.camera, &lamps, probe.as_ref(), panorama.is_some()).into_bytes()
        }
    };
    // The probe first: a scene that names a missing texture must never be seen.
    if let Some(probe) = &probe {
        probe.write()?;
        report.files.push(probe.path.clone());
    }
    report.bytes = bytes.len() as u64;
    lo_imaging::write_atomically(path, |file| file.write_all(&bytes))?;
    Ok(report)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use lo_geometry::Vec3;
    use lo_imaging::RadianceImage;

    use super::*;
    use crate::test_scene::box_room;

    #[test]
    fn formats_have_names() {
        for format in Format::ALL {
            assert_eq!(format.to_string().to_uppercase().parse::<Format>().unwrap(), format);
        }
        let error = "obj".parse::<Format>().unwrap_err().to_string();
        assert_eq!(error, "unknown export format \"obj\"; known are ply, glb and usda");
    }

    #[test]
    fn every_format_and_content_is_written_twice_the_same() {
        let scene = box_room();
        let folder = tempfile::tempdir().unwrap();
        let panorama = RadianceImage::new(8, 4, vec![[1.0; 3]; 32]);
        for format in Format::ALL {
            for (content, points) in [(Content::Leaves, 296), (Content::PhotoPoints, 47)] {
                for probe in [None, Some(LightProbe { radiance: &panorama, position_m: Vec3::ONE })] {
                    let path = folder.path().join(format!("room.{format}"));
                    let options = Options { format, content, probe };
                    let report = write(&scene, &options, &path).unwrap();
                    let bytes = fs::read(&path).unwrap();
                    assert_eq!(report.bytes, bytes.len() as u64);
                    assert_eq!(report.files.len(), 1 + usize::from(probe.is_some()));
                    assert!(report.files.iter().all(|file| file.is_file()));
                    let faces = if (format, content) == (Format::Glb, Content::Leaves) { 216 } else { 0 };
                    assert_eq!(report.faces, faces);
                    assert_eq!(report.points, if faces > 0 { 218 } else { points });
                    assert_eq!(report.lamps, usize::from(format != Format::Ply));
                    write(&scene, &options, &path).unwrap();
                    assert!(fs::read(&path).unwrap() == bytes, "{options:?}");
                    // What the program looks for before it replaces a file.
                    assert!(bytes[..bytes.len().min(16_384)].windows(18).any(|w| w == b"lightoctree export"));
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.ply");
        let options = Options { format: Format::Ply, content: Content::Leaves, probe: None };
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
        let options = Options { probe: Some(LightProbe { radiance: &square, position_m: Vec3::ZERO }), ..options };
        assert!(matches!(write(&box_room(), &options, &path), Err(ExportError::ProbeSize { width: 2, height: 2 })));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
