//! Fittings of work rooms: pipes, tool boards, ladders, barrels, tripods, pillars.

use std::f32::consts::TAU;

use lo_geometry::{Quat, Vec2, Vec3};

use super::equipment::machine_paint;
use super::small_objects::{dark_paint, random_tint};
use super::wall_objects::WallObject;
use crate::chance::{between, chance, count};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::Shape;

/// Builds one to three clamped pipes along a wall.
pub(super) fn pipes(builder: &mut RoomBuilder) -> WallObject {
    let half = between(&mut builder.random, 0.6, 2.4);
    let (metal, white) = (builder.palette.paint(Finish::Metal), builder.palette.paint(Finish::Gloss));
    let mut shape = Shape::default();
    let mut y = 0.0;
    for _ in 0..count(&mut builder.random, 1, 3) {
        let r = between(&mut builder.random, 0.01, 0.055);
        let paint = match count(&mut builder.random, 0, 2) {
            0 => metal,
            1 => white.tinted([between(&mut builder.random, 0.5, 0.8); 3]),
            _ => white.tinted(random_tint(builder)),
        };
        y += r;
        let z = r + 0.03;
        shape.bar(Vec3::new(-half, y, z), Vec3::new(half, y, z), [r; 2], 14, paint);
        for k in 0..3 {
            let x = half * (k as f32 - 1.0) * 0.85;
            let low = Vec3::new(x - 0.012, y - r - 0.003, 0.0);
            shape.cuboid(low, Vec3::new(x + 0.012, y + r + 0.003, 2.0 * r + 0.033), metal);
        }
        y += r + between(&mut builder.random, 0.02, 0.07);
    }
    WallObject { name: "pipes", shape }
}

/// Builds a board with hanging tools.
pub(super) fn tool_wall(builder: &mut RoomBuilder) -> WallObject {
    let board =
        if chance(&mut builder.random, 0.5) { builder.palette.paint(Finish::Wood) } else { machine_paint(builder) };
    let (metal, black) = (builder.palette.paint(Finish::Metal), dark_paint(builder));
    let gloss = builder.palette.paint(Finish::Gloss);
    let half = Vec2::new(between(&mut builder.random, 0.5, 1.0), between(&mut builder.random, 0.35, 0.55));
    let mut shape = Shape::default();
    shape.board(Vec3::new(-half.x, -half.y, 0.001), Vec3::new(half.x, half.y, 0.02), board);
    let z = 0.035;
    let rows = (half.y / 0.19) as usize;
    for row in 0..rows {
        let top = half.y - 0.05 - 2.0 * half.y * row as f32 / rows as f32;
        let mut x = -half.x + 0.06;
        while x < half.x - 0.12 {
            let p = |dx: f32, dy: f32| Vec3::new(x + dx, top - dy, z);
            let grip = gloss.tinted(random_tint(builder));
            let long = between(&mut builder.random, 0.16, 0.28);
            match count(&mut builder.random, 0, 4) {
                0 => {
                    // Hammer.
                    shape.bar(p(0.0, 0.02), p(0.0, long), [0.011, 0.014], 10, grip);
                    shape.rounded(p(-0.05, 0.035) - Vec3::Z * 0.014, p(0.05, 0.0) + Vec3::Z * 0.014, 0.004, 1, black);
                    x += 0.05;
                }
                1 => {
                    // Screwdrivers.
                    for k in 0..3 {
                        let dx = 0.035 * k as f32;
                        shape.bar(p(dx, 0.0), p(dx, 0.09), [0.013, 0.011], 10, grip);
                        shape.bar(p(dx, 0.09), p(dx, long), [0.003; 2], 6, metal);
                    }
                    x += 0.07;
                }
                2 => {
                    // Saw.
                    let teeth = [p(0.0, 0.09), p(0.3, 0.06), p(0.3, 0.03), p(0.0, 0.0)];
                    if x + 0.32 < half.x - 0.02 {
                        let first = shape.triangles.len();
                        shape.polygon(&teeth, metal);
                        shape.close_part(first);
                        shape.rounded(p(-0.03, 0.11) - Vec3::Z * 0.01, p(0.05, 0.0) + Vec3::Z * 0.01, 0.008, 1, grip);
                        x += 0.3;
                    }
                }
                3 => {
                    // Spanners.
                    for k in 0..4 {
                        let (dx, length) = (0.04 * k as f32, long - 0.025 * k as f32);
                        shape.bar(p(dx, 0.01), p(dx, length), [0.006; 2], 6, metal);
                        for end in [0.01, length] {
                            let hub = p(dx, end);
                            shape.bar(hub - Vec3::Z * 0.005, hub + Vec3::Z * 0.005, [0.013; 2], 10, metal);
                        }
                    }
                    x += 0.13;
                }
                _ => {
                    // Pliers.
                    shape.bar(p(-0.012, 0.06), p(-0.03, long), [0.008; 2], 8, grip);
                    shape.bar(p(0.012, 0.06), p(0.03, long), [0.008; 2], 8, grip);
                    shape.bar(p(0.0, 0.07), p(0.0, 0.0), [0.016, 0.006], 8, metal);
                    x += 0.05;
                }
            }
            x += between(&mut builder.random, 0.06, 0.14);
        }
    }
    WallObject { name: "tools", shape }
}

