//! Chairs, sofas and armchairs with seats 42–48 cm high.

use lo_geometry::{Quat, Vec2, Vec3};

use super::small_objects::random_tint;
use super::tables::legs;
use crate::chance::{between, chance, count, weighted};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::{Paint, Shape};

/// Style of a set of dining chairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ChairStyle {
    Slats,
    Upholstered,
    ShellSeat,
    Board,
}

/// Draws a chair style.
pub(super) fn chair_style(builder: &mut RoomBuilder) -> ChairStyle {
    let styles = [
        (ChairStyle::Slats, 0.35),
        (ChairStyle::Upholstered, 0.3),
        (ChairStyle::ShellSeat, 0.2),
        (ChairStyle::Board, 0.15),
    ];
    weighted(&mut builder.random, &styles)
}

/// Builds a dining chair: 43 cm wide, seat at 46 cm, front towards +z, seat centred on the origin.
pub(super) fn chair(builder: &mut RoomBuilder, style: ChairStyle) -> Piece {
    let wood = builder.palette.paint(Finish::Wood);
    let cloth = builder.palette.paint(Finish::SecondUpholstery);
    let metal = builder.palette.paint(Finish::SecondMetal);
    let seat = 0.46;
    let (hx, hz) = (0.215, 0.21);
    let mut shape = Shape::default();
    let lean = Quat::from_rotation_x(-0.14);
    let mut back = Shape::default();
    match style {
        ChairStyle::Slats => {
            legs(&mut shape, Vec2::new(hx, hz), seat - 0.02, 0.018, false, wood);
            shape.rounded(Vec3::new(-hx, seat - 0.022, -hz), Vec3::new(hx, seat, hz), 0.008, 1, wood);
            for x in [-hx + 0.018, hx - 0.018] {
                back.board(Vec3::new(x - 0.016, 0.0, -0.014), Vec3::new(x + 0.016, 0.45, 0.014), wood);
            }
            for k in 0..3 {
                let y = 0.14 + 0.12 * k as f32;
                back.rounded(Vec3::new(-hx + 0.03, y, -0.008), Vec3::new(hx - 0.03, y + 0.06, 0.008), 0.004, 1, wood);
            }
        }
        ChairStyle::Upholstered => {
            legs(&mut shape, Vec2::new(hx, hz), seat - 0.06, 0.016, true, wood);
            shape.bulging(Vec3::new(-hx, seat - 0.07, -hz), Vec3::new(hx, seat, hz), 0.025, 2, 0.015, cloth);
            back.rounded(Vec3::new(-hx, -0.03, -0.03), Vec3::new(hx, 0.46, 0.03), 0.028, 2, cloth);
        }
        ChairStyle::ShellSeat => {
            let shell = builder.palette.paint(Finish::Gloss).tinted(random_tint(builder));
            legs(&mut shape, Vec2::new(hx, hz), seat - 0.01, 0.012, true, metal);
            shape.rounded(Vec3::new(-hx, seat - 0.018, -hz), Vec3::new(hx, seat, hz), 0.008, 2, shell);
            back.rounded(Vec3::new(-hx, 0.0, -0.007), Vec3::new(hx, 0.36, 0.007), 0.006, 2, shell);
        }
        ChairStyle::Board => {
            legs(&mut shape, Vec2::new(hx, hz), seat - 0.02, 0.016, true, wood);
            shape.rounded(Vec3::new(-hx, seat - 0.024, -hz), Vec3::new(hx, seat, hz), 0.01, 2, wood);
            for x in [-0.12, 0.12] {
                back.bar(Vec3::new(x, 0.0, 0.0), Vec3::new(1.2 * x, 0.3, 0.0), [0.009; 2], 10, wood);
            }
            back.rounded(Vec3::new(-hx, 0.24, -0.01), Vec3::new(hx, 0.42, 0.01), 0.008, 2, wood);
        }
    }
    shape.add(&back, lean, Vec3::new(0.0, seat - 0.005, -hz + 0.02));
    Piece::new("chair", shape)
}

