//! Groups of furniture that are placed together.

use lo_geometry::{Vec2, Vec3};

use super::{clutter, seating, tables};
use crate::chance::{between, chance};
use crate::occupancy::Footprint;
use crate::room_builder::{Group, Piece, RoomBuilder, Support, WallPosition};
use crate::solids::Shape;

pub(super) fn single(piece: Piece) -> Group {
    vec![(piece, Vec2::ZERO, 0.0)]
}

pub(super) fn center(builder: &RoomBuilder, object: usize) -> Vec2 {
    let (min, max) = builder.object_bounds(object);
    Vec2::new(0.5 * (min.x + max.x), 0.5 * (min.z + max.z))
}

/// Places a table with chairs, most of them pushed in.
pub(super) fn dining_group(builder: &mut RoomBuilder) {
    let round = chance(&mut builder.random, 0.25);
    let large = builder.plan.area_m2() > 12.0;
    let half = if round {
        Vec2::splat(between(&mut builder.random, 0.45, if large { 0.65 } else { 0.5 }))
    } else {
        let long =
            if large { between(&mut builder.random, 0.7, 1.05) } else { between(&mut builder.random, 0.4, 0.62) };
        Vec2::new(long, between(&mut builder.random, 0.38, 0.48))
    };
    let style = seating::chair_style(builder);
    let chair = seating::chair(builder, style);
    let table = tables::dining_table(builder, half, round);
    let mut group = single(table);
    // Distance of the seat's centre from the table's edge; a pushed-in seat reaches 7 to 14 cm under the top.
    let out = |builder: &mut RoomBuilder| {
        if chance(&mut builder.random, 0.2) {
            between(&mut builder.random, 0.2, 0.35)
        } else {
            between(&mut builder.random, 0.07, 0.14)
        }
    };
    if round {
        let number = if half.x > 0.55 { 5 } else { 4 };
        for k in 0..number {
            let angle = std::f32::consts::TAU * (k as f32 + 0.25) / number as f32;
            let direction = Vec2::new(angle.sin(), angle.cos());
            // The chair faces the centre.
            group.push((chair.clone(), direction * (half.x + out(builder)), angle + std::f32::consts::PI));
        }
    } else {
        let along = if half.x > 0.85 {
            3
        } else if half.x > 0.6 {
            2
        } else {
            1
        };
        for (side, k) in [-1.0, 1.0].into_iter().flat_map(|side| (0..along).map(move |k| (side, k))) {
            let room = half.x - 0.12;
            let x = -room + 2.0 * room * (k as f32 + 0.5) / along as f32;
            let z = side * (half.y + out(builder));
            let yaw = if side > 0.0 { std::f32::consts::PI } else { 0.0 } + between(&mut builder.random, -0.06, 0.06);
            group.push((chair.clone(), Vec2::new(x, z), yaw));
        }
        if half.x > 0.6 && chance(&mut builder.random, 0.35) {
            for side in [-1.0, 1.0] {
                let yaw = -side * std::f32::consts::FRAC_PI_2;
                group.push((chair.clone(), Vec2::new(side * (half.x + out(builder)), 0.0), yaw));
            }
        }
    }
    let mut placed = builder.place_freely(&group, None, 0.25).or_else(|| builder.place_freely(&group, None, 0.02));
    while placed.is_none() && group.len() > 2 {
        group.truncate(group.len() / 2 + 1);
        placed = builder
            .place_freely(&group, None, 0.02)
            .or_else(|| builder.place_against_wall(&group, WallPosition::Anywhere));
    }
    if let Some(placed) = placed
        && chance(&mut builder.random, 0.3)
    {
        let at = center(builder, placed[0]);
        rug(builder, at, half + Vec2::splat(0.6));
    }
}

pub(super) fn desk_group(builder: &mut RoomBuilder, on: bool) {
    let width = between(&mut builder.random, 1.1, 1.7);
    let desk = tables::desk(builder, width);
    let depth = desk.shape.bounds().1.z;
    let mut group = single(desk);
    let chair = seating::office_chair(builder);
    let out = between(&mut builder.random, 0.25, 0.45);
    group.push((
        chair,
        Vec2::new(between(&mut builder.random, -0.2, 0.05), depth + out),
        std::f32::consts::PI + between(&mut builder.random, -0.5, 0.5),
    ));
    if builder.place_against_wall(&group, WallPosition::Anywhere).is_some() {
        let surface = builder.surfaces.len() - 1;
        let computer = clutter::computer(builder, on);
        let z = 0.5 * depth - 0.32;
        clutter::put_on(builder, surface, &computer, Some((Vec2::new(-0.12, -z.max(-0.05)), 0.0)));
    }
}

/// Adds a rug centred near `at`, limited by the walls. Furniture may stand on it.
pub(super) fn rug(builder: &mut RoomBuilder, at: Vec2, half: Vec2) {
    let (min, max) = builder.plan.extent();
    let half = half.min((max - min) * 0.5 - Vec2::splat(0.25));
    if half.min_element() < 0.4 {
        return;
    }
    let at = at.clamp(min + half + Vec2::splat(0.2), max - half - Vec2::splat(0.2));
    let footprint = Footprint { center: at, along: Vec2::X, half };
    let corners = footprint.corners();
    if !corners.iter().all(|&c| builder.plan.contains(c, 0.1)) {
        return;
    }
    let paint = builder.palette.rug(&mut builder.random, [2.0 * half.x, 2.0 * half.y]);
    let mut shape = Shape::default();
    shape.board(Vec3::new(0.0, 0.0, 0.0), Vec3::new(2.0 * half.x, 0.008, 2.0 * half.y), paint);
    builder.add_shape(
        "rug",
        Support::Floor,
        &shape,
        lo_geometry::Quat::IDENTITY,
        Vec3::new(at.x - half.x, 0.0, at.y - half.y),
    );
}
