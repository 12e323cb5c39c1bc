use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// Most files of a scene's objects.
pub const MAX_OBJECT_FILES: usize = 1000;

/// Longest layout of a scene's objects, bytes.
pub const MAX_OBJECT_LAYOUT: usize = 16 << 20;

/// Longest name of a file, bytes.
const MAX_NAME: usize = 255;

/// Most frames of a sequence.
pub const MAX_FRAMES: u32 = 100_000;

/// Most frames per second.
pub const MAX_FPS: u32 = 1000;

/// Latest time of a keyframe in a scene, seconds.
pub const MAX_TIME_S: f64 = 3600.0;

/// Objects that somebody stood into a scene's photo, for whoever opens it again. What they are is up to `insert`: here they are text and bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneObjects {
    /// What `insert --layout` reads, JSON; empty where nothing stands there.
    pub layout: String,
    /// The files of its meshes under their names, as they came; `car.obj/car.mtl` is the file `car.mtl` that `car.obj` names.
    pub files: BTreeMap<String, Arc<[u8]>>,
    /// How they are shown.
    pub shown: ObjectsShown,
}

/// How the objects of a scene are shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ObjectsShown {
    /// How polished what carries them is, from 0 to 1.
    pub floor_gloss: f32,
    /// Number of frames of a sequence; else as many as its keyframes take at `fps`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<u32>,
    /// Frames per second of a sequence.
    pub fps: u32,
    /// The time that was looked at, seconds.
    pub time_s: f64,
}

impl Default for ObjectsShown {
    fn default() -> Self {
        Self { floor_gloss: 0.0, frames: None, fps: 24, time_s: 0.0 }
    }
}

impl SceneObjects {
    /// Whether there is nothing to keep.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// What is wrong with sizes, names and numbers, if anything.
    pub(crate) fn wrong(&self) -> Option<String> {
        let Self { layout, files, shown } = self;
        if layout.len() > MAX_OBJECT_LAYOUT {
            return Some(format!("their layout has {} bytes, at most {MAX_OBJECT_LAYOUT} are read", layout.len()));
        }
        if files.len() > MAX_OBJECT_FILES {
            return Some(format!("they have {} files, at most {MAX_OBJECT_FILES} are read", files.len()));
        }
        if let Some(name) = files.keys().find(|name| !is_name(name)) {
            return Some(format!("{name:?} is no name of a file"));
        }
        shown.wrong().map(str::to_owned)
    }
}

impl ObjectsShown {
    /// Number of frames of a sequence between two times in seconds: what somebody chose, or as many as that takes at `fps`.
    pub fn frames_between(&self, [first_s, last_s]: [f64; 2]) -> u32 {
        let taken = ((last_s - first_s) * f64::from(self.fps)).round() as u32;
        self.frames.unwrap_or(taken.saturating_add(1)).clamp(1, MAX_FRAMES)
    }

    /// What is out of range, if anything.
    pub fn wrong(&self) -> Option<&'static str> {
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

/// `car.obj`, or `car.obj/car.mtl`.
fn is_name(name: &str) -> bool {
    let is_file = |part: &str| !matches!(part, "" | "." | "..") && part.len() <= MAX_NAME;
    let plain = |c: char| !c.is_control() && c != '\\';
    name.chars().all(plain) && name.split('/').count() <= 2 && name.split('/').all(is_file)
}