/// Builds a swivel chair on a five-star base.
pub(super) fn office_chair(builder: &mut RoomBuilder) -> Piece {
    let cloth =
        builder.palette.paint(if chance(&mut builder.random, 0.7) { Finish::Upholstery } else { Finish::Leather });
    let black = builder.palette.paint(Finish::Matte).tinted([0.035; 3]);
    let turn = between(&mut builder.random, 0.0, 1.2);
    let mut shape = Shape::default();
    for k in 0..5 {
        let angle = turn + std::f32::consts::TAU * k as f32 / 5.0;
        let out = Vec3::new(angle.cos(), 0.0, angle.sin());
        shape.bar(Vec3::Y * 0.1, out * 0.28 + Vec3::Y * 0.075, [0.022, 0.014], 8, black);
        shape.ball(out * 0.28 + Vec3::Y * 0.028, [0.026, 0.028], 10, black);
        shape.bar(out * 0.28 + Vec3::Y * 0.03, out * 0.28 + Vec3::Y * 0.078, [0.008; 2], 6, black);
    }
    shape.bar(Vec3::Y * 0.08, Vec3::Y * 0.42, [0.028, 0.022], 14, black);
    shape.bulging(Vec3::new(-0.24, 0.41, -0.23), Vec3::new(0.24, 0.48, 0.24), 0.03, 2, 0.015, cloth);
    let mut back = Shape::default();
    back.rounded(Vec3::new(-0.22, 0.1, -0.03), Vec3::new(0.22, 0.6, 0.03), 0.028, 2, cloth);
    back.board(Vec3::new(-0.03, -0.05, -0.05), Vec3::new(0.03, 0.3, -0.028), black);
    shape.add(&back, Quat::from_rotation_x(-0.12), Vec3::new(0.0, 0.47, -0.22));
    if chance(&mut builder.random, 0.6) {
        for x in [-0.27, 0.27] {
            shape.board(Vec3::new(x - 0.02, 0.44, -0.05), Vec3::new(x + 0.02, 0.66, -0.01), black);
            shape.rounded(Vec3::new(x - 0.03, 0.655, -0.16), Vec3::new(x + 0.03, 0.685, 0.12), 0.012, 1, black);
        }
    }
    Piece::new("office chair", shape)
}

/// Builds a sofa with cushions for `seats` people, or an armchair for one; back at z = 0.
pub(super) fn sofa(builder: &mut RoomBuilder, seats: usize) -> Piece {
    let leather = chance(&mut builder.random, 0.2);
    let cloth = builder.palette.paint(if leather { Finish::Leather } else { Finish::Upholstery });
    let foot = builder.palette.paint(if chance(&mut builder.random, 0.5) { Finish::Wood } else { Finish::Metal });
    let seat_width = between(&mut builder.random, 0.56, 0.74);
    let arm = between(&mut builder.random, 0.09, 0.22);
    let depth = between(&mut builder.random, 0.82, 0.96);
    let seat = between(&mut builder.random, 0.42, 0.46);
    let back_top = between(&mut builder.random, 0.74, 0.9);
    let arm_top = between(&mut builder.random, 0.52, 0.66);
    let soft = between(&mut builder.random, 0.02, 0.06);
    let width = seat_width * seats as f32 + 2.0 * arm;
    let half = 0.5 * width;
    let legs_m = between(&mut builder.random, 0.04, 0.14);
    let mut shape = Shape::default();
    for x in [-half + 0.07, half - 0.07] {
        for z in [0.08, depth - 0.08] {
            shape.bar(Vec3::new(x, 0.0, z), Vec3::new(x, legs_m + 0.02, z), [0.015, 0.022], 10, foot);
        }
    }
    let low = legs_m;
    shape.rounded(Vec3::new(-half, low, 0.0), Vec3::new(half, seat - 0.13, depth), 0.02, 1, cloth);
    for side in [-1.0f32, 1.0] {
        let [a, b] = [side * half, side * (half - arm)];
        let (min, max) = (Vec3::new(a.min(b), low, 0.0), Vec3::new(a.max(b), arm_top, depth));
        shape.rounded(min, max, soft.min(0.4 * arm), 3, cloth);
    }
    let (min, max) = (Vec3::new(-half + 0.5 * arm, low, 0.0), Vec3::new(half - 0.5 * arm, back_top - 0.06, 0.2));
    shape.rounded(min, max, soft, 3, cloth);
    let gap = 0.004;
    for k in 0..seats {
        let [a, b] = [0.0, 1.0].map(|e| -half + arm + seat_width * (k as f32 + e));
        let (min, max) = (Vec3::new(a + gap, seat - 0.14, 0.16), Vec3::new(b - gap, seat - 0.02, depth + 0.01));
        shape.bulging(min, max, 0.045, 3, 0.03, cloth);
        let mut cushion = Shape::default();
        let (w, h) = (0.5 * (b - a) - gap, back_top - seat + 0.02);
        cushion.rounded(Vec3::new(-w, 0.0, -0.085), Vec3::new(w, h, 0.085), 0.06, 3, cloth);
        let tilt = Quat::from_rotation_x(-0.2);
        shape.add(&cushion, tilt, Vec3::new(0.5 * (a + b), seat - 0.02, 0.3));
    }
    let second = builder.palette.paint(Finish::SecondUpholstery);
    let linen = builder.palette.paint(Finish::Linen);
    for k in 0..count(&mut builder.random, 0, seats + 1) {
        let size = between(&mut builder.random, 0.38, 0.5);
        let paint = if chance(&mut builder.random, 0.6) { second } else { linen };
        let place = (k as f32 + between(&mut builder.random, 0.2, 0.8)) / (seats + 1) as f32;
        let x = (-half + arm + 0.5 * size) + place * (width - 2.0 * arm - size);
        throw_cushion(builder, &mut shape, Vec3::new(x, seat, 0.44), size, paint);
    }
    if !leather && chance(&mut builder.random, 0.2) {
        blanket(builder, &mut shape, half - arm, arm_top, depth);
    }
    Piece::new(if seats == 1 { "armchair" } else { "sofa" }, shape).with_front(0.35)
}

