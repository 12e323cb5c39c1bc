//! Bathroom furniture: bath, shower, washstand, toilet.

use std::f32::consts::TAU;

use lo_geometry::{Vec2, Vec3};

use super::kitchen::tap;
use crate::chance::{between, chance};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::{Paint, Shape};

/// Builds a bathtub of 170 × 75 cm, 56 cm high; long side at z = 0.
pub(super) fn bath(builder: &mut RoomBuilder) -> Piece {
    let white = builder.palette.paint(Finish::Ceramic);
    let (half, depth, high) = (Vec2::new(0.85, 0.375), 0.4, 0.56);
    let mut shape = Shape::default();
    let p = Vec3::new;
    // Four sides; the basin closes the top.
    let (a, b) = (p(-half.x, 0.0, 0.0), p(half.x, high, 0.75));
    let first = shape.triangles.len();
    shape.polygon(&[p(a.x, 0.0, b.z), p(b.x, 0.0, b.z), p(b.x, high, b.z), p(a.x, high, b.z)], white);
    shape.polygon(&[p(b.x, 0.0, a.z), p(a.x, 0.0, a.z), p(a.x, high, a.z), p(b.x, high, a.z)], white);
    shape.polygon(&[p(a.x, 0.0, a.z), p(a.x, 0.0, b.z), p(a.x, high, b.z), p(a.x, high, a.z)], white);
    shape.polygon(&[p(b.x, 0.0, b.z), p(b.x, 0.0, a.z), p(b.x, high, a.z), p(b.x, high, b.z)], white);
    basin(&mut shape, p(0.0, high, 0.375), half, half - Vec2::splat(0.06), depth, white);
    shape.close_part(first);
    let metal = builder.palette.paint(Finish::Metal);
    tap(&mut shape, p(-0.3, high, 0.03), 0.16, metal);
    Piece::new("bath", shape).with_front(0.5)
}

/// Adds a basin, open below: a rim from a rectangle of `outer` to an oval of `inner` half extents and the hollow.
fn basin(shape: &mut Shape, at: Vec3, outer: Vec2, inner: Vec2, depth: f32, paint: Paint) {
    let direction = |u: f32| Vec2::new((TAU * u).cos(), -(TAU * u).sin());
    // The hollow is a superellipse of exponent 4.
    let oval = move |u: f32| {
        let d = direction(u);
        d / (d.x.abs().powi(4) + d.y.abs().powi(4)).powf(0.25) * inner
    };
    let square = move |u: f32| {
        let d = direction(u);
        d / d.abs().max_element() * outer
    };
    let around = 2.0 * (outer.x + outer.y);
    shape.grid([64, 1], Vec2::new(around, 0.1), paint, |u, v| {
        let q = square(u).lerp(oval(u), v);
        at + Vec3::new(q.x, 0.0, q.y)
    });
    shape.grid([48, 10], Vec2::new(around, depth), paint, |u, v| {
        let (side, drop) = if v < 0.7 {
            let t = v / 0.7;
            (1.0 - 0.18 * t * t, t.powf(0.8))
        } else {
            (0.82 * (1.0 - (v - 0.7) / 0.3), 1.0 + 0.02 * (v - 0.7))
        };
        let q = oval(u) * side;
        at + Vec3::new(q.x, -depth * drop, q.y)
    });
}

/// Builds a shower with a tray of 90 × 90 cm and glass on two sides; back at z = 0.
pub(super) fn shower(builder: &mut RoomBuilder) -> Piece {
    let white = builder.palette.paint(Finish::Ceramic);
    let glass = builder.palette.paint(Finish::Glass);
    let metal = builder.palette.paint(Finish::Metal);
    let (half, deep, high) = (0.45, 0.9, 1.95);
    let mut shape = Shape::default();
    shape.rounded(Vec3::new(-half, 0.0, 0.0), Vec3::new(half, 0.05, deep), 0.01, 1, white);
    let mut sheet = |a: Vec3, b: Vec3| {
        let first = shape.triangles.len();
        shape.polygon(&[a, b, b + Vec3::Y * high, a + Vec3::Y * high], glass);
        shape.close_part(first);
    };
    sheet(Vec3::new(half - 0.02, 0.05, 0.0), Vec3::new(half - 0.02, 0.05, deep - 0.02));
    sheet(Vec3::new(-half + 0.4, 0.05, deep - 0.02), Vec3::new(half - 0.02, 0.05, deep - 0.02));
    let corner = Vec3::new(half - 0.02, 0.05, deep - 0.02);
    shape.bar(corner, corner + Vec3::Y * high, [0.008; 2], 8, metal);
    shape.pipe(&[Vec3::new(0.0, 1.0, 0.03), Vec3::new(0.0, 2.05, 0.03), Vec3::new(0.0, 2.05, 0.3)], 0.01, 8, metal);
    shape.lathe(Vec3::new(0.0, 2.02, 0.3), &[[0.11, 0.0], [0.11, 0.008], [0.02, 0.025]], 24, metal);
    shape.board(Vec3::new(-0.12, 0.98, 0.0), Vec3::new(0.12, 1.03, 0.05), metal);
    Piece::new("shower", shape).with_front(0.5)
}

