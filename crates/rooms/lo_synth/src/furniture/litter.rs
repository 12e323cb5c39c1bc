//! Litter in lived-in rooms: papers, packages, devices, cables, posters.

use std::f32::consts::TAU;

use lo_geometry::{Quat, Vec2, Vec3};

use super::clutter::put_on;
use super::groups::single;
use super::small_objects::{
    book, can, computer_case, controller, drill, fruit, headphones, keyboard, package, papers, pens, phone_or_tablet,
    shoes, tape_roll, teddy_bear, waste_bin,
};
use super::{storage, wall_objects};
use crate::chance::{between, chance, count, pick, weighted};
use crate::occupancy::rotated_yaw;
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder, Support};
use crate::solids::{Paint, Shape};

/// Range of cable radii, metres: below the tolerance of contact between objects.
const CABLE_M: [f32; 2] = [0.0018, 0.0029];

/// Scatters litter over tables, shelves, floor and walls; `amount` in [0, 1].
pub(super) fn scatter(builder: &mut RoomBuilder, amount: f32) {
    for surface in 0..builder.surfaces.len() {
        let name = builder.surfaces[surface].name;
        if matches!(name, "window sill" | "washstand" | "kitchen line") && chance(&mut builder.random, 0.6) {
            continue;
        }
        let half = builder.surfaces[surface].half;
        let max = ((amount * (6.0 + 130.0 * half.x * half.y)).ceil() as usize).min(32);
        let number = count(&mut builder.random, max / 2, max);
        for _ in 0..number {
            let piece = random_object(builder);
            put_on(builder, surface, &piece, None);
        }
        for _ in 0..count(&mut builder.random, 0, 2) {
            cable_on(builder, surface);
        }
    }
    let area = builder.plan.area_m2();
    let max = ((amount * (2.0 + 0.25 * area)) as usize).min(9);
    for _ in 0..count(&mut builder.random, max / 2, max) {
        let piece = random_floor_object(builder);
        builder.place_freely(&single(piece), None, 0.02);
    }
    for _ in 0..count(&mut builder.random, 0, 1 + (3.0 * amount) as usize) {
        cable_on_floor(builder);
    }
    for _ in 0..count(&mut builder.random, 0, (5.0 * amount) as usize) {
        let poster = poster(builder);
        let y = pick(&mut builder.random, &[1.3, 1.5, 1.6]);
        wall_objects::hang(builder, &poster, y, None);
    }
}

fn random_object(builder: &mut RoomBuilder) -> Piece {
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
    match weighted(&mut builder.random, &kinds) {
        0 => papers(builder),
        1 => book(builder),
        2 => package(builder, 1.0),
        3 => can(builder),
        4 => phone_or_tablet(builder),
        5 => pens(builder),
        6 => keyboard(builder),
        7 => controller(builder),
        8 => tape_roll(builder),
        9 => drill(builder),
        10 => fruit(builder),
        11 => teddy_bear(builder),
        _ => headphones(builder),
    }
}

fn random_floor_object(builder: &mut RoomBuilder) -> Piece {
    match weighted(&mut builder.random, &[(0, 0.2), (1, 0.2), (2, 0.15), (3, 0.12), (4, 0.1), (5, 0.1), (6, 0.13)]) {
        0 => papers(builder),
        1 => {
            let size = between(&mut builder.random, 1.2, 2.6);
            package(builder, size)
        }
        2 => storage::boxes(builder),
        3 => shoes(builder),
        4 => teddy_bear(builder),
        5 => waste_bin(builder),
        _ => computer_case(builder),
    }
}

