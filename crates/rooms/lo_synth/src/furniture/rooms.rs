//! Furnishing of homes, offices and classrooms by room kind.

use lo_geometry::{Vec2, Vec3};

use super::groups::{alone, center, desk_group, dining_group, rug};
use super::{bathroom, beds, kitchen, seating, storage, tables, walls};
use crate::chance::{between, chance, count, pick};
use crate::description::LampUse;
use crate::stage::{Along, Stage};

pub(super) fn bedroom(stage: &mut Stage, clutter: f32, screens: bool) {
    let wide = stage.plan.area_m2() > 9.0 && chance(&mut stage.random, 0.75);
    let bed = beds::bed(stage, wide);
    let half = bed.shape.bounds().1.x;
    let mut group = alone(bed);
    if chance(&mut stage.random, 0.8) {
        let width = between(&mut stage.random, 0.38, 0.52);
        let height = between(&mut stage.random, 0.42, 0.6);
        for side in [-1.0, 1.0] {
            if wide || side > 0.0 {
                let table = storage::chest(stage, "night table", width, height, 0.4);
                group.push((table, Vec2::new(side * (half + 0.5 * width + 0.06), 0.0), 0.0));
            }
        }
    }
    let along = if wide { Along::Middle } else { Along::Corner };
    let mut placed = stage.against_wall(&group, along);
    if placed.is_none() {
        group.truncate(1);
        placed = stage.against_wall(&group, Along::Anywhere);
    }
    if let Some(bed) = placed {
        if chance(&mut stage.random, 0.5) {
            let near = center(stage, bed[0]);
            let half = Vec2::new(between(&mut stage.random, 0.8, 1.2), between(&mut stage.random, 0.9, 1.3));
            rug(stage, near, half);
        }
        let over = stage.box_of(bed[0]);
        if chance(&mut stage.random, 0.6) {
            let picture = walls::picture(stage);
            walls::hang(stage, &picture, (over.1.y + 0.45).max(1.5), Some(over));
        }
    }
    let wardrobe = storage::wardrobe(stage);
    stage.against_wall(&alone(wardrobe), Along::Corner);
    if chance(&mut stage.random, 0.6) {
        let (w, h) = (between(&mut stage.random, 0.8, 1.4), between(&mut stage.random, 0.75, 1.0));
        let chest = storage::chest(stage, "chest", w, h, 0.45);
        stage.against_wall(&alone(chest), Along::Anywhere);
    }
    if chance(&mut stage.random, 0.3) {
        desk_group(stage, screens);
    }
    if chance(&mut stage.random, 0.35) {
        let style = seating::chair_style(stage);
        let chair = seating::chair(stage, style);
        stage.against_wall(&alone(chair), Along::Anywhere);
    }
    if chance(&mut stage.random, 0.3 + 0.3 * clutter) {
        let shelf = storage::shelf(stage, 0.4 + 0.5 * clutter);
        stage.against_wall(&alone(shelf), Along::Anywhere);
    }
}

