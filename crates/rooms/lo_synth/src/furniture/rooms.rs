//! Furnishing of homes, offices and classrooms by room kind.

use lo_geometry::{Vec2, Vec3};

use super::groups::{center, desk_group, dining_group, rug, single};
use super::{bathroom, beds, kitchen, seating, storage, tables, wall_objects};
use crate::chance::{between, chance, count, pick};
use crate::description::LightingMode;
use crate::room_builder::{RoomBuilder, WallPosition};

pub(super) fn bedroom(builder: &mut RoomBuilder, clutter: f32, screens: bool) {
    let wide = builder.plan.area_m2() > 9.0 && chance(&mut builder.random, 0.75);
    let bed = beds::bed(builder, wide);
    let half = bed.shape.bounds().1.x;
    let mut group = single(bed);
    if chance(&mut builder.random, 0.8) {
        let width = between(&mut builder.random, 0.38, 0.52);
        let height = between(&mut builder.random, 0.42, 0.6);
        for side in [-1.0, 1.0] {
            if wide || side > 0.0 {
                let table = storage::chest(builder, "night table", width, height, 0.4);
                group.push((table, Vec2::new(side * (half + 0.5 * width + 0.06), 0.0), 0.0));
            }
        }
    }
    let along = if wide { WallPosition::Middle } else { WallPosition::Corner };
    let mut placed = builder.place_against_wall(&group, along);
    if placed.is_none() {
        group.truncate(1);
        placed = builder.place_against_wall(&group, WallPosition::Anywhere);
    }
    if let Some(bed) = placed {
        if chance(&mut builder.random, 0.5) {
            let near = center(builder, bed[0]);
            let half = Vec2::new(between(&mut builder.random, 0.8, 1.2), between(&mut builder.random, 0.9, 1.3));
            rug(builder, near, half);
        }
        let over = builder.object_bounds(bed[0]);
        if chance(&mut builder.random, 0.6) {
            let picture = wall_objects::picture(builder);
            wall_objects::hang(builder, &picture, (over.1.y + 0.45).max(1.5), Some(over));
        }
    }
    let wardrobe = storage::wardrobe(builder);
    builder.place_against_wall(&single(wardrobe), WallPosition::Corner);
    if chance(&mut builder.random, 0.6) {
        let (w, h) = (between(&mut builder.random, 0.8, 1.4), between(&mut builder.random, 0.75, 1.0));
        let chest = storage::chest(builder, "chest", w, h, 0.45);
        builder.place_against_wall(&single(chest), WallPosition::Anywhere);
    }
    if chance(&mut builder.random, 0.3) {
        desk_group(builder, screens);
    }
    if chance(&mut builder.random, 0.35) {
        let style = seating::chair_style(builder);
        let chair = seating::chair(builder, style);
        builder.place_against_wall(&single(chair), WallPosition::Anywhere);
    }
    if chance(&mut builder.random, 0.3 + 0.3 * clutter) {
        let shelf = storage::shelf(builder, 0.4 + 0.5 * clutter);
        builder.place_against_wall(&single(shelf), WallPosition::Anywhere);
    }
}

