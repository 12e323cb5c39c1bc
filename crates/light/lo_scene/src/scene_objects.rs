use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::is_invisible;

/// Largest number of files of a scene's objects.
pub const MAX_OBJECT_FILES: usize = 1000;

/// Longest layout of a scene's objects, bytes.
pub const MAX_OBJECT_LAYOUT: usize = 16 << 20;

/// Longest file name, bytes.
const MAX_NAME: usize = 255;

/// Largest number of frames of a sequence.
pub const MAX_FRAMES: u32 = 100_000;

/// Highest frame rate.
pub const MAX_FPS: u32 = 1000;

/// Latest keyframe time in a scene, seconds.
pub const MAX_TIME_S: f64 = 3600.0;

/// Objects that the user placed in a scene's photo. This crate stores them as text and bytes; `lo_insert` interprets
/// them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneObjects {
    /// Layout as read by `insert --layout`, JSON; empty without objects.
    pub layout: String,
    /// Contents of the mesh files by name. `car.obj/car.mtl` is the file `car.mtl` that `car.obj` refers to.
    pub files: BTreeMap<String, Arc<[u8]>>,
    /// Display options.
    pub shown: ObjectDisplay,
}

/// Display options of a scene's objects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ObjectDisplay {
    /// Gloss of the surface that supports them, from 0 to 1.
    pub floor_gloss: f32,
    /// Number of frames of a sequence; if absent, as many as its keyframes take at `fps`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<u32>,
    /// Frame rate of a sequence.
    pub fps: u32,
    /// Time of the displayed frame, seconds.
    pub time_s: f64,
}

impl Default for ObjectDisplay {
    fn default() -> Self {
        Self { floor_gloss: 0.0, frames: None, fps: 24, time_s: 0.0 }
    }
}

impl SceneObjects {
    /// Returns whether there is nothing to store.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Describes the first invalid size, name or number.
    pub(crate) fn invalid_field(&self) -> Option<String> {
        let Self { layout, files, shown } = self;
        if layout.len() > MAX_OBJECT_LAYOUT {
            return Some(format!("their layout has {} bytes; at most {MAX_OBJECT_LAYOUT} are read", layout.len()));
        }
        if files.len() > MAX_OBJECT_FILES {
            return Some(format!("they have {} files; at most {MAX_OBJECT_FILES} are read", files.len()));
        }
        if let Some(name) = files.keys().find(|name| !is_name(name)) {
            return Some(format!("{name:?} is not a valid file name"));
        }
        shown.invalid_field().map(str::to_owned)
    }
}

impl ObjectDisplay {
    /// Returns the number of frames between two times in seconds: the chosen number, or as many as that takes at
    /// `fps`.
    pub fn frames_between(&self, [first_s, last_s]: [f64; 2]) -> u32 {
        let taken = ((last_s - first_s) * f64::from(self.fps)).round() as u32;
        self.frames.unwrap_or(taken.saturating_add(1)).clamp(1, MAX_FRAMES)
    }

    /// Describes a value that is out of range.
    pub fn invalid_field(&self) -> Option<&'static str> {
        let Self { floor_gloss, frames, fps, time_s } = self;
        if !(0.0..=1.0).contains(floor_gloss) {
            return Some("the floor's gloss must be from 0 to 1");
        }
        if !frames.is_none_or(|frames| (1..=MAX_FRAMES).contains(&frames)) {
            return Some("the number of frames must be from 1 to 100,000");
        }
        if !(1..=MAX_FPS).contains(fps) {
            return Some("the frames per second must be from 1 to 1,000");
        }
        (!(0.0..=MAX_TIME_S).contains(time_s)).then_some("times must be from 0 to 3,600 seconds")
    }
}

/// Returns whether a name has the form `car.obj` or `car.obj/car.mtl`.
fn is_name(name: &str) -> bool {
    let is_file = |part: &str| !matches!(part, "" | "." | "..") && part.len() <= MAX_NAME;
    let plain = |c: char| !is_invisible(c) && c != '\\';
    name.chars().all(plain) && name.split('/').count() <= 2 && name.split('/').all(is_file)
}
