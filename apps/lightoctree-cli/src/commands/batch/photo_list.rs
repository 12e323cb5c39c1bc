//! Photos of arguments, folders and lists, with the names of their results.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::ffi::OsStr;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use anyhow::Context;
use lo_imaging::Format;

use crate::usage::Usage;

/// Longest list of photos, bytes.
const MAX_LIST_BYTES: u64 = 1 << 30;

/// Options that select photos.
#[derive(Debug, clap::Args)]
pub struct PhotoListArgs {
    /// Photos, and folders that are searched for photos, including their subfolders
    #[arg(value_name = "PHOTO|FOLDER", required_unless_present = "list")]
    photos: Vec<PathBuf>,

    /// File with one path of a photo per line, relative to the current folder; `-` reads standard input
    #[arg(long, value_name = "FILE")]
    list: Option<PathBuf>,

    /// Folder of all photos; results are named after the paths in it [default: the folder that is searched; for single
    /// photos, the one that contains the photo]
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
}

/// A photo, and the name of its results.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ListedPhoto {
    /// Relative path of its results without their extension: that of the photo in its root folder.
    name: PathBuf,
    /// The file.
    pub path: PathBuf,
}

impl ListedPhoto {
    /// Returns the path of a result relative to the output folder, such as `kitchen/a.jpg.scene`.
    pub fn result_name(&self, extension: &str) -> PathBuf {
        let mut name = self.name.clone().into_os_string();
        name.push(".");
        name.push(extension);
        name.into()
    }

    /// Returns the name as text, with `/` between folders.
    pub fn name_text(&self) -> String {
        let parts: Vec<_> = self.name.iter().map(OsStr::to_string_lossy).collect();
        parts.join("/")
    }
}

/// Returns all photos in the order of their names. The folder of the results is not searched.
///
/// # Errors
/// Arguments that do not exist, folders that cannot be read, no photos, two photos of one name, photos outside of
/// `--root`.
pub fn read(args: &PhotoListArgs, output: &Path) -> anyhow::Result<Vec<ListedPhoto>> {
    let mut found = Vec::new();
    let mut add = |path: PathBuf, folder: Option<&Path>| -> anyhow::Result<()> {
        let name = match (&args.root, folder) {
            (Some(root), _) => name_in(root, &path)?,
            (None, Some(folder)) => name_in(folder, &path)?,
            (None, None) => file_name(&path)?,
        };
        found.push(ListedPhoto { name, path });
        Ok(())
    };
    let output = output.canonicalize().ok();
    for given in &args.photos {
        let metadata = std::fs::metadata(given).with_context(|| format!("cannot read {}", given.display()))?;
        if metadata.is_dir() {
            let mut photos = Vec::new();
            search(given, output.as_deref(), &mut Vec::new(), &mut photos)?;
            photos.into_iter().try_for_each(|path| add(path, Some(given)))?;
        } else {
            add(given.clone(), None)?;
        }
    }
    if let Some(list) = &args.list {
        lines(&text(list)?).try_for_each(|line| add(line.into(), None))?;
    }
    if found.is_empty() {
        return Err(Usage("no photos; folders are searched for files with the extensions of images".into()).into());
    }
    found.sort();
    found.dedup();
    check_names(&found)?;
    Ok(found)
}

/// Finds photos by their extensions, except hidden files. `ancestors` are the folders above, without symbolic links.
fn search(
    folder: &Path,
    excluded: Option<&Path>,
    ancestors: &mut Vec<PathBuf>,
    photos: &mut Vec<PathBuf>,
) -> anyhow::Result<()> {
    let failed = || format!("cannot read the folder {}", folder.display());
    let real = folder.canonicalize().with_context(failed)?;
    if excluded == Some(&*real) || ancestors.contains(&real) {
        return Ok(());
    }
    ancestors.push(real);
    for entry in std::fs::read_dir(folder).with_context(failed)? {
        let entry = entry.with_context(failed)?;
        if entry.file_name().as_encoded_bytes().starts_with(b".") {
            continue;
        }
        let path = entry.path();
        // Symbolic links count as what they refer to. A broken one is recorded as a photo that cannot be read.
        if std::fs::metadata(&path).is_ok_and(|metadata| metadata.is_dir()) {
            search(&path, excluded, ancestors, photos)?;
        } else if is_photo(&path) {
            photos.push(path);
        }
    }
    ancestors.pop();
    Ok(())
}

fn is_photo(path: &Path) -> bool {
    Format::from_extension(path).is_some_and(|format| !matches!(format, Format::Npy | Format::Npz))
}

/// Returns the path of a photo in a folder, without `..`.
fn name_in(folder: &Path, path: &Path) -> anyhow::Result<PathBuf> {
    let is_plain = |name: &Path| name.components().all(|component| matches!(component, Component::Normal(_)));
    if let Ok(name) = path.strip_prefix(folder)
        && is_plain(name)
        && name.file_name().is_some()
    {
        return Ok(name.to_owned());
    }
    // Of the photo only the folder, so that a missing photo has a name, too, and a link its own.
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let real = folder.canonicalize().with_context(|| format!("cannot read the folder {}", folder.display()))?;
    let real_parent = parent.canonicalize().with_context(|| {
        format!(
            "{}: cannot read the folder {}; paths are relative to the current folder, not to --root",
            path.display(),
            parent.display()
        )
    })?;
    match real_parent.strip_prefix(&real) {
        Ok(inside) => Ok(inside.join(file_name(path)?)),
        Err(_) => Err(Usage(format!("{} is outside of --root {}", path.display(), folder.display())).into()),
    }
}

