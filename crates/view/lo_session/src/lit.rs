use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lightoctree::geometry::Vec3;
use lightoctree::scene::LightEdits;
use lightoctree::{AppliedLight, FittedLight, GuessedLight, LitScene};

use crate::{OpenScene, SessionError, State};

/// Choices of light that are held: undo and redo go from one to another.
const LAID: usize = 4;

/// A scene as its edits light it, the last one held: relighting takes longer than many pictures.
pub struct LitScenes {
    open: Arc<OpenScene>,
    last: Mutex<Option<Lit>>,
    /// The last one whose lamps are a preview.
    draft: Mutex<Option<Lit>>,
    /// The newest last.
    laid: Mutex<Vec<Arc<AppliedLight>>>,
    /// Held while lamps are fitted.
    fitting: Mutex<()>,
}

struct Lit {
    edits: LightEdits,
    /// From where, where light differs by direction.
    seen_from: Option<Vec3>,
    scene: Arc<LitScene>,
}

impl LitScenes {
    /// Of one scene.
    pub fn new(open: Arc<OpenScene>) -> Self {
        let laid = Mutex::new(vec![Arc::new(open.fitted.default_light().clone())]);
        Self { open, last: Mutex::default(), draft: Mutex::default(), laid, fitting: Mutex::default() }
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
    /// Where an edit is of an emitter that there is not, and where what is said to be white has no colour.
    pub fn of(&self, state: &State) -> Result<Arc<LitScene>, SessionError> {
        match self.seen_from(state)? {
            None => {
                let laid = self.laid(&state.guessed())?;
                lit(&self.last, state, None, || Ok(self.open.fitted.lit(&laid, &state.lights)?))
            }
            Some(at) => lit(&self.last, state, Some(at), || {
                let fitted = FittedLight::for_viewpoint(&self.open.document.estimate, at);
                Ok(fitted.lit(&fitted.apply(&state.guessed())?, &state.lights)?)
            }),
        }
    }

    /// As [`LitScenes::of`] where lamps are fitted in the state's light already; else with a preview of that, so that
    /// what moves does not wait.
    ///
    /// # Errors
    /// Those of [`LitScenes::of`].
    pub fn draft_of(&self, state: &State) -> Result<Arc<LitScene>, SessionError> {
        let guessed = state.guessed();
        if self.seen_from(state)?.is_some() || self.known(&guessed).is_some() {
            return self.of(state);
        }
        lit(&self.draft, state, None, || {
            let like = locked(&self.laid).last().cloned();
            let fitted = &self.open.fitted;
            let laid = fitted.preview(&guessed, like.as_deref().unwrap_or(fitted.default_light()))?;
            Ok(fitted.lit(&laid, &state.lights)?)
        })
    }

    fn seen_from(&self, state: &State) -> Result<Option<Vec3>, SessionError> {
        self.open.estimate().light.lobes.as_ref().map(|_| self.middle(state)).transpose()
    }

    fn known(&self, guessed: &GuessedLight) -> Option<Arc<AppliedLight>> {
        locked(&self.laid).iter().find(|laid| laid.choice() == guessed).cloned()
    }

    fn laid(&self, guessed: &GuessedLight) -> Result<Arc<AppliedLight>, SessionError> {
        // Concurrent callers share one result.
        let _fitting = locked(&self.fitting);
        if let Some(laid) = self.known(guessed) {
            return Ok(laid);
        }
        let new = Arc::new(self.open.fitted.apply(guessed)?);
        let mut laid = locked(&self.laid);
        if laid.len() >= LAID {
            laid.remove(0);
        }
        laid.push(new.clone());
        Ok(new)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What is held, where it is of the state, or else something new. Concurrent callers share one result.
fn lit(
    held: &Mutex<Option<Lit>>,
    state: &State,
    seen_from: Option<Vec3>,
    make: impl FnOnce() -> Result<LitScene, SessionError>,
) -> Result<Arc<LitScene>, SessionError> {
    let mut held = locked(held);
    if let Some(lit) = held.as_ref().filter(|lit| lit.edits == state.lights && lit.seen_from == seen_from) {
        return Ok(lit.scene.clone());
    }
    let scene = Arc::new(make()?);
    *held = Some(Lit { edits: state.lights.clone(), seen_from, scene: scene.clone() });
    Ok(scene)
}
