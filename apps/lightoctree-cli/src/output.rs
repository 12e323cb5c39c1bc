//! Checks that output paths never overwrite files of other origin.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::Context;
use lo_imaging::Format;

use crate::usage::Usage;

/// Returns the signature that a command of either program writes into its files.
///
/// It is stored in EXR attributes, a Radiance header line, a PNG text chunk, a JPEG comment, PLY comments, glTF's
/// `asset.generator`, USD's `customLayerData` or JSON's `generator`. PFM has no place for it.
pub fn signature(command: &str) -> String {
    format!("lightoctree {command}")
}

/// Bytes at the beginning of an existing file that are searched for the signature.
const SEARCHED_BYTES: u64 = 16 * 1024;

/// Start of the names of [`lo_imaging::temporary_beside`].
const TEMPORARY: &str = ".lightoctree-";

/// Extensions of radiance images.
pub const RADIANCE: &[&str] = &["exr", "hdr", "pfm"];
/// Extensions of photos and composites.
pub const PHOTO: &[&str] = &["png", "jpg", "exr", "hdr", "pfm"];
/// Extensions of distances and depth.
pub const DEPTH: &[&str] = &["exr", "png", "pfm", "npy"];
/// Extensions of masks.
pub const MASK: &[&str] = &["png", "jpg"];
/// Extension of OpenEXR layers.
pub const LAYERS: &[&str] = &["exr"];
/// Extension of JSON documents.
pub const JSON: &[&str] = &["json"];

/// Checks the output files of a command before any work: each has one of its extensions and can be written, and no two
/// are the same. Other extensions of the same image format are accepted, and without extensions any name.
///
/// # Errors
/// [`Usage`] that names the file.
pub fn check_outputs(outputs: &[(&Path, &[&str])], command: &str, force: bool) -> anyhow::Result<()> {
    for (index, &(path, extensions)) in outputs.iter().enumerate() {
        check_replaceable(path, command, force)?;
        let is_of = |extension: &&str| {
            let example = Path::new("a").with_extension(extension);
            let format = Format::from_extension(path);
            path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
                || (format.is_some() && format == Format::from_extension(&example))
        };
        if !(extensions.is_empty() || extensions.iter().any(is_of)) {
            let supported = extensions.join(", .");
            return Err(Usage(format!("{}: the extension must be one of .{supported}", path.display())).into());
        }
        if outputs[..index].iter().any(|(before, _)| *before == path) {
            return Err(Usage(format!("{} is the name of two outputs", path.display())).into());
        }
    }
    Ok(())
}

/// Checks that `path` can be written: it does not exist yet, is empty, or was written by the same command.
///
/// # Errors
/// [`Usage`] if it is another file, a folder, or in a folder that does not exist.
pub fn check_replaceable(path: &Path, command: &str, force: bool) -> anyhow::Result<()> {
    if force {
        return Ok(());
    }
    let metadata = match std::fs::metadata(path) {
        Ok(metadata) => metadata,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return check_parent(path),
        Err(error) => return Err(error).with_context(|| format!("cannot access {}", path.display())),
    };
    if metadata.is_dir() {
        return Err(Usage(format!("{} is a folder; give a file name", path.display())).into());
    }
    let mut head = Vec::new();
    File::open(path)
        .and_then(|file| file.take(SEARCHED_BYTES).read_to_end(&mut head))
        .with_context(|| format!("cannot read the existing {}", path.display()))?;
    let signature = signature(command);
    if head.is_empty() || head.windows(signature.len()).any(|window| window == signature.as_bytes()) {
        return Ok(());
    }
    Err(Usage(format!(
        "{} exists and was not written by `lightoctree {command}`; choose another name, or overwrite it with --force",
        path.display()
    ))
    .into())
}

/// Checks before any work that `path` can be the scene file of a command: no image's name, and replaceable.
///
/// # Errors
/// [`Usage`] that names the file.
pub fn check_scene(path: &Path, command: &str, force: bool) -> anyhow::Result<()> {
    if Format::from_extension(path).is_some() {
        let message =
            format!("{}: the extension is that of an image; a scene file is named NAME.scene", path.display());
        return Err(Usage(message).into());
    }
    check_replaceable(path, command, force)
}

