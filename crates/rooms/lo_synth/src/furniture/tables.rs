//! Tables and desks.

use lo_geometry::{Vec2, Vec3};

use crate::chance::{between, chance, count, weighted};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::{Paint, Shape};

/// Adds four legs, square or round and tapered, at the corners of `half`, up to `height`.
pub(super) fn legs(shape: &mut Shape, half: Vec2, height: f32, thick: f32, round: bool, paint: Paint) {
    for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let p = Vec3::new(x * (half.x - thick), 0.0, z * (half.y - thick));
        if round {
            let top = p * 0.94 + Vec3::Y * height;
            shape.bar(p, top, [0.55 * thick, 0.9 * thick], 12, paint);
        } else {
            let reach = Vec3::new(thick, 0.0, thick);
            shape.board(p - reach, p + reach + Vec3::Y * height, paint);
        }
    }
}

/// Builds a dining table of half extents `half`, 74–76 cm high. Round tables stand on a foot.
pub(super) fn dining_table(builder: &mut RoomBuilder, half: Vec2, round: bool) -> Piece {
    let wood = builder.palette.paint(Finish::Wood);
    let height = between(&mut builder.random, 0.735, 0.76);
    let thick = between(&mut builder.random, 0.022, 0.045);
    let mut shape = Shape::default();
    if round {
        let r = half.x;
        let metal = builder.palette.paint(if chance(&mut builder.random, 0.5) { Finish::Metal } else { Finish::Wood });
        shape.lathe(Vec3::ZERO, &[[0.24, 0.0], [0.24, 0.012], [0.05, 0.04], [0.04, height - thick]], 28, metal);
        let edge = 0.006;
        let top = [[r - edge, height - thick], [r, height - thick + edge], [r, height - edge], [r - edge, height]];
        shape.lathe(Vec3::ZERO, &top, 48, wood);
        return Piece::new("dining table", shape).with_surface(Vec3::Y * height, Vec2::splat(0.55 * r), 1.0);
    }
    let top = shape_top(builder, height, thick, half);
    shape.add_at(&top, Vec3::ZERO);
    let round_legs = chance(&mut builder.random, 0.3);
    let leg = between(&mut builder.random, 0.02, 0.04);
    let paint = builder.palette.paint(if chance(&mut builder.random, 0.25) { Finish::Metal } else { Finish::Wood });
    legs(&mut shape, half - Vec2::splat(0.02), height - thick, leg, round_legs, paint);
    let apron = [half.x - 0.06, half.y - 0.06];
    for side in [-1.0, 1.0] {
        let (z, x) = (side * apron[1], side * apron[0]);
        let low = height - thick - 0.08;
        shape.board(Vec3::new(-apron[0], low, z - 0.01), Vec3::new(apron[0], height - thick, z + 0.01), paint);
        shape.board(Vec3::new(x - 0.01, low, -apron[1]), Vec3::new(x + 0.01, height - thick, apron[1]), paint);
    }
    Piece::new("dining table", shape).with_surface(Vec3::Y * height, half - Vec2::splat(0.06), 1.0)
}

fn shape_top(builder: &mut RoomBuilder, height: f32, thick: f32, half: Vec2) -> Shape {
    let paint = builder.palette.paint(Finish::Wood);
    let mut shape = Shape::default();
    let (min, max) = (Vec3::new(-half.x, height - thick, -half.y), Vec3::new(half.x, height, half.y));
    shape.rounded(min, max, 0.006, 2, paint);
    shape
}

/// Builds a coffee table, 38–46 cm high, with a wooden or stone top.
pub(super) fn coffee_table(builder: &mut RoomBuilder) -> Piece {
    let height = between(&mut builder.random, 0.38, 0.46);
    let kind = weighted(&mut builder.random, &[(0, 0.5), (1, 0.3), (2, 0.2)]);
    let wood = builder.palette.paint(Finish::Wood);
    let mut shape = Shape::default();
    if kind == 1 {
        let r = between(&mut builder.random, 0.35, 0.5);
        let metal = builder.palette.paint(Finish::SecondMetal);
        let stone =
            builder.palette.paint(if chance(&mut builder.random, 0.5) { Finish::Worktop } else { Finish::Wood });
        for k in 0..4 {
            let angle = std::f32::consts::FRAC_PI_2 * k as f32 + 0.4;
            let at = |r: f32, y: f32| Vec3::new(r * angle.cos(), y, r * angle.sin());
            shape.bar(at(0.85 * r, 0.004), at(0.55 * r, height - 0.025), [0.01, 0.014], 10, metal);
        }
        shape.lathe(Vec3::ZERO, &[[r, height - 0.028], [r, height - 0.004], [r - 0.004, height]], 40, stone);
        return Piece::new("coffee table", shape).with_surface(Vec3::Y * height, Vec2::splat(0.6 * r), 1.0);
    }
    let half = Vec2::new(between(&mut builder.random, 0.45, 0.65), between(&mut builder.random, 0.25, 0.35));
    let (min, max) = (Vec3::new(-half.x, height - 0.03, -half.y), Vec3::new(half.x, height, half.y));
    shape.rounded(min, max, 0.005, 1, wood);
    if kind == 2 {
        // Side panels with a shelf between them.
        for side in [-1.0f32, 1.0] {
            let x = [side * half.x, side * (half.x - 0.025)];
            shape.board(
                Vec3::new(x[0].min(x[1]), 0.0, -half.y),
                Vec3::new(x[0].max(x[1]), height - 0.03, half.y),
                wood,
            );
        }
        let (min, max) = (Vec3::new(-half.x + 0.025, 0.1, -half.y), Vec3::new(half.x - 0.025, 0.125, half.y));
        shape.board(min, max, wood);
    } else {
        let round = chance(&mut builder.random, 0.6);
        legs(&mut shape, half - Vec2::splat(0.03), height - 0.03, 0.02, round, wood);
    }
    Piece::new("coffee table", shape).with_surface(Vec3::Y * height, half - Vec2::splat(0.05), 1.0)
}

