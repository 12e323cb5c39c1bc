use std::sync::Arc;

use lightoctree::OnEvent;
use lo_insert::{Composite, Inserter, Instance, Lighting, Placement, Quality};
use lo_mesh::PreparedModel;

use crate::lit::LitSceneCache;
use crate::{SessionError, State};

/// Renders the frames of an animated state, as `lightoctree insert --layout objects.json --frames N` does.
pub struct Sequence {
    inserter: Inserter,
    models: Vec<Arc<PreparedModel>>,
    names: Vec<String>,
    /// Placements by object and frame.
    placements: Vec<Vec<Placement>>,
    size: (usize, usize),
    frames: usize,
}

impl Sequence {
    /// Prepares the sequence of a state in the photo's full size.
    ///
    /// # Errors
    /// [`SessionError::NothingMoves`] without keyframes. Also if the light cannot be traced.
    pub fn new(scenes: &LitSceneCache, state: &State, quality: Quality) -> Result<Self, SessionError> {
        if state.span_s().is_none() {
            return Err(SessionError::NothingMoves);
        }
        let frames = state.sequence_frames() as usize;
        let plain: Vec<&PreparedModel> = state.objects.iter().map(|object| &**object.mesh.plain()).collect();
        let placements = state.layout()?.placements(scenes.scene().ground(), &plain, frames)?;
        let models = state.objects.iter().map(|object| object.mesh.prepared(object.material.as_ref()));
        let models = models.collect::<Result<_, SessionError>>()?;
        let lit = scenes.lit(state)?;
        let photo = &lit.frame.photo;
        let size = (photo.width(), photo.height());
        let inserter = Inserter::new(&lit, Lighting::Octree, quality)?;
        let inserter = inserter.with_floor_gloss(state.floor_gloss).with_photo_look();
        let names = state.objects.iter().map(|object| object.name.clone()).collect();
        Ok(Self { inserter, models, names, placements, size, frames })
    }

    /// Renders all layers, as `insert --layers` does.
    pub fn with_layers(self) -> Self {
        Self { inserter: self.inserter.with_passes(), ..self }
    }

    /// Returns the number of frames.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Returns width and height of a frame, pixels.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Renders a frame, counted from 0.
    ///
    /// # Errors
    /// Cancelled if `on_event` breaks ([`SessionError::is_cancelled`]).
    pub fn render(&self, frame: usize, on_event: OnEvent<'_>) -> Result<Composite, SessionError> {
        let objects = self.models.iter().zip(&self.placements).zip(&self.names);
        let instances: Vec<Instance> = objects
            .map(|((model, placements), name)| Instance::in_sequence(model, placements, frame).named(name))
            .collect();
        Ok(self.inserter.render(&instances, on_event)?)
    }
}
