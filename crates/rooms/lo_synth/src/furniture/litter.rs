//! Litter in lived-in rooms: papers, packages, devices, cables, posters.

use std::f32::consts::TAU;

use lo_geometry::{Quat, Vec2, Vec3};

use super::clutter::put_on;
use super::goods::{
    bin, book, can, controller, drill, fruit, handset, headphones, keyboard, package, papers, pens, roll, shoes, tower,
    toy,
};
use super::groups::alone;
use super::{storage, walls};
use crate::chance::{between, chance, count, pick, weighted};
use crate::layout::turned;
use crate::palette::Finish;
use crate::solids::{Paint, Shape};
use crate::stage::{Piece, Stage, Support};

/// Range of cable radii, metres: below the tolerance of contact between objects.
const CABLE_M: [f32; 2] = [0.0018, 0.0029];

/// Scatters litter over tables, shelves, floor and walls; `amount` in [0, 1].
pub(super) fn strew(stage: &mut Stage, amount: f32) {
    for top in 0..stage.tops.len() {
        let name = stage.tops[top].name;
        if matches!(name, "window sill" | "washstand" | "kitchen line") && chance(&mut stage.random, 0.6) {
            continue;
        }
        let half = stage.tops[top].half;
        let most = ((amount * (6.0 + 130.0 * half.x * half.y)).ceil() as usize).min(32);
        let number = count(&mut stage.random, most / 2, most);
        for _ in 0..number {
            let thing = thing(stage);
            put_on(stage, top, &thing, None);
        }
        for _ in 0..count(&mut stage.random, 0, 2) {
            cable_on(stage, top);
        }
    }
    let area = stage.plan.area_m2();
    let most = ((amount * (2.0 + 0.25 * area)) as usize).min(9);
    for _ in 0..count(&mut stage.random, most / 2, most) {
        let thing = thing_on_floor(stage);
        stage.freely(&alone(thing), None, 0.02);
    }
    for _ in 0..count(&mut stage.random, 0, 1 + (3.0 * amount) as usize) {
        cable_on_floor(stage);
    }
    for _ in 0..count(&mut stage.random, 0, (5.0 * amount) as usize) {
        let poster = poster(stage);
        let y = pick(&mut stage.random, &[1.3, 1.5, 1.6]);
        walls::hang(stage, &poster, y, None);
    }
}

fn thing(stage: &mut Stage) -> Piece {
    let kinds = [
        (0, 0.2),
        (1, 0.12),
        (2, 0.16),
        (3, 0.1),
        (4, 0.08),
        (5, 0.08),
        (6, 0.05),
        (7, 0.05),
        (8, 0.05),
        (9, 0.04),
        (10, 0.04),
        (11, 0.04),
        (12, 0.03),
    ];
    match weighted(&mut stage.random, &kinds) {
        0 => papers(stage),
        1 => book(stage),
        2 => package(stage, 1.0),
        3 => can(stage),
        4 => handset(stage),
        5 => pens(stage),
        6 => keyboard(stage),
        7 => controller(stage),
        8 => roll(stage),
        9 => drill(stage),
        10 => fruit(stage),
        11 => toy(stage),
        _ => headphones(stage),
    }
}

fn thing_on_floor(stage: &mut Stage) -> Piece {
    match weighted(&mut stage.random, &[(0, 0.2), (1, 0.2), (2, 0.15), (3, 0.12), (4, 0.1), (5, 0.1), (6, 0.13)]) {
        0 => papers(stage),
        1 => {
            let size = between(&mut stage.random, 1.2, 2.6);
            package(stage, size)
        }
        2 => storage::boxes(stage),
        3 => shoes(stage),
        4 => toy(stage),
        5 => bin(stage),
        _ => tower(stage),
    }
}

/// Builds a poster without a frame.
fn poster(stage: &mut Stage) -> walls::Hanging {
    use lo_random::RngExt;
    let half = pick(
        &mut stage.random,
        &[Vec2::new(0.105, 0.148), Vec2::new(0.21, 0.297), Vec2::new(0.3, 0.42), Vec2::new(0.45, 0.3)],
    );
    let page = chance(&mut stage.random, 0.3);
    let content = if page {
        stage.palette.page(&mut stage.random)
    } else {
        let seed = stage.random.random();
        stage.palette.picture(seed, half.x / half.y, None)
    };
    let white = stage.palette.paint(Finish::Matte).tinted([0.75; 3]);
    let mut shape = Shape::default();
    shape.cuboid(Vec3::new(-half.x, -half.y, 0.001), Vec3::new(half.x, half.y, 0.002), white);
    let p = |x: f32, y: f32| Vec3::new(x, y, 0.0024);
    shape.picture([p(-half.x, -half.y), p(half.x, -half.y), p(half.x, half.y), p(-half.x, half.y)], content);
    walls::Hanging { name: "poster", shape }
}

