//! Storage furniture: shelves, wardrobes, chests, boxes.

use lo_geometry::{Quat, Vec2, Vec3};

use super::tables::handle;
use crate::chance::{between, chance, count, pick};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::Shape;

/// Builds a shelf with books and other objects; back at z = 0.
pub(super) fn shelf(builder: &mut RoomBuilder, fill: f32) -> Piece {
    let width = between(&mut builder.random, 0.6, 1.3);
    let height = pick(&mut builder.random, &[0.8, 1.1, 1.5, 1.8, 2.0, 2.1]) + between(&mut builder.random, -0.05, 0.05);
    let depth = between(&mut builder.random, 0.26, 0.36);
    let paint = builder.palette.paint(if chance(&mut builder.random, 0.6) { Finish::Wood } else { Finish::Lacquer });
    let board = between(&mut builder.random, 0.016, 0.025);
    let half = 0.5 * width;
    let mut shape = Shape::default();
    for side in [-1.0f32, 1.0] {
        let [a, b] = [side * half, side * (half - board)];
        shape.board(Vec3::new(a.min(b), 0.0, 0.0), Vec3::new(a.max(b), height, depth), paint);
    }
    if chance(&mut builder.random, 0.7) {
        shape.cuboid(Vec3::new(-half + board, 0.05, 0.001), Vec3::new(half - board, height - 0.005, 0.007), paint);
    }
    let levels = (height / between(&mut builder.random, 0.3, 0.4)).round().max(2.0) as usize;
    let pitch = (height - 0.06 - board) / levels as f32;
    for k in 0..=levels {
        let y = 0.06 + pitch * k as f32;
        shape.board(Vec3::new(-half + board, y, 0.007), Vec3::new(half - board, y + board, depth - 0.003), paint);
        if k < levels {
            let inside =
                [Vec3::new(-half + board + 0.005, y + board, 0.012), Vec3::new(half - board - 0.005, y + pitch, depth)];
            fill_shelf(builder, &mut shape, inside, fill);
        }
    }
    let top = Vec3::new(0.0, height + 0.0, 0.5 * depth);
    let piece = Piece::new("shelf", shape).with_front(0.5);
    if height < 1.6 { piece.with_surface(top, Vec2::new(half - 0.05, 0.5 * depth - 0.05), 0.6) } else { piece }
}

/// Fills a shelf level with rows and piles of books, boxes and vases.
fn fill_shelf(builder: &mut RoomBuilder, shape: &mut Shape, [min, max]: [Vec3; 2], fill: f32) {
    let free = max.y - min.y - 0.015;
    let matte = builder.palette.paint(Finish::Matte);
    let mut x = min.x + between(&mut builder.random, 0.0, 0.1);
    let end = max.x;
    while x < end - 0.06 {
        if !chance(&mut builder.random, fill) {
            x += between(&mut builder.random, 0.08, 0.3);
            continue;
        }
        match count(&mut builder.random, 0, 9) {
            0 => {
                // Pile of books.
                let (w, d) = (between(&mut builder.random, 0.18, 0.26), (max.z - min.z) * 0.75);
                if x + w > end {
                    break;
                }
                let mut y = min.y;
                for _ in 0..count(&mut builder.random, 1, 5) {
                    let thick = between(&mut builder.random, 0.015, 0.04);
                    if y + thick > min.y + free {
                        break;
                    }
                    let tint = builder.palette.tint(&mut builder.random);
                    let z = max.z - d - between(&mut builder.random, 0.005, 0.03);
                    shape.cuboid(Vec3::new(x, y, z), Vec3::new(x + w, y + thick, z + d), matte.tinted(tint));
                    y += thick;
                }
                x += w + 0.02;
            }
            1 => {
                let w = between(&mut builder.random, 0.15, 0.32).min(end - x - 0.01);
                let h = (free * between(&mut builder.random, 0.4, 0.8)).min(0.3);
                if w > 0.1 {
                    let tint = builder.palette.tint(&mut builder.random);
                    let (a, b) = (Vec3::new(x, min.y, min.z + 0.02), Vec3::new(x + w, min.y + h, max.z - 0.02));
                    shape.rounded(a, b, 0.008, 1, matte.tinted(tint));
                }
                x += w + 0.03;
            }
            2 => {
                let r = between(&mut builder.random, 0.04, 0.08).min((end - x) * 0.5 - 0.005);
                if r > 0.03 {
                    let paint = builder.palette.paint(Finish::Gloss).tinted(builder.palette.tint(&mut builder.random));
                    let h = (free * between(&mut builder.random, 0.4, 0.9)).min(0.3);
                    let at = Vec3::new(x + r, min.y, 0.5 * (min.z + max.z));
                    shape.lathe(at, &[[0.6 * r, 0.0], [r, 0.45 * h], [0.5 * r, 0.85 * h], [0.6 * r, h]], 16, paint);
                }
                x += 2.0 * r.max(0.02) + 0.03;
            }
            _ => x = book_row(builder, shape, [min, max], x, free) + 0.01,
        }
    }
}

