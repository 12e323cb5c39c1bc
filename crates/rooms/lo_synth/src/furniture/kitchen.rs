//! Kitchen lines: base units with a worktop at 90 cm, sink, hob, oven, wall units and a refrigerator.

use lo_geometry::{Vec2, Vec3};

use super::tables::handle;
use crate::chance::{between, chance, count};
use crate::palette::Finish;
use crate::photometry::{self, Glow};
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::{Paint, Shape};

const UNIT_M: f32 = 0.6;
const DEPTH_M: f32 = 0.6;
const TOP_M: f32 = 0.9;

/// Materials shared by all units.
#[derive(Clone, Copy)]
struct KitchenMaterials {
    front: Paint,
    top: Paint,
    metal: Paint,
    black: Paint,
}

/// Builds a line of `units` 60 cm wide; back at z = 0. `upper` adds wall units, `strip` a light strip below them.
pub(super) fn line(builder: &mut RoomBuilder, units: usize, upper: bool, strip: bool) -> Piece {
    let materials = KitchenMaterials {
        front: builder.palette.paint(Finish::Fronts),
        top: builder.palette.paint(Finish::Worktop),
        metal: builder.palette.paint(Finish::Metal),
        black: builder.palette.paint(Finish::Gloss).tinted([0.03, 0.03, 0.033]),
    };
    let tall = upper && units >= 4 && chance(&mut builder.random, 0.75);
    let base = if tall { units - 1 } else { units };
    let width = units as f32 * UNIT_M;
    let left = -0.5 * width;
    let hob = count(&mut builder.random, 1, base.max(3) - 2).min(base - 1);
    let sink = if hob + 2 < base { hob + 2 } else { hob.saturating_sub(1) };
    let mut shape = Shape::default();
    let mut piece = Piece::new("kitchen line", Shape::default());
    let end = left + base as f32 * UNIT_M;
    shape.cuboid(Vec3::new(left, 0.0, 0.0), Vec3::new(end, 0.1, DEPTH_M - 0.06), materials.black);
    for k in 0..base {
        let x = left + k as f32 * UNIT_M;
        base_unit(builder, &mut shape, x, materials, k == hob, k == sink);
        if k != hob && k != sink {
            let center = Vec3::new(x + 0.5 * UNIT_M, TOP_M, 0.32);
            piece = piece.with_surface(center, Vec2::new(0.27, 0.22), if upper { 0.45 } else { 0.8 });
        }
    }
    worktop(&mut shape, [left, end], left + sink as f32 * UNIT_M, materials);
    hob_plates(builder, &mut shape, left + hob as f32 * UNIT_M, materials);
    let tiles = builder.palette.paint(Finish::WallTiles);
    let high = if upper { 1.45 } else { TOP_M + 0.1 };
    shape.cuboid(Vec3::new(left, TOP_M, 0.0), Vec3::new(end, high, 0.009), tiles);
    if upper {
        wall_units(builder, &mut shape, [left, base as f32], hob, materials);
        if strip {
            under_light(builder, &mut shape, [left, end]);
        }
    }
    if tall {
        refrigerator(builder, &mut shape, end, materials);
    }
    piece.shape = shape;
    piece.with_front(0.8)
}

fn base_unit(
    builder: &mut RoomBuilder,
    shape: &mut Shape,
    x: f32,
    materials: KitchenMaterials,
    oven: bool,
    sink: bool,
) {
    let (a, b) = (x + 0.002, x + UNIT_M - 0.002);
    let body_top = if sink { 0.66 } else { TOP_M - 0.04 };
    shape.cuboid(Vec3::new(x, 0.1, 0.0), Vec3::new(x + UNIT_M, body_top, DEPTH_M - 0.03), materials.front);
    let front = |shape: &mut Shape, y: [f32; 2], paint: Paint| {
        shape.board(Vec3::new(a, y[0], DEPTH_M - 0.03), Vec3::new(b, y[1], DEPTH_M - 0.011), paint);
    };
    let z = DEPTH_M - 0.011;
    let middle = x + 0.5 * UNIT_M;
    if oven {
        front(shape, [0.12, 0.74], materials.black);
        front(shape, [0.745, TOP_M - 0.045], materials.metal);
        shape.cuboid(Vec3::new(a + 0.06, 0.22, z), Vec3::new(b - 0.06, 0.6, z + 0.002), materials.black);
        handle(shape, Vec3::new(middle, 0.68, z), 0.42, materials.metal);
        for k in 0..4 {
            let at = Vec3::new(a + 0.12 + 0.11 * k as f32, 0.8, z);
            shape.bar(at, at + Vec3::Z * 0.02, [0.018; 2], 12, materials.black);
        }
    } else if !sink && chance(&mut builder.random, 0.35) {
        for [low, high] in [[0.12, 0.4], [0.404, 0.68], [0.684, TOP_M - 0.045]] {
            front(shape, [low, high], materials.front);
            handle(shape, Vec3::new(middle, high - 0.05, z), 0.16, materials.metal);
        }
    } else {
        front(shape, [0.12, TOP_M - 0.045], materials.front);
        handle(shape, Vec3::new(middle, TOP_M - 0.1, z), 0.16, materials.metal);
    }
}

