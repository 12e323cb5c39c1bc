//! Doors: linings, architraves, leaves, handles, and the hallway behind an open door.

use lo_geometry::{Quat, Vec2, Vec3};

use crate::chance::{between, chance};
use crate::occupancy::{Footprint, rotated_yaw};
use crate::palette::Finish;
use crate::photometry::{self, Glow};
use crate::plan::{Opening, OpeningKind};
use crate::room_builder::{RoomBuilder, Support};
use crate::solids::{Paint, Shape};
use crate::windows::reveal;

/// Builds all doors.
pub(crate) fn build(builder: &mut RoomBuilder) {
    let glazed = chance(&mut builder.random, 0.12);
    for index in 0..builder.plan.walls.len() {
        let openings = builder.plan.walls[index].openings.clone();
        for opening in openings.iter().filter(|o| !o.is_window()) {
            reveal(builder, index, opening);
            match opening.kind {
                OpeningKind::OpenDoor { leaf, lit } => {
                    hallway(builder, index, opening, lit);
                    if leaf {
                        architrave(builder, index, opening);
                        open_leaf(builder, index, opening, glazed);
                    }
                }
                _ => {
                    architrave(builder, index, opening);
                    closed_leaf(builder, index, opening);
                }
            }
        }
    }
}

/// Adds the boards around an opening.
fn architrave(builder: &mut RoomBuilder, wall: usize, opening: &Opening) {
    let paint = builder.palette.paint(Finish::DoorLeaf);
    let ([a, b], top) = (opening.s, opening.h[1]);
    let (wide, thick) = (0.07, 0.018);
    let mut shape = Shape::default();
    for [x0, x1] in [[a - wide, a + 0.008], [b - 0.008, b + wide]] {
        shape.board(Vec3::new(x0, 0.0, 0.0), Vec3::new(x1, top + wide, thick), paint);
    }
    shape.board(Vec3::new(a, top - 0.008, 0.0), Vec3::new(b, top + wide, thick), paint);
    builder.add_to_wall("architrave", Support::Building, &shape, wall);
}

/// Builds a leaf with panels and handles: hinge at x = 0, z from −0.04 to 0.
fn leaf(width: f32, height: f32, panels: usize, paint: Paint, metal: Paint) -> Shape {
    let mut shape = Shape::default();
    shape.board(Vec3::new(0.0, 0.0, -0.04), Vec3::new(width, height, 0.0), paint);
    for k in 0..panels {
        let span = (height - 0.35) / panels as f32;
        let low = 0.18 + k as f32 * span;
        for [z0, z1] in [[-0.004, 0.007], [-0.047, -0.036]] {
            let (min, max) = (Vec3::new(0.14, low, z0), Vec3::new(width - 0.14, low + span - 0.1, z1));
            shape.rounded(min, max, 0.006, 1, paint);
        }
    }
    for side in [1.0f32, -1.0] {
        let z = |out: f32| if side > 0.0 { out } else { -0.04 - out };
        let x = width - 0.06;
        let (plate0, plate1) =
            (Vec3::new(x - 0.02, 0.95, z(0.0).min(z(0.006))), Vec3::new(x + 0.02, 1.13, z(0.0).max(z(0.006))));
        shape.board(plate0, plate1, metal);
        shape.bar(Vec3::new(x, 1.05, z(0.0)), Vec3::new(x, 1.05, z(0.05)), [0.009; 2], 8, metal);
        shape.bar(Vec3::new(x + 0.01, 1.05, z(0.05)), Vec3::new(x - 0.12, 1.05, z(0.05)), [0.009; 2], 8, metal);
    }
    shape
}

fn closed_leaf(builder: &mut RoomBuilder, wall: usize, opening: &Opening) {
    let (paint, metal) = (builder.palette.paint(Finish::DoorLeaf), builder.palette.paint(Finish::Metal));
    let panels = crate::chance::count(&mut builder.random, 0, 3);
    // Slightly wider than the opening, so that no light leaks.
    let door = leaf(opening.width_m() + 0.012, opening.h[1] + 0.008, panels, paint, metal);
    let mut shape = Shape::default();
    shape.add_at(&door, Vec3::new(opening.s[0] - 0.006, 0.0, -0.03));
    builder.add_to_wall("door", Support::Building, &shape, wall);
}

