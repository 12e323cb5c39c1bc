use lightoctree::GuessedLight;
use lightoctree::insert::{Ground, InsertError, Layout};
use lightoctree::scene::{LightEdits, ObjectDisplay};

use crate::keyframes::kept_time_s;
use crate::{Object, SessionError};

/// All that a session's user decides of the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// What stands in the photo.
    pub objects: Vec<Object>,
    /// What is changed of the light.
    pub lights: LightEdits,
    /// How polished what carries the objects is, from 0 to 1.
    pub floor_gloss: f32,
    /// Number of frames of a sequence, where somebody chose it.
    pub frames: Option<u32>,
    /// Frames per second of a sequence.
    pub fps: u32,
    /// The time that is looked at, seconds.
    pub time_s: f64,
}

impl Default for State {
    fn default() -> Self {
        let ObjectDisplay { floor_gloss, frames, fps, time_s } = ObjectDisplay::default();
        Self { objects: Vec::new(), lights: LightEdits::default(), floor_gloss, frames, fps, time_s }
    }
}

impl State {
    /// The object of this number.
    ///
    /// # Errors
    /// Where there is none.
    pub fn object(&self, id: u32) -> Result<&Object, SessionError> {
        self.objects.iter().find(|object| object.id == id).ok_or(SessionError::NoObject(id))
    }

    /// The light that it is lit by.
    pub fn guessed(&self) -> GuessedLight {
        self.lights.guessed.unwrap_or_default().in_effect()
    }

    /// The same at another time.
    ///
    /// # Errors
    /// A time out of range.
    pub fn at<'a>(&self, time_s: f64, ground: impl Into<Ground<'a>>) -> Result<Self, SessionError> {
        let ground = ground.into();
        let time_s = kept_time_s(time_s)?;
        let placed = |object: &Object| match object.path {
            Some(_) => object.clone().placed(ground, time_s),
            None => Ok(object.clone()),
        };
        let objects = self.objects.iter().map(placed).collect::<Result<_, _>>()?;
        Ok(Self { objects, time_s, lights: self.lights.clone(), ..*self })
    }

    /// Times of the first keyframe of all objects and of the last, seconds; `None` where nothing moves.
    pub fn span_s(&self) -> Option<[f64; 2]> {
        let keys = self.objects.iter().filter_map(|object| object.path.as_ref()).flat_map(|path| &path.keyframes);
        keys.map(|key| [key.time_s; 2]).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// Number of frames of a sequence: what somebody chose, or as many as its keyframes take.
    pub fn sequence_frames(&self) -> u32 {
        self.shown().frames_between(self.span_s().unwrap_or_default())
    }

    /// How the scene's file holds that.
    pub(crate) fn shown(&self) -> ObjectDisplay {
        let Self { floor_gloss, frames, fps, time_s, .. } = *self;
        ObjectDisplay { floor_gloss, frames, fps, time_s }
    }

    /// As `insert --layout` reads it.
    ///
    /// # Errors
    /// Without objects.
    pub fn layout(&self) -> Result<Layout, InsertError> {
        Layout::new(self.objects.iter().map(Object::to_layout).collect())
    }
}