pub(super) fn ladder(builder: &mut RoomBuilder) -> Piece {
    let metal = builder.palette.paint(Finish::Metal);
    let height = between(&mut builder.random, 0.9, 1.9).min(builder.plan.height_m - 0.3);
    let spread = 0.24 * height;
    let mut shape = Shape::default();
    for side in [-1.0f32, 1.0] {
        let x = 0.2 * side;
        shape.bar(Vec3::new(x * 1.2, 0.012, spread), Vec3::new(x, height, 0.0), [0.014; 2], 8, metal);
        shape.bar(Vec3::new(x * 1.2, 0.012, -spread), Vec3::new(x, height, 0.0), [0.012; 2], 8, metal);
    }
    let steps = (height / 0.26) as usize;
    for k in 1..steps {
        let t = k as f32 / steps as f32;
        let (w, z) = (0.24 - 0.04 * t, spread * (1.0 - t));
        shape.board(Vec3::new(-w, height * t - 0.012, z - 0.03), Vec3::new(w, height * t + 0.012, z + 0.03), metal);
    }
    shape.board(Vec3::new(-0.21, height - 0.01, -0.06), Vec3::new(0.21, height + 0.02, 0.06), metal);
    Piece::new("ladder", shape)
}

/// Builds a barrel or a bucket.
pub(super) fn barrel(builder: &mut RoomBuilder) -> Piece {
    let paint = builder.palette.paint(Finish::Gloss).tinted(random_tint(builder));
    let mut shape = Shape::default();
    if chance(&mut builder.random, 0.5) {
        let (r, h) = (between(&mut builder.random, 0.2, 0.29), between(&mut builder.random, 0.6, 0.88));
        let mut profile = vec![[0.97 * r, 0.0]];
        for k in 0..3 {
            let y = h * (0.02 + 0.47 * k as f32);
            profile.extend([[r, y], [1.03 * r, y + 0.012], [r, y + 0.025]]);
        }
        profile.push([0.96 * r, h]);
        shape.lathe(Vec3::ZERO, &profile, 32, paint);
    } else {
        let (r, h) = (between(&mut builder.random, 0.09, 0.16), between(&mut builder.random, 0.12, 0.32));
        let front = builder.palette.printed_front(&mut builder.random);
        let t = 0.003;
        shape.lathe(Vec3::ZERO, &[[r, 0.0], [r, h], [r - t, h], [r - t, 0.6 * h], [0.0, 0.6 * h]], 28, paint);
        shape.label(Vec3::Y * 0.2 * h, r + 0.0006, 0.55 * h, 28, front);
    }
    Piece::new("barrel", shape)
}

/// Builds a tripod with a camera.
pub(super) fn tripod(builder: &mut RoomBuilder) -> Piece {
    let black = dark_paint(builder);
    let height = between(&mut builder.random, 1.1, 1.6);
    let mut shape = Shape::default();
    for k in 0..3 {
        let angle = TAU * k as f32 / 3.0;
        let foot = Vec3::new(angle.cos() * 0.4, 0.012, angle.sin() * 0.4);
        shape.bar(foot, Vec3::Y * (height - 0.1), [0.009, 0.014], 8, black);
    }
    shape.bar(Vec3::Y * (height - 0.3), Vec3::Y * height, [0.012; 2], 10, black);
    let turn = Quat::from_rotation_y(between(&mut builder.random, 0.0, TAU));
    let mut head = Shape::default();
    head.rounded(Vec3::new(-0.07, 0.0, -0.04), Vec3::new(0.07, 0.1, 0.04), 0.012, 1, black);
    head.bar(Vec3::new(0.0, 0.05, 0.03), Vec3::new(0.0, 0.05, 0.12), [0.036, 0.04], 18, black.tinted([0.02; 3]));
    shape.add(&head, turn, Vec3::Y * height);
    Piece::new("tripod", shape)
}

/// Builds a pillar from the floor to the ceiling.
pub(super) fn pillar(builder: &mut RoomBuilder) -> Piece {
    let paint = builder.palette.paint(if chance(&mut builder.random, 0.5) { Finish::Wall } else { Finish::Trim });
    let top = builder.plan.height_m - 0.008;
    let r = between(&mut builder.random, 0.12, 0.3);
    let mut shape = Shape::default();
    if chance(&mut builder.random, 0.4) {
        shape.lathe(Vec3::ZERO, &[[r, 0.0], [r, top]], 32, paint);
    } else {
        shape.board(Vec3::new(-r, 0.0, -r), Vec3::new(r, top, r), paint);
    }
    Piece::new("pillar", shape)
}
