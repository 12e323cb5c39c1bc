//! Small everyday objects: papers, books, packages, devices, toys.

use lo_geometry::{Quat, Vec2, Vec3};

use super::wall_objects;
use crate::chance::{between, chance, count, pick};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::{Paint, Shape};

pub(super) fn random_tint(builder: &mut RoomBuilder) -> [f32; 3] {
    builder.palette.tint(&mut builder.random)
}

pub(super) fn dark_paint(builder: &mut RoomBuilder) -> Paint {
    let grey = between(&mut builder.random, 0.012, 0.05);
    builder.palette.paint(Finish::Matte).tinted([grey; 3])
}

/// Builds a few sheets of paper, sometimes on a pile.
pub(super) fn papers(builder: &mut RoomBuilder) -> Piece {
    let white = builder.palette.paint(Finish::Matte).tinted([0.78, 0.77, 0.74]);
    let small = chance(&mut builder.random, 0.25);
    let half = if small { Vec2::new(0.074, 0.105) } else { Vec2::new(0.105, 0.148) };
    let mut shape = Shape::default();
    // Paper is never perfectly flat.
    let mut y = 0.0003;
    for k in 0..count(&mut builder.random, 1, 4) {
        let pile = k == 0 && chance(&mut builder.random, 0.35);
        let thick = if pile { between(&mut builder.random, 0.004, 0.05) } else { 0.0008 };
        let page = builder.palette.page(&mut builder.random);
        let mut sheet = Shape::default();
        sheet.cuboid(Vec3::new(-half.x, 0.0, -half.y), Vec3::new(half.x, thick, half.y), white);
        sheet.picture_on(-half, half, thick + 0.0003, page);
        let turn = Quat::from_rotation_y(between(&mut builder.random, -0.5, 0.5));
        let aside = Vec3::new(between(&mut builder.random, -0.03, 0.03), y, between(&mut builder.random, -0.03, 0.03));
        shape.add(&sheet, turn, aside);
        y += thick + 0.0008;
    }
    Piece::new("papers", shape)
}

/// Builds a book lying with its front up.
pub(super) fn book(builder: &mut RoomBuilder) -> Piece {
    let front = builder.palette.printed_front(&mut builder.random);
    let body = builder.palette.paint(Finish::Matte).tinted(random_tint(builder));
    let white = body.tinted([0.75; 3]);
    let half = Vec2::new(between(&mut builder.random, 0.06, 0.12), between(&mut builder.random, 0.09, 0.155));
    let thick = between(&mut builder.random, 0.004, 0.045);
    let mut shape = Shape::default();
    let cover = (0.15 * thick).min(0.002);
    shape.cuboid(Vec3::new(-half.x, 0.0, -half.y), Vec3::new(half.x, cover, half.y), body);
    let (low, high) =
        (Vec3::new(-half.x + 0.001, cover, -half.y + 0.003), Vec3::new(half.x - 0.003, thick - cover, half.y - 0.003));
    shape.cuboid(low, high, white);
    shape.cuboid(Vec3::new(-half.x, thick - cover, -half.y), Vec3::new(half.x, thick, half.y), body);
    shape.picture_on(-half, half, thick + 0.0003, front);
    Piece::new("book", shape)
}

/// Builds a printed box, `size` times as large as those on tables.
pub(super) fn package(builder: &mut RoomBuilder, size: f32) -> Piece {
    let body = builder.palette.paint(Finish::Matte).tinted(random_tint(builder));
    let fronts = [(); 2].map(|()| builder.palette.printed_front(&mut builder.random));
    let half = Vec3::new(
        size * between(&mut builder.random, 0.025, 0.11),
        0.0,
        size * between(&mut builder.random, 0.018, 0.08),
    );
    let high = size * between(&mut builder.random, 0.04, 0.3);
    let mut shape = Shape::default();
    shape.cuboid(-half, half + Vec3::Y * high, body);
    let out = 0.0004;
    for side in [-1.0f32, 1.0] {
        let (x, z) = (half.x * side, (half.z + out) * side);
        let p = |x: f32, y: f32| Vec3::new(x, y, z);
        shape.picture([p(-x, 0.0), p(x, 0.0), p(x, high), p(-x, high)], fronts[0]);
        let (x, z) = ((half.x + out) * side, half.z * side);
        let p = |z: f32, y: f32| Vec3::new(x, y, z);
        shape.picture([p(z, 0.0), p(-z, 0.0), p(-z, high), p(z, high)], fronts[1]);
    }
    if chance(&mut builder.random, 0.6) {
        let top = Vec2::new(half.x, half.z);
        shape.picture_on(-top, top, high + out, fronts[1]);
    }
    Piece::new("package", shape)
}