/// Adds a row of standing books from `x` on, the last one leaning. Returns the end of the row.
fn book_row(builder: &mut RoomBuilder, shape: &mut Shape, [min, max]: [Vec3; 2], mut x: f32, free: f32) -> f32 {
    let matte = builder.palette.paint(Finish::Matte);
    let (usual, deep) = (between(&mut builder.random, 0.19, 0.27), between(&mut builder.random, 0.14, 0.2));
    for _ in 0..count(&mut builder.random, 4, 16) {
        let thick = between(&mut builder.random, 0.012, 0.045);
        if x + thick > max.x {
            return x;
        }
        let h = (usual * between(&mut builder.random, 0.8, 1.15)).min(free);
        let d = (deep * between(&mut builder.random, 0.85, 1.15)).min(max.z - min.z - 0.02);
        let z = max.z - between(&mut builder.random, 0.015, 0.04);
        let tint = builder.palette.tint(&mut builder.random);
        shape.cuboid(Vec3::new(x, min.y, z - d), Vec3::new(x + thick, min.y + h, z), matte.tinted(tint));
        if builder.palette.has_prints && chance(&mut builder.random, 0.6) {
            // Titles run up the spine, so the picture is rotated.
            let spine = builder.palette.printed_front(&mut builder.random);
            let p = |x: f32, y: f32| Vec3::new(x, min.y + y, z + 0.0004);
            let right = x + thick;
            shape.picture([p(right, 0.02 * h), p(right, 0.98 * h), p(x, 0.98 * h), p(x, 0.02 * h)], spine);
        }
        x += thick + 0.0008;
    }
    let (thick, h, lean) = (0.025, usual.min(free) * 0.95, 0.22f32);
    let width = thick * lean.cos() + h * lean.sin();
    if x + width < max.x && h * lean.cos() + thick * lean.sin() < free {
        let mut book = Shape::default();
        let tint = builder.palette.tint(&mut builder.random);
        book.cuboid(Vec3::new(0.0, 0.0, -0.16), Vec3::new(thick, h, 0.0), matte.tinted(tint));
        // The book leans on its neighbours; its lower right corner rests on the board.
        let at = Vec3::new(x + h * lean.sin(), min.y, max.z - 0.03);
        shape.add(&book, Quat::from_rotation_z(lean), at);
        x += width;
    }
    x
}

/// Builds a wardrobe, 56–62 cm deep and up to 2.25 m high, sometimes with a mirror; back at z = 0.
pub(super) fn wardrobe(builder: &mut RoomBuilder) -> Piece {
    let doors = count(&mut builder.random, 2, 4);
    let width = doors as f32 * between(&mut builder.random, 0.42, 0.55);
    let height = between(&mut builder.random, 1.9, 2.25).min(builder.plan.height_m - 0.08);
    let depth = between(&mut builder.random, 0.56, 0.62);
    let front = builder.palette.paint(Finish::Fronts);
    let metal = builder.palette.paint(Finish::Metal);
    let mirrored = chance(&mut builder.random, 0.2);
    let half = 0.5 * width;
    let mut shape = Shape::default();
    shape.board(Vec3::new(-half, 0.0, 0.0), Vec3::new(half, height, depth - 0.022), front);
    for k in 0..doors {
        let [a, b] = [0.0, 1.0].map(|e| -half + width * (k as f32 + e) / doors as f32);
        let (min, max) = (Vec3::new(a + 0.0015, 0.07, depth - 0.02), Vec3::new(b - 0.0015, height - 0.01, depth));
        shape.board(min, max, front);
        if mirrored && k == doors / 2 {
            let mirror = builder.palette.paint(Finish::Mirror);
            let (min, max) = (Vec3::new(a + 0.02, 0.1, depth), Vec3::new(b - 0.02, height - 0.03, depth + 0.004));
            shape.cuboid(min, max, mirror);
        }
        let x = if k % 2 == 0 { b - 0.04 } else { a + 0.04 };
        shape.bar(Vec3::new(x, 0.95, depth + 0.025), Vec3::new(x, 1.12, depth + 0.025), [0.006; 2], 8, metal);
        for y in [0.97, 1.1] {
            shape.bar(Vec3::new(x, y, depth), Vec3::new(x, y, depth + 0.025), [0.004; 2], 6, metal);
        }
    }
    Piece::new("wardrobe", shape).with_front(0.6)
}

