use std::sync::{Arc, Mutex, PoisonError};

use lightoctree::FittedLight;
use lightoctree::geometry::Vec3;
use lightoctree::scene::{LightEdits, Scene};

use crate::{OpenScene, SessionError, State};

/// A scene as its edits light it, the last one held: relighting takes longer than many pictures.
pub struct LitScenes {
    open: Arc<OpenScene>,
    last: Mutex<Option<Lit>>,
}

struct Lit {
    edits: LightEdits,
    /// From where, where light differs by direction.
    seen_from: Option<Vec3>,
    scene: Arc<Scene>,
}

impl LitScenes {
    /// Of one scene.
    pub fn new(open: Arc<OpenScene>) -> Self {
        Self { open, last: Mutex::default() }
    }

    /// The scene.
    pub fn open(&self) -> &Arc<OpenScene> {
        &self.open
    }

    /// The middle of the objects, of those that move in their first frame.
    fn middle(&self, state: &State) -> Result<Vec3, SessionError> {
        let first = match state.span_s() {
            Some([first_s, _]) => &state.at(first_s, self.open.ground())?,
            None => state,
        };
        let places = first.objects.iter().map(|object| object.placement.position_m);
        Ok(places.sum::<Vec3>() / first.objects.len().max(1) as f32)
    }

    /// Lit as a state says, as `insert` lights it.
    ///
    /// # Errors
    /// Where an edit is of an emitter that there is not.
    pub fn of(&self, state: &State) -> Result<Arc<Scene>, SessionError> {
        let seen_from = match self.open.scene.light.lobes {
            Some(_) => Some(self.middle(state)?),
            None => None,
        };
        // Who comes second waits for the first, and does not do the same beside.
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(lit) = last.as_ref().filter(|lit| lit.edits == state.lights && lit.seen_from == seen_from) {
            return Ok(lit.scene.clone());
        }
        let scene = match seen_from {
            None => self.open.fitted.lit(&state.lights)?,
            Some(at) => {
                let mut scene = self.open.scene.clone();
                lightoctree::seen_from(&mut scene, at);
                FittedLight::new(scene).lit(&state.lights)?
            }
        };
        let scene = Arc::new(scene);
        *last = Some(Lit { edits: state.lights.clone(), seen_from, scene: scene.clone() });
        Ok(scene)
    }
}
