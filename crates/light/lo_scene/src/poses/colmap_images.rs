//! COLMAP's `images.txt`: for each image a line `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, world to camera,
//! OpenCV's axes, and a line with its 2D points, which may be empty (colmap.github.io/format.html). The lens and
//! distortion of `CAMERA_ID` are in `cameras.txt` beside it.
//!
//! Unit and up axis of the world are arbitrary. Positions are used as they are; the scale must come from elsewhere.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Error, ErrorKind, Read};
use std::path::{Path, PathBuf};

use lo_geometry::{DQuat, DVec3};
use lo_imaging::open_regular_file;

use super::colmap::{self, ColmapCamera};
use super::pose::Axes;
use super::values::{checked_position, content};
use super::{Pose, PoseError, PoseFile, PoseFormat};

/// Longest `images.txt` that is read, bytes. Most of it are 2D points, which are not kept.
const MAX_FILE_BYTES: u64 = 4 << 30;

/// Most bytes that are kept of it, and longest line.
const MAX_KEPT_BYTES: usize = 48 << 20;

/// Returns the path of `images.txt` if `path` is the folder of a model, else `path`.
///
/// # Errors
/// If the model is binary.
pub(super) fn file_of_model(path: &Path) -> Result<PathBuf, PoseError> {
    let images = if path.is_dir() { path.join("images.txt") } else { path.to_owned() };
    let binary = images.with_file_name("images.bin");
    let only_binary = path.is_dir() && !images.exists() && binary.exists();
    if only_binary || images.file_name() == binary.file_name() {
        return Err(PoseError::ColmapBinary(binary.display().to_string()));
    }
    Ok(images)
}

/// Reads `images.txt` with its 2D points replaced by empty lines.
pub(super) fn read_text(path: &Path) -> Result<String, Error> {
    let (file, _) = open_regular_file(path, MAX_FILE_BYTES)?;
    without_points(BufReader::new(file))
}

fn without_points(mut reader: impl BufRead) -> Result<String, Error> {
    let too_long = || Error::new(ErrorKind::FileTooLarge, "images.txt has too many or too long lines");
    let (mut text, mut line, mut order) = (String::new(), String::new(), LineOrder::default());
    loop {
        line.clear();
        if reader.by_ref().take(MAX_KEPT_BYTES as u64).read_line(&mut line)? == 0 {
            return Ok(text);
        }
        let row = line.strip_prefix('\u{feff}').unwrap_or(&line);
        let points = order.next(row) == Line::Points && is_points(row);
        let kept = if points { "\n" } else { row };
        if line.len() == MAX_KEPT_BYTES || text.len() + kept.len() > MAX_KEPT_BYTES {
            return Err(too_long());
        }
        text.push_str(kept);
    }
}

/// Whether a text has the form of `images.txt`.
pub(super) fn is_images(text: &str) -> bool {
    rows(text).next().is_some_and(|(_, row, _)| image(row).is_some())
}

/// Reads poses. `cameras` are text and name of `cameras.txt`; without them, poses have no lens.
pub(super) fn read(text: &str, name: &str, cameras: Option<(String, String)>) -> Result<PoseFile, PoseError> {
    let cameras = match cameras {
        Some((cameras, name)) => Some((colmap::cameras(&cameras, &name)?, name)),
        None => None,
    };
    let by_id: Option<HashMap<&str, &ColmapCamera>> =
        cameras.as_ref().map(|(cameras, _)| cameras.iter().map(|camera| (camera.id.as_str(), camera)).collect());
    let mut poses = Vec::new();
    for (line, row, points) in rows(text) {
        let image = image(row).ok_or_else(|| {
            let expected = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME";
            content(name, format!("line {line} is not `{expected}`"))
        })?;
        if !is_points(points) {
            let expected = "the 2D points `X Y POINT3D_ID …` of the image above, or empty";
            return Err(content(name, format!("line {} is not {expected}", line + 1)));
        }
        let label = format!("line {line} ({})", image.name);
        let [w, x, y, z] = image.wxyz;
        let mut pose = Pose::from_quaternion([-x, -y, -z, w], DVec3::ZERO, Axes::OpenCv, name, &label)?;
        // The centre of x_camera = R · x_world + t is −Rᵀ · t.
        let world_from_camera = DQuat::from_xyzw(-x, -y, -z, w).normalize();
        pose.position_m = checked_position(world_from_camera * -image.translation, name, &label)?;
        if let (Some(by_id), Some((_, cameras))) = (&by_id, &cameras) {
            let camera = by_id
                .get(image.camera)
                .ok_or_else(|| content(name, format!("{label}: camera {} is not in {cameras}", image.camera)))?;
            (pose.lens, pose.distortion) = (Some(camera.lens), camera.distortion);
        }
        pose.file = Some(image.name.to_owned());
        poses.push(pose);
    }
    Ok(PoseFile { name: name.to_owned(), format: PoseFormat::Colmap, poses, world_up: None })
}

