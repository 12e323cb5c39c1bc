use lightoctree::{InferredLight, KnownLength};
use lo_insert::{Ground, InsertError, Layout};
use lo_scene::{LightEdits, ObjectDisplay};

use crate::key_times::quantized_time_s;
use crate::{Object, SessionError};

/// The edited state of a session: everything that determines the rendered image.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Objects in the photo.
    pub objects: Vec<Object>,
    /// Edits of the light.
    pub lights: LightEdits,
    /// Gloss of the surfaces that carry objects, 0 to 1.
    pub floor_gloss: f32,
    /// Chosen number of frames of the sequence; `None` follows from the keyframes.
    pub frames: Option<u32>,
    /// Frames per second of the sequence.
    pub fps: u32,
    /// Current time, seconds.
    pub time_s: f64,
    /// Length to which the room of the scene file is scaled.
    pub known_length: Option<KnownLength>,
}

impl Default for State {
    fn default() -> Self {
        let ObjectDisplay { floor_gloss, frames, fps, time_s } = ObjectDisplay::default();
        let (objects, lights) = (Vec::new(), LightEdits::default());
        Self { objects, lights, floor_gloss, frames, fps, time_s, known_length: None }
    }
}

impl State {
    /// Returns the object with an id.
    ///
    /// # Errors
    /// If there is none.
    pub fn object(&self, id: u32) -> Result<&Object, SessionError> {
        self.objects.iter().find(|object| object.id == id).ok_or(SessionError::NoObject(id))
    }

    /// Returns the effective choice of light for unobserved regions.
    pub fn inferred_light(&self) -> InferredLight {
        self.lights.inferred.unwrap_or_default().in_effect()
    }

    /// Returns the state without hidden objects, which images show.
    pub fn shown_in_images(&self) -> Self {
        let objects = self.objects.iter().filter(|object| !object.is_hidden).cloned().collect();
        Self { objects, lights: self.lights.clone(), ..*self }
    }

    /// Returns the state at another time.
    ///
    /// # Errors
    /// If the time is out of range.
    pub fn at<'a>(&self, time_s: f64, ground: impl Into<Ground<'a>>) -> Result<Self, SessionError> {
        let ground = ground.into();
        let time_s = quantized_time_s(time_s)?;
        let placed = |object: &Object| match object.path {
            Some(_) => object.clone().placed(ground, time_s),
            None => Ok(object.clone()),
        };
        let objects = self.objects.iter().map(placed).collect::<Result<_, _>>()?;
        Ok(Self { objects, time_s, lights: self.lights.clone(), ..*self })
    }

    /// Returns whether a scene file of this state equals that of another one, apart from the current time.
    pub(crate) fn is_equally_saved(&self, other: &Self) -> bool {
        let same = |a: &Object, b: &Object| a.to_layout() == b.to_layout();
        self.objects.len() == other.objects.len()
            && std::iter::zip(&self.objects, &other.objects).all(|(a, b)| same(a, b))
            && (&self.lights, self.floor_gloss, self.frames, self.fps, self.known_length)
                == (&other.lights, other.floor_gloss, other.frames, other.fps, other.known_length)
    }

    /// Returns the times of the first and last keyframe, seconds; `None` without keyframes.
    pub fn span_s(&self) -> Option<[f64; 2]> {
        let keys = self.objects.iter().filter_map(|object| object.path.as_ref()).flat_map(|path| &path.keyframes);
        keys.map(|key| [key.time_s; 2]).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// Returns the number of frames of the sequence: the chosen one, or as many as the keyframes take.
    pub fn sequence_frames(&self) -> u32 {
        self.shown().frames_between(self.span_s().unwrap_or_default())
    }

    /// Returns the settings that the scene file stores.
    pub(crate) fn shown(&self) -> ObjectDisplay {
        let Self { floor_gloss, frames, fps, time_s, .. } = *self;
        ObjectDisplay { floor_gloss, frames, fps, time_s }
    }

    /// Returns the layout that `insert --layout` reads.
    ///
    /// # Errors
    /// If there are no objects.
    pub fn layout(&self) -> Result<Layout, InsertError> {
        Layout::new(self.objects.iter().map(Object::to_layout).collect())
    }
}
