//! Furnishing of laboratories, workshops, cellars, halls and empty rooms.

use lo_geometry::Vec2;

use super::clutter::put_on;
use super::groups::{alone, desk_group, dining_group};
use super::{fittings, seating, storage, walls, works};
use crate::chance::{between, chance, count};
use crate::stage::{Along, Piece, Stage};

/// Places `number` pieces along the walls, skipping those that do not fit.
fn along_walls(stage: &mut Stage, number: usize, mut piece: impl FnMut(&mut Stage) -> Piece) {
    for _ in 0..number {
        let piece = piece(stage);
        stage.against_wall(&alone(piece), Along::Anywhere);
    }
}

/// One per `each` square metres of floor, from 1 to 7.
fn per_area(stage: &Stage, each: f32) -> usize {
    ((stage.plan.area_m2() / each) as usize).clamp(1, 7)
}

pub(super) fn laboratory(stage: &mut Stage, clutter: f32, screens: bool) {
    let benches = per_area(stage, 8.0);
    for _ in 0..benches {
        let bench = works::laboratory_bench(stage);
        if stage.against_wall(&alone(bench), Along::Anywhere).is_some() {
            let top = stage.tops.len() - 1;
            for _ in 0..count(&mut stage.random, 1, 4) {
                let one = works::instrument(stage);
                let x = between(&mut stage.random, -0.9, 0.9) * stage.tops[top].half.x;
                let turn = between(&mut stage.random, -0.15, 0.15);
                put_on(stage, top, &one, Some((Vec2::new(x, -0.1), turn)));
            }
        }
    }
    for _ in 0..count(&mut stage.random, 0, 2) {
        desk_group(stage, screens);
    }
    if stage.plan.area_m2() > 18.0 {
        dining_group(stage);
    }
    let number = count(&mut stage.random, 1, 2);
    along_walls(stage, number, works::electronics);
    along_walls(stage, 1, |stage| works::rack(stage, 0.4 + 0.5 * clutter));
    along_walls(stage, 1, storage::wardrobe);
    for _ in 0..count(&mut stage.random, 1, 3) {
        let stool = seating::pouf(stage);
        stage.freely(&alone(stool), None, 0.05);
    }
    if chance(&mut stage.random, 0.5) {
        let board = walls::school_board(stage);
        walls::hang(stage, &board, 1.5, None);
    }
    if chance(&mut stage.random, 0.4) {
        let tripod = fittings::tripod(stage);
        stage.freely(&alone(tripod), None, 0.05);
    }
    pipes(stage, 2);
}

pub(super) fn workshop(stage: &mut Stage, clutter: f32) {
    for _ in 0..per_area(stage, 12.0).min(4) {
        let bench = works::workbench(stage);
        if let Some(placed) = stage.against_wall(&alone(bench), Along::Anywhere) {
            let over = stage.box_of(placed[0]);
            let tools = fittings::tool_wall(stage);
            walls::hang(stage, &tools, 1.62, Some(over));
        }
    }
    let machines = per_area(stage, 9.0).min(4);
    along_walls(stage, machines, works::machine);
    let racks = count(&mut stage.random, 1, 3);
    along_walls(stage, racks, |stage| works::rack(stage, 0.4 + 0.5 * clutter));
    if stage.plan.area_m2() > 22.0 {
        let machine = works::machine(stage);
        stage.freely(&alone(machine), None, 0.3);
        let bench = works::workbench(stage);
        stage.freely(&alone(bench), None, 0.3);
    }
    loose(stage, 4);
    pipes(stage, 3);
}

pub(super) fn cellar(stage: &mut Stage, clutter: f32) {
    let racks = per_area(stage, 7.0).min(4);
    along_walls(stage, racks, |stage| works::rack(stage, 0.5 + 0.5 * clutter));
    let appliances = count(&mut stage.random, 1, 2);
    along_walls(stage, appliances, works::appliance);
    if chance(&mut stage.random, 0.4) {
        along_walls(stage, 1, works::workbench);
    }
    let piles = count(&mut stage.random, 1, 3 + (3.0 * clutter) as usize);
    along_walls(stage, piles, storage::boxes);
    loose(stage, 3);
    pipes(stage, 5);
}

/// Furnishes a hall sparsely.
pub(super) fn hall(stage: &mut Stage, clutter: f32, screens: bool) {
    for _ in 0..count(&mut stage.random, 0, 4) {
        let pillar = fittings::pillar(stage);
        stage.freely(&alone(pillar), None, 0.4);
    }
    for _ in 0..count(&mut stage.random, 1, 5) {
        dining_group(stage);
    }
    for _ in 0..count(&mut stage.random, 0, 3) {
        desk_group(stage, screens);
    }
    let racks = count(&mut stage.random, 0, 4);
    along_walls(stage, racks, |stage| works::rack(stage, 0.3 + 0.6 * clutter));
    for _ in 0..count(&mut stage.random, 0, 3) {
        let tripod = fittings::tripod(stage);
        stage.freely(&alone(tripod), None, 0.1);
    }
    loose(stage, 6);
    pipes(stage, 4);
}

/// Adds a few left-over objects to an empty room.
pub(super) fn empty(stage: &mut Stage) {
    let number = count(&mut stage.random, 0, 2);
    loose(stage, number);
    if chance(&mut stage.random, 0.3) {
        let style = seating::chair_style(stage);
        let chair = seating::chair(stage, style);
        stage.freely(&alone(chair), None, 0.1);
    }
}

/// Places ladders, barrels and boxes.
fn loose(stage: &mut Stage, most: usize) {
    for _ in 0..count(&mut stage.random, 0, most) {
        let piece = match count(&mut stage.random, 0, 3) {
            0 => fittings::ladder(stage),
            1 => storage::boxes(stage),
            _ => fittings::barrel(stage),
        };
        if chance(&mut stage.random, 0.5) {
            stage.freely(&alone(piece), None, 0.05);
        } else {
            stage.against_wall(&alone(piece), Along::Corner);
        }
    }
}

fn pipes(stage: &mut Stage, most: usize) {
    for _ in 0..count(&mut stage.random, 1, most) {
        let one = fittings::pipes(stage);
        let top = stage.plan.height_m - one.shape.bounds().1.y - 0.05;
        let y = if chance(&mut stage.random, 0.7) { top } else { between(&mut stage.random, 0.2, top) };
        walls::hang(stage, &one, y, None);
    }
}
