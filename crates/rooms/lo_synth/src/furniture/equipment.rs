//! Equipment of laboratories, workshops and cellars: benches, racks, instruments, machines, appliances.

use std::f32::consts::TAU;

use lo_geometry::{Vec2, Vec3};

use super::small_objects::{can, dark_paint, package, random_tint};
use super::tables::{handle, legs};
use super::wall_objects;
use crate::chance::{between, chance, count, pick};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::{Paint, Shape};

pub(super) fn machine_paint(builder: &mut RoomBuilder) -> Paint {
    let colors =
        [[0.04, 0.12, 0.08], [0.02, 0.06, 0.2], [0.3; 3], [0.55, 0.54, 0.5], [0.35, 0.05, 0.02], [0.45, 0.3, 0.02]];
    builder.palette.paint(Finish::Gloss).tinted(pick(&mut builder.random, &colors))
}

/// Fills a box with packages, tins, crates and cartons in a row.
fn fill_level(builder: &mut RoomBuilder, shape: &mut Shape, [min, max]: [Vec3; 2], fill: f32) {
    let carton = builder.palette.paint(Finish::Cardboard);
    let plastic = builder.palette.paint(Finish::Gloss);
    let (deep, free) = (max.z - min.z, max.y - min.y - 0.02);
    let mut x = min.x;
    loop {
        if !chance(&mut builder.random, fill) {
            x += between(&mut builder.random, 0.08, 0.3);
        }
        let mut one = Shape::default();
        match count(&mut builder.random, 0, 6) {
            0..=2 => {
                let half = Vec3::new(
                    between(&mut builder.random, 0.08, 0.25),
                    0.0,
                    0.5 * deep * between(&mut builder.random, 0.6, 0.95),
                );
                let high = free * between(&mut builder.random, 0.35, 0.95);
                let grey = [between(&mut builder.random, 0.75, 1.0); 3];
                one.board(-half, half + Vec3::Y * high, carton.tinted(grey));
                if chance(&mut builder.random, 0.5) {
                    let front = builder.palette.printed_front(&mut builder.random);
                    let (w, z) = (0.35 * half.x, half.z + 0.0005);
                    let p = |x: f32, y: f32| Vec3::new(x, y, z);
                    one.picture([p(-w, 0.3 * high), p(w, 0.3 * high), p(w, 0.7 * high), p(-w, 0.7 * high)], front);
                }
            }
            3 => {
                // An open crate.
                let (w, d, h) = (between(&mut builder.random, 0.1, 0.2), 0.45 * deep, (free * 0.6).min(0.22));
                let color = plastic.tinted(random_tint(builder));
                let t = 0.004;
                one.cuboid(Vec3::new(-w, 0.0, -d), Vec3::new(w, t, d), color);
                for side in [-1.0f32, 1.0] {
                    let (a, b) = (side * w, side * (w - t));
                    one.cuboid(Vec3::new(a.min(b), t, -d), Vec3::new(a.max(b), h, d), color);
                    let (a, b) = (side * d, side * (d - t));
                    one.cuboid(Vec3::new(-w + t, t, a.min(b)), Vec3::new(w - t, h, a.max(b)), color);
                }
            }
            4 => one = package(builder, 1.0).shape,
            _ => one = can(builder).shape,
        }
        let (low, high) = one.bounds();
        let width = high.x - low.x;
        if x + width > max.x {
            return;
        }
        if high.y < free {
            let z = between(&mut builder.random, min.z - low.z, (max.z - high.z).max(min.z - low.z));
            shape.add_at(&one, Vec3::new(x - low.x, min.y, z));
        }
        x += width + between(&mut builder.random, 0.005, 0.06);
    }
}

