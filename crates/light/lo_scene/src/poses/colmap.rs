//! COLMAP's `cameras.txt`, one camera a line as `CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]` (colmap.github.io/format.html).

use lo_geometry::Distortion;

use super::record3d::whole_size;
use super::values::content;
use super::{Lens, PoseError};

/// A camera of `cameras.txt`.
pub(super) struct ColmapCamera {
    pub id: String,
    pub lens: Lens,
    pub distortion: Option<Distortion>,
}

/// Whether a text has the form of `cameras.txt`.
pub(super) fn is_cameras(text: &str) -> bool {
    let mut words = rows(text).next().map(str::split_whitespace).into_iter().flatten();
    let (id, model) = (words.next(), words.next());
    let (width, height) = (words.next(), words.next());
    let is_count = |word: Option<&str>| word.is_some_and(|word| word.parse::<u64>().is_ok());
    let is_name = |word: &str| word.chars().all(|c| c.is_ascii_uppercase() || c == '_' || c.is_ascii_digit());
    is_count(id)
        && model.is_some_and(|model| is_name(model) && !is_count(Some(model)))
        && is_count(width)
        && is_count(height)
}

pub(super) fn cameras(text: &str, name: &str) -> Result<Vec<ColmapCamera>, PoseError> {
    rows(text).map(|row| camera(row, name)).collect()
}

fn rows(text: &str) -> impl Iterator<Item = &str> {
    text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'))
}

fn camera(row: &str, name: &str) -> Result<ColmapCamera, PoseError> {
    let words: Vec<&str> = row.split_whitespace().collect();
    let [id, model, width, height, parameters @ ..] = &words[..] else {
        return Err(content(name, format!("`{}` is not CAMERA_ID MODEL WIDTH HEIGHT PARAMS", clip(row))));
    };
    let numbers: Option<Vec<f64>> =
        parameters.iter().map(|word| word.parse().ok().filter(|value: &f64| value.is_finite())).collect();
    let numbers = numbers.ok_or_else(|| content(name, format!("camera {id}: a parameter is not a finite number")))?;
    let size = width.parse().ok().zip(height.parse().ok()).and_then(|(width, height)| whole_size(width, height));
    let size = size.ok_or_else(|| content(name, format!("camera {id}: invalid size {width} × {height}")))?;
    let (intrinsics, distortion) = match (*model, &numbers[..]) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f, cx, cy], None),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy, cx, cy], None),
        ("SIMPLE_RADIAL", &[f, cx, cy, k1]) => ([f, f, cx, cy], Some(Distortion::brown(&[k1]))),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], Some(Distortion::brown(&[k1, k2]))),
        ("OPENCV" | "FULL_OPENCV", &[fx, fy, cx, cy, ref k @ ..]) if matches!(k.len(), 4 | 8) => {
            ([fx, fy, cx, cy], Some(Distortion::brown(k)))
        }
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => {
            ([fx, fy, cx, cy], Some(Distortion::Fisheye([k1, k2, k3, k4])))
        }
        ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k1]) => ([f, f, cx, cy], Some(Distortion::Fisheye([k1, 0.0, 0.0, 0.0]))),
        ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], Some(Distortion::Fisheye([k1, k2, 0.0, 0.0]))),
        (model, numbers) if MODELS.contains(&model) => {
            return Err(content(name, format!("camera {id}: {model} with {} parameters", numbers.len())));
        }
        (model, _) => return Err(PoseError::CameraModel { file: name.to_owned(), model: clip(model) }),
    };
    let distortion = distortion.filter(|distortion| !distortion.is_identity());
    Ok(ColmapCamera { id: (*id).to_owned(), lens: Lens::Pixels { intrinsics, size: Some(size) }, distortion })
}

const MODELS: [&str; 9] = [
    "SIMPLE_PINHOLE",
    "PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
    "FULL_OPENCV",
    "OPENCV_FISHEYE",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
];

fn clip(text: &str) -> String {
    text.chars().take(60).collect()
}