/// Adds the worktop with a cut-out, the basin and the tap.
fn worktop(shape: &mut Shape, [left, right]: [f32; 2], sink: f32, materials: KitchenMaterials) {
    let (hole_x, hole_z) = ([sink + 0.06, sink + 0.54], [0.12, 0.5]);
    let (low, high) = (TOP_M - 0.04, TOP_M);
    let mut slab = |x: [f32; 2], z: [f32; 2]| {
        if x[1] - x[0] > 0.002 {
            shape.cuboid(Vec3::new(x[0], low, z[0]), Vec3::new(x[1], high, z[1]), materials.top);
        }
    };
    let edge = DEPTH_M + 0.005;
    slab([left, hole_x[0]], [0.0, edge]);
    slab([hole_x[1], right], [0.0, edge]);
    slab(hole_x, [0.0, hole_z[0]]);
    slab(hole_x, [hole_z[1], edge]);
    let floor = high - 0.18;
    let wall = 0.004;
    let m = materials.metal;
    shape.cuboid(Vec3::new(hole_x[0], floor - wall, hole_z[0]), Vec3::new(hole_x[1], floor, hole_z[1]), m);
    let rim = high + 0.003;
    for [a, b] in [[hole_x[0] - 0.01, hole_x[0] + wall], [hole_x[1] - wall, hole_x[1] + 0.01]] {
        shape.cuboid(Vec3::new(a.max(hole_x[0]), floor, hole_z[0]), Vec3::new(b.min(hole_x[1]), rim, hole_z[1]), m);
    }
    for [a, b] in [[hole_z[0], hole_z[0] + wall], [hole_z[1] - wall, hole_z[1]]] {
        shape.cuboid(Vec3::new(hole_x[0], floor, a), Vec3::new(hole_x[1], rim, b), m);
    }
    tap(shape, Vec3::new(0.5 * (hole_x[0] + hole_x[1]), high, 0.07), 0.28, m);
}

/// Adds a tap: a bent pipe with a lever.
pub(super) fn tap(shape: &mut Shape, at: Vec3, height: f32, paint: Paint) {
    shape.bar(at, at + Vec3::Y * 0.03, [0.026, 0.022], 12, paint);
    let reach = 0.55 * height;
    let points: Vec<Vec3> = (0..=6)
        .map(|k| {
            let angle = std::f32::consts::PI * k as f32 / 6.0;
            at + Vec3::new(0.0, height - 0.5 * reach + 0.5 * reach * angle.sin(), 0.5 * reach * (1.0 - angle.cos()))
        })
        .collect();
    let mut path = vec![at];
    path.extend(points);
    shape.pipe(&path, 0.011, 8, paint);
    shape.bar(at + Vec3::Y * 0.05, at + Vec3::new(0.06, 0.08, 0.0), [0.007; 2], 6, paint);
}

fn hob_plates(builder: &mut RoomBuilder, shape: &mut Shape, x: f32, materials: KitchenMaterials) {
    shape.cuboid(Vec3::new(x + 0.02, TOP_M, 0.06), Vec3::new(x + 0.58, TOP_M + 0.005, 0.54), materials.black);
    let gas = chance(&mut builder.random, 0.4);
    for (dx, dz, r) in [(0.16, 0.18, 0.075), (0.43, 0.18, 0.09), (0.16, 0.41, 0.1), (0.43, 0.41, 0.075)] {
        let at = Vec3::new(x + dx, TOP_M + 0.005, dz);
        if gas {
            shape.lathe(at, &[[0.4 * r, 0.0], [0.4 * r, 0.018], [0.3 * r, 0.022]], 14, materials.black);
            for turn in 0..2 {
                let along = if turn == 0 { Vec3::X } else { Vec3::Z } * r;
                let lift = Vec3::Y * 0.03;
                shape.bar(at - along + lift, at + along + lift, [0.005; 2], 6, materials.black);
            }
        } else {
            shape.lathe(at, &[[r, 0.0], [r, 0.0008]], 24, materials.metal.tinted([0.25; 3]));
        }
    }
    if chance(&mut builder.random, 0.45) {
        // Pot.
        let lift = if gas { 0.037 } else { 0.007 };
        let at = Vec3::new(x + 0.16, TOP_M + lift, 0.41);
        let (r, h) = (0.1, between(&mut builder.random, 0.08, 0.16));
        let profile = [[r, 0.0], [r, h], [r + 0.004, h], [0.97 * r, h + 0.012], [0.03, h + 0.03], [0.015, h + 0.06]];
        shape.lathe(at, &profile, 24, materials.metal);
    }
}