/// Finds the camera of an image by its file name in `images.txt`.
pub(super) fn camera_of_image(images: &str, photo: &str) -> Option<String> {
    let images = rows(images).filter_map(|(_, row, _)| image(row));
    let mut found = images.filter(|image| image.name.rsplit(['/', '\\']).next() == Some(photo));
    let first = found.next()?.camera;
    found.all(|other| other.camera == first).then(|| first.to_owned())
}

/// A line of an image.
struct Image<'a> {
    wxyz: [f64; 4],
    translation: DVec3,
    camera: &'a str,
    name: &'a str,
}

/// Parses the line of an image; its name may have spaces.
fn image(row: &str) -> Option<Image<'_>> {
    let mut rest = row;
    let mut word = || {
        let (word, after) = rest.trim_start().split_once(char::is_whitespace)?;
        rest = after;
        Some(word)
    };
    word()?.parse::<u64>().ok()?;
    let mut numbers = [0.0; 7];
    for number in &mut numbers {
        *number = word()?.parse().ok()?;
    }
    let camera = word()?;
    camera.parse::<u64>().ok()?;
    let [w, x, y, z, tx, ty, tz] = numbers;
    let name = Some(rest.trim()).filter(|name| !name.is_empty())?;
    Some(Image { wxyz: [w, x, y, z], translation: DVec3::new(tx, ty, tz), camera, name })
}

/// Whether a line lists 2D points, or nothing.
fn is_points(line: &str) -> bool {
    let (mut count, mut last) = (0, None);
    for word in line.split_whitespace() {
        (count, last) = (count + 1, Some(word));
    }
    count % 3 == 0 && last.is_none_or(|last| last.parse::<i64>().is_ok())
}

/// Lines of images, numbered from 1, each with the line of its points.
fn rows(text: &str) -> impl Iterator<Item = (usize, &str, &str)> {
    let mut lines = text.lines().enumerate();
    let mut order = LineOrder::default();
    std::iter::from_fn(move || {
        let (index, row) = lines.by_ref().find(|(_, line)| order.next(line) == Line::Image)?;
        let points = lines.next().map_or("", |(_, line)| line);
        order.next(points);
        Some((index + 1, row, points))
    })
}

/// Role of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Line {
    /// A comment, or an empty line before the line of an image.
    Other,
    Image,
    Points,
}

/// Tells the roles of successive lines apart as COLMAP does: the line after an image's has its points.
#[derive(Default)]
struct LineOrder {
    after_image: bool,
}