pub(super) fn living(builder: &mut RoomBuilder, clutter: f32, screens: bool) {
    let seats = if builder.plan.area_m2() < 16.0 { 2 } else { count(&mut builder.random, 2, 3) };
    let sofa = seating::sofa(builder, seats);
    let depth = sofa.shape.bounds().1.z;
    let half = sofa.shape.bounds().1.x;
    let mut group = single(sofa);
    let gap = between(&mut builder.random, 0.32, 0.45);
    let table = tables::coffee_table(builder);
    let reach = table.shape.bounds().1.z;
    group[0].0.front_m = 0.0;
    group.push((table, Vec2::new(0.0, depth + gap + reach), 0.0));
    if chance(&mut builder.random, 0.5) {
        let side = pick(&mut builder.random, &[-1.0, 1.0]);
        let one = tables::side_table(builder);
        group.push((one, Vec2::new(side * (half + 0.3), 0.35), 0.0));
    }
    let mut placed = builder.place_against_wall(&group, WallPosition::Middle);
    if placed.is_none() {
        placed = builder
            .place_against_wall(&group, WallPosition::Anywhere)
            .or_else(|| builder.place_freely(&group, None, 0.0));
    }
    if placed.is_none() {
        group.truncate(1);
        placed = builder.place_against_wall(&group, WallPosition::Anywhere);
    }
    let focus = placed.as_ref().map(|p| center(builder, *p.last().unwrap_or(&p[0])));
    if let Some(placed) = &placed {
        let over = builder.object_bounds(placed[0]);
        if placed.len() > 1 && chance(&mut builder.random, 0.6) {
            let at = center(builder, placed[1]);
            let size = Vec2::new(between(&mut builder.random, 0.9, 1.4), between(&mut builder.random, 0.7, 1.1));
            rug(builder, at, size);
        }
        if chance(&mut builder.random, 0.6) {
            let picture = wall_objects::picture(builder);
            wall_objects::hang(builder, &picture, 1.55, Some(over));
        }
    }
    let width = between(&mut builder.random, 1.2, 2.0);
    let height = between(&mut builder.random, 0.4, 0.55);
    let bench = storage::chest(builder, "television bench", width, height, 0.42);
    if let Some(placed) = builder.place_against_wall(&single(bench), WallPosition::Middle)
        && chance(&mut builder.random, 0.8)
    {
        let over = builder.object_bounds(placed[0]);
        let half = between(&mut builder.random, 0.45, 0.68).min(0.5 * width);
        let screen = wall_objects::television(builder, half, screens);
        wall_objects::hang(builder, &screen, over.1.y + 0.12 + half * 9.0 / 16.0, Some(over));
    }
    for _ in 0..count(&mut builder.random, 0, 2) {
        let chair = if chance(&mut builder.random, 0.75) { seating::sofa(builder, 1) } else { seating::pouf(builder) };
        if builder.place_freely(&single(chair.clone()), focus, 0.12).is_none() {
            builder.place_against_wall(&single(chair), WallPosition::Anywhere);
        }
    }
    for _ in 0..count(&mut builder.random, 0, 2) {
        let shelf = storage::shelf(builder, 0.3 + 0.6 * clutter);
        builder.place_against_wall(&single(shelf), WallPosition::Anywhere);
    }
    if builder.plan.area_m2() > 22.0 && chance(&mut builder.random, 0.7) {
        dining_group(builder);
    }
    if chance(&mut builder.random, 0.4) {
        let width = between(&mut builder.random, 1.2, 1.9);
        let chest = storage::chest(builder, "sideboard", width, 0.78, 0.45);
        builder.place_against_wall(&single(chest), WallPosition::Anywhere);
    }
}

pub(super) fn kitchen_room(builder: &mut RoomBuilder, lighting: LightingMode) {
    let strip = !matches!(lighting, LightingMode::Daylight) && chance(&mut builder.random, 0.3);
    let longest = builder.plan.walls.iter().map(|w| w.length_m).fold(0.0, f32::max);
    let max = ((longest - 0.1) / 0.6).floor().clamp(3.0, 7.0) as usize;
    for units in (3..=max).rev() {
        let upper = chance(&mut builder.random, 0.75);
        let line = kitchen::line(builder, units, upper && builder.plan.height_m > 2.25, strip);
        if builder.place_against_wall(&single(line), WallPosition::Corner).is_some() {
            break;
        }
    }
    if builder.plan.area_m2() > 8.0 {
        dining_group(builder);
    }
    if chance(&mut builder.random, 0.3) {
        let shelf = storage::shelf(builder, 0.5);
        builder.place_against_wall(&single(shelf), WallPosition::Anywhere);
    }
}

pub(super) fn dining(builder: &mut RoomBuilder, clutter: f32) {
    dining_group(builder);
    let width = between(&mut builder.random, 1.2, 2.0);
    let height = between(&mut builder.random, 0.75, 0.9);
    let chest = storage::chest(builder, "sideboard", width, height, 0.45);
    builder.place_against_wall(&single(chest), WallPosition::Middle);
    if chance(&mut builder.random, 0.5) {
        let shelf = storage::shelf(builder, 0.2 + 0.5 * clutter);
        builder.place_against_wall(&single(shelf), WallPosition::Anywhere);
    }
}

pub(super) fn office(builder: &mut RoomBuilder, clutter: f32, screens: bool) {
    let desks = ((builder.plan.area_m2() / 7.0) as usize).clamp(1, 5);
    for _ in 0..desks {
        desk_group(builder, screens);
    }
    for _ in 0..count(&mut builder.random, 1, 3) {
        let shelf = storage::shelf(builder, 0.4 + 0.5 * clutter);
        builder.place_against_wall(&single(shelf), WallPosition::Anywhere);
    }
    if builder.plan.area_m2() > 16.0 && chance(&mut builder.random, 0.5) {
        dining_group(builder);
    }
    if chance(&mut builder.random, 0.3) {
        let board = wall_objects::school_board(builder);
        wall_objects::hang(builder, &board, 1.5, None);
    }
}