/// Builds steel shelving filled with packages; back at z = 0.
pub(super) fn rack(builder: &mut RoomBuilder, fill: f32) -> Piece {
    let paint =
        if chance(&mut builder.random, 0.5) { builder.palette.paint(Finish::Metal) } else { machine_paint(builder) };
    let half = 0.5 * between(&mut builder.random, 0.8, 1.8);
    let depth = between(&mut builder.random, 0.32, 0.6);
    let height = between(&mut builder.random, 1.5, 2.2).min(builder.plan.height_m - 0.1);
    let levels = count(&mut builder.random, 3, 5);
    let mut shape = Shape::default();
    for x in [-half, half - 0.035] {
        for z in [0.0, depth - 0.035] {
            shape.cuboid(Vec3::new(x, 0.0, z), Vec3::new(x + 0.035, height, z + 0.035), paint);
        }
    }
    let pitch = (height - 0.1) / levels as f32;
    for k in 0..=levels {
        let y = 0.08 + (pitch - 0.004) * k as f32;
        shape.cuboid(Vec3::new(-half + 0.003, y - 0.03, 0.003), Vec3::new(half - 0.003, y, depth - 0.003), paint);
        if k < levels {
            let inside =
                [Vec3::new(-half + 0.045, y + 0.0005, 0.01), Vec3::new(half - 0.045, y + pitch - 0.035, depth - 0.01)];
            fill_level(builder, &mut shape, inside, fill);
        }
    }
    Piece::new("rack", shape).with_front(0.5)
}

/// Builds a heavy wooden workbench with a vice and a lower board; back at z = 0.
pub(super) fn workbench(builder: &mut RoomBuilder) -> Piece {
    let wood = builder.palette.paint(Finish::Wood);
    let steel = machine_paint(builder);
    let (half, depth, height) = (
        0.5 * between(&mut builder.random, 1.2, 2.2),
        between(&mut builder.random, 0.55, 0.75),
        between(&mut builder.random, 0.82, 0.92),
    );
    let mut shape = Shape::default();
    shape.rounded(Vec3::new(-half, height - 0.05, 0.0), Vec3::new(half, height, depth), 0.004, 1, wood);
    let mut frame = Shape::default();
    legs(&mut frame, Vec2::new(half - 0.04, 0.5 * depth - 0.03), height - 0.05, 0.03, false, steel);
    shape.add_at(&frame, Vec3::Z * 0.5 * depth);
    shape.board(Vec3::new(-half + 0.1, 0.16, 0.06), Vec3::new(half - 0.1, 0.18, depth - 0.06), wood);
    let below = [Vec3::new(-half + 0.15, 0.181, 0.08), Vec3::new(half - 0.15, height - 0.1, depth - 0.08)];
    fill_level(builder, &mut shape, below, 0.6);
    // The vice.
    let x = -half + 0.16;
    let cast = machine_paint(builder);
    shape.rounded(
        Vec3::new(x - 0.06, height, depth - 0.26),
        Vec3::new(x + 0.06, height + 0.06, depth - 0.1),
        0.01,
        1,
        cast,
    );
    shape.rounded(
        Vec3::new(x - 0.07, height + 0.05, depth - 0.2),
        Vec3::new(x + 0.07, height + 0.13, depth - 0.15),
        0.008,
        1,
        cast,
    );
    shape.rounded(
        Vec3::new(x - 0.07, height + 0.05, depth - 0.1),
        Vec3::new(x + 0.07, height + 0.13, depth - 0.05),
        0.008,
        1,
        cast,
    );
    let metal = builder.palette.paint(Finish::Metal);
    shape.bar(
        Vec3::new(x, height + 0.08, depth - 0.2),
        Vec3::new(x, height + 0.08, depth + 0.06),
        [0.012; 2],
        10,
        metal,
    );
    shape.bar(
        Vec3::new(x - 0.09, height + 0.08, depth + 0.05),
        Vec3::new(x + 0.09, height + 0.08, depth + 0.05),
        [0.006; 2],
        8,
        metal,
    );
    let free = Vec2::new(half - 0.18, 0.5 * depth - 0.04);
    Piece::new("workbench", shape).with_front(0.5).with_surface(Vec3::new(0.14, height, 0.5 * depth), free, 0.6)
}