/// Builds a cabinet with drawers: a chest, a sideboard, a night table, a television bench; back at z = 0.
pub(super) fn chest(builder: &mut RoomBuilder, name: &'static str, width: f32, height: f32, depth: f32) -> Piece {
    let body = builder.palette.paint(if chance(&mut builder.random, 0.55) { Finish::Wood } else { Finish::Lacquer });
    let front = if chance(&mut builder.random, 0.5) { body } else { builder.palette.paint(Finish::Fronts) };
    let metal = builder.palette.paint(Finish::SecondMetal);
    let foot = between(&mut builder.random, 0.03, 0.16);
    let half = 0.5 * width;
    let mut shape = Shape::default();
    for x in [-half + 0.05, half - 0.05] {
        for z in [0.05, depth - 0.06] {
            shape.bar(Vec3::new(x, 0.0, z), Vec3::new(x, foot + 0.005, z), [0.013, 0.018], 8, body);
        }
    }
    shape.board(Vec3::new(-half, foot, 0.0), Vec3::new(half, height - 0.02, depth - 0.02), body);
    let (min, max) = (Vec3::new(-half - 0.005, height - 0.022, 0.0), Vec3::new(half + 0.005, height, depth));
    shape.rounded(min, max, 0.004, 1, body);
    let columns = (width / 0.55).round().max(1.0) as usize;
    let rows = ((height - foot) / between(&mut builder.random, 0.18, 0.3)).round().max(1.0) as usize;
    for (c, r) in (0..columns).flat_map(|c| (0..rows).map(move |r| (c, r))) {
        let x = [0.0, 1.0].map(|e| -half + width * (c as f32 + e) / columns as f32);
        let y = [0.0, 1.0].map(|e| foot + (height - 0.022 - foot) * (r as f32 + e) / rows as f32);
        let (min, max) = (
            Vec3::new(x[0] + 0.003, y[0] + 0.003, depth - 0.021),
            Vec3::new(x[1] - 0.003, y[1] - 0.003, depth - 0.003),
        );
        shape.board(min, max, front);
        let at = Vec3::new(0.5 * (x[0] + x[1]), y[1] - 0.3 * (y[1] - y[0]), depth - 0.003);
        handle(&mut shape, at, 0.1, metal);
    }
    let center = Vec3::new(0.0, height, 0.5 * depth);
    Piece::new(name, shape).with_front(0.45).with_surface(center, Vec2::new(half - 0.06, 0.5 * depth - 0.05), 0.8)
}

/// Builds a stack of one to three cardboard boxes.
pub(super) fn boxes(builder: &mut RoomBuilder) -> Piece {
    let paint = builder.palette.paint(Finish::Cardboard);
    let tape = builder.palette.paint(Finish::Gloss).tinted([0.5, 0.4, 0.25]);
    let mut shape = Shape::default();
    let mut y = 0.0;
    let mut half = Vec2::new(between(&mut builder.random, 0.2, 0.3), between(&mut builder.random, 0.15, 0.22));
    for _ in 0..count(&mut builder.random, 1, 3) {
        let high = between(&mut builder.random, 0.2, 0.36);
        let mut one = Shape::default();
        one.board(Vec3::new(-half.x, 0.0, -half.y), Vec3::new(half.x, high, half.y), paint);
        one.cuboid(Vec3::new(-half.x, high - 0.001, -0.025), Vec3::new(half.x, high + 0.0005, 0.025), tape);
        shape.add(&one, Quat::from_rotation_y(between(&mut builder.random, -0.12, 0.12)), Vec3::Y * y);
        y += high + 0.0005;
        half *= between(&mut builder.random, 0.75, 0.95);
    }
    Piece::new("boxes", shape)
}
