use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use lightoctree::{AppliedLight, FittedLight, InferredLight, LitScene};
use lo_geometry::Vec3;
use lo_scene::LightEdits;

use crate::{OpenScene, SessionError, State};

/// Maximum number of cached choices of light, so that undo and redo do not fit again.
const MAX_CACHED_LIGHTS: usize = 4;

/// Caches the scene lit by a state's edits, because relighting takes longer than rendering many images.
pub struct LitSceneCache {
    scene: Arc<OpenScene>,
    last: Mutex<Option<CachedScene>>,
    /// The last scene whose lamps are only previewed.
    draft: Mutex<Option<CachedScene>>,
    /// Lights by choice, newest last.
    applied: Mutex<Vec<Arc<AppliedLight>>>,
    /// Locked while lamps are fitted.
    fitting: Mutex<()>,
}

struct CachedScene {
    edits: LightEdits,
    /// Position from which directional radiance is evaluated.
    seen_from: Option<Vec3>,
    scene: Arc<LitScene>,
}

impl LitSceneCache {
    /// Creates a cache for one scene.
    pub fn new(scene: Arc<OpenScene>) -> Self {
        let applied = Mutex::new(vec![Arc::new(scene.fitted.default_light().clone())]);
        Self { scene, last: Mutex::default(), draft: Mutex::default(), applied, fitting: Mutex::default() }
    }

    /// Returns the scene.
    pub fn scene(&self) -> &Arc<OpenScene> {
        &self.scene
    }

    /// Returns the centre of the objects, in the first frame if they are animated.
    fn middle(&self, state: &State) -> Result<Vec3, SessionError> {
        let first = match state.span_s() {
            Some([first_s, _]) => &state.at(first_s, self.scene.ground())?,
            None => state,
        };
        let positions = first.objects.iter().map(|object| object.placement.position_m);
        Ok(positions.sum::<Vec3>() / first.objects.len().max(1) as f32)
    }

    /// Returns the scene lit by a state's edits, as `insert` lights it.
    ///
    /// # Errors
    /// If an edit refers to an unknown emitter, or the white pixel has no colour.
    pub fn lit(&self, state: &State) -> Result<Arc<LitScene>, SessionError> {
        match self.seen_from(state)? {
            None => {
                let applied = self.applied(&state.inferred_light())?;
                cached(&self.last, state, None, || Ok(self.scene.fitted.lit(&applied, &state.lights)?))
            }
            Some(at) => cached(&self.last, state, Some(at), || {
                let fitted = FittedLight::for_viewpoint(&self.scene.document.estimate, at);
                Ok(fitted.lit(&fitted.apply(&state.inferred_light())?, &state.lights)?)
            }),
        }
    }

    /// Returns the same as [`LitSceneCache::lit`] if the lamps of the state's light are fitted already, else a preview
    /// of it, so that drafts do not wait.
    ///
    /// # Errors
    /// Those of [`LitSceneCache::lit`].
    pub fn lit_draft(&self, state: &State) -> Result<Arc<LitScene>, SessionError> {
        let inferred = state.inferred_light();
        if self.seen_from(state)?.is_some() || self.fitted_light(&inferred).is_some() {
            return self.lit(state);
        }
        cached(&self.draft, state, None, || {
            let like = locked(&self.applied).last().cloned();
            let fitted = &self.scene.fitted;
            let applied = fitted.preview(&inferred, like.as_deref().unwrap_or(fitted.default_light()))?;
            Ok(fitted.lit(&applied, &state.lights)?)
        })
    }

    fn seen_from(&self, state: &State) -> Result<Option<Vec3>, SessionError> {
        self.scene.estimate().light.lobes.as_ref().map(|_| self.middle(state)).transpose()
    }

    fn fitted_light(&self, inferred: &InferredLight) -> Option<Arc<AppliedLight>> {
        locked(&self.applied).iter().find(|light| light.choice() == inferred).cloned()
    }

    fn applied(&self, inferred: &InferredLight) -> Result<Arc<AppliedLight>, SessionError> {
        // Concurrent callers share one result.
        let _fitting = locked(&self.fitting);
        if let Some(applied) = self.fitted_light(inferred) {
            return Ok(applied);
        }
        let new = Arc::new(self.scene.fitted.apply(inferred)?);
        let mut applied = locked(&self.applied);
        if applied.len() >= MAX_CACHED_LIGHTS {
            applied.remove(0);
        }
        applied.push(new.clone());
        Ok(new)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the cached scene if it matches the state, else makes and caches one. Concurrent callers share one result.
fn cached(
    slot: &Mutex<Option<CachedScene>>,
    state: &State,
    seen_from: Option<Vec3>,
    make: impl FnOnce() -> Result<LitScene, SessionError>,
) -> Result<Arc<LitScene>, SessionError> {
    let mut slot = locked(slot);
    if let Some(lit) = slot.as_ref().filter(|lit| lit.edits == state.lights && lit.seen_from == seen_from) {
        return Ok(lit.scene.clone());
    }
    let scene = Arc::new(make()?);
    *slot = Some(CachedScene { edits: state.lights.clone(), seen_from, scene: scene.clone() });
    Ok(scene)
}