/// Builds a tin or a plastic bottle.
pub(super) fn can(builder: &mut RoomBuilder) -> Piece {
    let front = builder.palette.printed_front(&mut builder.random);
    let mut shape = Shape::default();
    if chance(&mut builder.random, 0.6) {
        let metal = builder.palette.paint(Finish::Metal);
        let (r, h) = (between(&mut builder.random, 0.026, 0.052), between(&mut builder.random, 0.05, 0.17));
        shape.lathe(Vec3::ZERO, &[[0.95 * r, 0.0], [r, 0.004], [r, h - 0.004], [0.94 * r, h]], 24, metal);
        shape.label(Vec3::Y * 0.006, r + 0.0005, h - 0.012, 24, front);
    } else {
        let gloss = builder.palette.paint(Finish::Gloss).tinted(random_tint(builder));
        let cap = gloss.tinted(random_tint(builder));
        let (r, h) = (between(&mut builder.random, 0.025, 0.042), between(&mut builder.random, 0.12, 0.25));
        let body =
            [[0.9 * r, 0.0], [r, 0.01], [r, 0.6 * h], [0.85 * r, 0.72 * h], [0.35 * r, 0.85 * h], [0.3 * r, 0.9 * h]];
        let mut bottle = Shape::default();
        bottle.lathe(Vec3::ZERO, &body, 20, gloss);
        bottle.label(Vec3::Y * 0.12 * h, r + 0.0005, 0.42 * h, 20, front);
        bottle.lathe(Vec3::Y * 0.88 * h, &[[0.42 * r, 0.0], [0.4 * r, 0.08 * h], [0.15 * r, 0.12 * h]], 16, cap);
        let flat = between(&mut builder.random, 0.6, 1.0);
        shape.add_at(&bottle.scaled_by(Vec3::new(1.0, 1.0, flat)), Vec3::ZERO);
    }
    Piece::new("can", shape)
}

/// Builds a phone or a tablet, lying, with its screen on or off.
pub(super) fn phone_or_tablet(builder: &mut RoomBuilder) -> Piece {
    let body =
        if chance(&mut builder.random, 0.6) { dark_paint(builder) } else { builder.palette.paint(Finish::Metal) };
    let (half, thick) = if chance(&mut builder.random, 0.7) {
        (Vec2::new(0.037, 0.077), 0.009)
    } else {
        (Vec2::new(0.088, 0.123), 0.007)
    };
    let mut shape = Shape::default();
    shape.rounded(Vec3::new(-half.x, 0.0, -half.y), Vec3::new(half.x, thick, half.y), 0.003, 1, body);
    let mut face = Shape::default();
    let on = chance(&mut builder.random, 0.35);
    wall_objects::screen(builder, &mut face, half - Vec2::new(0.003, 0.006), Vec2::ZERO, 0.0, on);
    shape.add(&face, Quat::from_rotation_x(-0.5 * std::f32::consts::PI), Vec3::Y * (thick + 0.0003));
    Piece::new("handset", shape)
}