/// Builds a toilet with the seat at 42 cm; cistern at z = 0.
pub(super) fn toilet(builder: &mut RoomBuilder) -> Piece {
    let white = builder.palette.paint(Finish::Ceramic);
    let metal = builder.palette.paint(Finish::Metal);
    let mut shape = Shape::default();
    shape.rounded(Vec3::new(-0.19, 0.36, 0.0), Vec3::new(0.19, 0.78, 0.17), 0.03, 2, white);
    shape.bar(Vec3::new(0.0, 0.779, 0.085), Vec3::new(0.0, 0.79, 0.085), [0.025; 2], 14, metal);
    let mut bowl = Shape::default();
    let profile = [[0.11, 0.0], [0.1, 0.08], [0.12, 0.2], [0.17, 0.34], [0.18, 0.39], [0.175, 0.4]];
    bowl.lathe(Vec3::ZERO, &profile, 28, white);
    bowl.lathe(Vec3::ZERO, &[[0.185, 0.402], [0.188, 0.418], [0.178, 0.428], [0.1, 0.432]], 28, white);
    stretch(&mut bowl, Vec3::new(1.0, 1.0, 1.35));
    shape.add_at(&bowl, Vec3::Z * 0.41);
    shape.rounded(Vec3::new(-0.1, 0.0, 0.02), Vec3::new(0.1, 0.38, 0.3), 0.03, 2, white);
    Piece::new("toilet", shape).with_front(0.5)
}

/// Scales an unrotated shape along the axes.
fn stretch(shape: &mut Shape, factor: Vec3) {
    for p in &mut shape.positions {
        *p *= factor;
    }
    for n in &mut shape.normals {
        *n = (*n / factor).normalize();
    }
}

/// Builds a washstand: a basin on a cupboard, 83 cm high.
pub(super) fn washstand(builder: &mut RoomBuilder) -> Piece {
    let white = builder.palette.paint(Finish::Ceramic);
    let front = builder.palette.paint(Finish::Fronts);
    let metal = builder.palette.paint(Finish::Metal);
    let half = between(&mut builder.random, 0.3, 0.55);
    let depth = 0.48;
    let mut shape = Shape::default();
    let low = 0.3;
    shape.board(Vec3::new(-half, low, 0.0), Vec3::new(half, 0.8, depth - 0.02), front);
    shape.board(Vec3::new(-half + 0.002, low + 0.01, depth - 0.02), Vec3::new(half - 0.002, 0.79, depth), front);
    for x in [-half + 0.05, half - 0.05] {
        for z in [0.05, depth - 0.05] {
            shape.bar(Vec3::new(x, 0.0, z), Vec3::new(x, low + 0.01, z), [0.015; 2], 8, metal);
        }
    }
    shape.rounded(Vec3::new(-half, 0.8, 0.0), Vec3::new(half, 0.825, depth + 0.005), 0.005, 1, white);
    let vessel =
        [[0.08, 0.0], [0.15, 0.02], [0.2, 0.09], [0.2, 0.1], [0.19, 0.1], [0.14, 0.03], [0.05, 0.015], [0.0, 0.014]];
    let mut bowl = Shape::default();
    bowl.lathe(Vec3::ZERO, &vessel, 32, white);
    shape.add_at(&bowl, Vec3::new(0.0, 0.825, 0.25));
    tap(&mut shape, Vec3::new(0.0, 0.825, 0.03), 0.26, metal);
    let piece = Piece::new("washstand", shape).with_front(0.5);
    if half > 0.42 && chance(&mut builder.random, 0.8) {
        let center = Vec3::new(half - 0.12, 0.825, 0.25);
        piece.with_surface(center, Vec2::new(0.09, 0.16), 0.4)
    } else {
        piece
    }
}
