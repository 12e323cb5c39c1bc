use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use lightoctree::OnEvent;
use lightoctree::imaging::{self, Image, Photo};
use lightoctree::insert::{Composite, Inserter, Instance, Lighting, Quality};
use lightoctree::mesh::PreparedModel;
use lightoctree::scene::{Frame, resized_photo};
use lightoctree::{Estimate, LitScene};
use serde::Serialize;

use crate::enlarged::{Part, enlarged};
use crate::lit::LitScenes;
use crate::{SessionError, State};

/// Pictures of one state, each better than the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Step {
    /// While something moves: `draft`, as large as this machine holds pace with ([`MOVING_SIDES`]).
    Moving,
    /// When it rests: `normal`, at most [`RESTING_SIDE`] pixels.
    Resting,
    /// What `insert --quality high` makes.
    Final,
}

/// Longer sides of pictures of moving objects, pixels.
pub const MOVING_SIDES: [usize; 4] = [480, 400, 320, 240];

/// A moving picture that takes longer is followed by a smaller one; with what encodes and shows it this is ten pictures a second and more.
const SLOW: Duration = Duration::from_millis(40);

/// One that takes less is followed by a larger one.
const FAST: Duration = Duration::from_millis(20);

/// Longer side of the first picture of resting objects, pixels.
pub const RESTING_SIDE: usize = 960;

impl Step {
    fn quality(self) -> Quality {
        match self {
            Self::Moving => Quality::Draft,
            Self::Resting => Quality::Normal,
            Self::Final => Quality::High,
        }
    }
}

/// Makes the pictures of one scene's states. What does not depend on the objects is held for each step.
pub struct Renderer {
    scenes: Arc<LitScenes>,
    ready: HashMap<Step, Ready>,
    /// Which of [`MOVING_SIDES`] is taken.
    pace: usize,
    /// What moving objects are shown in.
    photo: Option<Image<[u8; 3]>>,
}

/// An inserter, and what it was made for.
struct Ready {
    lit: Arc<LitScene>,
    floor_gloss: f32,
    side: usize,
    inserter: Inserter,
    /// Whether the next picture in this light is to gather all of it first.
    is_unprepared: bool,
}

impl Renderer {
    /// For one scene.
    pub fn new(scenes: Arc<LitScenes>) -> Self {
        Self { scenes, ready: HashMap::new(), pace: 0, photo: None }
    }

    /// A picture of a state.
    ///
    /// # Errors
    /// [`SessionError::NoObjects`] without objects: the picture is the photo. Cancelled where `on_event` breaks off ([`SessionError::is_cancelled`]).
    pub fn render(&mut self, state: &State, step: Step, on_event: OnEvent<'_>) -> Result<Composite, SessionError> {
        if state.objects.is_empty() {
            return Err(SessionError::NoObjects);
        }
        self.prepare(state, step)?;
        let models: Vec<Arc<PreparedModel>> = state
            .objects
            .iter()
            .map(|object| object.mesh.prepared(object.material.as_ref()))
            .collect::<Result<_, SessionError>>()?;
        let instances: Vec<Instance> =
            models.iter().zip(&state.objects).map(|(model, object)| Instance::new(model, object.placement)).collect();
        let Some(ready) = self.ready.get(&step) else { return Err(SessionError::NoObjects) };
        Ok(ready.inserter.render(&instances, on_event)?)
    }

    /// The photo that parts of moving pictures lie on: at most [`RESTING_SIDE`] pixels along the longer side, as it is shown.
    pub fn photo(&mut self) -> &Image<[u8; 3]> {
        let photo = &self.scenes.open().estimate().frame.photo;
        self.photo.get_or_insert_with(|| match photo_at_side(photo, RESTING_SIDE) {
            Photo::Srgb8(image) => image,
            Photo::Linear(image) => image.map(|rgb| rgb.map(imaging::srgb8_from_linear)),
        })
    }

