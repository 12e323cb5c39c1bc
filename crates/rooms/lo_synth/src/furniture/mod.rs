//! Furniture: pieces by type, and rules that place them by room kind.

mod bathroom;
mod beds;
mod clutter;
mod fittings;
mod goods;
mod groups;
mod kitchen;
mod litter;
mod people;
mod plants;
mod rooms;
mod seating;
mod storage;
mod tables;
mod trades;
mod walls;
mod works;

pub(crate) use clutter::put_on;
pub(crate) use walls::{Hanging, hang};

use groups::alone;
use rooms::{bathroom_room, bedroom, classroom, corridor, dining, kitchen_room, living, office};
use trades::{cellar, empty, hall, laboratory, workshop};

use crate::chance::{between, chance, count};
use crate::description::{LampUse, RoomKind};
use crate::stage::{Along, Stage};

/// Furnishes a room; `clutter` in [0, 1].
pub(crate) fn furnish(stage: &mut Stage, kind: RoomKind, clutter: f32, lighting: LampUse) {
    let screens = lighting != LampUse::SingleLamp && lighting != LampUse::Daylight;
    let screens = chance(&mut stage.random, if screens { 0.5 } else { 0.25 });
    match kind {
        RoomKind::Bedroom => bedroom(stage, clutter, screens),
        RoomKind::Living => living(stage, clutter, screens),
        RoomKind::Kitchen => kitchen_room(stage, lighting),
        RoomKind::Office => office(stage, clutter, screens),
        RoomKind::Dining => dining(stage, clutter),
        RoomKind::Bathroom => bathroom_room(stage),
        RoomKind::Corridor => corridor(stage, clutter),
        RoomKind::Studio => {
            bedroom(stage, 0.5 * clutter, false);
            living(stage, clutter, screens);
            office(stage, 0.3 * clutter, screens);
        }
        RoomKind::Classroom => classroom(stage),
        RoomKind::OpenPlan => {
            kitchen_room(stage, lighting);
            living(stage, clutter, screens);
        }
        RoomKind::Laboratory => laboratory(stage, clutter, screens),
        RoomKind::Cellar => cellar(stage, clutter),
        RoomKind::Workshop => workshop(stage, clutter),
        RoomKind::Hall => hall(stage, clutter, screens),
        RoomKind::Empty => return empty(stage),
    }
    extras(stage, kind, clutter);
    clutter::scatter(stage, clutter);
}

/// Adds people, and litter of an `amount` in [0, 1].
pub(crate) fn live_in(stage: &mut Stage, amount: Option<f32>, with_people: bool) {
    if with_people {
        people::people(stage);
    }
    if let Some(amount) = amount {
        litter::strew(stage, amount);
    }
}

/// Adds plants, boxes, pictures and other objects common to all room kinds.
fn extras(stage: &mut Stage, kind: RoomKind, clutter: f32) {
    if kind == RoomKind::Bathroom {
        for _ in 0..count(&mut stage.random, 1, 2) {
            let towel = walls::towel(stage);
            walls::hang(stage, &towel, 1.35, None);
        }
    } else {
        let number = (clutter * 5.0) as usize;
        let few = count(&mut stage.random, 0, 1 + number);
        walls::pictures(stage, few);
        if chance(&mut stage.random, 0.2) {
            let clock = walls::clock(stage);
            walls::hang(stage, &clock, 2.0, None);
        }
        if chance(&mut stage.random, 0.25 + 0.4 * clutter) {
            let shelf = walls::wall_shelf(stage);
            walls::hang(stage, &shelf, 1.35, None);
        }
    }
    let plants_most = if kind == RoomKind::Bathroom { 1 } else { 3 };
    for _ in 0..count(&mut stage.random, 0, plants_most) {
        let height = between(&mut stage.random, 0.5, 1.6);
        let plant = plants::potted(stage, height);
        stage.against_wall(&alone(plant), Along::Corner);
    }
    if clutter > 0.6 {
        for _ in 0..count(&mut stage.random, 1, 3) {
            let boxes = storage::boxes(stage);
            stage.against_wall(&alone(boxes), Along::Corner);
        }
    }
    if clutter > 0.4 && kind != RoomKind::Bathroom && chance(&mut stage.random, 0.3) {
        let pouf = seating::pouf(stage);
        stage.freely(&alone(pouf), None, 0.1);
    }
}
