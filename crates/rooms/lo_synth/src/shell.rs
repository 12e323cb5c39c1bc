//! The shell of a room: floor, ceiling, walls with openings, skirting boards and cornices.

use lo_geometry::{Quat, Vec2, Vec3};

use crate::chance::{between, chance, count};
use crate::palette::{Finish, Mood};
use crate::plan::{Plan, Wall};
use crate::room_builder::{RoomBuilder, Support};
use crate::solids::{Paint, Shape};

/// Builds the shell and leaves doors and windows open.
pub(crate) fn build(builder: &mut RoomBuilder) {
    let floor = builder.palette.paint(Finish::Floor);
    let ceiling = builder.palette.paint(Finish::Ceiling);
    let style = builder.palette.style();
    let plain = builder.palette.paint(if style.wet { Finish::WallTiles } else { Finish::Wall });
    let accent = if style.mood != Mood::Dark && !style.wet && chance(&mut builder.random, 0.25) {
        Some(count(&mut builder.random, 0, builder.plan.walls.len() - 1))
    } else {
        None
    };
    let upper = builder.palette.paint(Finish::Wall);
    // Bathrooms are tiled up to this height, or completely.
    let tiled_m =
        if style.wet && chance(&mut builder.random, 0.6) { between(&mut builder.random, 1.2, 2.1) } else { 99.0 };
    let mut shape = Shape::default();
    for [a, b] in &builder.plan.rectangles {
        let corner = |x: f32, z: f32| Vec3::new(x, 0.0, z);
        shape.polygon(&[corner(a.x, b.y), corner(b.x, b.y), corner(b.x, a.y), corner(a.x, a.y)], floor);
    }
    build_ceiling(&mut shape, &builder.plan, ceiling);
    for (index, wall) in builder.plan.walls.iter().enumerate() {
        let paint = if accent == Some(index) { builder.palette.paint(Finish::AccentWall) } else { plain };
        build_wall(&mut shape, &builder.plan, wall, [paint, upper], tiled_m);
    }
    let first = 0;
    shape.close_part(first);
    builder.add_shape("shell", Support::Building, &shape, Quat::IDENTITY, Vec3::ZERO);
    if !style.wet {
        skirting(builder);
    }
    if builder.plan.slope.is_none() && builder.plan.height_m > 2.55 && !style.sober && chance(&mut builder.random, 0.25)
    {
        cornice(builder);
    }
}

fn build_ceiling(shape: &mut Shape, plan: &Plan, paint: Paint) {
    for [a, b] in &plan.rectangles {
        let axis = plan.slope.map_or(0, |slope| slope.axis);
        let mut lines = vec![a[axis]];
        lines.extend(plan.bends());
        lines.push(b[axis]);
        for pair in lines.windows(2) {
            let (mut low, mut high) = (*a, *b);
            low[axis] = pair[0];
            high[axis] = pair[1];
            // Adjacent strips share the height at a bend.
            let corner = |x: f32, z: f32| Vec3::new(x, plan.ceiling(Vec2::new(x, z)), z);
            let corners = [corner(low.x, low.y), corner(high.x, low.y), corner(high.x, high.y), corner(low.x, high.y)];
            shape.polygon(&corners, paint);
        }
    }
}

