//! Furniture: pieces by type, and rules that place them by room kind.

mod bathroom;
mod beds;
mod clutter;
mod equipment;
mod fittings;
mod groups;
mod kitchen;
mod litter;
mod people;
mod plants;
mod rooms;
mod seating;
mod small_objects;
mod storage;
mod tables;
mod wall_objects;
mod work_rooms;

pub(crate) use clutter::put_on;
pub(crate) use wall_objects::{WallObject, hang};

use groups::single;
use rooms::{bathroom_room, bedroom, classroom, corridor, dining, kitchen_room, living, office};
use work_rooms::{cellar, empty, hall, laboratory, workshop};

use crate::chance::{between, chance, count};
use crate::description::{LightingMode, RoomKind};
use crate::room_builder::{RoomBuilder, WallPosition};

/// Furnishes a room; `clutter` in [0, 1].
pub(crate) fn furnish(builder: &mut RoomBuilder, kind: RoomKind, clutter: f32, lighting: LightingMode) {
    let screens = lighting != LightingMode::SingleLamp && lighting != LightingMode::Daylight;
    let screens = chance(&mut builder.random, if screens { 0.5 } else { 0.25 });
    match kind {
        RoomKind::Bedroom => bedroom(builder, clutter, screens),
        RoomKind::Living => living(builder, clutter, screens),
        RoomKind::Kitchen => kitchen_room(builder, lighting),
        RoomKind::Office => office(builder, clutter, screens),
        RoomKind::Dining => dining(builder, clutter),
        RoomKind::Bathroom => bathroom_room(builder),
        RoomKind::Corridor => corridor(builder, clutter),
        RoomKind::Studio => {
            bedroom(builder, 0.5 * clutter, false);
            living(builder, clutter, screens);
            office(builder, 0.3 * clutter, screens);
        }
        RoomKind::Classroom => classroom(builder),
        RoomKind::OpenPlan => {
            kitchen_room(builder, lighting);
            living(builder, clutter, screens);
        }
        RoomKind::Laboratory => laboratory(builder, clutter, screens),
        RoomKind::Cellar => cellar(builder, clutter),
        RoomKind::Workshop => workshop(builder, clutter),
        RoomKind::Hall => hall(builder, clutter, screens),
        RoomKind::Empty => return empty(builder),
    }
    add_common_objects(builder, kind, clutter);
    clutter::scatter(builder, clutter);
}

/// Adds people, and litter of an `amount` in [0, 1].
pub(crate) fn add_people_and_litter(builder: &mut RoomBuilder, amount: Option<f32>, with_people: bool) {
    if with_people {
        people::people(builder);
    }
    if let Some(amount) = amount {
        litter::scatter(builder, amount);
    }
}

/// Adds plants, boxes, pictures and other objects common to all room kinds.
fn add_common_objects(builder: &mut RoomBuilder, kind: RoomKind, clutter: f32) {
    if kind == RoomKind::Bathroom {
        for _ in 0..count(&mut builder.random, 1, 2) {
            let towel = wall_objects::towel(builder);
            wall_objects::hang(builder, &towel, 1.35, None);
        }
    } else {
        let number = (clutter * 5.0) as usize;
        let few = count(&mut builder.random, 0, 1 + number);
        wall_objects::pictures(builder, few);
        if chance(&mut builder.random, 0.2) {
            let clock = wall_objects::clock(builder);
            wall_objects::hang(builder, &clock, 2.0, None);
        }
        if chance(&mut builder.random, 0.25 + 0.4 * clutter) {
            let shelf = wall_objects::wall_shelf(builder);
            wall_objects::hang(builder, &shelf, 1.35, None);
        }
    }
    let max_plants = if kind == RoomKind::Bathroom { 1 } else { 3 };
    for _ in 0..count(&mut builder.random, 0, max_plants) {
        let height = between(&mut builder.random, 0.5, 1.6);
        let plant = plants::potted(builder, height);
        builder.place_against_wall(&single(plant), WallPosition::Corner);
    }
    if clutter > 0.6 {
        for _ in 0..count(&mut builder.random, 1, 3) {
            let boxes = storage::boxes(builder);
            builder.place_against_wall(&single(boxes), WallPosition::Corner);
        }
    }
    if clutter > 0.4 && kind != RoomKind::Bathroom && chance(&mut builder.random, 0.3) {
        let pouf = seating::pouf(builder);
        builder.place_freely(&single(pouf), None, 0.1);
    }
}