fn cable_paint(stage: &mut Stage) -> Paint {
    let colors =
        [[0.02; 3], [0.02; 3], [0.02; 3], [0.7; 3], [0.25; 3], [0.03, 0.08, 0.4], [0.5, 0.04, 0.03], [0.6, 0.5, 0.05]];
    stage.palette.paint(Finish::Gloss).tinted(pick(&mut stage.random, &colors))
}

/// Draws a winding line from `a` to `b` at the height of a cable's axis.
fn winding(stage: &mut Stage, [a, b]: [Vec2; 2], radius: f32) -> Vec<Vec3> {
    let along = b - a;
    let aside = Vec2::new(-along.y, along.x);
    let waves = [(); 3].map(|()| (between(&mut stage.random, -0.16, 0.16), between(&mut stage.random, 0.0, TAU)));
    let number = ((along.length() / 0.03).ceil() as usize).clamp(6, 60);
    (0..=number)
        .map(|k| {
            let t = k as f32 / number as f32;
            let wave = |(n, (amount, phase)): (usize, &(f32, f32))| {
                amount * ((phase + TAU * t * (0.7 + n as f32)).sin() - phase.sin() * (1.0 - t)) / (1.0 + n as f32)
            };
            let p = a + along * t + aside * waves.iter().enumerate().map(wave).sum::<f32>();
            Vec3::new(p.x, radius, p.y)
        })
        .collect()
}

/// Adds a cable across a support surface. Other objects may stand on it.
fn cable_on(stage: &mut Stage, top: usize) {
    let (half, object) = (stage.tops[top].half, stage.tops[top].object);
    if half.min_element() < 0.12 {
        return;
    }
    let paint = cable_paint(stage);
    let [low, high] = CABLE_M;
    let radius = between(&mut stage.random, low, high);
    let mut place = || {
        let r = &mut stage.random;
        Vec2::new(between(r, -0.9, 0.9) * half.x, between(r, -0.9, 0.9) * half.y)
    };
    let ends = [place(), place()];
    let inside = |p: Vec3| p.x.abs() < half.x && p.z.abs() < half.y;
    let line: Vec<Vec3> = winding(stage, ends, radius).into_iter().take_while(|&p| inside(p)).collect();
    if line.len() < 4 {
        return;
    }
    let mut shape = Shape::default();
    shape.tube(&line, radius, 6, paint);
    let (center, yaw) = (stage.tops[top].center, stage.tops[top].yaw_rad);
    stage.fix("cable", Support::Object(object), &shape, Quat::from_rotation_y(yaw), center);
}

/// Adds a cable on the floor from a wall into the room, ignoring furniture.
fn cable_on_floor(stage: &mut Stage) {
    let paint = cable_paint(stage);
    let radius = between(&mut stage.random, 0.0024, 0.0035);
    let wall = stage.plan.walls[count(&mut stage.random, 0, stage.plan.walls.len() - 1)].clone();
    let s = wall.length_m * between(&mut stage.random, 0.1, 0.9);
    let (reach, turn) = (between(&mut stage.random, 0.6, 2.8), between(&mut stage.random, -1.35, 1.35));
    let from = wall.point(s, 0.0, 0.06);
    let from = Vec2::new(from.x, from.z);
    let to = from + turned(wall.inward(), turn) * reach;
    let line = winding(stage, [from, to], radius);
    let inside = |p: &Vec3| stage.plan.contains(Vec2::new(p.x, p.z), 0.03);
    let line: Vec<Vec3> = line.into_iter().take_while(inside).collect();
    if line.len() < 6 {
        return;
    }
    let mut shape = Shape::default();
    shape.tube(&line, radius, 6, paint);
    stage.fix("cable", Support::Floor, &shape, Quat::IDENTITY, Vec3::ZERO);
}
