//! Furniture by use of the room.

mod tables;

use crate::description::RoomKind;
use crate::stage::{Along, Stage};

/// Fills the room.
pub(crate) fn furnish(stage: &mut Stage, _kind: RoomKind, _clutter: f32) {
    let table = tables::dining_table(stage);
    stage.freely(&vec![(table, geometry::Vec2::ZERO, 0.0)], None, 0.3);
    let cabinet = tables::side_table(stage);
    stage.against_wall(&vec![(cabinet, geometry::Vec2::ZERO, 0.0)], Along::Anywhere);
}