/// Builds a pot of pens or a single pen.
pub(super) fn pens(builder: &mut RoomBuilder) -> Piece {
    let mut shape = Shape::default();
    let gloss = builder.palette.paint(Finish::Gloss);
    if chance(&mut builder.random, 0.4) {
        let (a, b) = (Vec3::new(-0.07, 0.005, 0.0), Vec3::new(0.07, 0.005, 0.0));
        shape.bar(a, b, [0.0045, 0.005], 8, gloss.tinted(random_tint(builder)));
        shape.bar(a - Vec3::X * 0.012, a, [0.001, 0.004], 8, gloss.tinted([0.1; 3]));
        return Piece::new("pen", shape);
    }
    let (r, h) = (between(&mut builder.random, 0.03, 0.045), between(&mut builder.random, 0.09, 0.12));
    let wall = 0.002;
    let pot = gloss.tinted(random_tint(builder));
    shape.lathe(Vec3::ZERO, &[[r, 0.0], [r, h], [r - wall, h], [r - wall, 0.004], [0.0, 0.004]], 20, pot);
    for k in 0..count(&mut builder.random, 2, 7) {
        let angle = 2.4 * k as f32 + between(&mut builder.random, -0.3, 0.3);
        let out = Vec3::new(angle.cos(), 0.0, angle.sin());
        let foot = Vec3::Y * 0.008 - out * 0.4 * r;
        let tip = out * 0.8 * r + Vec3::Y * between(&mut builder.random, 0.14, 0.18);
        shape.bar(foot, tip, [0.004; 2], 7, gloss.tinted(random_tint(builder)));
    }
    Piece::new("pens", shape)
}

pub(super) fn keyboard(builder: &mut RoomBuilder) -> Piece {
    let keys = builder.palette.keys(&mut builder.random);
    let half = Vec2::new(between(&mut builder.random, 0.14, 0.225), between(&mut builder.random, 0.06, 0.075));
    let body = dark_paint(builder);
    let mut shape = Shape::default();
    shape.rounded(Vec3::new(-half.x, 0.0, -half.y), Vec3::new(half.x, 0.018, half.y), 0.004, 1, body);
    shape.picture_on(-half + Vec2::splat(0.005), half - Vec2::splat(0.005), 0.0184, keys);
    Piece::new("keyboard", shape)
}

/// Builds a game controller or a mouse.
pub(super) fn controller(builder: &mut RoomBuilder) -> Piece {
    let paint = if chance(&mut builder.random, 0.6) {
        dark_paint(builder)
    } else {
        builder.palette.paint(Finish::Gloss).tinted(random_tint(builder))
    };
    let mut shape = Shape::default();
    if chance(&mut builder.random, 0.5) {
        shape.rounded(Vec3::new(-0.03, 0.0, -0.05), Vec3::new(0.03, 0.034, 0.05), 0.016, 3, paint);
        return Piece::new("mouse", shape);
    }
    shape.rounded(Vec3::new(-0.06, 0.002, -0.03), Vec3::new(0.06, 0.036, 0.03), 0.014, 2, paint);
    for side in [-1.0, 1.0] {
        let grip = Vec3::new(0.062 * side, 0.021, 0.005);
        shape.bar(grip, grip + Vec3::new(0.012 * side, -0.002, 0.05), [0.021, 0.015], 12, paint);
        shape.ball(grip, [0.024, 0.021], 14, paint);
        shape.ball(grip + Vec3::new(0.012 * side, -0.002, 0.05), [0.016, 0.016], 12, paint);
        let stick = Vec3::new(0.026 * side, 0.034, 0.016);
        shape.bar(stick, stick + Vec3::Y * 0.012, [0.004; 2], 8, paint);
        shape.bar(stick + Vec3::Y * 0.01, stick + Vec3::Y * 0.016, [0.009; 2], 12, paint);
    }
    Piece::new("controller", shape)
}

/// Builds a roll of adhesive tape, lying.
pub(super) fn tape_roll(builder: &mut RoomBuilder) -> Piece {
    let paint = builder.palette.paint(Finish::Gloss).tinted(random_tint(builder));
    let (outer, high) = (between(&mut builder.random, 0.035, 0.06), between(&mut builder.random, 0.015, 0.05));
    let inner = between(&mut builder.random, 0.5, 0.75) * outer;
    let mut shape = Shape::default();
    shape.ring(Vec3::ZERO, &[[inner, 0.0], [outer, 0.0], [outer, high], [inner, high]], 28, paint);
    Piece::new("tape", shape)
}