/// Builds a small round table for the side of a sofa.
pub(super) fn side_table(builder: &mut RoomBuilder) -> Piece {
    let height = between(&mut builder.random, 0.42, 0.58);
    let r = between(&mut builder.random, 0.18, 0.25);
    let wood = builder.palette.paint(Finish::SecondWood);
    let metal = builder.palette.paint(Finish::SecondMetal);
    let mut shape = Shape::default();
    shape.lathe(Vec3::ZERO, &[[0.8 * r, 0.0], [0.8 * r, 0.012], [0.013, 0.02], [0.013, height - 0.02]], 24, metal);
    shape.lathe(Vec3::ZERO, &[[r, height - 0.022], [r, height - 0.003], [r - 0.003, height]], 32, wood);
    Piece::new("side table", shape).with_surface(Vec3::Y * height, Vec2::splat(0.6 * r), 1.0)
}

/// Builds a desk, 72–75 cm high, sometimes with drawers on one side; back at z = 0.
pub(super) fn desk(builder: &mut RoomBuilder, width: f32) -> Piece {
    let height = between(&mut builder.random, 0.72, 0.75);
    let depth = between(&mut builder.random, 0.6, 0.8);
    let top = builder.palette.paint(if chance(&mut builder.random, 0.7) { Finish::Wood } else { Finish::Lacquer });
    let leg = builder.palette.paint(Finish::Metal);
    let (half, thick) = (0.5 * width, 0.025);
    let mut shape = Shape::default();
    let (min, max) = (Vec3::new(-half, height - thick, 0.0), Vec3::new(half, height, depth));
    shape.rounded(min, max, 0.004, 1, top);
    for x in [-half + 0.05, half - 0.05] {
        for z in [0.05, depth - 0.05] {
            let (min, max) = (Vec3::new(x - 0.02, 0.0, z - 0.02), Vec3::new(x + 0.02, height - thick, z + 0.02));
            shape.board(min, max, leg);
        }
        let (min, max) = (Vec3::new(x - 0.015, 0.05, 0.05), Vec3::new(x + 0.015, 0.08, depth - 0.05));
        shape.board(min, max, leg);
    }
    if chance(&mut builder.random, 0.5) {
        let front = builder.palette.paint(Finish::Fronts);
        let metal = builder.palette.paint(Finish::Metal);
        let [a, b] = [half - 0.48, half - 0.08];
        shape.board(Vec3::new(a, 0.06, 0.06), Vec3::new(b, height - thick, depth - 0.06), front);
        for k in 0..3 {
            let low = 0.07 + k as f32 * (height - thick - 0.08) / 3.0;
            let high = low + (height - thick - 0.08) / 3.0 - 0.006;
            shape.board(Vec3::new(a, low, depth - 0.06), Vec3::new(b, high, depth - 0.042), front);
            handle(&mut shape, Vec3::new(0.5 * (a + b), high - 0.05, depth - 0.042), 0.12, metal);
        }
    }
    let center = Vec3::new(0.0, height, 0.5 * depth);
    Piece::new("desk", shape).with_front(0.0).with_surface(center, Vec2::new(half - 0.05, 0.5 * depth - 0.05), 0.9)
}

/// Adds a bar handle on a front that faces +z.
pub(super) fn handle(shape: &mut Shape, at: Vec3, width: f32, paint: Paint) {
    let half = Vec3::new(0.5 * width, 0.0, 0.0);
    let out = Vec3::Z * 0.025;
    shape.bar(at - half + out, at + half + out, [0.005; 2], 8, paint);
    for end in [-0.8, 0.8] {
        shape.bar(at + half * end, at + half * end + out, [0.004; 2], 6, paint);
    }
}

/// Builds a school desk for two.
pub(super) fn school_desk(builder: &mut RoomBuilder) -> Piece {
    let top = builder.palette.paint(Finish::Wood);
    let metal = builder.palette.paint(Finish::Metal);
    let half = Vec2::new(0.6, 0.25);
    let height = 0.72;
    let mut shape = Shape::default();
    shape.rounded(Vec3::new(-half.x, height - 0.02, -half.y), Vec3::new(half.x, height, half.y), 0.004, 1, top);
    legs(&mut shape, half - Vec2::splat(0.02), height - 0.02, 0.014, false, metal);
    let tops = count(&mut builder.random, 0, 1) as f32;
    let piece = Piece::new("school desk", shape);
    if tops > 0.0 { piece.with_surface(Vec3::Y * height, half - Vec2::splat(0.05), 0.4) } else { piece }
}