pub(super) fn living(stage: &mut Stage, clutter: f32, screens: bool) {
    let seats = if stage.plan.area_m2() < 16.0 { 2 } else { count(&mut stage.random, 2, 3) };
    let sofa = seating::sofa(stage, seats);
    let depth = sofa.shape.bounds().1.z;
    let half = sofa.shape.bounds().1.x;
    let mut group = alone(sofa);
    let gap = between(&mut stage.random, 0.32, 0.45);
    let table = tables::coffee_table(stage);
    let reach = table.shape.bounds().1.z;
    group[0].0.front_m = 0.0;
    group.push((table, Vec2::new(0.0, depth + gap + reach), 0.0));
    if chance(&mut stage.random, 0.5) {
        let side = pick(&mut stage.random, &[-1.0, 1.0]);
        let one = tables::side_table(stage);
        group.push((one, Vec2::new(side * (half + 0.3), 0.35), 0.0));
    }
    let mut placed = stage.against_wall(&group, Along::Middle);
    if placed.is_none() {
        placed = stage.against_wall(&group, Along::Anywhere).or_else(|| stage.freely(&group, None, 0.0));
    }
    if placed.is_none() {
        group.truncate(1);
        placed = stage.against_wall(&group, Along::Anywhere);
    }
    let focus = placed.as_ref().map(|p| center(stage, *p.last().unwrap_or(&p[0])));
    if let Some(placed) = &placed {
        let over = stage.box_of(placed[0]);
        if placed.len() > 1 && chance(&mut stage.random, 0.6) {
            let at = center(stage, placed[1]);
            let size = Vec2::new(between(&mut stage.random, 0.9, 1.4), between(&mut stage.random, 0.7, 1.1));
            rug(stage, at, size);
        }
        if chance(&mut stage.random, 0.6) {
            let picture = walls::picture(stage);
            walls::hang(stage, &picture, 1.55, Some(over));
        }
    }
    let width = between(&mut stage.random, 1.2, 2.0);
    let height = between(&mut stage.random, 0.4, 0.55);
    let bench = storage::chest(stage, "television bench", width, height, 0.42);
    if let Some(placed) = stage.against_wall(&alone(bench), Along::Middle)
        && chance(&mut stage.random, 0.8)
    {
        let over = stage.box_of(placed[0]);
        let half = between(&mut stage.random, 0.45, 0.68).min(0.5 * width);
        let screen = walls::television(stage, half, screens);
        walls::hang(stage, &screen, over.1.y + 0.12 + half * 9.0 / 16.0, Some(over));
    }
    for _ in 0..count(&mut stage.random, 0, 2) {
        let chair = if chance(&mut stage.random, 0.75) { seating::sofa(stage, 1) } else { seating::pouf(stage) };
        if stage.freely(&alone(chair.clone()), focus, 0.12).is_none() {
            stage.against_wall(&alone(chair), Along::Anywhere);
        }
    }
    for _ in 0..count(&mut stage.random, 0, 2) {
        let shelf = storage::shelf(stage, 0.3 + 0.6 * clutter);
        stage.against_wall(&alone(shelf), Along::Anywhere);
    }
    if stage.plan.area_m2() > 22.0 && chance(&mut stage.random, 0.7) {
        dining_group(stage);
    }
    if chance(&mut stage.random, 0.4) {
        let width = between(&mut stage.random, 1.2, 1.9);
        let chest = storage::chest(stage, "sideboard", width, 0.78, 0.45);
        stage.against_wall(&alone(chest), Along::Anywhere);
    }
}

pub(super) fn kitchen_room(stage: &mut Stage, lighting: LampUse) {
    let strip = !matches!(lighting, LampUse::Daylight) && chance(&mut stage.random, 0.3);
    let longest = stage.plan.walls.iter().map(|w| w.length_m).fold(0.0, f32::max);
    let most = ((longest - 0.1) / 0.6).floor().clamp(3.0, 7.0) as usize;
    for units in (3..=most).rev() {
        let upper = chance(&mut stage.random, 0.75);
        let line = kitchen::line(stage, units, upper && stage.plan.height_m > 2.25, strip);
        if stage.against_wall(&alone(line), Along::Corner).is_some() {
            break;
        }
    }
    if stage.plan.area_m2() > 8.0 {
        dining_group(stage);
    }
    if chance(&mut stage.random, 0.3) {
        let shelf = storage::shelf(stage, 0.5);
        stage.against_wall(&alone(shelf), Along::Anywhere);
    }
}

pub(super) fn dining(stage: &mut Stage, clutter: f32) {
    dining_group(stage);
    let width = between(&mut stage.random, 1.2, 2.0);
    let height = between(&mut stage.random, 0.75, 0.9);
    let chest = storage::chest(stage, "sideboard", width, height, 0.45);
    stage.against_wall(&alone(chest), Along::Middle);
    if chance(&mut stage.random, 0.5) {
        let shelf = storage::shelf(stage, 0.2 + 0.5 * clutter);
        stage.against_wall(&alone(shelf), Along::Anywhere);
    }
}

pub(super) fn office(stage: &mut Stage, clutter: f32, screens: bool) {
    let desks = ((stage.plan.area_m2() / 7.0) as usize).clamp(1, 5);
    for _ in 0..desks {
        desk_group(stage, screens);
    }
    for _ in 0..count(&mut stage.random, 1, 3) {
        let shelf = storage::shelf(stage, 0.4 + 0.5 * clutter);
        stage.against_wall(&alone(shelf), Along::Anywhere);
    }
    if stage.plan.area_m2() > 16.0 && chance(&mut stage.random, 0.5) {
        dining_group(stage);
    }
    if chance(&mut stage.random, 0.3) {
        let board = walls::school_board(stage);
        walls::hang(stage, &board, 1.5, None);
    }
}

