use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use lightoctree::OnEvent;
use lightoctree::{Estimate, LitScene};
use lo_imaging as imaging;
use lo_imaging::{Image, Photo};
use lo_insert::{Composite, Inserter, Instance, Lighting, Quality};
use lo_mesh::PreparedModel;
use lo_scene::{Frame, resized_photo};
use serde::Serialize;

use crate::draft_patch::{ImagePatch, draft_patch};
use crate::lit::LitSceneCache;
use crate::{SessionError, State};

/// Progressive rendering steps of one state, in increasing quality.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum RenderStep {
    /// During a movement: `draft` quality, at the largest of [`MOVING_SIDES`] that keeps up.
    Moving,
    /// At rest: `normal` quality, at most [`RESTING_SIDE`] pixels.
    Resting,
    /// Equal to `insert --quality high`.
    Final,
}

/// Longer sides of drafts, pixels.
pub const MOVING_SIDES: [usize; 4] = [480, 400, 320, 240];

/// After a draft that took longer, the next one is smaller. Including encoding and display, this keeps ten images/s.
const SLOW: Duration = Duration::from_millis(40);

/// After a draft that took less, the next one is larger.
const FAST: Duration = Duration::from_millis(20);

/// Longer side of the first image at rest, pixels.
pub const RESTING_SIDE: usize = 960;

impl RenderStep {
    fn quality(self) -> Quality {
        match self {
            Self::Moving => Quality::Draft,
            Self::Resting => Quality::Normal,
            Self::Final => Quality::High,
        }
    }
}

/// Renders the states of one scene. What does not depend on the objects is cached per step.
pub struct Renderer {
    scenes: Arc<LitSceneCache>,
    inserters: HashMap<RenderStep, CachedInserter>,
    /// Current index into [`MOVING_SIDES`].
    size_index: usize,
    /// Photo that draft patches are laid over.
    photo: Option<Image<[u8; 3]>>,
}

/// An inserter and its inputs.
struct CachedInserter {
    lit: Arc<LitScene>,
    floor_gloss: f32,
    side: usize,
    inserter: Inserter,
    /// Whether the light must be gathered before the next image.
    is_unprepared: bool,
}

impl Renderer {
    /// Creates a renderer for one scene.
    pub fn new(scenes: Arc<LitSceneCache>) -> Self {
        Self { scenes, inserters: HashMap::new(), size_index: 0, photo: None }
    }

    /// Renders a state.
    ///
    /// # Errors
    /// [`SessionError::NoObjects`] without objects, when the image is the photo. Cancelled if `on_event` breaks
    /// ([`SessionError::is_cancelled`]).
    pub fn render(
        &mut self,
        state: &State,
        step: RenderStep,
        on_event: OnEvent<'_>,
    ) -> Result<Composite, SessionError> {
        if state.objects.is_empty() {
            return Err(SessionError::NoObjects);
        }
        self.prepare(state, step)?;
        let models: Vec<Arc<PreparedModel>> = state
            .objects
            .iter()
            .map(|object| object.mesh.prepared(object.material.as_ref()))
            .collect::<Result<_, SessionError>>()?;
        let layout = state.layout()?;
        let objects = models.iter().zip(&state.objects).zip(layout.objects());
        let instances: Vec<Instance> = objects
            .map(|((model, object), entry)| Instance::new(model, object.placement).named(entry.name()))
            .collect();
        let Some(cached) = self.inserters.get(&step) else { return Err(SessionError::NoObjects) };
        Ok(cached.inserter.render(&instances, on_event)?)
    }

    /// Returns the photo that draft patches are laid over, at most [`RESTING_SIDE`] pixels along the longer side.
    pub fn photo(&mut self) -> &Image<[u8; 3]> {
        let photo = &self.scenes.scene().estimate().frame.photo;
        self.photo.get_or_insert_with(|| photo_at_side(photo, RESTING_SIDE).into_srgb8())
    }

