use std::ops::Range;

use crate::stage::Support;

/// A thing in a room: a piece of furniture, a lamp, a part of the building.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// What it is.
    pub name: &'static str,
    /// What it rests on.
    pub support: Support,
    /// Triangles of each of its solids (or open sheets).
    pub parts: Vec<Range<usize>>,
}