/// Builds a cordless drill lying on its side.
pub(super) fn drill(builder: &mut RoomBuilder) -> Piece {
    let colors = [[0.5, 0.02, 0.02], [0.02, 0.16, 0.2], [0.6, 0.35, 0.02], [0.02, 0.06, 0.3]];
    let body = builder.palette.paint(Finish::Gloss).tinted(pick(&mut builder.random, &colors));
    let black = dark_paint(builder);
    let metal = builder.palette.paint(Finish::Metal);
    let y = 0.033;
    let p = |x: f32, z: f32| Vec3::new(x, y, z);
    let mut shape = Shape::default();
    shape.bar(p(-0.1, -0.06), p(0.03, -0.06), [0.03, 0.033], 16, body);
    shape.bar(p(0.03, -0.06), p(0.085, -0.06), [0.03, 0.018], 16, black);
    shape.bar(p(0.08, -0.06), p(0.15, -0.06), [0.004, 0.003], 8, metal);
    shape.bar(p(-0.07, -0.05), p(-0.05, 0.07), [0.021, 0.019], 12, body);
    shape.rounded(Vec3::new(-0.105, 0.0, 0.065), Vec3::new(0.01, 2.0 * y, 0.115), 0.006, 1, black);
    Piece::new("drill", shape)
}

pub(super) fn fruit(builder: &mut RoomBuilder) -> Piece {
    let mut shape = Shape::default();
    if chance(&mut builder.random, 0.5) {
        let paint = builder.palette.paint(Finish::Gloss).tinted([0.7, 0.48, 0.04]);
        let at = |k: usize| {
            let angle = -0.9 + 1.8 * k as f32 / 6.0;
            Vec3::new(0.1 * angle.sin(), 0.018, 0.1 * (1.0 - angle.cos()))
        };
        let thick = [0.006, 0.014, 0.017, 0.018, 0.017, 0.013, 0.005];
        for k in 0..6 {
            shape.bar(at(k), at(k + 1), [thick[k], thick[k + 1]], 10, paint);
            shape.ball(at(k), [thick[k], thick[k]], 10, paint);
        }
    } else {
        let colors = [[0.5, 0.05, 0.03], [0.65, 0.3, 0.02], [0.25, 0.4, 0.05]];
        let paint = builder.palette.paint(Finish::Gloss).tinted(pick(&mut builder.random, &colors));
        let r = between(&mut builder.random, 0.03, 0.042);
        shape.ball(Vec3::Y * 0.92 * r, [r, 0.92 * r], 18, paint);
    }
    Piece::new("fruit", shape)
}

/// Builds a sitting teddy bear.
pub(super) fn teddy_bear(builder: &mut RoomBuilder) -> Piece {
    let cloth = builder.palette.clothing(&mut builder.random).tinted([0.8, 0.6, 0.45]);
    let black = dark_paint(builder);
    let s = between(&mut builder.random, 0.5, 1.3);
    let mut shape = Shape::default();
    let mut ball = |x: f32, y: f32, z: f32, r: f32, paint: Paint| {
        shape.ball(Vec3::new(x, y, z) * s, [r * s, r * s], 12, paint);
    };
    ball(0.0, 0.085, 0.0, 0.085, cloth);
    ball(0.0, 0.205, 0.01, 0.065, cloth);
    ball(0.0, 0.19, 0.065, 0.03, cloth);
    ball(0.0, 0.2, 0.092, 0.009, black);
    for side in [-1.0, 1.0] {
        ball(0.05 * side, 0.262, 0.0, 0.024, cloth);
        ball(0.025 * side, 0.225, 0.066, 0.007, black);
        ball(0.09 * side, 0.12, 0.03, 0.034, cloth);
        ball(0.075 * side, 0.038, 0.085, 0.037, cloth);
    }
    Piece::new("toy", shape)
}