impl LineOrder {
    fn next(&mut self, line: &str) -> Line {
        let line = line.trim();
        if std::mem::take(&mut self.after_image) {
            Line::Points
        } else if line.is_empty() || line.starts_with('#') {
            Line::Other
        } else {
            self.after_image = true;
            Line::Image
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Distortion, Vec3};

    use super::super::PhotoPoses;
    use super::*;

    const CAMERAS: &str = "# Camera list\n1 PINHOLE 640 480 500 510 320 240\n2 SIMPLE_RADIAL 640 480 600 320 240 0.1\n";

    /// Two images of cameras at (0, 0, 0) and (100, 2, 3). The first looks along the world's +Z with −Y up, as OpenCV's
    /// axes do. The second is turned about y by 90°: R = R_y(−90°) maps the world's x to the camera's z, so it looks
    /// along the world's +X, and t = −R · C = (3, −2, −100).
    fn images() -> String {
        let half = 0.5f64.sqrt();
        format!(
            "# Image list\n\n1 1 0 0 0 0 0 0 2 shot/a_0001.jpg\n10.5 20 -1 30 40 7\n\
             2 {half} 0 {} 0 3 -2 -100 1 b 2.jpg\n\n",
            -half
        )
    }

    fn file(images: &str) -> Result<PoseFile, String> {
        let cameras = Some((CAMERAS.to_owned(), "cameras.txt".to_owned()));
        read(images, "images.txt", cameras).map_err(|error| error.to_string())
    }

    #[test]
    fn centres_and_lenses() {
        let file = file(&images()).unwrap();
        assert_eq!((file.poses.len(), file.world_up, file.format.has_unit()), (2, None, false));
        assert!((file.poses[1].position_m - DVec3::new(100.0, 2.0, 3.0)).length() < 1e-12, "{:?}", file.poses[1]);
        // Columns are our axes: +X right, +Y up, backwards.
        let first = file.poses[0].rotation;
        assert!((first * DVec3::NEG_Z - DVec3::Z).length() < 1e-12 && (first * DVec3::Y + DVec3::Y).length() < 1e-12);
        let second = file.poses[1].rotation;
        assert!((second * DVec3::NEG_Z - DVec3::X).length() < 1e-12, "{second}");
        assert!((second * DVec3::Y + DVec3::Y).length() < 1e-12 && (second * DVec3::X + DVec3::Z).length() < 1e-12);
        // 100 units are no distance in metres, so that they are not refused.
        let poses = PhotoPoses::of(&[file], &["b 2.jpg", "x/shot/a_0001.jpg"]).unwrap();
        assert!((poses.first_from_cameras()[1].translation_m - Vec3::new(3.0, 2.0, 100.0)).length() < 1e-4);
        assert_eq!(poses.camera(0, 640, 480).unwrap().unwrap().fy, 510.0);
        assert_eq!(poses.camera(1, 320, 240).unwrap().unwrap().fx, 300.0);
        assert_eq!((poses.distortion(0), poses.distortion(1)), (None, Some(Distortion::brown(&[0.1]))));
    }

    #[test]
    fn models_on_disk() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("images.bin"), [2, 0, 0, 0]).unwrap();
        for path in [folder.path().to_owned(), at("images.bin")] {
            let error = PoseFile::read(&path).unwrap_err().to_string();
            assert!(error.contains("images.bin is binary") && error.contains("--output_type TXT"), "{error}");
        }
        std::fs::write(at("images.txt"), images()).unwrap();
        let error = PoseFile::read(folder.path()).unwrap_err().to_string();
        assert!(error.contains("cameras.txt"), "{error}");
        std::fs::write(at("cameras.txt"), CAMERAS).unwrap();
        let of_folder = PoseFile::read(folder.path()).unwrap();
        assert_eq!(of_folder, PoseFile::read(&at("images.txt")).unwrap());
        assert_eq!(of_folder.poses, file(&images()).unwrap().poses);
        assert!(PoseFile::read(&at("nowhere")).unwrap_err().to_string().contains("nowhere"));
    }

    #[test]
    fn points_are_not_kept() {
        let text = images();
        let kept = without_points(text.as_bytes()).unwrap();
        assert_eq!(kept, text.replace("10.5 20 -1 30 40 7", ""));
        let invalid = text.replace("10.5 20 -1 30 40 7", "10.5 20");
        assert_eq!(without_points(invalid.as_bytes()).unwrap(), invalid, "errors are left to the parser");
    }

    #[test]
    fn invalid_lines_are_named() {
        let text = images();
        for (images, expected) in [
            (
                text.replace("1 1 0 0 0", "1 1 0 0"),
                "images.txt: line 3 is not `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID",
            ),
            (text.replace(" 1 b 2.jpg", " 1"), "line 5 is not `IMAGE_ID"),
            (text.replace("10.5 20 -1 30 40 7\n", ""), "line 4 is not the 2D points"),
            (text.replace("1 1 0 0 0", "1 2 0 0 0"), "line 3 (shot/a_0001.jpg) is not a rotation and translation"),
            (text.replace("1 1 0 0 0", "1 nan 0 0 0"), "contains NaN"),
            (text.replace("3 -2 -100", "3 inf -100"), "line 5 (b 2.jpg) contains"),
            (text.replace("-100 1 b", "-100 3 b"), "line 5 (b 2.jpg): camera 3 is not in cameras.txt"),
        ] {
            let error = file(&images).unwrap_err();
            assert!(error.contains(expected), "{error:?} has no {expected:?}");
        }
        let alone = PoseFile::from_bytes(text.as_bytes(), "any name").unwrap();
        assert_eq!((alone.format, alone.poses[0].lens), (PoseFormat::Colmap, None));
    }
}
