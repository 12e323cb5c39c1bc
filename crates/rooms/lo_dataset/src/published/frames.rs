use std::borrow::Cow;
use std::path::{Path, PathBuf};

use lo_geometry::Camera;
use lo_imaging::{read_depth, read_photo, resize_depth};
use serde::Deserialize;

use super::files::stem;
use crate::sample::Metadata;
use crate::{Dataset, DatasetError, Sample};

/// File that lists a folder's frames.
const LIST: &str = "frames.json";

/// Photos with measured depth: a `.json` file, or a folder with a `frames.json`, that contains a list of
///
/// ```json
/// {"color": "a.jpg", "depth": "a.png", "depth_scale": 5000,
///  "intrinsics": [517.3, 516.5, 318.6, 255.3], "room": "office"}
/// ```
///
/// Paths are relative to the list. `depth_scale` is the number of depth units per metre; 0 means no reading.
/// `intrinsics` are the photo's (fx, fy, cx, cy in pixels), with which depth is registered. Other keys are ignored.
/// Measured depth is used as true depth. The room's light is unknown.
#[derive(Debug)]
pub struct Frames {
    list: PathBuf,
    frames: Vec<FrameEntry>,
}

#[derive(Debug, Deserialize)]
struct FrameEntry {
    color: PathBuf,
    depth: PathBuf,
    depth_scale: f64,
    intrinsics: [f64; 4],
    room: String,
}

impl Frames {
    /// Whether a path is such a list or a folder with one.
    pub(crate) fn is_at(path: &Path) -> bool {
        path.extension().is_some_and(|extension| extension == "json") || path.join(LIST).is_file()
    }

    /// Reads the list.
    ///
    /// # Errors
    /// If the list cannot be read, is invalid, or is empty.
    pub fn open(path: &Path) -> Result<Self, DatasetError> {
        let list = if path.is_dir() { path.join(LIST) } else { path.to_owned() };
        let text = std::fs::read_to_string(&list).map_err(DatasetError::io(&list))?;
        let frames: Vec<FrameEntry> =
            serde_json::from_str(&text).map_err(|error| DatasetError::field(&list, "frames", error))?;
        if frames.is_empty() {
            return Err(DatasetError::field(&list, "frames", "the list is empty"));
        }
        if let Some(wrong) = frames.iter().find(|frame| !(frame.depth_scale > 0.0 && frame.depth_scale.is_finite())) {
            let field = format!("depth_scale of {}", wrong.color.display());
            return Err(DatasetError::field(&list, field, format!("{} is not positive and finite", wrong.depth_scale)));
        }
        Ok(Self { list, frames })
    }

    fn beside(&self, file: &Path) -> PathBuf {
        self.list.parent().unwrap_or(Path::new("")).join(file)
    }
}

impl Dataset for Frames {
    fn len(&self) -> usize {
        self.frames.len()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        self.frames[index].room.as_str().into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let len = self.len();
        let frame = self.frames.get(index).ok_or(DatasetError::Index { index, len })?;
        let file = self.beside(&frame.color);
        let photo = read_photo(&file)?.photo.into_srgb8();
        let (width, height) = (photo.width(), photo.height());
        let [fx, fy, cx, cy] = frame.intrinsics;
        let camera = Camera::new(fx, fy, cx, cy, width as u32, height as u32).map_err(|error| {
            DatasetError::field(&self.list, format!("intrinsics of {}", frame.color.display()), error)
        })?;
        let depth_m = read_depth(self.beside(&frame.depth), Some(frame.depth_scale))?;
        Ok(Sample {
            id: stem(&file),
            scene_id: frame.room.clone(),
            photo,
            camera,
            up: None,
            radiance: None,
            depth_m: Some(resize_depth(&depth_m, width, height)),
            sensor_depth_m: None,
            normal: None,
            albedo: None,
            points: Vec::new(),
            point_area_m2: None,
            views: Vec::new(),
            metadata: Metadata::new(),
        })
    }
}
