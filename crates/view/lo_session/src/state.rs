use lightoctree::insert::{InsertError, Layout};
use lightoctree::scene::LightEdits;

use crate::{Object, SessionError};

/// All that a session's user decides of the picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct State {
    /// What stands in the photo.
    pub objects: Vec<Object>,
    /// What is changed of the light.
    pub lights: LightEdits,
    /// How polished what carries the objects is, from 0 to 1.
    pub floor_gloss: f32,
}

impl State {
    /// The object of this number.
    ///
    /// # Errors
    /// Where there is none.
    pub fn object(&self, id: u32) -> Result<&Object, SessionError> {
        self.objects.iter().find(|object| object.id == id).ok_or(SessionError::NoObject(id))
    }

    /// As `insert --layout` reads it.
    ///
    /// # Errors
    /// Without objects.
    pub fn layout(&self) -> Result<Layout, InsertError> {
        Layout::new(self.objects.iter().map(Object::to_layout).collect())
    }
}