/// Checks that the folder `path` does not exist, is empty, or contains a manifest of the same command.
///
/// # Errors
/// [`Usage`] if it contains other files, or is none.
pub fn check_folder(path: &Path, manifest: &str, command: &str, force: bool) -> anyhow::Result<()> {
    match std::fs::read_dir(path) {
        Ok(entries) => {
            // A run that begins at the same time may be writing its manifest.
            let is_temporary =
                |entry: &std::fs::DirEntry| entry.file_name().as_encoded_bytes().starts_with(TEMPORARY.as_bytes());
            let empty = entries.filter_map(Result::ok).all(|entry| is_temporary(&entry));
            if !empty && !path.join(manifest).exists() && !force {
                return Err(Usage(format!(
                    "{} is not empty and contains no {manifest} of an earlier run; choose another folder, or write into it with \
                     --force",
                    path.display()
                ))
                .into());
            }
            check_replaceable(&path.join(manifest), command, force)
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error).with_context(|| format!("cannot use {} as a folder", path.display())),
    }
}

/// Creates the folder `path`, after [`check_folder`].
///
/// # Errors
/// As for [`check_folder`], or if it cannot be created.
pub fn prepare_folder(path: &Path, manifest: &str, command: &str, force: bool) -> anyhow::Result<()> {
    check_folder(path, manifest, command, force)?;
    std::fs::create_dir_all(path).with_context(|| format!("cannot create the folder {}", path.display()))
}

fn check_parent(path: &Path) -> anyhow::Result<()> {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() && !parent.is_dir() => {
            Err(Usage(format!("cannot write {}: the folder {} does not exist", path.display(), parent.display()))
                .into())
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn only_own_results_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("own.ply");
        std::fs::write(&own, "ply\ncomment lightoctree export\n").unwrap();
        let foreign = folder.path().join("foreign.ply");
        std::fs::write(&foreign, "ply\ncomment other program\n").unwrap();
        assert!(check_replaceable(&own, "export", false).is_ok());
        assert!(check_replaceable(&own, "envmap", false).unwrap_err().is::<Usage>());
        assert!(check_replaceable(&foreign, "export", false).unwrap_err().is::<Usage>());
        assert!(check_replaceable(&foreign, "export", true).is_ok());
        assert!(check_replaceable(&folder.path().join("new.ply"), "export", false).is_ok());
        assert!(check_replaceable(&folder.path().join("no/new.ply"), "export", false).unwrap_err().is::<Usage>());
        assert!(check_replaceable(folder.path(), "export", false).unwrap_err().is::<Usage>());
    }

    #[test]
    fn outputs_have_their_extensions_and_different_names() {
        let folder = tempfile::tempdir().unwrap();
        let [map, json, other] = ["a.EXR", "a.json", "a.txt"].map(|name| folder.path().join(name));
        let message = |outputs: &[(&Path, &[&str])]| {
            check_outputs(outputs, "envmap", false).map_err(|error| error.downcast::<Usage>().unwrap().to_string())
        };
        assert_eq!(message(&[(&map, RADIANCE), (&json, JSON), (&other, &[])]), Ok(()));
        assert_eq!(message(&[(Path::new("a.pic"), RADIANCE), (Path::new("a.JPEG"), PHOTO)]), Ok(()));
        assert!(message(&[(&json, RADIANCE)]).unwrap_err().ends_with("must be one of .exr, .hdr, .pfm"));
        assert!(message(&[(&other, JSON)]).unwrap_err().ends_with("must be one of .json"));
        assert!(message(&[(&json, JSON), (&map, RADIANCE), (&json, JSON)]).unwrap_err().contains("two outputs"));
    }

    #[test]
    fn a_scene_has_no_image_name() {
        let folder = tempfile::tempdir().unwrap();
        let check = |name: &str| check_scene(&folder.path().join(name), "estimate", false);
        assert!(check("room.scene").is_ok() && check("room").is_ok());
        assert!(check("room.png").unwrap_err().is::<Usage>() && check("room.EXR").unwrap_err().is::<Usage>());
    }

    #[test]
    fn folders_with_other_things_are_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("probes");
        prepare_folder(&path, "manifest.json", "probes", false).unwrap();
        let temporary = lo_imaging::temporary_beside(&path.join("manifest.json")).unwrap();
        assert!(path.join(temporary.path().file_name().unwrap()).exists());
        prepare_folder(&path, "manifest.json", "probes", false).unwrap();
        std::fs::write(path.join("letter.txt"), "dear").unwrap();
        assert!(prepare_folder(&path, "manifest.json", "probes", false).unwrap_err().is::<Usage>());
        std::fs::write(path.join("manifest.json"), r#"{"generator":"lightoctree probes"}"#).unwrap();
        prepare_folder(&path, "manifest.json", "probes", false).unwrap();
    }
}
