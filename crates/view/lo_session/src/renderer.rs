use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use lightoctree::OnEvent;
use lightoctree::imaging::{self, Image, Photo};
use lightoctree::insert::{Composite, Inserter, Instance, Lighting, Quality};
use lightoctree::mesh::PreparedModel;
use lightoctree::scene::{Frame, Scene, SceneObjects, resized_photo};
use serde::Serialize;

use crate::enlarged::enlarged;
use crate::lit::LitScenes;
use crate::{SessionError, State};

/// Pictures of one state, each better than the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Step {
    /// While something moves: `draft`, at most [`MOVING_SIDE`] pixels along the longer side.
    Moving,
    /// When it rests: `normal`, at most [`RESTING_SIDE`] pixels.
    Resting,
    /// What `insert --quality high` makes.
    Final,
}

/// Longer side of pictures of moving objects, pixels.
pub const MOVING_SIDE: usize = 480;

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

    fn side(self) -> usize {
        match self {
            Self::Moving => MOVING_SIDE,
            Self::Resting => RESTING_SIDE,
            Self::Final => usize::MAX,
        }
    }
}

/// Makes the pictures of one scene's states. What does not depend on the objects is held for each step.
pub struct Renderer {
    scenes: Arc<LitScenes>,
    ready: HashMap<Step, Ready>,
    /// What moving objects are shown in.
    photo: Option<Image<[u8; 3]>>,
}

/// An inserter, and what it was made for.
struct Ready {
    lit: Arc<Scene>,
    floor_gloss: f32,
    inserter: Inserter,
}

impl Renderer {
    /// For one scene.
    pub fn new(scenes: Arc<LitScenes>) -> Self {
        Self { scenes, ready: HashMap::new(), photo: None }
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

    /// A picture of what moves, for a screen: the draft's objects and shadows in a photo of [`RESTING_SIDE`] pixels.
    ///
    /// # Errors
    /// Those of [`Renderer::render`].
    pub fn moving(&mut self, state: &State, on_event: OnEvent<'_>) -> Result<Image<[u8; 3]>, SessionError> {
        let composite = self.render(state, Step::Moving, on_event)?;
        let open = self.scenes.open();
        let photo = self.photo.get_or_insert_with(|| match photo_at_side(&open.scene.frame.photo, RESTING_SIDE) {
            Photo::Srgb8(image) => image,
            Photo::Linear(image) => image.map(|rgb| rgb.map(imaging::srgb8_from_linear)),
        });
        Ok(enlarged(photo, &composite, open.scene.frame.exposure))
    }

    /// Makes ready what does not depend on the objects, so that the first picture does not wait for it.
    ///
    /// # Errors
    /// Edits that do not fit the scene; light that cannot be traced.
    pub fn prepare(&mut self, state: &State, step: Step) -> Result<(), SessionError> {
        let lit = self.scenes.of(state)?;
        let floor_gloss = state.floor_gloss;
        let inserter = match self.ready.remove(&step) {
            Some(ready) if Arc::ptr_eq(&ready.lit, &lit) => {
                if ready.floor_gloss == floor_gloss {
                    ready.inserter
                } else {
                    ready.inserter.with_floor_gloss(floor_gloss)
                }
            }
            _ => Inserter::new(&at_side(&lit, step.side()), Lighting::Octree, step.quality())?
                .with_floor_gloss(floor_gloss),
        };
        self.ready.insert(step, Ready { lit, floor_gloss, inserter });
        Ok(())
    }
}

/// The scene with a photo of at most `side` pixels along the longer side.
pub(crate) fn at_side(scene: &Scene, side: usize) -> Cow<'_, Scene> {
    let photo = &scene.frame.photo;
    if photo.width().max(photo.height()) <= side {
        return Cow::Borrowed(scene);
    }
    let photo = photo_at_side(photo, side);
    let camera = scene.frame.camera.resized(photo.width() as u32, photo.height() as u32);
    let frame = Frame { camera, photo, depth_m: scene.frame.depth_m.clone(), exposure: scene.frame.exposure };
    // Part by part, so that the large photo is not cloned.
    Cow::Owned(Scene {
        frame,
        light: scene.light.clone(),
        completion: scene.completion,
        room: scene.room.clone(),
        sources: scene.sources.clone(),
        predicted_depth: scene.predicted_depth,
        depth_model: scene.depth_model.clone(),
        confidence: None,
        panorama: scene.panorama.clone(),
        other_photos: scene.other_photos.clone(),
        light_edits: scene.light_edits.clone(),
        objects: SceneObjects::default(),
        edited: scene.edited.clone(),
    })
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
