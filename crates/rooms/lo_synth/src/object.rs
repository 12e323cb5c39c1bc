use std::ops::Range;

use crate::room_builder::Support;

/// An object of a room: a piece of furniture, a lamp or a part of the building.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Kind of object, in English.
    pub name: &'static str,
    /// The surface that carries it.
    pub support: Support,
    /// Triangle range of each of its solids or open sheets.
    pub parts: Vec<Range<usize>>,
}
