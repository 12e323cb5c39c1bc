//! Files of light probes beside the scene.

use std::path::Path;

use lo_geometry::{Orientation, Vec3};
use lo_imaging::{EnvironmentLayout, ExrOptions, RadianceImage};

use crate::header::{GENERATOR, SOFTWARE, UNITS};
use crate::sibling_file::SiblingFile;
use crate::world_frame::WorldFrame;
use crate::{ExportError, Format};

/// Light that arrives at one point of the scene.
#[derive(Clone, Copy, Debug)]
pub struct LightProbe<'a> {
    /// Equirectangular panorama in this project's orientation: centre −Z, +X to its right.
    pub radiance: &'a RadianceImage,
    /// Position in metres.
    pub position_m: Vec3,
}

/// A light probe prepared for its file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ProbeFile {
    /// Path and name of the file.
    pub file: SiblingFile,
    /// Position in metres, in the camera's frame.
    pub position_m: Vec3,
    /// Description of the panorama's orientation.
    pub convention: &'static str,
    /// The panorama, in the orientation that the format's readers expect.
    panorama: RadianceImage,
}

impl ProbeFile {
    /// Names the file `<stem of scene>_probe.exr` (`…_probe2.exr` for the second one). Rotates the panorama from the
    /// camera's frame to the world's and to the orientation that the format's readers expect.
    ///
    /// # Errors
    /// If the panorama is not equirectangular, or the scene's name cannot be used in a text file.
    pub fn beside(
        scene: &Path,
        index: usize,
        format: Format,
        probe: LightProbe,
        level: WorldFrame,
    ) -> Result<Self, ExportError> {
        let (width, height) = (probe.radiance.width(), probe.radiance.height());
        if height == 0 || width != 2 * height {
            return Err(ExportError::ProbeSize { width, height });
        }
        if !probe.position_m.is_finite() {
            return Err(ExportError::ProbePosition(probe.position_m.to_array()));
        }
        let (orientation, convention) = match format {
            Format::Glb => (Orientation::Threejs, "equirectangular, centre +X, +Y up (three.js)"),
            Format::Ply | Format::Usda | Format::Usdz => {
                (Orientation::Openexr, "equirectangular, centre +Z, +Y up (OpenEXR, USD)")
            }
        };
        let panorama = if level == WorldFrame::CAMERA {
            lo_imaging::reorient(probe.radiance, Orientation::Lightoctree, orientation)
        } else {
            let camera_from_map = (orientation.map_from_world() * level.rotation).transpose();
            RadianceImage::from_fn(width, height, |x, y| {
                let direction = camera_from_map * lo_geometry::pixel_direction(x, y, width, height);
                lo_imaging::sample_equirectangular(probe.radiance, direction)
            })
        };
        let ending = if index == 0 { "probe.exr".to_owned() } else { format!("probe{}.exr", index + 1) };
        Ok(Self { file: SiblingFile::new(scene, &ending)?, position_m: probe.position_m, convention, panorama })
    }

    /// Writes the OpenEXR file.
    pub fn write(&self) -> Result<(), ExportError> {
        let options = ExrOptions {
            generator: SOFTWARE.to_owned(),
            environment: Some(EnvironmentLayout::LatitudeLongitude),
            metadata: vec![
                ("generator".to_owned(), GENERATOR.to_owned()),
                ("orientation".to_owned(), self.convention.to_owned()),
                ("units".to_owned(), UNITS.to_owned()),
            ],
            ..ExrOptions::default()
        };
        Ok(lo_imaging::write_radiance(&self.file.path, &self.panorama, &options)?)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Vec2, direction_from_uv, pixel_direction};

    use super::*;

    /// A panorama whose pixels contain their own direction.
    fn directions() -> RadianceImage {
        RadianceImage::from_fn(64, 32, |x, y| pixel_direction(x, y, 64, 32).to_array())
    }

    fn turned(format: Format) -> ProbeFile {
        let panorama = directions();
        let probe = LightProbe { radiance: &panorama, position_m: Vec3::ZERO };
        ProbeFile::beside(Path::new("folder/my room.x"), 0, format, probe, WorldFrame::CAMERA).unwrap()
    }

    #[test]
    fn each_format_sees_every_direction_where_it_looks() {
        // u of a direction, from the readers' source code. v is as ours.
        let openexr = |d: Vec3| 0.5 - d.x.atan2(d.z) / std::f32::consts::TAU;
        let threejs = |d: Vec3| 0.5 + d.z.atan2(d.x) / std::f32::consts::TAU;
        type Reader = fn(Vec3) -> f32;
        let readers: [(Format, Reader); 3] = [(Format::Ply, openexr), (Format::Usda, openexr), (Format::Glb, threejs)];
        for (format, u_of) in readers {
            let file = turned(format);
            for (u, v) in [(0.51, 0.52), (0.26, 0.4), (0.77, 0.6), (0.05, 0.9), (0.9, 0.1)] {
                let direction = direction_from_uv(Vec2::new(u, v));
                let x = (u_of(direction).rem_euclid(1.0) * 64.0) as usize;
                let found = Vec3::from(file.panorama[(x, (v * 32.0) as usize)]);
                // Within a pixel of 5.6°.
                assert!(found.angle_between(direction) < 0.1, "{format}: {direction} shows {found}");
            }
        }
    }

    #[test]
    fn a_levelled_probe_shows_the_room_where_the_world_has_it() {
        let up = Vec3::new(0.1, 0.9, 0.4).normalize();
        let level = WorldFrame::of(Some(&lo_scene::Room { up, planes: Vec::new() })).unwrap();
        let panorama = directions();
        let probe = LightProbe { radiance: &panorama, position_m: Vec3::ZERO };
        let file = ProbeFile::beside(Path::new("room.usda"), 1, Format::Usda, probe, level).unwrap();
        assert_eq!(file.file.name, "room_probe2.exr");
        // The topmost row is the world's up, which is `up` in the camera's frame.
        assert!(Vec3::from(file.panorama[(9, 0)]).angle_between(up) < 0.1);
        // The centre is the world's +Z.
        let back = level.rotation.transpose() * Vec3::Z;
        assert!(Vec3::from(file.panorama[(32, 16)]).angle_between(back) < 0.1);
    }

    #[test]
    fn probes_nowhere_are_refused() {
        let panorama = directions();
        let nowhere = LightProbe { radiance: &panorama, position_m: Vec3::NAN };
        let error = ProbeFile::beside(Path::new("a.ply"), 0, Format::Ply, nowhere, WorldFrame::CAMERA).unwrap_err();
        assert!(matches!(error, ExportError::ProbePosition(_)));
    }

    #[test]
    fn the_written_file_reads_back() {
        let folder = tempfile::tempdir().unwrap();
        let panorama = directions();
        let probe = LightProbe { radiance: &panorama, position_m: Vec3::ZERO };
        let file =
            ProbeFile::beside(&folder.path().join("room.usda"), 0, Format::Usda, probe, WorldFrame::CAMERA).unwrap();
        file.write().unwrap();
        assert_eq!(lo_imaging::read_radiance(&file.file.path).unwrap(), file.panorama);
    }
}