    /// Renders a draft for display: the region of [`Renderer::photo`] that objects and shadows change.
    ///
    /// # Errors
    /// Those of [`Renderer::render`].
    pub fn draft(&mut self, state: &State, on_event: OnEvent<'_>) -> Result<ImagePatch, SessionError> {
        let begun = Instant::now();
        let composite = self.render(state, RenderStep::Moving, on_event)?;
        let took = begun.elapsed();
        if took > SLOW {
            self.size_index = (self.size_index + 1).min(MOVING_SIDES.len() - 1);
        } else if took < FAST {
            self.size_index = self.size_index.saturating_sub(1);
        }
        let exposure = self.scenes.scene().estimate().frame.exposure;
        Ok(draft_patch(self.photo(), &composite, exposure))
    }

    /// Prepares what does not depend on the objects, so that the first image does not wait for it.
    ///
    /// # Errors
    /// Those of [`LitSceneCache::lit`], and if the light cannot be traced.
    pub fn prepare(&mut self, state: &State, step: RenderStep) -> Result<(), SessionError> {
        let lit = if step == RenderStep::Moving { self.scenes.lit_draft(state)? } else { self.scenes.lit(state)? };
        let floor_gloss = state.floor_gloss;
        let side = match step {
            RenderStep::Moving => MOVING_SIDES[self.size_index],
            RenderStep::Resting => RESTING_SIDE,
            RenderStep::Final => usize::MAX,
        };
        let mut cached = match self.inserters.remove(&step) {
            Some(cached) if Arc::ptr_eq(&cached.lit, &lit) => cached,
            last => {
                // While the light changes, each inserter renders a single image.
                let is_unprepared = last.is_some() && step == RenderStep::Moving;
                let new = if is_unprepared { Inserter::unprepared } else { Inserter::new };
                let inserter = new(&at_side(&lit, side), Lighting::Octree, step.quality())?;
                let inserter = inserter.with_floor_gloss(floor_gloss).with_photo_look();
                let inserter = if step == RenderStep::Final { inserter.with_passes() } else { inserter };
                let cached = CachedInserter { lit, floor_gloss, side, inserter, is_unprepared };
                self.inserters.insert(step, cached);
                return Ok(());
            }
        };
        if std::mem::take(&mut cached.is_unprepared) {
            cached.inserter.prepare();
        }
        if cached.floor_gloss != floor_gloss {
            cached.inserter = cached.inserter.with_floor_gloss(floor_gloss);
            cached.floor_gloss = floor_gloss;
        }
        if cached.side != side {
            cached.inserter = cached.inserter.with_photo(photo_at_side(&cached.lit.frame.photo, side));
            cached.side = side;
        }
        self.inserters.insert(step, cached);
        Ok(())
    }
}

/// Returns the scene with a photo of at most `side` pixels along the longer side.
pub(crate) fn at_side(scene: &LitScene, side: usize) -> Cow<'_, LitScene> {
    let photo = &scene.frame.photo;
    if photo.width().max(photo.height()) <= side {
        return Cow::Borrowed(scene);
    }
    let photo = photo_at_side(photo, side);
    let camera = scene.frame.camera.resized(photo.width() as u32, photo.height() as u32);
    let frame = Frame { camera, photo, depth_m: scene.frame.depth_m.clone(), exposure: scene.frame.exposure };
    // Field by field, to avoid cloning the large photo.
    let estimate = Estimate {
        room: scene.room.clone(),
        panorama: scene.panorama.clone(),
        other_photos: scene.other_photos.clone(),
        origin: scene.origin.clone(),
        ..Estimate::observed_only(scene.light.clone(), frame)
    };
    Cow::Owned(LitScene { estimate: estimate.into(), light: scene.light.clone(), edited: scene.edited.clone() })
}

/// Resizes a photo to at most `side` pixels along the longer side, keeping its kind.
pub(crate) fn photo_at_side(photo: &Photo, side: usize) -> Photo {
    let longer = photo.width().max(photo.height()).max(1);
    let side = side.min(longer);
    let scaled = |length: usize| (length * side).div_ceil(longer).max(1);
    match (photo, resized_photo(photo, scaled(photo.width()), scaled(photo.height()))) {
        // Keep 8 bits, as displayed.
        (Photo::Srgb8(_) | Photo::Encoded8(_), Photo::Linear(linear)) => {
            Photo::Srgb8(linear.map(|rgb| rgb.map(imaging::srgb8_from_linear)))
        }
        (_, smaller) => smaller,
    }
}