/// Builds a poster without a frame.
fn poster(builder: &mut RoomBuilder) -> wall_objects::WallObject {
    use lo_random::RngExt;
    let half = pick(
        &mut builder.random,
        &[Vec2::new(0.105, 0.148), Vec2::new(0.21, 0.297), Vec2::new(0.3, 0.42), Vec2::new(0.45, 0.3)],
    );
    let page = chance(&mut builder.random, 0.3);
    let content = if page {
        builder.palette.page(&mut builder.random)
    } else {
        let seed = builder.random.random();
        builder.palette.picture(seed, half.x / half.y, None)
    };
    let white = builder.palette.paint(Finish::Matte).tinted([0.75; 3]);
    let mut shape = Shape::default();
    shape.cuboid(Vec3::new(-half.x, -half.y, 0.001), Vec3::new(half.x, half.y, 0.002), white);
    let p = |x: f32, y: f32| Vec3::new(x, y, 0.0024);
    shape.picture([p(-half.x, -half.y), p(half.x, -half.y), p(half.x, half.y), p(-half.x, half.y)], content);
    wall_objects::WallObject { name: "poster", shape }
}

fn cable_paint(builder: &mut RoomBuilder) -> Paint {
    let colors =
        [[0.02; 3], [0.02; 3], [0.02; 3], [0.7; 3], [0.25; 3], [0.03, 0.08, 0.4], [0.5, 0.04, 0.03], [0.6, 0.5, 0.05]];
    builder.palette.paint(Finish::Gloss).tinted(pick(&mut builder.random, &colors))
}

/// Draws a winding line from `a` to `b` at the height of a cable's axis.
fn winding(builder: &mut RoomBuilder, [a, b]: [Vec2; 2], radius: f32) -> Vec<Vec3> {
    let along = b - a;
    let aside = Vec2::new(-along.y, along.x);
    let waves = [(); 3].map(|()| (between(&mut builder.random, -0.16, 0.16), between(&mut builder.random, 0.0, TAU)));
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
fn cable_on(builder: &mut RoomBuilder, surface: usize) {
    let (half, object) = (builder.surfaces[surface].half, builder.surfaces[surface].object);
    if half.min_element() < 0.12 {
        return;
    }
    let paint = cable_paint(builder);
    let [low, high] = CABLE_M;
    let radius = between(&mut builder.random, low, high);
    let mut place = || {
        let r = &mut builder.random;
        Vec2::new(between(r, -0.9, 0.9) * half.x, between(r, -0.9, 0.9) * half.y)
    };
    let ends = [place(), place()];
    let inside = |p: Vec3| p.x.abs() < half.x && p.z.abs() < half.y;
    let line: Vec<Vec3> = winding(builder, ends, radius).into_iter().take_while(|&p| inside(p)).collect();
    if line.len() < 4 {
        return;
    }
    let mut shape = Shape::default();
    shape.tube(&line, radius, 6, paint);
    let (center, yaw) = (builder.surfaces[surface].center, builder.surfaces[surface].yaw_rad);
    builder.add_shape("cable", Support::Object(object), &shape, Quat::from_rotation_y(yaw), center);
}

/// Adds a cable on the floor from a wall into the room, ignoring furniture.
fn cable_on_floor(builder: &mut RoomBuilder) {
    let paint = cable_paint(builder);
    let radius = between(&mut builder.random, 0.0024, 0.0035);
    let wall = builder.plan.walls[count(&mut builder.random, 0, builder.plan.walls.len() - 1)].clone();
    let s = wall.length_m * between(&mut builder.random, 0.1, 0.9);
    let (reach, turn) = (between(&mut builder.random, 0.6, 2.8), between(&mut builder.random, -1.35, 1.35));
    let from = wall.point(s, 0.0, 0.06);
    let from = Vec2::new(from.x, from.z);
    let to = from + rotated_yaw(wall.inward(), turn) * reach;
    let line = winding(builder, [from, to], radius);
    let inside = |p: &Vec3| builder.plan.contains(Vec2::new(p.x, p.z), 0.03);
    let line: Vec<Vec3> = line.into_iter().take_while(inside).collect();
    if line.len() < 6 {
        return;
    }
    let mut shape = Shape::default();
    shape.tube(&line, radius, 6, paint);
    builder.add_shape("cable", Support::Floor, &shape, Quat::IDENTITY, Vec3::ZERO);
}