fn wall_units(
    builder: &mut RoomBuilder,
    shape: &mut Shape,
    [left, units]: [f32; 2],
    hob: usize,
    materials: KitchenMaterials,
) {
    let (low, depth) = (1.45, 0.35);
    let high = (builder.plan.height_m - 0.03).min(between(&mut builder.random, 2.05, 2.2));
    let open = chance(&mut builder.random, 0.2).then(|| count(&mut builder.random, 0, units as usize - 1));
    for k in 0..units as usize {
        let x = left + k as f32 * UNIT_M;
        if k == hob {
            // Extractor hood: body and flue.
            shape.rounded(
                Vec3::new(x + 0.005, low + 0.1, 0.0),
                Vec3::new(x + 0.595, low + 0.18, 0.48),
                0.006,
                1,
                materials.metal,
            );
            shape.board(Vec3::new(x + 0.16, low + 0.18, 0.0), Vec3::new(x + 0.44, high, 0.28), materials.metal);
            continue;
        }
        if open == Some(k) {
            for y in [low, 0.5 * (low + high), high - 0.018] {
                shape.board(Vec3::new(x, y, 0.0), Vec3::new(x + UNIT_M, y + 0.018, depth), materials.front);
            }
            continue;
        }
        shape.cuboid(Vec3::new(x, low, 0.0), Vec3::new(x + UNIT_M, high, depth - 0.02), materials.front);
        let (min, max) = (Vec3::new(x + 0.002, low - 0.01, depth - 0.02), Vec3::new(x + UNIT_M - 0.002, high, depth));
        shape.board(min, max, materials.front);
        handle(shape, Vec3::new(x + 0.5, low + 0.04, depth), 0.12, materials.metal);
    }
}

/// Adds an LED strip, switched on, under the wall units.
fn under_light(builder: &mut RoomBuilder, shape: &mut Shape, [left, right]: [f32; 2]) {
    let paint = builder.palette.paint(Finish::Metal);
    shape.cuboid(Vec3::new(left + 0.05, 1.439, 0.05), Vec3::new(right - 0.05, 1.448, 0.075), paint);
    let first = shape.triangles.len();
    shape.cuboid(Vec3::new(left + 0.05, 1.435, 0.054), Vec3::new(right - 0.05, 1.4389, 0.071), paint);
    let glow = Glow { flux_lm: 500.0 * (right - left), kelvin: between(&mut builder.random, 2700.0, 4000.0) };
    photometry::emit_from(&mut builder.palette, shape, first, &glow);
    builder.lamps += 1;
    builder.lamps_on += 1;
    builder.flux_lm += glow.flux_lm;
}

fn refrigerator(builder: &mut RoomBuilder, shape: &mut Shape, x: f32, materials: KitchenMaterials) {
    let height = between(&mut builder.random, 1.75, 2.02);
    let paint = if chance(&mut builder.random, 0.5) { materials.metal } else { builder.palette.paint(Finish::Gloss) };
    let (a, b) = (x + 0.005, x + UNIT_M - 0.005);
    shape.board(Vec3::new(a, 0.0, 0.02), Vec3::new(b, height, 0.58), paint);
    let split = height * between(&mut builder.random, 0.3, 0.65);
    for [low, high] in [[0.05, split], [split + 0.008, height]] {
        shape.rounded(Vec3::new(a, low, 0.585), Vec3::new(b, high, 0.64), 0.012, 2, paint);
    }
    for [low, high] in [[split - 0.4, split - 0.04], [split + 0.05, split + 0.4]] {
        let x = a + 0.05;
        shape.bar(
            Vec3::new(x, low, 0.675),
            Vec3::new(x, high.min(height - 0.05), 0.675),
            [0.009; 2],
            8,
            materials.metal,
        );
        for y in [low + 0.02, high.min(height - 0.05) - 0.02] {
            shape.bar(Vec3::new(x, y, 0.63), Vec3::new(x, y, 0.675), [0.006; 2], 6, materials.metal);
        }
    }
}
