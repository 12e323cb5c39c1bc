use lo_mesh::PreparedModel;

use crate::Placement;

/// A model at a place: one of the objects that are inserted together.
#[derive(Clone, Copy, Debug)]
pub struct Instance<'a> {
    /// What stands there.
    pub model: &'a PreparedModel,
    /// Where it stands.
    pub placement: Placement,
}

impl<'a> Instance<'a> {
    /// A model at a place.
    pub fn new(model: &'a PreparedModel, placement: Placement) -> Self {
        Self { model, placement }
    }
}
