//! Objects on walls: pictures, mirrors, clocks, boards, wall shelves, televisions, towels.

use lo_geometry::{Vec2, Vec3};
use lo_random::RngExt;

use crate::chance::{between, chance, count, pick};
use crate::occupancy::Footprint;
use crate::palette::Finish;
use crate::room_builder::{RoomBuilder, Support};
use crate::solids::{Paint, Shape};

/// An object for a wall: centred on x = 0 and y = 0, back at z = 0.
pub(crate) struct WallObject {
    pub name: &'static str,
    pub shape: Shape,
}

/// Builds a framed panel. `whole` maps the texture once over the panel.
fn framed(builder: &mut RoomBuilder, name: &'static str, half: Vec2, content: Paint, whole: bool) -> WallObject {
    let frame = match count(&mut builder.random, 0, 3) {
        0 => builder.palette.paint(Finish::Wood),
        1 => builder.palette.paint(Finish::SecondMetal),
        2 => builder.palette.paint(Finish::Matte).tinted([0.04; 3]),
        _ => builder.palette.paint(Finish::Trim),
    };
    let (bar, thick) = (between(&mut builder.random, 0.012, 0.045), between(&mut builder.random, 0.015, 0.035));
    let mut shape = Shape::default();
    let outer = half + Vec2::splat(bar);
    for [x0, x1] in [[-outer.x, -half.x], [half.x, outer.x]] {
        shape.board(Vec3::new(x0, -outer.y, 0.002), Vec3::new(x1, outer.y, thick), frame);
    }
    for [y0, y1] in [[-outer.y, -half.y], [half.y, outer.y]] {
        shape.board(Vec3::new(-half.x, y0, 0.002), Vec3::new(half.x, y1, thick), frame);
    }
    let z = 0.6 * thick;
    shape.cuboid(Vec3::new(-half.x, -half.y, 0.002), Vec3::new(half.x, half.y, z - 0.001), frame);
    let first = (shape.triangles.len(), shape.uvs.len());
    let corners = [(-half.x, -half.y), (half.x, -half.y), (half.x, half.y), (-half.x, half.y)];
    shape.polygon(&corners.map(|(x, y)| Vec3::new(x, y, z)), content);
    if whole {
        shape.uvs[first.1..].copy_from_slice(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    }
    shape.close_part(first.0);
    WallObject { name, shape }
}

pub(super) fn picture(builder: &mut RoomBuilder) -> WallObject {
    let seed = builder.random.random();
    let (w, h) = (between(&mut builder.random, 0.12, 0.5), between(&mut builder.random, 0.14, 0.42));
    let content = builder.palette.picture(seed, w / h, None);
    framed(builder, "picture", Vec2::new(w, h), content, true)
}

pub(super) fn mirror(builder: &mut RoomBuilder) -> WallObject {
    let content = builder.palette.paint(Finish::Mirror);
    let half = Vec2::new(between(&mut builder.random, 0.2, 0.5), between(&mut builder.random, 0.3, 0.6));
    framed(builder, "mirror", half, content, false)
}

/// Builds a whiteboard or a blackboard with a rail.
pub(super) fn school_board(builder: &mut RoomBuilder) -> WallObject {
    let white = chance(&mut builder.random, 0.5);
    let content = if white {
        builder.palette.paint(Finish::Gloss).tinted([0.9; 3])
    } else {
        builder.palette.paint(Finish::Matte).tinted([0.03, 0.06, 0.045])
    };
    let half = Vec2::new(between(&mut builder.random, 1.2, 1.9), 0.6);
    let mut board = framed(builder, "school board", half, content, false);
    let metal = builder.palette.paint(Finish::Metal);
    board.shape.board(Vec3::new(-half.x, -half.y - 0.05, 0.002), Vec3::new(half.x, -half.y - 0.03, 0.08), metal);
    board
}

/// Builds a flat-screen television.
pub(super) fn television(builder: &mut RoomBuilder, half_width: f32, on: bool) -> WallObject {
    let black = builder.palette.paint(Finish::Gloss).tinted([0.02; 3]);
    let half = Vec2::new(half_width, half_width * 9.0 / 16.0);
    let mut shape = Shape::default();
    shape.board(Vec3::new(-half.x, -half.y, 0.03), Vec3::new(half.x, half.y, 0.065), black);
    shape.board(Vec3::new(-0.2, -0.12, 0.001), Vec3::new(0.2, 0.12, 0.031), black);
    screen(builder, &mut shape, half - Vec2::splat(0.01), Vec2::ZERO, 0.0655, on);
    WallObject { name: "television", shape }
}

/// Adds a screen centred at `center`, at depth `z`. White has 120–350 cd/m² if `on`.
pub(super) fn screen(builder: &mut RoomBuilder, shape: &mut Shape, half: Vec2, center: Vec2, z: f32, on: bool) {
    let content = if on {
        let seed = builder.random.random();
        let white = between(&mut builder.random, 1.2, 3.5);
        builder.lamps += 1;
        builder.lamps_on += 1;
        builder.palette.picture(seed, half.x / half.y, Some(white))
    } else {
        builder.palette.paint(Finish::Gloss).tinted([0.015; 3])
    };
    let first = (shape.triangles.len(), shape.uvs.len());
    let corners = [(-half.x, -half.y), (half.x, -half.y), (half.x, half.y), (-half.x, half.y)];
    shape.polygon(&corners.map(|(x, y)| Vec3::new(center.x + x, center.y + y, z)), content);
    shape.uvs[first.1..].copy_from_slice(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    shape.close_part(first.0);
}

pub(super) fn clock(builder: &mut RoomBuilder) -> WallObject {
    let r = between(&mut builder.random, 0.11, 0.2);
    let rim = builder.palette.paint(Finish::SecondMetal);
    let face = builder.palette.paint(Finish::Matte);
    let black = face.tinted([0.03; 3]);
    let mut shape = Shape::default();
    shape.bar(Vec3::Z * 0.002, Vec3::Z * 0.035, [r; 2], 32, rim);
    shape.bar(Vec3::Z * 0.03, Vec3::Z * 0.037, [0.92 * r; 2], 32, face);
    for (angle, long) in [
        (between(&mut builder.random, 0.0, std::f32::consts::TAU), 0.5),
        (between(&mut builder.random, 0.0, std::f32::consts::TAU), 0.8),
    ] {
        let tip = Vec3::new(angle.sin(), angle.cos(), 0.0) * long * r;
        shape.bar(Vec3::Z * 0.04, tip + Vec3::Z * 0.04, [0.004; 2], 6, black);
    }
    WallObject { name: "clock", shape }
}

/// Builds a shelf board with books.
pub(super) fn wall_shelf(builder: &mut RoomBuilder) -> WallObject {
    let wood = builder.palette.paint(Finish::Wood);
    let half = between(&mut builder.random, 0.3, 0.6);
    let depth = between(&mut builder.random, 0.18, 0.25);
    let mut shape = Shape::default();
    shape.board(Vec3::new(-half, -0.03, 0.001), Vec3::new(half, 0.0, depth), wood);
    let matte = builder.palette.paint(Finish::Matte);
    let mut x = -half + 0.03;
    while x < half - 0.1 {
        if chance(&mut builder.random, 0.7) {
            let thick = between(&mut builder.random, 0.015, 0.05);
            let high = between(&mut builder.random, 0.12, 0.26);
            let tint = builder.palette.tint(&mut builder.random);
            shape.cuboid(Vec3::new(x, 0.0, 0.02), Vec3::new(x + thick, high, 0.17), matte.tinted(tint));
            x += thick + 0.001;
        } else {
            x += between(&mut builder.random, 0.03, 0.2);
        }
    }
    WallObject { name: "wall shelf", shape }
}

pub(super) fn towel(builder: &mut RoomBuilder) -> WallObject {
    let metal = builder.palette.paint(Finish::Metal);
    let cloth = builder.palette.paint(Finish::Linen).tinted(builder.palette.tint(&mut builder.random));
    let mut shape = Shape::default();
    shape.bar(Vec3::new(-0.3, 0.0, 0.06), Vec3::new(0.3, 0.0, 0.06), [0.008; 2], 8, metal);
    for x in [-0.28, 0.28] {
        shape.bar(Vec3::new(x, 0.0, 0.0), Vec3::new(x, 0.0, 0.06), [0.008; 2], 8, metal);
    }
    let first = shape.triangles.len();
    shape.grid([10, 14], Vec2::new(0.45, 1.0), cloth, |u, v| {
        let x = (u - 0.5) * 0.44;
        let wave = 0.004 * (20.0 * u + 3.0 * v).sin();
        let s = (v - 0.5) * 1.1;
        let z = 0.06 - (0.014 + wave) * (s * 40.0).tanh();
        Vec3::new(x, 0.014 - s.abs() + 0.02 * (1.0 - (s * 20.0).tanh().abs()) * 0.2, z)
    });
    shape.close_part(first);
    WallObject { name: "towel", shape }
}

/// Hangs an object on a free stretch of wall at height `y`. Returns whether it fitted.
///
/// With `over`, the bounds of another object, only the position above that object is tried.
pub(crate) fn hang(builder: &mut RoomBuilder, object: &WallObject, y: f32, over: Option<(Vec3, Vec3)>) -> bool {
    let (min, max) = object.shape.bounds();
    for _ in 0..14 {
        let index = match over {
            Some(bounds) => nearest_wall(builder, bounds),
            None => count(&mut builder.random, 0, builder.plan.walls.len() - 1),
        };
        let wall = &builder.plan.walls[index];
        let margin = 0.05;
        let room = wall.length_m - (max.x - min.x) - 2.0 * margin;
        if room <= 0.0 {
            continue;
        }
        let (start, along) = (wall.start, wall.along);
        let s = match over {
            Some((a, b)) => {
                let middle = (a + b) * 0.5;
                let s = (Vec2::new(middle.x, middle.z) - start).dot(along);
                s.clamp(margin - min.x, wall.length_m - margin - max.x)
            }
            None => margin - min.x + room * between(&mut builder.random, 0.0, 1.0),
        };
        if hang_at(builder, object, index, s, y) {
            return true;
        }
        if over.is_some() {
            return false;
        }
    }
    false
}

/// Hangs an object at `s` along the wall `index` and height `y` if it fits there.
pub(super) fn hang_at(builder: &mut RoomBuilder, object: &WallObject, index: usize, s: f32, y: f32) -> bool {
    let (min, max) = object.shape.bounds();
    let wall = &builder.plan.walls[index];
    let (from, to) = (s + min.x, s + max.x);
    let blocked = wall
        .openings
        .iter()
        .any(|o| from < o.s[1] + 0.1 && to > o.s[0] - 0.1 && y + min.y < o.h[1] + 0.1 && y + max.y > o.h[0] - 0.05);
    let origin = wall.point(s, 0.0, 0.0);
    let yaw = wall.yaw_rad();
    let footprint = Footprint::of_box(
        Vec3::new(min.x, 0.0, 0.003),
        Vec3::new(max.x, 0.0, max.z.max(0.03)),
        yaw,
        Vec2::new(origin.x, origin.z),
    );
    let heights = [y + min.y, y + max.y];
    if blocked || from < 0.02 || to > wall.length_m - 0.02 || heights[0] < 0.12 {
        return false;
    }
    if !builder.occupancy.fits(&builder.plan, &footprint, heights)
        || !builder.occupancy.leaves_passages(&footprint, heights)
    {
        return false;
    }
    builder.occupancy.occupy(footprint, heights);
    let rotation = lo_geometry::Quat::from_rotation_y(yaw);
    builder.add_shape(object.name, Support::Wall, &object.shape, rotation, origin + Vec3::Y * y);
    true
}

fn nearest_wall(builder: &RoomBuilder, (min, max): (Vec3, Vec3)) -> usize {
    let middle = (min + max) * 0.5;
    let half = (max - min) * 0.5;
    let p = Vec2::new(middle.x, middle.z);
    let distance = |k: usize| {
        let wall = &builder.plan.walls[k];
        let reach = half.x * wall.inward().x.abs() + half.z * wall.inward().y.abs();
        let s = (p - wall.start).dot(wall.along);
        let beside = (s - s.clamp(0.0, wall.length_m)).abs();
        ((p - wall.start).dot(wall.inward()) - reach).abs() + beside
    };
    (0..builder.plan.walls.len()).fold(0, |best, k| if distance(k) < distance(best) { k } else { best })
}

/// Hangs pictures and mirrors at random places.
pub(super) fn pictures(builder: &mut RoomBuilder, number: usize) {
    for _ in 0..number {
        let one = if chance(&mut builder.random, 0.85) { picture(builder) } else { mirror(builder) };
        let y = pick(&mut builder.random, &[1.45, 1.5, 1.55, 1.7]);
        hang(builder, &one, y, None);
    }
}