pub(super) fn bathroom_room(stage: &mut Stage) {
    let stand = bathroom::washstand(stage);
    if let Some(placed) = stage.against_wall(&alone(stand), Along::Anywhere) {
        let over = stage.box_of(placed[0]);
        let mirror = walls::mirror(stage);
        let half = mirror.shape.bounds().1.y;
        walls::hang(stage, &mirror, 1.2 + half, Some(over));
    }
    let toilet = bathroom::toilet(stage);
    stage.against_wall(&alone(toilet), Along::Anywhere);
    if chance(&mut stage.random, 0.55) {
        let bath = bathroom::bath(stage);
        if stage.against_wall(&alone(bath), Along::Corner).is_some() {
            return;
        }
    }
    let shower = bathroom::shower(stage);
    stage.against_wall(&alone(shower), Along::Corner);
}

pub(super) fn corridor(stage: &mut Stage, clutter: f32) {
    if chance(&mut stage.random, 0.7) {
        let (w, h) = (between(&mut stage.random, 0.6, 1.2), between(&mut stage.random, 0.75, 0.95));
        let depth = between(&mut stage.random, 0.25, 0.35);
        let chest = storage::chest(stage, "chest", w, h, depth);
        stage.against_wall(&alone(chest), Along::Anywhere);
    }
    if chance(&mut stage.random, 0.3) {
        let shelf = storage::shelf(stage, 0.3 + 0.5 * clutter);
        stage.against_wall(&alone(shelf), Along::Corner);
    }
    let mirror = walls::mirror(stage);
    walls::hang(stage, &mirror, 1.5, None);
    let (least, most) = stage.plan.extent();
    let half = (most - least) * 0.5;
    if chance(&mut stage.random, 0.4) {
        rug(stage, (least + most) * 0.5, (half - Vec2::splat(0.35)).min(Vec2::splat(1.6)));
    }
}

pub(super) fn classroom(stage: &mut Stage) {
    let (least, most) = stage.plan.extent();
    let board = walls::school_board(stage);
    // Pupils face a wall that is free for the board.
    let order = crate::chance::shuffled(&mut stage.random, vec![0, 1, 2, 3]);
    let length = |stage: &Stage, w: usize| stage.plan.walls[w].length_m;
    let wall = order.iter().copied().find(|&w| {
        let middle = 0.5 * length(stage, w);
        walls::place(stage, &board, w, middle, 1.5)
    });
    let facing = wall.unwrap_or(0);
    let (inward, yaw) = (stage.plan.walls[facing].inward(), stage.plan.walls[facing].yaw_rad() + std::f32::consts::PI);
    let middle = (least + most) * 0.5;
    let along = stage.plan.walls[facing].along;
    let size = most - least;
    let (deep, wide) = (size.dot(inward.abs()), size.dot(along.abs()));
    let teacher = tables::desk(stage, 1.4);
    let start = middle - inward * (0.5 * deep - 1.3);
    stage.try_at(&alone(teacher), yaw, Vec3::new(start.x, 0.0, start.y), 0.0);
    let columns = ((wide - 0.8) / 1.75) as usize;
    let rows = ((deep - 2.9) / 1.35) as usize;
    let style = seating::chair_style(stage);
    let chair = seating::chair(stage, style);
    for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
        let x = (column as f32 + 0.5 - 0.5 * columns as f32) * 1.75;
        let at = middle + inward * (-0.5 * deep + 2.6 + 1.35 * row as f32) + along * x;
        let desk = tables::school_desk(stage);
        let mut group = alone(desk);
        for x in [-0.3, 0.3] {
            let out = between(&mut stage.random, 0.1, 0.25);
            group.push((chair.clone(), Vec2::new(x, -0.25 - out), between(&mut stage.random, -0.15, 0.15)));
        }
        stage.try_at(&group, yaw, Vec3::new(at.x, 0.0, at.y), 0.0);
    }
    let shelf = storage::shelf(stage, 0.7);
    stage.against_wall(&alone(shelf), Along::Corner);
}
