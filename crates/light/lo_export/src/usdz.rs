//! USD packages for AR Quick Look: <https://openusd.org/release/spec_usdz.html>.

use std::io::{Cursor, Write};

use lo_imaging::Photo;
use lo_scene::LitScene;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::room_mesh::RoomMesh;
use crate::shown_photo::shown_photo;
use crate::world_frame::WorldFrame;
use crate::{ExportError, header, photo_mesh, usda};

/// Alignment of the files' contents in the package, in bytes.
const ALIGNMENT: u16 = 64;

/// Names in the package. The stage is the first file.
const STAGE: &str = "room.usda";
const TEXTURES: [&str; 2] = ["room.png", "photo.jpg"];

/// Encodes the room's meshes with their textures. Radiance above the photo's white is clipped: textures of AR Quick
/// Look have eight bits.
pub fn encode(scene: &LitScene, mut room: RoomMesh, level: WorldFrame) -> Result<Vec<u8>, ExportError> {
    room.move_behind_photo(scene.surface());
    let photo = photo_mesh::of_scene(scene);
    let stage = usda::encode_for_ar(&room, &photo, TEXTURES, level);
    let images = [Photo::Linear(room.texture()).into_srgb8(), shown_photo(&scene.frame)];
    let mut files = vec![(STAGE, stage.into_bytes())];
    for (name, image) in TEXTURES.into_iter().zip(images) {
        files.push((name, lo_imaging::encode_srgb8(name, &image, lo_imaging::JPEG_QUALITY, header::SOFTWARE)?));
    }
    package(&files).map_err(|error| ExportError::Io(error.into()))
}

/// Packs files without compression, each at a multiple of [`ALIGNMENT`] bytes. Equal files give equal bytes.
fn package(files: &[(&str, Vec<u8>)]) -> zip::result::ZipResult<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Stored)
        .last_modified_time(zip::DateTime::default())
        .with_alignment(ALIGNMENT);
    for (name, content) in files {
        archive.start_file(*name, options)?;
        archive.write_all(content)?;
    }
    Ok(archive.finish()?.into_inner())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::test_scene::box_room;
    use crate::{Content, Format, Options, write};

    #[test]
    fn contents_are_aligned_and_not_compressed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.usdz");
        let options =
            Options { format: Format::Usdz, content: Content::Leaves, level: false, probes: &[], lights: &[] };
        let report = write(&box_room(), &options, &path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!((report.files.len(), report.bytes, report.lamps), (1, bytes.len() as u64, 0));
        let mut archive = zip::ZipArchive::new(Cursor::new(&bytes)).unwrap();
        let names: Vec<String> = (0..3).map(|i| archive.by_index(i).unwrap().name().unwrap().into_owned()).collect();
        assert_eq!(names, ["room.usda", "room.png", "photo.jpg"]);
        for index in 0..3 {
            let file = archive.by_index(index).unwrap();
            assert_eq!(file.data_start().unwrap() % 64, 0, "file {index}");
            assert_eq!(file.compressed_size(), file.size());
        }
        let start = archive.by_index(0).unwrap().data_start().unwrap() as usize;
        let stage = std::str::from_utf8(&bytes[start..start + 200]).unwrap();
        assert!(stage.starts_with("#usda 1.0") && stage.contains("lightoctree export"), "{stage}");
    }

    #[test]
    fn points_are_refused() {
        let options =
            Options { format: Format::Usdz, content: Content::PhotoPoints, level: false, probes: &[], lights: &[] };
        let error = write(&box_room(), &options, "never.usdz").unwrap_err();
        assert!(matches!(error, ExportError::NoPoints), "{error}");
    }
}