/// Builds a laboratory bench with cupboards and a shelf above; back at z = 0.
pub(super) fn laboratory_bench(builder: &mut RoomBuilder) -> Piece {
    let front = builder.palette.paint(Finish::Gloss).tinted([between(&mut builder.random, 0.45, 0.85); 3]);
    let grey = between(&mut builder.random, 0.03, 0.7);
    let top = builder.palette.paint(Finish::Gloss).tinted([grey; 3]);
    let metal = builder.palette.paint(Finish::Metal);
    let units = count(&mut builder.random, 2, 4);
    let (half, depth, height) = (0.3 * units as f32, between(&mut builder.random, 0.65, 0.8), 0.9);
    let mut shape = Shape::default();
    shape.board(Vec3::new(-half, 0.08, 0.02), Vec3::new(half, height - 0.03, depth - 0.05), front);
    shape.cuboid(Vec3::new(-half + 0.02, 0.0, 0.04), Vec3::new(half - 0.02, 0.08, depth - 0.1), top.tinted([0.03; 3]));
    shape.rounded(Vec3::new(-half, height - 0.03, 0.0), Vec3::new(half, height, depth), 0.004, 1, top);
    for k in 0..units {
        let [a, b] = [0.0, 1.0].map(|e| -half + 0.6 * (k as f32 + e));
        shape.board(Vec3::new(a + 0.002, 0.1, depth - 0.05), Vec3::new(b - 0.002, height - 0.04, depth - 0.032), front);
        handle(&mut shape, Vec3::new(0.5 * (a + b), height - 0.1, depth - 0.032), 0.12, metal);
    }
    for x in [-half + 0.02, half - 0.05] {
        shape.cuboid(Vec3::new(x, height, 0.01), Vec3::new(x + 0.03, height + 0.62, 0.04), metal);
    }
    let y = height + 0.5;
    shape.board(Vec3::new(-half, y, 0.005), Vec3::new(half, y + 0.02, 0.3), front);
    shape.cuboid(Vec3::new(-half, height + 0.1, 0.005), Vec3::new(half, height + 0.2, 0.03), front.tinted([0.6; 3]));
    let mut above = Shape::default();
    fill_level(
        builder,
        &mut above,
        [Vec3::new(-half + 0.05, y + 0.0205, 0.045), Vec3::new(half - 0.05, y + 0.36, 0.28)],
        0.7,
    );
    shape.add_at(&above, Vec3::ZERO);
    let free = Vec2::new(half - 0.06, 0.5 * depth - 0.06);
    Piece::new("bench", shape).with_front(0.5).with_surface(Vec3::new(0.0, height, 0.5 * depth + 0.03), free, 0.45)
}

/// Builds an instrument with a display, knobs and sockets, for benches and racks.
pub(super) fn instrument(builder: &mut RoomBuilder) -> Piece {
    let greys = [[0.6, 0.59, 0.54], [0.3, 0.31, 0.33], [0.08; 3], [0.55, 0.6, 0.66]];
    let body = builder.palette.paint(Finish::Matte).tinted(pick(&mut builder.random, &greys));
    let (w, h, d) = (
        between(&mut builder.random, 0.1, 0.22),
        between(&mut builder.random, 0.07, 0.26),
        between(&mut builder.random, 0.1, 0.2),
    );
    let mut shape = Shape::default();
    for x in [-0.8 * w, 0.8 * w] {
        for z in [-0.7 * d, 0.7 * d] {
            shape.bar(Vec3::new(x, 0.0, z), Vec3::new(x, 0.013, z), [0.01; 2], 8, body.tinted([0.02; 3]));
        }
    }
    shape.board(Vec3::new(-w, 0.012, -d), Vec3::new(w, h, d), body);
    let middle = 0.5 * (h + 0.012);
    let on = chance(&mut builder.random, 0.6);
    let half = Vec2::new(0.38 * w, 0.32 * (h - 0.012));
    wall_objects::screen(builder, &mut shape, half, Vec2::new(-0.5 * w, middle), d + 0.0006, on);
    for k in 0..count(&mut builder.random, 3, 9) {
        let at = Vec3::new(w * (0.08 + 0.22 * (k % 4) as f32), middle + h * (0.2 - 0.22 * (k / 4) as f32), d);
        let color = body.tinted(random_tint(builder));
        let (r, out) = (between(&mut builder.random, 0.004, 0.013), between(&mut builder.random, 0.004, 0.016));
        shape.bar(at, at + Vec3::Z * out, [r; 2], 12, color);
    }
    Piece::new("instrument", shape)
}

