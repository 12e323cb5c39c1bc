use std::path::Path;

use lo_geometry::{Camera, Distortion};
use serde_json::Value;

use super::matching::{by_name, frame_of, stem};
use super::read::read_text;
use super::values::content;
use super::{Lens, Pose, PoseError, PoseFile, PoseFormat, colmap, colmap_images, nerf, record3d};

/// Lens of one photo, from a file of another program.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoLens {
    file: String,
    photo: String,
    lens: Lens,
    /// Distortion of the lens, if the file states one.
    pub distortion: Option<Distortion>,
}

/// A lens with its distortion.
type FileLens = (Lens, Option<Distortion>);

impl PhotoLens {
    /// Reads the lens of a photo: from a pose file of any format, such a file without poses, or COLMAP's `cameras.txt`.
    ///
    /// A file of several photos gives the lens of the one with the photo's name, or number in files of frames. If none
    /// has it, all lenses of the file must be equal.
    ///
    /// # Errors
    /// If the file cannot be read, its format is unknown, it has no intrinsics, or different ones.
    pub fn read(path: &Path, photo: &Path) -> Result<Self, PoseError> {
        let (text, name) = read_text(path, PoseError::UnknownLens)?;
        let images = || colmap_images::read_text(&path.with_file_name("images.txt")).ok();
        Self::from_text(&text, &name, photo, images)
    }

    /// Takes the lens of a photo from the text of such a file. `images` reads the `images.txt` beside `cameras.txt`.
    /// `name` appears in errors.
    ///
    /// # Errors
    /// As [`PhotoLens::read`].
    pub fn from_text(
        text: &str,
        name: &str,
        photo: &Path,
        images: impl FnOnce() -> Option<String>,
    ) -> Result<Self, PoseError> {
        let lenses = if colmap::is_cameras(text) {
            of_cameras(text, name, photo, images)?
        } else if let Some(lens) = of_json_without_poses(text, name)? {
            vec![lens]
        } else {
            let file = PoseFile::from_bytes(text.as_bytes(), name).map_err(|error| match error {
                PoseError::Unknown(name) => PoseError::UnknownLens(name),
                error => error,
            })?;
            of_poses(&file, photo)
        };
        let photo = photo.display().to_string();
        let Some((first, others)) = lenses.split_first() else { return Err(PoseError::NoLens(name.to_owned())) };
        if others.iter().any(|other| other != first) {
            let different = lenses.iter().enumerate().filter(|(index, lens)| !lenses[..*index].contains(lens));
            return Err(PoseError::SeveralLenses { file: name.to_owned(), photo, lenses: different.count() });
        }
        let (lens, distortion) = *first;
        Ok(Self { file: name.to_owned(), photo, lens, distortion })
    }

    /// Returns the camera of the photo, which has this size.
    ///
    /// # Errors
    /// If the intrinsics are for an image of another aspect ratio, or are invalid.
    pub fn camera(&self, width: u32, height: u32) -> Result<Camera, PoseError> {
        self.lens.camera(width, height, &self.file, &self.photo)
    }
}

/// Lenses of `cameras.txt`: the photo's alone if `images.txt` names it.
fn of_cameras(
    text: &str,
    name: &str,
    photo: &Path,
    images: impl FnOnce() -> Option<String>,
) -> Result<Vec<FileLens>, PoseError> {
    let mut cameras = colmap::cameras(text, name)?;
    if cameras.len() > 1
        && let Some(images) = images()
        && let Some(file) = photo.file_name().and_then(|file| file.to_str())
        && let Some(id) = colmap_images::camera_of_image(&images, file)
    {
        cameras.retain(|camera| camera.id == id);
    }
    Ok(cameras.into_iter().map(|camera| (camera.lens, camera.distortion)).collect())
}

/// Lenses of a pose file: the photo's alone if a pose has its name or number.
fn of_poses(file: &PoseFile, photo: &Path) -> Vec<FileLens> {
    let named: Option<&Pose> = match file.format {
        PoseFormat::Record3d => {
            stem(photo).and_then(|stem| stem.parse::<usize>().ok()).and_then(|index| file.poses.get(index))
        }
        PoseFormat::Chan | PoseFormat::Usd => {
            frame_of(photo).and_then(|frame| file.poses.iter().find(|pose| pose.frame == Some(frame)))
        }
        _ => by_name(file, photo).ok(),
    };
    let poses = named.map_or(&file.poses[..], std::slice::from_ref);
    poses.iter().filter_map(|pose| Some((pose.lens?, pose.distortion))).collect()
}

