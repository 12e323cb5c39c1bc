//! Windows: reveals, frames, panes, sills, radiators, blinds and curtains.

use lo_geometry::{Quat, Vec2, Vec3};
use lo_transport::Portal;

use crate::chance::{between, chance, count, weighted};
use crate::occupancy::Footprint;
use crate::palette::Finish;
use crate::plan::{Opening, Wall};
use crate::room_builder::{Piece, RoomBuilder, Support};
use crate::solids::Shape;

/// Builds all windows and returns the portals through which daylight enters.
pub(crate) fn build(builder: &mut RoomBuilder, night: bool) -> Vec<Portal> {
    let mut portals = Vec::new();
    let covering = weighted(
        &mut builder.random,
        &[
            (WindowCovering::None, 0.3),
            (WindowCovering::Curtains, 0.36),
            (WindowCovering::RollerBlind, 0.16),
            (WindowCovering::VenetianBlind, 0.18),
        ],
    );
    let grid =
        weighted(&mut builder.random, &[([1, 1], 0.4), ([2, 1], 0.35), ([2, 2], 0.12), ([2, 3], 0.08), ([3, 1], 0.05)]);
    for index in 0..builder.plan.walls.len() {
        let wall = builder.plan.walls[index].clone();
        for opening in wall.openings.iter().filter(|o| o.is_window()) {
            reveal(builder, index, opening);
            let shelf = matches!(covering, WindowCovering::None | WindowCovering::Curtains);
            frame(builder, index, opening, grid, shelf);
            portals.push(portal(&wall, opening));
            match covering {
                WindowCovering::None => {}
                WindowCovering::Curtains => curtains(builder, index, opening, night),
                WindowCovering::RollerBlind => roller_blind(builder, index, opening, night),
                WindowCovering::VenetianBlind => venetian_blind(builder, index, opening, night),
            }
            if opening.h[0] > 0.6 && covering != WindowCovering::Curtains && chance(&mut builder.random, 0.45) {
                radiator(builder, index, opening);
            }
        }
    }
    portals
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum WindowCovering {
    None,
    Curtains,
    RollerBlind,
    VenetianBlind,
}

fn portal(wall: &Wall, opening: &Opening) -> Portal {
    let corner = wall.point(opening.s[0], opening.h[0], -wall.thickness_m);
    let along = wall.point(opening.s[1], opening.h[0], -wall.thickness_m) - corner;
    let up = Vec3::new(0.0, opening.h[1] - opening.h[0], 0.0);
    Portal { corner, edges: [along, up] }
}

/// Adds the four sides of an opening, seen from inside.
pub(crate) fn reveal(builder: &mut RoomBuilder, wall: usize, opening: &Opening) {
    let paint = builder.palette.paint(Finish::Trim);
    let deep = -builder.plan.walls[wall].thickness_m;
    let ([a, b], [low, high]) = (opening.s, opening.h);
    let mut shape = Shape::default();
    let p = Vec3::new;
    shape.polygon(&[p(a, low, deep), p(a, low, 0.0), p(a, high, 0.0), p(a, high, deep)], paint);
    shape.polygon(&[p(b, low, 0.0), p(b, low, deep), p(b, high, deep), p(b, high, 0.0)], paint);
    shape.polygon(&[p(a, high, 0.0), p(b, high, 0.0), p(b, high, deep), p(a, high, deep)], paint);
    shape.polygon(&[p(a, low, deep), p(b, low, deep), p(b, low, 0.0), p(a, low, 0.0)], paint);
    shape.close_part(0);
    builder.add_to_wall("reveal", Support::Building, &shape, wall);
}

/// Adds the frame, glazing bars, the pane and a sill. `shelf` lets small objects stand on the sill.
fn frame(builder: &mut RoomBuilder, wall: usize, opening: &Opening, [columns, rows]: [usize; 2], shelf: bool) {
    let paint = builder.palette.paint(Finish::WindowFrame);
    let glass = builder.palette.paint(Finish::Glass);
    let deep = -builder.plan.walls[wall].thickness_m;
    let ([a, b], [low, high]) = (opening.s, opening.h);
    let columns = columns.max((opening.width_m() / 1.3).ceil() as usize);
    let (bar, depth) = (0.06, 0.05f32.min(-deep * 0.5));
    let (front, back) = (deep * 0.75 + 0.5 * depth, deep * 0.75 - 0.5 * depth);
    let mut shape = Shape::default();
    let mut beam = |x: [f32; 2], y: [f32; 2]| {
        shape.board(Vec3::new(x[0], y[0], back), Vec3::new(x[1], y[1], front), paint);
    };
    // The outer bars reach into the wall, so that no light leaks beside them.
    beam([a - 0.01, a + bar], [low - 0.01, high + 0.01]);
    beam([b - bar, b + 0.01], [low - 0.01, high + 0.01]);
    beam([a, b], [low - 0.01, low + bar]);
    beam([a, b], [high - bar, high + 0.01]);
    let line = |k: usize, number: usize, from: f32, to: f32| from + (to - from) * k as f32 / number as f32;
    for k in 1..columns {
        let x = line(k, columns, a, b);
        beam([x - 0.5 * bar, x + 0.5 * bar], [low, high]);
    }
    for k in 1..rows {
        let y = line(k, rows, low, high);
        beam([a, b], [y - 0.35 * bar, y + 0.35 * bar]);
    }
    builder.add_to_wall("window frame", Support::Building, &shape, wall);
    let mut pane = Shape::default();
    let z = 0.5 * (front + back);
    let corners = [Vec3::new(a, low, z), Vec3::new(b, low, z), Vec3::new(b, high, z), Vec3::new(a, high, z)];
    pane.polygon(&corners, glass);
    pane.close_part(0);
    builder.add_to_wall("pane", Support::Building, &pane, wall);
    if low > 0.3 {
        let reach = between(&mut builder.random, 0.02, 0.12);
        let mut sill = Shape::default();
        sill.board(Vec3::new(a - 0.03, low - 0.03, 0.001), Vec3::new(b + 0.03, low, reach), paint);
        builder.add_to_wall("sill edge", Support::Building, &sill, wall);
        // The board in the reveal, which carries flower pots; its frame is centred.
        let half = Vec2::new(0.5 * (b - a), -0.5 * front);
        let mut board = Shape::default();
        board.cuboid(Vec3::new(-half.x, -0.006, -half.y), Vec3::new(half.x, 0.0, half.y), paint);
        let mut piece = Piece::new("window sill", board);
        if shelf && half.y > 0.07 {
            piece = piece.with_surface(Vec3::ZERO, half - Vec2::new(0.1, 0.055), (high - low - 0.1).min(0.5));
        }
        let place = builder.plan.walls[wall].point(0.5 * (a + b), low + 0.004, 0.5 * front);
        let yaw = builder.plan.walls[wall].yaw_rad();
        builder.add_piece(&piece, Support::Building, yaw, place);
    }
}

/// Marks a box in the frame of a wall as occupied, so that no furniture intersects it.
fn occupy(builder: &mut RoomBuilder, wall: usize, min: Vec3, max: Vec3) {
    let origin = builder.plan.walls[wall].point(0.0, 0.0, 0.0);
    let yaw = builder.plan.walls[wall].yaw_rad();
    let footprint = Footprint::of_box(min, max, yaw, Vec2::new(origin.x, origin.z));
    builder.occupancy.occupy(footprint, [min.y, max.y]);
}

/// Adds a rod with a curtain on either side, partly drawn, and sometimes a net curtain behind.
fn curtains(builder: &mut RoomBuilder, wall: usize, opening: &Opening, night: bool) {
    let length = builder.plan.walls[wall].length_m;
    let over = between(&mut builder.random, 0.12, 0.3);
    let [a, b] = [(opening.s[0] - over).max(0.06), (opening.s[1] + over).min(length - 0.06)];
    let top = opening.h[1] + 0.06;
    let to_floor = opening.h[0] < 0.5 || chance(&mut builder.random, 0.6);
    let bottom = if to_floor { 0.02 } else { opening.h[0] - 0.15 };
    let z = 0.145;
    let space = [Vec3::new(a - 0.03, bottom, 0.0), Vec3::new(b + 0.03, top + 0.04, 0.21)];
    let free = {
        let at = builder.plan.walls[wall].point(0.0, 0.0, 0.0);
        let yaw = builder.plan.walls[wall].yaw_rad();
        let footprint = Footprint::of_box(space[0], space[1], yaw, Vec2::new(at.x, at.z));
        builder.occupancy.fits(&builder.plan, &footprint.expanded(-0.001), [bottom, top + 0.05])
    };
    if !free {
        return;
    }
    occupy(builder, wall, space[0], space[1]);
    let rod = builder.palette.paint(Finish::SecondMetal);
    let mut shape = Shape::default();
    shape.bar(Vec3::new(a, top, z), Vec3::new(b, top, z), [0.012; 2], 10, rod);
    for x in [a + 0.02, b - 0.02] {
        shape.bar(Vec3::new(x, top, 0.0), Vec3::new(x, top, z), [0.008; 2], 8, rod);
    }
    for x in [a, b] {
        shape.ball(Vec3::new(x, top, z), [0.022, 0.022], 10, rod);
    }
    let with_net = !night && chance(&mut builder.random, 0.35);
    if with_net {
        shape.bar(Vec3::new(a + 0.02, top, 0.075), Vec3::new(b - 0.02, top, 0.075), [0.008; 2], 8, rod);
    }
    builder.add_to_wall("curtain rod", Support::Wall, &shape, wall);
    let carrier = Support::Object(builder.objects.len() - 1);
    let cloth = builder.palette.paint(Finish::Curtain);
    let closed_share = if night { 0.5 } else { 0.08 };
    let drawn = if chance(&mut builder.random, closed_share) {
        between(&mut builder.random, 0.75, 0.98)
    } else {
        between(&mut builder.random, 0.2, 0.42)
    };
    let width = 0.5 * (b - a - 0.08) * drawn;
    let mut shape = Shape::default();
    for side in [0.0, 1.0] {
        let folds = (width / between(&mut builder.random, 0.09, 0.14)).max(2.0);
        let phase = between(&mut builder.random, 0.0, 6.0);
        let start = shape.positions.len();
        shape.drape(width, top - 0.02 - bottom, folds, 0.03, phase, cloth);
        let x = if side == 0.0 { a + 0.04 } else { b - 0.04 - width };
        for p in &mut shape.positions[start..] {
            *p += Vec3::new(x, bottom, z);
        }
    }
    builder.add_to_wall("curtain", carrier, &shape, wall);
    if with_net {
        let net = builder.palette.paint(Finish::NetCurtain);
        let mut shape = Shape::default();
        shape.drape(b - a - 0.1, top - 0.03 - bottom, (b - a) / 0.16, 0.018, 0.0, net);
        for p in &mut shape.positions {
            *p += Vec3::new(a + 0.05, bottom, 0.075);
        }
        builder.add_to_wall("net curtain", carrier, &shape, wall);
    }
}

/// Draws how far a blind is lowered, as a share of the window.
fn lowered_share(builder: &mut RoomBuilder, night: bool) -> f32 {
    match weighted(
        &mut builder.random,
        &[(0, if night { 0.2 } else { 0.5 }), (1, 0.35), (2, if night { 0.45 } else { 0.15 })],
    ) {
        0 => between(&mut builder.random, 0.06, 0.2),
        1 => between(&mut builder.random, 0.2, 0.65),
        _ => between(&mut builder.random, 0.8, 0.97),
    }
}

/// Adds a roller blind at the top of the reveal.
fn roller_blind(builder: &mut RoomBuilder, wall: usize, opening: &Opening, night: bool) {
    let share = lowered_share(builder, night);
    let cloth = builder.palette.paint(Finish::Blind);
    let metal = builder.palette.paint(Finish::SecondMetal);
    let ([a, b], [low, high]) = (opening.s, opening.h);
    let z = -0.35 * builder.plan.walls[wall].thickness_m;
    let down = high - 0.04 - share * (high - low - 0.06);
    let mut shape = Shape::default();
    shape.bar(Vec3::new(a + 0.004, high - 0.03, z), Vec3::new(b - 0.004, high - 0.03, z), [0.022; 2], 10, cloth);
    shape.bar(Vec3::new(a + 0.012, down, z), Vec3::new(b - 0.012, down, z), [0.008; 2], 8, metal);
    let first = shape.triangles.len();
    let z = z + 0.012;
    shape.polygon(
        &[
            Vec3::new(a + 0.012, down, z),
            Vec3::new(b - 0.012, down, z),
            Vec3::new(b - 0.012, high - 0.03, z),
            Vec3::new(a + 0.012, high - 0.03, z),
        ],
        cloth,
    );
    shape.close_part(first);
    builder.add_to_wall("roller blind", Support::Wall, &shape, wall);
}

/// Adds a Venetian blind with 25 mm slats of a common tilt.
fn venetian_blind(builder: &mut RoomBuilder, wall: usize, opening: &Opening, night: bool) {
    let share = lowered_share(builder, night);
    let metal = builder.palette.paint(Finish::Lacquer);
    let ([a, b], [low, high]) = (opening.s, opening.h);
    let z = -0.35 * builder.plan.walls[wall].thickness_m;
    let tilt = between(&mut builder.random, -0.2, 1.1);
    let pitch = 0.028;
    let number = (((high - low - 0.08) * share / pitch) as usize).max(1);
    let mut shape = Shape::default();
    shape.board(Vec3::new(a + 0.004, high - 0.035, z - 0.016), Vec3::new(b - 0.004, high - 0.001, z + 0.016), metal);
    let turn = Quat::from_rotation_x(tilt);
    let mut slat = Shape::default();
    slat.cuboid(Vec3::new(a + 0.012, -0.0006, -0.0125), Vec3::new(b - 0.012, 0.0006, 0.0125), metal);
    for k in 0..number {
        shape.add(&slat, turn, Vec3::new(0.0, high - 0.05 - pitch * k as f32, z));
    }
    let last = high - 0.05 - pitch * number as f32;
    shape.board(Vec3::new(a + 0.012, last - 0.008, z - 0.012), Vec3::new(b - 0.012, last + 0.004, z + 0.012), metal);
    builder.add_to_wall("venetian blind", Support::Wall, &shape, wall);
}

/// Adds a panel or column radiator below the sill.
fn radiator(builder: &mut RoomBuilder, wall: usize, opening: &Opening) {
    let width = (opening.width_m() - 0.1).min(between(&mut builder.random, 0.6, 1.6));
    let middle = 0.5 * (opening.s[0] + opening.s[1]);
    let (a, b) = (middle - 0.5 * width, middle + 0.5 * width);
    let (bottom, top) = (0.12, (opening.h[0] - 0.12).min(0.75));
    let paint = builder.palette.paint(Finish::Gloss).tinted([0.9; 3]);
    let mut shape = Shape::default();
    if chance(&mut builder.random, 0.6) {
        shape.rounded(Vec3::new(a, bottom, 0.035), Vec3::new(b, top, 0.105), 0.008, 1, paint);
        let grooves = (width / 0.035) as usize;
        for k in 0..grooves {
            let x = a + (k as f32 + 0.5) * width / grooves as f32;
            shape.board(Vec3::new(x - 0.009, bottom + 0.02, 0.1), Vec3::new(x + 0.009, top - 0.02, 0.112), paint);
        }
    } else {
        let columns = (width / 0.05) as usize;
        for k in 0..columns {
            let x = a + (k as f32 + 0.5) * width / columns as f32;
            shape.rounded(Vec3::new(x - 0.02, bottom, 0.035), Vec3::new(x + 0.02, top, 0.14), 0.015, 1, paint);
        }
    }
    for x in [a + 0.1, b - 0.1] {
        shape.cuboid(Vec3::new(x - 0.015, top - 0.15, 0.0), Vec3::new(x + 0.015, top - 0.1, 0.04), paint);
    }
    // Pipes to the floor.
    let pipe_x = if count(&mut builder.random, 0, 1) == 0 { a + 0.02 } else { b - 0.02 };
    shape.bar(Vec3::new(pipe_x, 0.0, 0.07), Vec3::new(pipe_x, bottom + 0.02, 0.07), [0.009; 2], 8, paint);
    let origin = builder.plan.walls[wall].point(0.0, 0.0, 0.0);
    let yaw = builder.plan.walls[wall].yaw_rad();
    let (min, max) = (Vec3::new(a, 0.0, 0.0), Vec3::new(b, top, 0.16));
    let footprint = Footprint::of_box(min, max, yaw, Vec2::new(origin.x, origin.z));
    if builder.occupancy.fits(&builder.plan, &footprint.expanded(-0.002), [0.0, top]) {
        builder.occupancy.occupy(footprint, [0.0, top]);
        builder.add_to_wall("radiator", Support::Wall, &shape, wall);
    }
}
