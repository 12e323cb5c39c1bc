use lo_mesh::PreparedModel;

use crate::Placement;

/// A model with its placement: one of the objects that are inserted together.
#[derive(Clone, Copy, Debug)]
pub struct Instance<'a> {
    /// The model.
    pub model: &'a PreparedModel,
    /// Its placement.
    pub placement: Placement,
}

impl<'a> Instance<'a> {
    /// Combines a model and its placement.
    pub fn new(model: &'a PreparedModel, placement: Placement) -> Self {
        Self { model, placement }
    }
}