/// Builds a tall cabinet of rack-mounted electronics; back at z = 0.
pub(super) fn electronics(builder: &mut RoomBuilder) -> Piece {
    let frame = dark_paint(builder);
    let (w, d) = (0.3, between(&mut builder.random, 0.5, 0.8));
    let height = between(&mut builder.random, 1.2, 2.05).min(builder.plan.height_m - 0.1);
    let mut shape = Shape::default();
    shape.board(Vec3::new(-w, 0.0, 0.0), Vec3::new(w, height, d), frame);
    let mut y = 0.1;
    while y < height - 0.2 {
        let high = 0.0444 * count(&mut builder.random, 1, 4) as f32;
        if chance(&mut builder.random, 0.75) {
            let grey = frame.tinted([between(&mut builder.random, 0.01, 0.5); 3]);
            shape.cuboid(Vec3::new(-w + 0.03, y, d), Vec3::new(w - 0.03, y + high - 0.002, d + 0.012), grey);
            let lit = between(&mut builder.random, 0.05, 0.5);
            for k in 0..count(&mut builder.random, 2, 8) {
                let x = -w + 0.06 + 0.055 * k as f32;
                let color = pick(&mut builder.random, &[[0.02; 3], [0.05, lit, 0.05], [lit, 0.04, 0.02], [0.5; 3]]);
                let (a, b) = (Vec3::new(x, y + 0.3 * high, d + 0.012), Vec3::new(x + 0.02, y + 0.6 * high, d + 0.015));
                shape.cuboid(a, b, frame.tinted(color));
            }
        }
        y += high;
    }
    Piece::new("electronics", shape).with_front(0.5)
}

/// Builds a pillar drill or a cased machine with a control panel; back at z = 0.
pub(super) fn machine(builder: &mut RoomBuilder) -> Piece {
    let (body, metal) = (machine_paint(builder), builder.palette.paint(Finish::Metal));
    let black = dark_paint(builder);
    let mut shape = Shape::default();
    if chance(&mut builder.random, 0.5) {
        let height = between(&mut builder.random, 1.4, 1.8).min(builder.plan.height_m - 0.1);
        shape.rounded(Vec3::new(-0.2, 0.0, 0.0), Vec3::new(0.2, 0.06, 0.55), 0.015, 1, body);
        shape.bar(Vec3::new(0.0, 0.06, 0.14), Vec3::new(0.0, height - 0.05, 0.14), [0.04; 2], 16, metal);
        let table = between(&mut builder.random, 0.75, 0.95);
        shape.rounded(Vec3::new(-0.17, table, 0.18), Vec3::new(0.17, table + 0.04, 0.52), 0.01, 1, body);
        shape.rounded(Vec3::new(-0.05, table - 0.05, 0.09), Vec3::new(0.05, table + 0.05, 0.2), 0.01, 1, body);
        shape.rounded(Vec3::new(-0.13, height - 0.34, 0.02), Vec3::new(0.13, height, 0.5), 0.03, 2, body);
        shape.bar(Vec3::new(0.0, height - 0.34, 0.35), Vec3::new(0.0, height - 0.46, 0.35), [0.03, 0.018], 14, metal);
        shape.bar(Vec3::new(0.0, height - 0.45, 0.35), Vec3::new(0.0, height - 0.58, 0.35), [0.006, 0.005], 8, metal);
        let hub = Vec3::new(0.15, height - 0.2, 0.3);
        shape.bar(hub - Vec3::X * 0.02, hub + Vec3::X * 0.03, [0.03; 2], 12, black);
        for k in 0..3 {
            let angle = TAU * k as f32 / 3.0 + 0.4;
            let tip = hub + Vec3::new(0.03, angle.cos() * 0.2, angle.sin() * 0.2);
            shape.bar(hub + Vec3::X * 0.02, tip, [0.006; 2], 8, metal);
            shape.ball(tip, [0.018, 0.018], 10, black);
        }
    } else {
        let (w, h, d) = (
            between(&mut builder.random, 0.3, 0.8),
            between(&mut builder.random, 0.9, 1.6),
            between(&mut builder.random, 0.45, 0.8),
        );
        shape.rounded(Vec3::new(-w, 0.08, 0.0), Vec3::new(w, h, d), 0.02, 1, body);
        for x in [-w + 0.06, w - 0.06] {
            for z in [0.06, d - 0.06] {
                shape.bar(Vec3::new(x, 0.0, z), Vec3::new(x, 0.09, z), [0.035; 2], 10, black);
            }
        }
        shape.rounded(Vec3::new(-0.7 * w, 0.45 * h, d - 0.01), Vec3::new(0.1 * w, 0.85 * h, d + 0.015), 0.01, 1, black);
        let plate = body.tinted([0.6; 3]);
        shape.board(Vec3::new(0.25 * w, 0.55 * h, d - 0.01), Vec3::new(0.9 * w, 0.9 * h, d + 0.012), plate);
        for k in 0..6 {
            let at = Vec3::new(w * (0.35 + 0.2 * (k % 3) as f32), h * (0.82 - 0.12 * (k / 3) as f32), d + 0.01);
            let color = pick(&mut builder.random, &[[0.5, 0.02, 0.02], [0.03, 0.3, 0.05], [0.03; 3], [0.6, 0.5, 0.03]]);
            shape.bar(at, at + Vec3::Z * 0.025, [0.016; 2], 12, black.tinted(color));
        }
        handle(&mut shape, Vec3::new(-0.3 * w, 0.3 * h, d), 0.2, metal);
    }
    Piece::new("machine", shape).with_front(0.5)
}

