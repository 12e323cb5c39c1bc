//! Furnishing of laboratories, workshops, cellars, halls and empty rooms.

use lo_geometry::Vec2;

use super::clutter::put_on;
use super::groups::{desk_group, dining_group, single};
use super::{equipment, fittings, seating, storage, wall_objects};
use crate::chance::{between, chance, count};
use crate::room_builder::{Piece, RoomBuilder, WallPosition};

/// Places `number` pieces along the walls, skipping those that do not fit.
fn along_walls(builder: &mut RoomBuilder, number: usize, mut piece: impl FnMut(&mut RoomBuilder) -> Piece) {
    for _ in 0..number {
        let piece = piece(builder);
        builder.place_against_wall(&single(piece), WallPosition::Anywhere);
    }
}

/// One per `each` square metres of floor, from 1 to 7.
fn per_area(builder: &RoomBuilder, each: f32) -> usize {
    ((builder.plan.area_m2() / each) as usize).clamp(1, 7)
}

pub(super) fn laboratory(builder: &mut RoomBuilder, clutter: f32, screens: bool) {
    let benches = per_area(builder, 8.0);
    for _ in 0..benches {
        let bench = equipment::laboratory_bench(builder);
        if builder.place_against_wall(&single(bench), WallPosition::Anywhere).is_some() {
            let surface = builder.surfaces.len() - 1;
            for _ in 0..count(&mut builder.random, 1, 4) {
                let one = equipment::instrument(builder);
                let x = between(&mut builder.random, -0.9, 0.9) * builder.surfaces[surface].half.x;
                let turn = between(&mut builder.random, -0.15, 0.15);
                put_on(builder, surface, &one, Some((Vec2::new(x, -0.1), turn)));
            }
        }
    }
    for _ in 0..count(&mut builder.random, 0, 2) {
        desk_group(builder, screens);
    }
    if builder.plan.area_m2() > 18.0 {
        dining_group(builder);
    }
    let number = count(&mut builder.random, 1, 2);
    along_walls(builder, number, equipment::electronics);
    along_walls(builder, 1, |builder| equipment::rack(builder, 0.4 + 0.5 * clutter));
    along_walls(builder, 1, storage::wardrobe);
    for _ in 0..count(&mut builder.random, 1, 3) {
        let stool = seating::pouf(builder);
        builder.place_freely(&single(stool), None, 0.05);
    }
    if chance(&mut builder.random, 0.5) {
        let board = wall_objects::school_board(builder);
        wall_objects::hang(builder, &board, 1.5, None);
    }
    if chance(&mut builder.random, 0.4) {
        let tripod = fittings::tripod(builder);
        builder.place_freely(&single(tripod), None, 0.05);
    }
    pipes(builder, 2);
}

pub(super) fn workshop(builder: &mut RoomBuilder, clutter: f32) {
    for _ in 0..per_area(builder, 12.0).min(4) {
        let bench = equipment::workbench(builder);
        if let Some(placed) = builder.place_against_wall(&single(bench), WallPosition::Anywhere) {
            let over = builder.object_bounds(placed[0]);
            let tools = fittings::tool_wall(builder);
            wall_objects::hang(builder, &tools, 1.62, Some(over));
        }
    }
    let machines = per_area(builder, 9.0).min(4);
    along_walls(builder, machines, equipment::machine);
    let racks = count(&mut builder.random, 1, 3);
    along_walls(builder, racks, |builder| equipment::rack(builder, 0.4 + 0.5 * clutter));
    if builder.plan.area_m2() > 22.0 {
        let machine = equipment::machine(builder);
        builder.place_freely(&single(machine), None, 0.3);
        let bench = equipment::workbench(builder);
        builder.place_freely(&single(bench), None, 0.3);
    }
    loose_objects(builder, 4);
    pipes(builder, 3);
}

pub(super) fn cellar(builder: &mut RoomBuilder, clutter: f32) {
    let racks = per_area(builder, 7.0).min(4);
    along_walls(builder, racks, |builder| equipment::rack(builder, 0.5 + 0.5 * clutter));
    let appliances = count(&mut builder.random, 1, 2);
    along_walls(builder, appliances, equipment::appliance);
    if chance(&mut builder.random, 0.4) {
        along_walls(builder, 1, equipment::workbench);
    }
    let piles = count(&mut builder.random, 1, 3 + (3.0 * clutter) as usize);
    along_walls(builder, piles, storage::boxes);
    loose_objects(builder, 3);
    pipes(builder, 5);
}

/// Furnishes a hall sparsely.
pub(super) fn hall(builder: &mut RoomBuilder, clutter: f32, screens: bool) {
    for _ in 0..count(&mut builder.random, 0, 4) {
        let pillar = fittings::pillar(builder);
        builder.place_freely(&single(pillar), None, 0.4);
    }
    for _ in 0..count(&mut builder.random, 1, 5) {
        dining_group(builder);
    }
    for _ in 0..count(&mut builder.random, 0, 3) {
        desk_group(builder, screens);
    }
    let racks = count(&mut builder.random, 0, 4);
    along_walls(builder, racks, |builder| equipment::rack(builder, 0.3 + 0.6 * clutter));
    for _ in 0..count(&mut builder.random, 0, 3) {
        let tripod = fittings::tripod(builder);
        builder.place_freely(&single(tripod), None, 0.1);
    }
    loose_objects(builder, 6);
    pipes(builder, 4);
}

/// Adds a few left-over objects to an empty room.
pub(super) fn empty(builder: &mut RoomBuilder) {
    let number = count(&mut builder.random, 0, 2);
    loose_objects(builder, number);
    if chance(&mut builder.random, 0.3) {
        let style = seating::chair_style(builder);
        let chair = seating::chair(builder, style);
        builder.place_freely(&single(chair), None, 0.1);
    }
}

/// Places ladders, barrels and boxes.
fn loose_objects(builder: &mut RoomBuilder, max: usize) {
    for _ in 0..count(&mut builder.random, 0, max) {
        let piece = match count(&mut builder.random, 0, 3) {
            0 => fittings::ladder(builder),
            1 => storage::boxes(builder),
            _ => fittings::barrel(builder),
        };
        if chance(&mut builder.random, 0.5) {
            builder.place_freely(&single(piece), None, 0.05);
        } else {
            builder.place_against_wall(&single(piece), WallPosition::Corner);
        }
    }
}

fn pipes(builder: &mut RoomBuilder, max: usize) {
    for _ in 0..count(&mut builder.random, 1, max) {
        let one = fittings::pipes(builder);
        let top = builder.plan.height_m - one.shape.bounds().1.y - 0.05;
        let y = if chance(&mut builder.random, 0.7) { top } else { between(&mut builder.random, 0.2, top) };
        wall_objects::hang(builder, &one, y, None);
    }
}