pub(super) fn bathroom_room(builder: &mut RoomBuilder) {
    let stand = bathroom::washstand(builder);
    if let Some(placed) = builder.place_against_wall(&single(stand), WallPosition::Anywhere) {
        let over = builder.object_bounds(placed[0]);
        let mirror = wall_objects::mirror(builder);
        let half = mirror.shape.bounds().1.y;
        wall_objects::hang(builder, &mirror, 1.2 + half, Some(over));
    }
    let toilet = bathroom::toilet(builder);
    builder.place_against_wall(&single(toilet), WallPosition::Anywhere);
    if chance(&mut builder.random, 0.55) {
        let bath = bathroom::bath(builder);
        if builder.place_against_wall(&single(bath), WallPosition::Corner).is_some() {
            return;
        }
    }
    let shower = bathroom::shower(builder);
    builder.place_against_wall(&single(shower), WallPosition::Corner);
}

pub(super) fn corridor(builder: &mut RoomBuilder, clutter: f32) {
    if chance(&mut builder.random, 0.7) {
        let (w, h) = (between(&mut builder.random, 0.6, 1.2), between(&mut builder.random, 0.75, 0.95));
        let depth = between(&mut builder.random, 0.25, 0.35);
        let chest = storage::chest(builder, "chest", w, h, depth);
        builder.place_against_wall(&single(chest), WallPosition::Anywhere);
    }
    if chance(&mut builder.random, 0.3) {
        let shelf = storage::shelf(builder, 0.3 + 0.5 * clutter);
        builder.place_against_wall(&single(shelf), WallPosition::Corner);
    }
    let mirror = wall_objects::mirror(builder);
    wall_objects::hang(builder, &mirror, 1.5, None);
    let (min, max) = builder.plan.extent();
    let half = (max - min) * 0.5;
    if chance(&mut builder.random, 0.4) {
        rug(builder, (min + max) * 0.5, (half - Vec2::splat(0.35)).min(Vec2::splat(1.6)));
    }
}

pub(super) fn classroom(builder: &mut RoomBuilder) {
    let (min, max) = builder.plan.extent();
    let board = wall_objects::school_board(builder);
    // Pupils face a wall that is free for the board.
    let order = crate::chance::shuffled(&mut builder.random, vec![0, 1, 2, 3]);
    let length = |builder: &RoomBuilder, w: usize| builder.plan.walls[w].length_m;
    let wall = order.iter().copied().find(|&w| {
        let middle = 0.5 * length(builder, w);
        wall_objects::hang_at(builder, &board, w, middle, 1.5)
    });
    let facing = wall.unwrap_or(0);
    let (inward, yaw) =
        (builder.plan.walls[facing].inward(), builder.plan.walls[facing].yaw_rad() + std::f32::consts::PI);
    let middle = (min + max) * 0.5;
    let along = builder.plan.walls[facing].along;
    let size = max - min;
    let (deep, wide) = (size.dot(inward.abs()), size.dot(along.abs()));
    let teacher = tables::desk(builder, 1.4);
    let start = middle - inward * (0.5 * deep - 1.3);
    builder.try_place(&single(teacher), yaw, Vec3::new(start.x, 0.0, start.y), 0.0);
    let columns = ((wide - 0.8) / 1.75) as usize;
    let rows = ((deep - 2.9) / 1.35) as usize;
    let style = seating::chair_style(builder);
    let chair = seating::chair(builder, style);
    for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
        let x = (column as f32 + 0.5 - 0.5 * columns as f32) * 1.75;
        let at = middle + inward * (-0.5 * deep + 2.6 + 1.35 * row as f32) + along * x;
        let desk = tables::school_desk(builder);
        let mut group = single(desk);
        for x in [-0.3, 0.3] {
            let out = between(&mut builder.random, 0.1, 0.25);
            group.push((chair.clone(), Vec2::new(x, -0.25 - out), between(&mut builder.random, -0.15, 0.15)));
        }
        builder.try_place(&group, yaw, Vec3::new(at.x, 0.0, at.y), 0.0);
    }
    let shelf = storage::shelf(builder, 0.7);
    builder.place_against_wall(&single(shelf), WallPosition::Corner);
}