    /// A picture of what moves, for a screen: what the draft's objects and shadows change of [`Renderer::photo`].
    ///
    /// # Errors
    /// Those of [`Renderer::render`].
    pub fn moving(&mut self, state: &State, on_event: OnEvent<'_>) -> Result<Part, SessionError> {
        let begun = Instant::now();
        let composite = self.render(state, Step::Moving, on_event)?;
        let took = begun.elapsed();
        if took > SLOW {
            self.pace = (self.pace + 1).min(MOVING_SIDES.len() - 1);
        } else if took < FAST {
            self.pace = self.pace.saturating_sub(1);
        }
        let exposure = self.scenes.open().estimate().frame.exposure;
        Ok(enlarged(self.photo(), &composite, exposure))
    }

    /// Makes ready what does not depend on the objects, so that the first picture does not wait for it.
    ///
    /// # Errors
    /// Edits that do not fit the scene; light that cannot be traced.
    pub fn prepare(&mut self, state: &State, step: Step) -> Result<(), SessionError> {
        let lit = if step == Step::Moving { self.scenes.draft_of(state)? } else { self.scenes.of(state)? };
        let floor_gloss = state.floor_gloss;
        let side = match step {
            Step::Moving => MOVING_SIDES[self.pace],
            Step::Resting => RESTING_SIDE,
            Step::Final => usize::MAX,
        };
        let mut ready = match self.ready.remove(&step) {
            Some(ready) if Arc::ptr_eq(&ready.lit, &lit) => ready,
            last => {
                // While the light changes, each is of one picture.
                let is_unprepared = last.is_some() && step == Step::Moving;
                let new = if is_unprepared { Inserter::unprepared } else { Inserter::new };
                let inserter = new(&at_side(&lit, side), Lighting::Octree, step.quality())?;
                let ready =
                    Ready { lit, floor_gloss, side, inserter: inserter.with_floor_gloss(floor_gloss), is_unprepared };
                self.ready.insert(step, ready);
                return Ok(());
            }
        };
        if std::mem::take(&mut ready.is_unprepared) {
            ready.inserter.prepare();
        }
        if ready.floor_gloss != floor_gloss {
            ready.inserter = ready.inserter.with_floor_gloss(floor_gloss);
            ready.floor_gloss = floor_gloss;
        }
        if ready.side != side {
            ready.inserter = ready.inserter.with_photo(photo_at_side(&ready.lit.frame.photo, side));
            ready.side = side;
        }
        self.ready.insert(step, ready);
        Ok(())
    }
}

/// The scene with a photo of at most `side` pixels along the longer side.
pub(crate) fn at_side(scene: &LitScene, side: usize) -> Cow<'_, LitScene> {
    let photo = &scene.frame.photo;
    if photo.width().max(photo.height()) <= side {
        return Cow::Borrowed(scene);
    }
    let photo = photo_at_side(photo, side);
    let camera = scene.frame.camera.resized(photo.width() as u32, photo.height() as u32);
    let frame = Frame { camera, photo, depth_m: scene.frame.depth_m.clone(), exposure: scene.frame.exposure };
    // Part by part, so that the large photo is not cloned.
    let estimate = Estimate {
        room: scene.room.clone(),
        panorama: scene.panorama.clone(),
        other_photos: scene.other_photos.clone(),
        origin: scene.origin.clone(),
        ..Estimate::observed_only(scene.light.clone(), frame)
    };
    Cow::Owned(LitScene { estimate: estimate.into(), light: scene.light.clone(), edited: scene.edited.clone() })
}

/// A photo of at most `side` pixels along the longer side, of the same kind.
fn photo_at_side(photo: &Photo, side: usize) -> Photo {
    let longer = photo.width().max(photo.height()).max(1);
    let side = side.min(longer);
    let scaled = |length: usize| (length * side).div_ceil(longer).max(1);
    match (photo, resized_photo(photo, scaled(photo.width()), scaled(photo.height()))) {
        // As it is shown, in as few bytes.
        (Photo::Srgb8(_), Photo::Linear(linear)) => Photo::Srgb8(linear.map(|rgb| rgb.map(imaging::srgb8_from_linear))),
        (_, smaller) => smaller,
    }
}