/// Builds a wall from columns between the edges of its openings and the bends of the ceiling.
fn build_wall(shape: &mut Shape, plan: &Plan, wall: &Wall, [paint, upper]: [Paint; 2], tiled_m: f32) {
    let mut lines = vec![0.0, wall.length_m];
    for opening in &wall.openings {
        lines.extend(opening.s);
    }
    if let Some(slope) = plan.slope {
        let rate = wall.along[slope.axis];
        if rate.abs() > 0.5 {
            lines.extend(plan.bends().iter().map(|bend| (bend - wall.start[slope.axis]) / rate));
        }
    }
    lines.sort_by(f32::total_cmp);
    lines.dedup_by(|a, b| (*a - *b).abs() < 1e-5);
    for pair in lines.windows(2) {
        let [left, right] = [pair[0], pair[1]];
        let top = |s: f32| plan.ceiling(wall.start + wall.along * s);
        let middle = 0.5 * (left + right);
        let mut holes: Vec<[f32; 2]> =
            wall.openings.iter().filter(|o| o.s[0] < middle && middle < o.s[1]).map(|o| o.h).collect();
        holes.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut low = 0.0;
        let mut piece = |from: f32, to: [f32; 2], paint: Paint| {
            if to[0].max(to[1]) - from > 1e-5 {
                wall_piece(shape, wall, [left, right], from, to, paint);
            }
        };
        for [from, to] in holes.into_iter().map(Some).chain([None]).map(|h| h.unwrap_or([f32::INFINITY; 2])) {
            let end = [top(left).min(from), top(right).min(from)];
            if end[0].min(end[1]) > tiled_m && low < tiled_m {
                piece(low, [tiled_m; 2], paint);
                piece(tiled_m, end, upper);
            } else {
                piece(low, end, if low >= tiled_m { upper } else { paint });
            }
            low = to;
        }
    }
}

/// Adds one quadrilateral of a wall with a level lower edge. Texture coordinates are continuous along the wall.
fn wall_piece(shape: &mut Shape, wall: &Wall, [left, right]: [f32; 2], low: f32, top: [f32; 2], paint: Paint) {
    let corners = [
        wall.point(left, low, 0.0),
        wall.point(right, low, 0.0),
        wall.point(right, top[1], 0.0),
        wall.point(left, top[0], 0.0),
    ];
    let first = shape.uvs.len();
    shape.polygon(&corners, paint);
    for (uv, p) in shape.uvs[first..].iter_mut().zip(corners) {
        *uv = [(Vec2::new(p.x, p.z) - wall.start).dot(wall.along), -p.y];
    }
}

/// Intervals of a wall between its doors.
fn between_doors(wall: &Wall, margin: f32) -> Vec<[f32; 2]> {
    let mut doors: Vec<[f32; 2]> = wall.openings.iter().filter(|o| o.h[0] < 0.1).map(|o| o.s).collect();
    doors.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut intervals = Vec::new();
    let mut from = 0.0;
    for [start, end] in doors {
        intervals.push([from, start - margin]);
        from = end + margin;
    }
    intervals.push([from, wall.length_m]);
    intervals.retain(|[a, b]| b - a > 0.02);
    intervals
}

fn skirting(builder: &mut RoomBuilder) {
    let paint = builder.palette.paint(Finish::Trim);
    let (height, depth) = (between(&mut builder.random, 0.05, 0.11), between(&mut builder.random, 0.01, 0.016));
    for index in 0..builder.plan.walls.len() {
        let mut shape = Shape::default();
        for [a, b] in between_doors(&builder.plan.walls[index], 0.09) {
            shape.cuboid(Vec3::new(a, 0.0, 0.0), Vec3::new(b, height, depth), paint);
        }
        builder.add_to_wall("skirting board", Support::Building, &shape, index);
    }
}

fn cornice(builder: &mut RoomBuilder) {
    let paint = builder.palette.paint(Finish::Ceiling);
    let size = between(&mut builder.random, 0.05, 0.12);
    let top = builder.plan.height_m;
    for index in 0..builder.plan.walls.len() {
        let length = builder.plan.walls[index].length_m;
        let mut shape = Shape::default();
        // A concave moulding from the wall up to the ceiling.
        let rows = 6;
        shape.grid([1, rows], Vec2::new(length, size * 1.5), paint, |u, v| {
            let angle = v * std::f32::consts::FRAC_PI_2;
            Vec3::new(u * length, top - size + size * angle.sin(), size * (1.0 - angle.cos()))
        });
        let first = 0;
        shape.close_part(first);
        builder.add_to_wall("cornice", Support::Building, &shape, index);
    }
}