fn file_name(path: &Path) -> anyhow::Result<PathBuf> {
    let name = path.file_name().ok_or_else(|| Usage(format!("{} is not the path of a photo", path.display())))?;
    Ok(name.into())
}

/// Reads the list of photos.
fn text(list: &Path) -> anyhow::Result<String> {
    if list != Path::new("-") {
        return lo_imaging::read_regular_text(list, MAX_LIST_BYTES)
            .with_context(|| format!("--list: cannot read {}", list.display()));
    }
    let mut text = String::new();
    std::io::stdin().lock().take(MAX_LIST_BYTES).read_to_string(&mut text).context("--list: cannot read the input")?;
    Ok(text)
}

/// Returns the lines of a list, without empty ones.
fn lines(text: &str) -> impl Iterator<Item = &str> {
    // A byte order mark of Windows programs.
    text.trim_start_matches('\u{feff}').lines().filter(|line| !line.trim().is_empty())
}

fn check_names(photos: &[ListedPhoto]) -> anyhow::Result<()> {
    let mut first = HashMap::new();
    for photo in photos {
        match first.entry(&photo.name) {
            Entry::Vacant(entry) => {
                entry.insert(&photo.path);
            }
            Entry::Occupied(entry) => {
                return Err(Usage(format!(
                    "{} and {} would have the same result {}; set --root to a folder that contains both",
                    entry.get().display(),
                    photo.path.display(),
                    photo.result_name("scene").display()
                ))
                .into());
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn list(folder: &Path, photos: &[&str], list: &[&str], root: Option<&str>) -> anyhow::Result<Vec<String>> {
        let list_file = folder.join("list.txt");
        let lines: Vec<_> = list.iter().map(|line| folder.join(line).display().to_string()).collect();
        std::fs::write(&list_file, format!("\u{feff}{}\r\n\r\n", lines.join("\r\n"))).unwrap();
        let args = PhotoListArgs {
            photos: photos.iter().map(|photo| folder.join(photo)).collect(),
            list: (!list.is_empty()).then_some(list_file),
            root: root.map(|root| folder.join(root)),
        };
        let photos = read(&args, &folder.join("photos/results"))?;
        Ok(photos.iter().map(ListedPhoto::name_text).collect())
    }

    fn message(found: anyhow::Result<Vec<String>>) -> String {
        found.unwrap_err().to_string()
    }

    fn folder_of(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "x").unwrap();
        }
        folder
    }

    #[test]
    fn folders_are_searched_for_photos() {
        let folder = folder_of(&[
            "photos/b.JPG",
            "photos/a/c.heic",
            "photos/a/c.jpg",
            "photos/a/notes.txt",
            "photos/a/depth.npy",
            "photos/.hidden/d.jpg",
            "photos/._b.JPG",
            "photos/results/e.jpg.exr",
        ]);
        assert_eq!(list(folder.path(), &["photos"], &[], None).unwrap(), ["a/c.heic", "a/c.jpg", "b.JPG"]);
        let names = list(folder.path(), &["photos"], &[], Some("."));
        assert_eq!(names.unwrap(), ["photos/a/c.heic", "photos/a/c.jpg", "photos/b.JPG"]);
        // Given twice.
        assert_eq!(list(folder.path(), &["photos/b.JPG"], &["photos/b.JPG"], None).unwrap(), ["b.JPG"]);
        assert!(message(list(folder.path(), &["photos/.hidden/.."], &["fotos"], Some("photos"))).contains("outside"));
        assert!(message(list(folder.path(), &["fotos"], &[], None)).contains("fotos"));
    }

    #[cfg(unix)]
    #[test]
    fn links_to_folders_are_followed_once() {
        let folder = folder_of(&["photos/a/c.jpg"]);
        std::os::unix::fs::symlink("..", folder.path().join("photos/a/up")).unwrap();
        std::os::unix::fs::symlink("a", folder.path().join("photos/b")).unwrap();
        assert_eq!(list(folder.path(), &["photos"], &[], None).unwrap(), ["a/c.jpg", "b/c.jpg"]);
    }

    #[test]
    fn two_photos_never_have_one_result() {
        let folder = folder_of(&["a/x.jpg", "b/x.jpg", "b/x.png"]);
        let text = message(list(folder.path(), &["a", "b"], &[], None));
        assert!(text.contains("would have the same result x.jpg.scene; set --root"), "{text}");
        assert!(message(list(folder.path(), &["a/x.jpg", "b/x.jpg"], &[], None)).contains("--root"));
        let all = ["a/x.jpg", "b/x.jpg", "b/x.png"];
        assert_eq!(list(folder.path(), &["a", "b"], &[], Some(".")).unwrap(), all);
        assert_eq!(list(folder.path(), &[], &all, Some(".")).unwrap(), all);
    }

    #[test]
    fn results_stay_in_their_folder() {
        let folder = folder_of(&["a/x.jpg", "y.jpg"]);
        // The names of a missing photo, and of one that `..` leads to.
        assert_eq!(list(folder.path(), &[], &["a/none.jpg"], Some("a")).unwrap(), ["none.jpg"]);
        assert_eq!(list(folder.path(), &[], &["a/../a/x.jpg"], Some("a")).unwrap(), ["x.jpg"]);
        let text = message(list(folder.path(), &[], &["a/../y.jpg"], Some("a")));
        assert!(text.contains("y.jpg is outside of --root"), "{text}");
    }
}