/// Builds a washing machine or a boiler.
pub(super) fn appliance(builder: &mut RoomBuilder) -> Piece {
    let white = builder.palette.paint(Finish::Gloss).tinted([between(&mut builder.random, 0.6, 0.85); 3]);
    let metal = builder.palette.paint(Finish::Metal);
    let black = dark_paint(builder);
    let mut shape = Shape::default();
    if chance(&mut builder.random, 0.5) {
        shape.rounded(Vec3::new(-0.3, 0.0, 0.02), Vec3::new(0.3, 0.85, 0.6), 0.012, 1, white);
        let middle = Vec3::new(0.0, 0.42, 0.6);
        shape.bar(middle - Vec3::Z * 0.01, middle + Vec3::Z * 0.025, [0.19, 0.175], 32, metal);
        shape.bar(middle, middle + Vec3::Z * 0.03, [0.14, 0.11], 32, black);
        shape.cuboid(Vec3::new(-0.27, 0.72, 0.59), Vec3::new(-0.1, 0.82, 0.603), white.tinted([0.5; 3]));
        shape.bar(Vec3::new(0.15, 0.77, 0.59), Vec3::new(0.15, 0.77, 0.62), [0.03; 2], 18, metal);
        return Piece::new("washing machine", shape).with_front(0.6).with_surface(
            Vec3::new(0.0, 0.85, 0.3),
            Vec2::new(0.25, 0.23),
            0.6,
        );
    }
    let (r, h) = (
        between(&mut builder.random, 0.22, 0.36),
        between(&mut builder.random, 1.1, 1.6).min(builder.plan.height_m - 0.5),
    );
    let at = Vec3::Z * (r + 0.08);
    shape.lathe(
        at,
        &[[0.9 * r, 0.0], [0.9 * r, 0.06], [r, 0.1], [r, h - 0.12], [0.85 * r, h - 0.03], [0.4 * r, h]],
        36,
        white,
    );
    for x in [-0.4 * r, 0.4 * r] {
        let foot = at + Vec3::new(x, h - 0.05, 0.0);
        let bend = Vec3::new(foot.x, h + 0.22, foot.z);
        shape.pipe(&[foot, bend, Vec3::new(foot.x, h + 0.22, 0.02)], 0.014, 10, metal);
    }
    shape.rounded(
        at + Vec3::new(-0.1, 0.5 * h, r - 0.02),
        at + Vec3::new(0.1, 0.5 * h + 0.14, r + 0.05),
        0.01,
        1,
        black,
    );
    Piece::new("boiler", shape)
}