/// Builds headphones lying on their side.
pub(super) fn headphones(builder: &mut RoomBuilder) -> Piece {
    let paint = dark_paint(builder);
    let mut shape = Shape::default();
    let arc: Vec<Vec3> = (0..=10)
        .map(|k| {
            let angle = std::f32::consts::PI * k as f32 / 10.0;
            Vec3::new(0.08 * angle.cos(), 0.03, -0.1 * angle.sin())
        })
        .collect();
    shape.tube(&arc, 0.008, 8, paint);
    for side in [-1.0, 1.0] {
        let x = 0.08 * side;
        shape.bar(Vec3::new(x - 0.018, 0.036, 0.02), Vec3::new(x + 0.018, 0.036, 0.02), [0.036; 2], 18, paint);
    }
    Piece::new("headphones", shape)
}

pub(super) fn shoes(builder: &mut RoomBuilder) -> Piece {
    let upper = builder.palette.paint(Finish::Leather).tinted([0.8; 3]);
    let sole = builder.palette.paint(Finish::Matte).tinted(random_tint(builder));
    let mut shape = Shape::default();
    for side in [-1.0f32, 1.0] {
        let mut shoe = Shape::default();
        shoe.rounded(Vec3::new(-0.045, 0.0, -0.13), Vec3::new(0.045, 0.025, 0.14), 0.012, 2, sole);
        shoe.bulging(Vec3::new(-0.04, 0.02, -0.01), Vec3::new(0.04, 0.065, 0.13), 0.03, 2, 0.02, upper);
        shoe.rounded(Vec3::new(-0.038, 0.02, -0.125), Vec3::new(0.038, 0.11, 0.01), 0.025, 2, upper);
        let turn = Quat::from_rotation_y(between(&mut builder.random, -0.4, 0.4));
        let aside = Vec3::new(0.075 * side, 0.0, between(&mut builder.random, -0.05, 0.05));
        shape.add(&shoe, turn, aside);
    }
    Piece::new("shoes", shape)
}

/// Builds a waste bin with paper.
pub(super) fn waste_bin(builder: &mut RoomBuilder) -> Piece {
    let paint = builder.palette.paint(Finish::Gloss).tinted(random_tint(builder));
    let white = builder.palette.paint(Finish::Matte).tinted([0.7; 3]);
    let (r, h) = (between(&mut builder.random, 0.1, 0.16), between(&mut builder.random, 0.25, 0.4));
    let t = 0.003;
    let mut shape = Shape::default();
    let profile = [[0.8 * r, 0.0], [r, h], [r - t, h], [0.8 * r - t, 0.005], [0.0, 0.005]];
    shape.lathe(Vec3::ZERO, &profile, 24, paint);
    for k in 0..count(&mut builder.random, 0, 6) {
        let angle = 2.4 * k as f32;
        let at = Vec3::new(angle.cos() * 0.4 * r, h * (0.45 + 0.06 * k as f32), angle.sin() * 0.4 * r);
        shape.ball(at, [0.4 * r, 0.35 * r], 7, white);
    }
    Piece::new("bin", shape)
}

/// Builds a computer case.
pub(super) fn computer_case(builder: &mut RoomBuilder) -> Piece {
    let body = if chance(&mut builder.random, 0.7) {
        dark_paint(builder)
    } else {
        builder.palette.paint(Finish::Matte).tinted([0.6, 0.59, 0.55])
    };
    let (w, h, d) = (
        between(&mut builder.random, 0.08, 0.11),
        between(&mut builder.random, 0.34, 0.5),
        between(&mut builder.random, 0.18, 0.25),
    );
    let black = body.tinted([0.02; 3]);
    let mut shape = Shape::default();
    shape.board(Vec3::new(-w, 0.0, -d), Vec3::new(w, h, d), body);
    shape.cuboid(Vec3::new(-0.8 * w, 0.82 * h, d), Vec3::new(0.8 * w, 0.92 * h, d + 0.002), black);
    shape.cuboid(Vec3::new(-0.8 * w, 0.1 * h, d), Vec3::new(0.8 * w, 0.45 * h, d + 0.002), black);
    shape.bar(Vec3::new(0.0, 0.65 * h, d), Vec3::new(0.0, 0.65 * h, d + 0.004), [0.012; 2], 14, black);
    Piece::new("computer case", shape)
}
