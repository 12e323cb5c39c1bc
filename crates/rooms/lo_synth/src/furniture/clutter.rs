//! Small objects on support surfaces: bottles, bowls, books, computers, cups.

use lo_geometry::{Quat, Vec2, Vec3};

use super::{plants, wall_objects};
use crate::chance::{between, chance, count, pick, weighted};
use crate::occupancy::{Footprint, rotated_yaw};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder, Support};
use crate::solids::Shape;

/// Places small objects on all support surfaces; `amount` in [0, 1].
pub(super) fn scatter(builder: &mut RoomBuilder, amount: f32) {
    for surface in 0..builder.surfaces.len() {
        let name = builder.surfaces[surface].name;
        let area = 4.0 * builder.surfaces[surface].half.x * builder.surfaces[surface].half.y;
        let max = (amount * (2.0 + 9.0 * area)).ceil() as usize;
        let number = count(&mut builder.random, 0, max.min(12));
        for _ in 0..number {
            let piece = object_for_surface(builder, name);
            put_on(builder, surface, &piece, None);
        }
    }
}

fn object_for_surface(builder: &mut RoomBuilder, name: &str) -> Piece {
    let kinds: &[(u32, f32)] = match name {
        "desk" | "school desk" => &[(0, 0.35), (1, 0.25), (2, 0.1), (5, 0.2), (6, 0.1)],
        "kitchen line" => &[(3, 0.4), (4, 0.25), (1, 0.15), (7, 0.2)],
        "washstand" => &[(3, 0.6), (1, 0.4)],
        "dining table" => &[(4, 0.3), (1, 0.25), (3, 0.15), (2, 0.15), (7, 0.15)],
        "window sill" => &[(6, 0.7), (2, 0.3)],
        _ => &[(0, 0.25), (2, 0.2), (4, 0.1), (6, 0.15), (5, 0.15), (1, 0.15)],
    };
    match weighted(&mut builder.random, kinds) {
        0 => books(builder),
        1 => cup(builder),
        2 => vase(builder),
        3 => bottle(builder),
        4 => bowl(builder),
        5 => small_box(builder),
        6 => {
            let height = between(&mut builder.random, 0.15, 0.4);
            plants::potted(builder, height)
        }
        _ => plate(builder),
    }
}

/// Places an object on a support surface. Returns whether it fitted.
///
/// `at` is its position and yaw in the surface's frame; without it, free positions are drawn.
pub(crate) fn put_on(builder: &mut RoomBuilder, surface: usize, piece: &Piece, at: Option<(Vec2, f32)>) -> bool {
    let (min, max) = piece.shape.bounds();
    let place = &builder.surfaces[surface];
    if max.y > place.headroom_m || builder.plan.height_m < place.center.y + max.y + 0.05 {
        return false;
    }
    let (center, yaw, half, object) = (place.center, place.yaw_rad, place.half, place.object);
    for _ in 0..8 {
        let (offset, turn) = at.unwrap_or_else(|| {
            let r = &mut builder.random;
            (
                Vec2::new(between(r, -half.x, half.x), between(r, -half.y, half.y)),
                between(r, 0.0, std::f32::consts::TAU),
            )
        });
        let footprint = Footprint::of_box(min, max, turn, offset);
        let inside = footprint.corners().iter().all(|c| c.abs().cmple(half + Vec2::splat(0.04)).all());
        let place = &mut builder.surfaces[surface];
        if inside && !place.taken.iter().any(|t| t.overlaps(&footprint.expanded(0.005))) {
            place.taken.push(footprint);
            let moved = rotated_yaw(offset, yaw);
            let origin = center + Vec3::new(moved.x, 0.0, moved.y);
            // Tall objects could reach into curtains and lamps.
            let world = Footprint::of_box(min, max, yaw + turn, Vec2::new(origin.x, origin.z));
            let y = [origin.y + 0.01, origin.y + max.y];
            let on_sill = builder.surfaces[surface].name == "window sill";
            if !on_sill && !builder.occupancy.is_clear_on(&builder.plan, &world, y, object) {
                continue;
            }
            builder.add_piece(piece, Support::Object(object), yaw + turn, origin);
            return true;
        }
        if at.is_some() {
            return false;
        }
    }
    false
}

fn books(builder: &mut RoomBuilder) -> Piece {
    let matte = builder.palette.paint(Finish::Matte);
    let mut shape = Shape::default();
    let mut y = 0.0;
    for _ in 0..count(&mut builder.random, 1, 4) {
        let half = Vec2::new(between(&mut builder.random, 0.07, 0.11), between(&mut builder.random, 0.1, 0.15));
        let thick = between(&mut builder.random, 0.01, 0.035);
        let tint = builder.palette.tint(&mut builder.random);
        let mut book = Shape::default();
        book.cuboid(Vec3::new(-half.x, 0.0, -half.y), Vec3::new(half.x, 0.002, half.y), matte.tinted(tint));
        let inner = half - Vec2::splat(0.004);
        book.cuboid(
            Vec3::new(-half.x, 0.002, -inner.y),
            Vec3::new(inner.x, thick - 0.002, inner.y),
            matte.tinted([0.8; 3]),
        );
        book.cuboid(Vec3::new(-half.x, thick - 0.002, -half.y), Vec3::new(half.x, thick, half.y), matte.tinted(tint));
        let turn = between(&mut builder.random, -0.2, 0.2);
        shape.add(&book, Quat::from_rotation_y(turn), Vec3::Y * y);
        y += thick;
    }
    Piece::new("books", shape)
}