/// Reads the intrinsics of a JSON file that has no poses.
fn of_json_without_poses(text: &str, name: &str) -> Result<Option<FileLens>, PoseError> {
    if !text.trim_start().starts_with('{') {
        return Ok(None);
    }
    let value: &Value = &serde_json::from_str(text).map_err(|error| content(name, error))?;
    let has = |key: &str| value.get(key).is_some();
    let of = |key: &str| value.get(key);
    if has("K") && !has("poses") {
        return record3d::lens(value, name).map(|lens| lens.map(|lens| (lens, None)));
    }
    let has_frames = of("frames").is_some_and(|frames| frames.as_array().is_none_or(|frames| !frames.is_empty()));
    if (has("fl_x") || has("camera_angle_x")) && !has_frames {
        let distortion = nerf::distortion(&of, name)?;
        return nerf::lens(&of, name).map(|lens| lens.map(|lens| (lens, distortion)));
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn read(text: &str, photo: &str, images: Option<&str>) -> Result<PhotoLens, String> {
        let images = images.map(str::to_owned);
        PhotoLens::from_text(text, "file", Path::new(photo), || images).map_err(|error| error.to_string())
    }

    fn numbers(lens: &PhotoLens, width: u32, height: u32) -> [f64; 4] {
        let Camera { fx, fy, cx, cy, .. } = lens.camera(width, height).unwrap();
        [fx, fy, cx, cy]
    }

    #[test]
    fn all_common_models_of_colmap() {
        let fisheye = |k1, k2, k3, k4| Some(Distortion::Fisheye([k1, k2, k3, k4]));
        for (row, expected, distortion) in [
            ("SIMPLE_PINHOLE 640 480 500 320 240", [500.0, 500.0, 320.0, 240.0], None),
            ("PINHOLE 640 480 500 510 320 240", [500.0, 510.0, 320.0, 240.0], None),
            ("SIMPLE_RADIAL 640 480 500 320 240 0.1", [500.0, 500.0, 320.0, 240.0], Some(Distortion::brown(&[0.1]))),
            ("RADIAL 640 480 500 320 240 0.1 0.2", [500.0, 500.0, 320.0, 240.0], Some(Distortion::brown(&[0.1, 0.2]))),
            (
                "OPENCV 640 480 500 510 320 240 0.1 0.2 0.3 0.4",
                [500.0, 510.0, 320.0, 240.0],
                Some(Distortion::brown(&[0.1, 0.2, 0.3, 0.4])),
            ),
            (
                "FULL_OPENCV 640 480 500 510 320 240 1 2 3 4 5 6 7 8",
                [500.0, 510.0, 320.0, 240.0],
                Some(Distortion::brown(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0])),
            ),
            (
                "OPENCV_FISHEYE 640 480 500 510 320 240 1 2 3 4",
                [500.0, 510.0, 320.0, 240.0],
                fisheye(1.0, 2.0, 3.0, 4.0),
            ),
            ("SIMPLE_RADIAL_FISHEYE 640 480 500 320 240 1", [500.0, 500.0, 320.0, 240.0], fisheye(1.0, 0.0, 0.0, 0.0)),
            ("RADIAL_FISHEYE 640 480 500 320 240 1 2", [500.0, 500.0, 320.0, 240.0], fisheye(1.0, 2.0, 0.0, 0.0)),
            ("RADIAL 640 480 500 320 240 0 0", [500.0, 500.0, 320.0, 240.0], None),
        ] {
            let text = format!("# Camera list\n#   CAMERA_ID, MODEL\n1 {row}\n");
            let lens = read(&text, "a.jpg", None).unwrap();
            assert_eq!((numbers(&lens, 640, 480), lens.distortion), (expected, distortion), "{row}");
            assert_eq!(numbers(&lens, 320, 240), expected.map(|v| v / 2.0), "{row}");
        }
        let error = read("1 FOV 640 480 500 500 320 240 0.9\n", "a.jpg", None).unwrap_err();
        assert!(error.contains("camera model is FOV"), "{error}");
        let error = read("1 PINHOLE 640 480 500\n", "a.jpg", None).unwrap_err();
        assert!(error.contains("PINHOLE with 1 parameters"), "{error}");
        let error = read("1 PINHOLE 640 480 x 1 2 3\n", "a.jpg", None).unwrap_err();
        assert!(error.contains("not a finite number"), "{error}");
        let error = read("1 PINHOLE 0 480 1 1 2 3\n", "a.jpg", None).unwrap_err();
        assert!(error.contains("invalid size 0 × 480"), "{error}");
    }

    #[test]
    fn one_of_several_cameras_is_that_of_the_image() {
        let two = "1 SIMPLE_PINHOLE 640 480 500 320 240\n2 SIMPLE_PINHOLE 640 480 600 320 240\n";
        let images = "# Image list\n1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 0 2 shots/b c.jpg\n1 2 -1\n";
        assert_eq!(numbers(&read(two, "x/a.jpg", Some(images)).unwrap(), 640, 480)[0], 500.0);
        assert_eq!(numbers(&read(two, "b c.jpg", Some(images)).unwrap(), 640, 480)[0], 600.0);
        for images in [None, Some(images)] {
            let error = read(two, "d.jpg", images).unwrap_err();
            assert!(error.contains("2 different lenses") && error.contains("d.jpg"), "{error}");
        }
        let same = "1 PINHOLE 640 480 500 500 320 240\n2 SIMPLE_PINHOLE 640 480 500 320 240\n";
        assert!(read(same, "d.jpg", None).is_ok());
    }

    #[test]
    fn lenses_of_pose_files() {
        let record3d = r#"{"w": 480, "h": 720, "K": [520, 0, 0, 0, 521, 0, 240, 360, 1]}"#;
        assert_eq!(numbers(&read(record3d, "a.jpg", None).unwrap(), 240, 360), [260.0, 260.5, 120.0, 180.0]);
        let error = read(record3d, "a.jpg", None).unwrap().camera(720, 480).unwrap_err().to_string();
        assert!(error.contains("480 × 720 pixels, but a.jpg has 720 × 480"), "{error}");
        let frames = r#"{"poses": [[0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0, 0]], "w": 480, "h": 720,
            "perFrameIntrinsicCoeffs": [[520, 520, 240, 360], [530, 530, 240, 360]]}"#;
        assert_eq!(numbers(&read(frames, "rgb/1.jpg", None).unwrap(), 480, 720)[0], 530.0);
        assert!(read(frames, "photo.jpg", None).unwrap_err().contains("2 different lenses"));
        let nerf = r#"{"fl_x": 520, "w": 480, "h": 720, "k1": -0.25, "k2": 0.05}"#;
        let lens = read(nerf, "a.jpg", None).unwrap();
        assert_eq!(numbers(&lens, 480, 720), [520.0, 520.0, 240.0, 360.0]);
        assert_eq!(lens.distortion, Some(Distortion::brown(&[-0.25, 0.05])));
        let no_frames = r#"{"fl_x": 520, "w": 480, "h": 720, "frames": []}"#;
        assert_eq!(numbers(&read(no_frames, "a.jpg", None).unwrap(), 480, 720)[0], 520.0);
        let tum = "1 0 0 0 0 0 0 1\n";
        assert!(read(tum, "a.jpg", None).unwrap_err().contains("no intrinsics"));
        assert!(read("hello", "a.jpg", None).unwrap_err().contains("unknown format of a lens"));
        let own = r#"{"photos": [{"file": "a.jpg", "rotation_xyzw": [0, 0, 0, 1], "position_m": [0, 0, 0]}]}"#;
        assert!(read(own, "a.jpg", None).unwrap_err().contains("no intrinsics"));
    }

    #[test]
    fn lenses_of_real_captures() {
        let Some(folder) = lo_testdata::shared_data("inputs/r3d", "lenses of a Record3D capture") else { return };
        let lens = |name: &str| PhotoLens::read(&folder.join(name), &folder.join("rgb/0.jpg")).unwrap();
        for name in ["metadata.json", "transforms_2x.json", "transforms_dist.json"] {
            assert_eq!(numbers(&lens(name), 480, 720), [520.0, 520.0, 240.0, 360.0], "{name}");
        }
        let angle = lens("transforms_anglex.json").camera(480, 720).unwrap().hfov_deg();
        assert!((angle - 0.86f64.to_degrees()).abs() < 1e-9);
        assert_eq!(lens("transforms_dist.json").distortion, Some(Distortion::brown(&[-0.25, 0.05])));
        let fisheye = lens("transforms_fisheye.json");
        assert_eq!(fisheye.distortion, Some(Distortion::Fisheye([0.05, 0.01, 0.0, 0.0])));
        assert_eq!(numbers(&fisheye, 480, 720)[0], 300.0);
    }
}