/// Adds a cushion that leans against the back.
fn throw_cushion(builder: &mut RoomBuilder, shape: &mut Shape, at: Vec3, size: f32, paint: Paint) {
    let mut cushion = Shape::default();
    let thick = between(&mut builder.random, 0.11, 0.17);
    cushion.pillow(Vec3::ZERO, Vec3::new(size, thick, size), 10, paint.tinted(lighter(builder)));
    let lean = Quat::from_rotation_x(1.15) * Quat::from_rotation_y(between(&mut builder.random, -0.15, 0.15));
    shape.add(&cushion, lean, at + Vec3::Y * (0.46 * size - 0.02));
}

fn lighter(builder: &mut RoomBuilder) -> [f32; 3] {
    [between(&mut builder.random, 0.6, 1.0); 3]
}

/// Adds a blanket over an armrest.
fn blanket(builder: &mut RoomBuilder, shape: &mut Shape, inner: f32, top: f32, depth: f32) {
    let paint = builder.palette.paint(Finish::SecondUpholstery).tinted(lighter(builder));
    let first = shape.triangles.len();
    let wide = between(&mut builder.random, 0.25, 0.45);
    let z0 = between(&mut builder.random, 0.25, depth - wide - 0.05);
    let drop = between(&mut builder.random, 0.1, 0.2);
    shape.grid([16, 6], Vec2::new(0.6, wide), paint, |u, v| {
        // Up the inner side, then a quarter circle over the arm.
        let r = 0.05;
        let s = u * (drop + 0.1);
        let z = z0 + (1.0 - v) * wide + 0.01 * (14.0 * u).sin();
        let fold = 0.004 * (25.0 * v + 6.0 * u).sin();
        if s < drop {
            Vec3::new(inner - 0.006 + fold, top - r - drop + s, z)
        } else {
            let angle = ((s - drop) / r).min(std::f32::consts::FRAC_PI_2);
            Vec3::new(inner + r - 0.006 - (r - fold) * angle.cos(), top - r + 0.008 + r * angle.sin(), z)
        }
    });
    shape.close_part(first);
}

/// Builds a low seat without a back.
pub(super) fn pouf(builder: &mut RoomBuilder) -> Piece {
    let cloth = builder.palette.paint(Finish::SecondUpholstery);
    let (r, h) = (between(&mut builder.random, 0.2, 0.3), between(&mut builder.random, 0.36, 0.45));
    let mut shape = Shape::default();
    let profile = [[0.9 * r, 0.0], [r, 0.04], [1.03 * r, 0.5 * h], [r, h - 0.04], [0.88 * r, h - 0.005], [0.6 * r, h]];
    shape.lathe(Vec3::ZERO, &profile, 28, cloth);
    Piece::new("pouf", shape)
}