fn cup(builder: &mut RoomBuilder) -> Piece {
    let paint = builder.palette.paint(Finish::Gloss).tinted(builder.palette.tint(&mut builder.random));
    let (r, h) = (between(&mut builder.random, 0.034, 0.045), between(&mut builder.random, 0.07, 0.11));
    let mut shape = Shape::default();
    let wall = 0.003;
    let profile = [
        [0.75 * r, 0.0],
        [r, 0.2 * h],
        [r, h],
        [r - wall, h],
        [r - wall, 0.22 * h],
        [0.7 * r, 0.06 * h],
        [0.0, 0.06 * h],
    ];
    shape.lathe(Vec3::ZERO, &profile, 20, paint);
    let points: Vec<Vec3> = (0..=5)
        .map(|k| {
            let angle = -1.4 + 2.8 * k as f32 / 5.0;
            Vec3::new(r - 0.002 + 0.024 * angle.cos(), 0.55 * h + 0.026 * angle.sin(), 0.0)
        })
        .collect();
    shape.pipe(&points, 0.0045, 6, paint);
    Piece::new("cup", shape)
}

fn vase(builder: &mut RoomBuilder) -> Piece {
    let paint = builder.palette.paint(Finish::Gloss).tinted(builder.palette.tint(&mut builder.random));
    let h = between(&mut builder.random, 0.14, 0.32);
    let r = h * between(&mut builder.random, 0.2, 0.4);
    let neck = between(&mut builder.random, 0.3, 0.7);
    let belly = between(&mut builder.random, 0.25, 0.6);
    let mut profile: Vec<[f32; 2]> = (0..=12)
        .map(|k| {
            let t = k as f32 / 12.0;
            let bulge = (-((t - belly) / 0.35).powi(2)).exp();
            [r * (neck * t + 0.55 * (1.0 - t) + (1.0 - neck) * bulge).min(1.0), h * t]
        })
        .collect();
    let mouth = profile[12][0];
    profile.extend([[mouth - 0.004, h], [mouth - 0.006, 0.6 * h], [0.0, 0.59 * h]]);
    let mut shape = Shape::default();
    shape.lathe(Vec3::ZERO, &profile, 28, paint);
    if chance(&mut builder.random, 0.35) {
        let leaf = builder.palette.paint(Finish::Leaf);
        let first = shape.triangles.len();
        for k in 0..count(&mut builder.random, 5, 11) {
            let angle = 2.4 * k as f32;
            let reach = Vec3::new(angle.cos() * 0.1, between(&mut builder.random, 0.12, 0.25), angle.sin() * 0.1);
            shape.leaf(Vec3::Y * 0.9 * h, reach, 0.05, 0.1, leaf);
        }
        shape.close_part(first);
    }
    Piece::new("vase", shape)
}

fn bottle(builder: &mut RoomBuilder) -> Piece {
    let tints = [[0.02, 0.07, 0.03], [0.1, 0.045, 0.01], [0.85, 0.85, 0.82], [0.05, 0.05, 0.06]];
    let tint = if chance(&mut builder.random, 0.6) {
        pick(&mut builder.random, &tints)
    } else {
        builder.palette.tint(&mut builder.random)
    };
    let paint = builder.palette.paint(Finish::Gloss).tinted(tint);
    let (r, h) = (between(&mut builder.random, 0.028, 0.045), between(&mut builder.random, 0.16, 0.31));
    let mut shape = Shape::default();
    let profile = [
        [0.95 * r, 0.0],
        [r, 0.02 * h],
        [r, 0.55 * h],
        [0.85 * r, 0.65 * h],
        [0.4 * r, 0.75 * h],
        [0.35 * r, 0.95 * h],
        [0.4 * r, 0.955 * h],
        [0.4 * r, h],
    ];
    shape.lathe(Vec3::ZERO, &profile, 20, paint);
    let label = builder.palette.paint(Finish::Matte).tinted(builder.palette.tint(&mut builder.random));
    shape.lathe(Vec3::Y * 0.15 * h, &[[r + 0.0006, 0.0], [r + 0.0006, 0.28 * h]], 20, label);
    Piece::new("bottle", shape)
}

