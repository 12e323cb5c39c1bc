use lo_mesh::PreparedModel;

use crate::Placement;

/// A model with its placement: one of the objects that are inserted together.
#[derive(Clone, Copy, Debug)]
pub struct Instance<'a> {
    /// The model.
    pub model: &'a PreparedModel,
    /// Its placement.
    pub placement: Placement,
    /// Its name in mattes; `object 1` and so on without one.
    pub name: Option<&'a str>,
    /// Its placement in the previous and in the next image of a sequence, for motion vectors.
    pub moves: Option<[Placement; 2]>,
}

impl<'a> Instance<'a> {
    /// Combines a model and its placement.
    pub fn new(model: &'a PreparedModel, placement: Placement) -> Self {
        Self { model, placement, name: None, moves: None }
    }

    /// Combines a model and its placement in image `frame` of a sequence, of which `placements` has one for each image.
    ///
    /// # Panics
    /// If the sequence has no such image.
    pub fn in_sequence(model: &'a PreparedModel, placements: &[Placement], frame: usize) -> Self {
        let instance = Self::new(model, placements[frame]);
        let at = |frame: usize| placements[frame.min(placements.len() - 1)];
        if placements.len() == 1 { instance } else { instance.moving(at(frame.saturating_sub(1)), at(frame + 1)) }
    }

    /// Sets the name.
    #[must_use]
    pub fn named(self, name: &'a str) -> Self {
        Self { name: Some(name), ..self }
    }

    /// Sets the placements in the previous and in the next image of a sequence.
    #[must_use]
    pub fn moving(self, previous: Placement, next: Placement) -> Self {
        Self { moves: Some([previous, next]), ..self }
    }
}