/// Adds a leaf swung into the room at an angle at which it fits.
fn open_leaf(builder: &mut RoomBuilder, wall: usize, opening: &Opening, glazed: bool) {
    let (paint, metal) = (builder.palette.paint(Finish::DoorLeaf), builder.palette.paint(Finish::Metal));
    let panels = if glazed { 0 } else { crate::chance::count(&mut builder.random, 0, 3) };
    let width = opening.width_m() - 0.01;
    let door = leaf(width, opening.h[1] - 0.012, panels, paint, metal);
    let (origin, base) = {
        let w = &builder.plan.walls[wall];
        // Clear of the architrave, as far as the hinge pin protrudes.
        (w.point(opening.s[0] + 0.004, 0.006, 0.024), w.yaw_rad())
    };
    for _ in 0..8 {
        let angle = between(&mut builder.random, 60.0_f32, 100.0).to_radians();
        let yaw = base - angle;
        let at = Vec2::new(origin.x, origin.z);
        let (min, max) = door.bounds();
        let footprint = Footprint::of_box(min, max, yaw, at);
        // The kept-free volume in front of its own door may overlap the leaf.
        if builder.plan.contains(at + rotated_yaw(Vec2::new(width, 0.0), yaw), 0.05)
            && builder.occupancy.is_clear(&builder.plan, &footprint.expanded(-0.03), [0.0, opening.h[1]])
            && builder.occupancy.leaves_passages(&footprint, [0.0, opening.h[1]])
        {
            builder.occupancy.occupy(footprint, [0.0, opening.h[1]]);
            builder.add_shape("open door", Support::Building, &door, Quat::from_rotation_y(yaw), origin);
            return;
        }
    }
}

/// Adds a plain hallway behind an open door, with a lamp if `lit`.
fn hallway(builder: &mut RoomBuilder, wall: usize, opening: &Opening, lit: bool) {
    let w = &builder.plan.walls[wall];
    let (length, t) = (w.length_m, w.thickness_m);
    let mut left = (opening.s[0] - between(&mut builder.random, 0.15, 1.5)).max(0.0);
    let mut right = (opening.s[1] + between(&mut builder.random, 0.15, 1.5)).min(length);
    // Must not reach a window or another door.
    for other in &w.openings {
        if other.s[1] < opening.s[0] {
            left = left.max(other.s[1] + 0.05);
        } else if other.s[0] > opening.s[1] {
            right = right.min(other.s[0] - 0.05);
        }
    }
    let back = -t - between(&mut builder.random, 1.1, 2.6);
    let high = between(&mut builder.random, 2.3, 2.7).max(opening.h[1] + 0.1);
    let (walls, floor, ceiling) = (
        builder.palette.paint(Finish::Wall),
        builder.palette.paint(Finish::HallFloor),
        builder.palette.paint(Finish::Ceiling),
    );
    let p = Vec3::new;
    let mut shape = Shape::default();
    shape.polygon(&[p(left, 0.0, -t), p(right, 0.0, -t), p(right, 0.0, back), p(left, 0.0, back)], floor);
    shape.polygon(&[p(left, high, back), p(right, high, back), p(right, high, -t), p(left, high, -t)], ceiling);
    shape.polygon(&[p(left, 0.0, back), p(right, 0.0, back), p(right, high, back), p(left, high, back)], walls);
    shape.polygon(&[p(left, 0.0, -t), p(left, 0.0, back), p(left, high, back), p(left, high, -t)], walls);
    shape.polygon(&[p(right, 0.0, back), p(right, 0.0, -t), p(right, high, -t), p(right, high, back)], walls);
    // The back of the room's wall around the opening.
    let [a, b] = opening.s;
    let top = opening.h[1];
    let mut front = |x: [f32; 2], y: [f32; 2]| {
        if x[1] - x[0] > 1e-4 {
            shape.polygon(&[p(x[1], y[0], -t), p(x[0], y[0], -t), p(x[0], y[1], -t), p(x[1], y[1], -t)], walls);
        }
    };
    front([left, a], [0.0, high]);
    front([b, right], [0.0, high]);
    front([a, b], [top, high]);
    shape.close_part(0);
    builder.add_to_wall("hallway", Support::Building, &shape, wall);
    if lit {
        let flux_lm = between(&mut builder.random, 300.0, 1200.0);
        let kelvin = between(&mut builder.random, 2700.0, 4000.0);
        let mut lamp = Shape::default();
        let middle = p(between(&mut builder.random, left + 0.3, right - 0.3), high - 0.045, 0.5 * (back - t));
        let metal = builder.palette.paint(Finish::Metal);
        let first = lamp.triangles.len();
        lamp.lathe(middle - Vec3::Y * 0.02, &[[0.1, 0.0], [0.12, 0.01], [0.12, 0.03]], 16, metal);
        photometry::emit_from(&mut builder.palette, &mut lamp, first, &Glow { flux_lm, kelvin });
        lamp.lathe(middle + Vec3::Y * 0.01, &[[0.125, 0.0], [0.125, 0.034]], 16, metal);
        builder.add_to_wall("hall lamp", Support::Building, &lamp, wall);
        builder.lamps += 1;
        builder.lamps_on += 1;
        builder.flux_lm += flux_lm;
    }
}