fn bowl(builder: &mut RoomBuilder) -> Piece {
    let paint = builder.palette.paint(Finish::Gloss).tinted(builder.palette.tint(&mut builder.random));
    let r = between(&mut builder.random, 0.08, 0.16);
    let h = r * between(&mut builder.random, 0.4, 0.6);
    let mut shape = Shape::default();
    let mut profile = vec![[0.4 * r, 0.0]];
    profile.extend((1..=6).map(|k| [r * (0.4 + 0.6 * (k as f32 / 6.0).powf(0.6)), h * k as f32 / 6.0]));
    profile.extend((1..=6).rev().map(|k| [r * (0.37 + 0.6 * (k as f32 / 6.0).powf(0.6)), h * k as f32 / 6.0 + 0.001]));
    profile.push([0.0, 0.08 * h]);
    shape.lathe(Vec3::ZERO, &profile, 28, paint);
    if chance(&mut builder.random, 0.5) {
        let fruits = [[0.55, 0.08, 0.03], [0.7, 0.4, 0.03], [0.25, 0.4, 0.05], [0.75, 0.6, 0.08]];
        let gloss = builder.palette.paint(Finish::Gloss).tinted(pick(&mut builder.random, &fruits));
        for k in 0..count(&mut builder.random, 3, 5) {
            let angle = 1.3 * k as f32;
            let size = 0.033;
            let at = Vec3::new(angle.cos() * 0.42 * r, 0.5 * h + size, angle.sin() * 0.42 * r);
            shape.ball(at, [size, size * 0.94], 14, gloss);
        }
    }
    Piece::new("bowl", shape)
}

fn plate(builder: &mut RoomBuilder) -> Piece {
    let paint = builder.palette.paint(Finish::Ceramic);
    let r = between(&mut builder.random, 0.09, 0.14);
    let mut shape = Shape::default();
    let profile = [[0.55 * r, 0.0], [r, 0.018], [r, 0.021], [0.6 * r, 0.006], [0.0, 0.006]];
    shape.lathe(Vec3::ZERO, &profile, 28, paint);
    Piece::new("plate", shape)
}

fn small_box(builder: &mut RoomBuilder) -> Piece {
    let paint = builder.palette.paint(Finish::Matte).tinted(builder.palette.tint(&mut builder.random));
    let half = Vec3::new(between(&mut builder.random, 0.05, 0.12), 0.0, between(&mut builder.random, 0.04, 0.09));
    let high = between(&mut builder.random, 0.04, 0.14);
    let mut shape = Shape::default();
    shape.board(-half, half + Vec3::Y * high, paint);
    Piece::new("box", shape)
}

/// Builds a monitor with keyboard and mouse, or a laptop.
pub(super) fn computer(builder: &mut RoomBuilder, on: bool) -> Piece {
    let black = builder.palette.paint(Finish::Matte).tinted([0.03; 3]);
    let grey = builder.palette.paint(Finish::Metal);
    let mut shape = Shape::default();
    if chance(&mut builder.random, 0.3) {
        shape.rounded(Vec3::new(-0.16, 0.0, -0.11), Vec3::new(0.16, 0.014, 0.11), 0.004, 1, grey);
        let mut lid = Shape::default();
        lid.rounded(Vec3::new(-0.16, 0.0, -0.004), Vec3::new(0.16, 0.215, 0.003), 0.002, 1, grey);
        wall_objects::screen(builder, &mut lid, Vec2::new(0.15, 0.095), Vec2::new(0.0, 0.11), 0.0034, on);
        shape.add(&lid, Quat::from_rotation_x(-0.35), Vec3::new(0.0, 0.012, -0.105));
        if builder.palette.has_prints {
            let keys = builder.palette.keys(&mut builder.random);
            shape.picture_on(Vec2::new(-0.14, -0.085), Vec2::new(0.14, 0.02), 0.0144, keys);
        }
        return Piece::new("laptop", shape);
    }
    let half = Vec2::new(between(&mut builder.random, 0.26, 0.35), 0.175);
    shape.rounded(Vec3::new(-0.12, 0.0, -0.26), Vec3::new(0.12, 0.012, -0.08), 0.005, 1, black);
    shape.board(Vec3::new(-0.03, 0.01, -0.23), Vec3::new(0.03, 0.3, -0.2), black);
    let mut panel = Shape::default();
    panel.rounded(Vec3::new(-half.x, 0.11, -0.2), Vec3::new(half.x, 0.11 + 2.0 * half.y, -0.165), 0.005, 1, black);
    let inner = half - Vec2::splat(0.008);
    wall_objects::screen(builder, &mut panel, inner, Vec2::new(0.0, 0.11 + half.y), -0.1645, on);
    shape.add_at(&panel, Vec3::ZERO);
    shape.rounded(Vec3::new(-0.22, 0.0, 0.06), Vec3::new(0.22, 0.018, 0.19), 0.004, 1, black);
    shape.rounded(Vec3::new(0.27, 0.0, 0.09), Vec3::new(0.33, 0.03, 0.19), 0.014, 2, black);
    if builder.palette.has_prints {
        let keys = builder.palette.keys(&mut builder.random);
        shape.picture_on(Vec2::new(-0.215, 0.066), Vec2::new(0.215, 0.184), 0.0184, keys);
    }
    Piece::new("computer", shape)
}
