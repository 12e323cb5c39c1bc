use std::sync::Arc;

use lightoctree::OnEvent;
use lightoctree::insert::{Composite, Inserter, Instance, Lighting, Placement, Quality};
use lightoctree::mesh::PreparedModel;

use crate::lit::LitScenes;
use crate::{SessionError, State};

/// The pictures of what moves, as `lightoctree insert --layout objects.json --frames N` makes them.
pub struct Sequence {
    inserter: Inserter,
    models: Vec<Arc<PreparedModel>>,
    /// Of each object its placement in each frame.
    placements: Vec<Vec<Placement>>,
    size: (usize, usize),
    frames: usize,
}

impl Sequence {
    /// Of a state, in the photo's full size.
    ///
    /// # Errors
    /// [`SessionError::NothingMoves`] without keyframes; light that cannot be traced.
    pub fn new(scenes: &LitScenes, state: &State, quality: Quality) -> Result<Self, SessionError> {
        if state.span_s().is_none() {
            return Err(SessionError::NothingMoves);
        }
        let frames = state.sequence_frames() as usize;
        let plain: Vec<&PreparedModel> = state.objects.iter().map(|object| &**object.mesh.plain()).collect();
        let placements = state.layout()?.placements(scenes.open().ground(), &plain, frames)?;
        let models = state.objects.iter().map(|object| object.mesh.prepared(object.material.as_ref()));
        let models = models.collect::<Result<_, SessionError>>()?;
        let lit = scenes.of(state)?;
        let photo = &lit.frame.photo;
        let size = (photo.width(), photo.height());
        let inserter = Inserter::new(&lit, Lighting::Octree, quality)?.with_floor_gloss(state.floor_gloss);
        Ok(Self { inserter, models, placements, size, frames })
    }

    /// Number of pictures.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Width and height of each, pixels.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// One of them, from 0.
    ///
    /// # Errors
    /// Cancelled where `on_event` breaks off ([`SessionError::is_cancelled`]).
    pub fn render(&self, frame: usize, on_event: OnEvent<'_>) -> Result<Composite, SessionError> {
        let objects = self.models.iter().zip(&self.placements);
        let instances: Vec<Instance> = objects.map(|(model, places)| Instance::new(model, places[frame])).collect();
        Ok(self.inserter.render(&instances, on_event)?)
    }
}
