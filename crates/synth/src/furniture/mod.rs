//! Furniture by use of the room: what stands where, by simple rules of use.

mod bathroom;
mod beds;
mod clutter;
mod kitchen;
mod plants;
mod seating;
mod storage;
mod tables;
mod walls;

pub(crate) use clutter::put_on;
pub(crate) use walls::{Hanging, hang};

use geometry::{Vec2, Vec3};

use crate::chance::{between, chance, count, pick};
use crate::description::{Lighting, RoomKind};
use crate::layout::Footprint;
use crate::solids::Shape;
use crate::stage::{Along, Group, Piece, Stage, Support};

/// Fills the room; `clutter` 0 … 1.
pub(crate) fn furnish(stage: &mut Stage, kind: RoomKind, clutter: f32, lighting: Lighting) {
    let screens = lighting != Lighting::SingleLamp && lighting != Lighting::Daylight;
    let screens = chance(&mut stage.random, if screens { 0.5 } else { 0.25 });
    match kind {
        RoomKind::Bedroom => bedroom(stage, clutter, screens),
        RoomKind::Living => living(stage, clutter, screens),
        RoomKind::Kitchen => kitchen_room(stage, lighting),
        RoomKind::Office => office(stage, clutter, screens),
        RoomKind::Dining => dining(stage, clutter),
        RoomKind::Bathroom => bathroom_room(stage),
        RoomKind::Corridor => corridor(stage, clutter),
        RoomKind::Studio => {
            bedroom(stage, 0.5 * clutter, false);
            living(stage, clutter, screens);
            office(stage, 0.3 * clutter, screens);
        }
        RoomKind::Classroom => classroom(stage),
        RoomKind::OpenPlan => {
            kitchen_room(stage, lighting);
            living(stage, clutter, screens);
        }
    }
    extras(stage, kind, clutter);
    clutter::scatter(stage, clutter);
}

fn alone(piece: Piece) -> Group {
    vec![(piece, Vec2::ZERO, 0.0)]
}

fn center(stage: &Stage, object: usize) -> Vec2 {
    let (least, most) = stage.box_of(object);
    Vec2::new(0.5 * (least.x + most.x), 0.5 * (least.z + most.z))
}

fn bedroom(stage: &mut Stage, clutter: f32, screens: bool) {
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

fn living(stage: &mut Stage, clutter: f32, screens: bool) {
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

fn kitchen_room(stage: &mut Stage, lighting: Lighting) {
    let strip = !matches!(lighting, Lighting::Daylight) && chance(&mut stage.random, 0.3);
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

fn dining(stage: &mut Stage, clutter: f32) {
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

/// A table with chairs, most of them pushed under it, some drawn out.
fn dining_group(stage: &mut Stage) {
    let round = chance(&mut stage.random, 0.25);
    let large = stage.plan.area_m2() > 12.0;
    let half = if round {
        Vec2::splat(between(&mut stage.random, 0.45, if large { 0.65 } else { 0.5 }))
    } else {
        let long = if large { between(&mut stage.random, 0.7, 1.05) } else { between(&mut stage.random, 0.4, 0.62) };
        Vec2::new(long, between(&mut stage.random, 0.38, 0.48))
    };
    let style = seating::chair_style(stage);
    let chair = seating::chair(stage, style);
    let table = tables::dining_table(stage, half, round);
    let mut group = alone(table);
    // The seat's middle from the edge of the table: its front is 10 to 15 cm below the top.
    let out = |stage: &mut Stage| {
        if chance(&mut stage.random, 0.2) {
            between(&mut stage.random, 0.2, 0.35)
        } else {
            between(&mut stage.random, 0.07, 0.14)
        }
    };
    if round {
        let number = if half.x > 0.55 { 5 } else { 4 };
        for k in 0..number {
            let angle = std::f32::consts::TAU * (k as f32 + 0.25) / number as f32;
            let direction = Vec2::new(angle.sin(), angle.cos());
            // The chair's front (z) looks to the middle.
            group.push((chair.clone(), direction * (half.x + out(stage)), angle + std::f32::consts::PI));
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
            let z = side * (half.y + out(stage));
            let yaw = if side > 0.0 { std::f32::consts::PI } else { 0.0 } + between(&mut stage.random, -0.06, 0.06);
            group.push((chair.clone(), Vec2::new(x, z), yaw));
        }
        if half.x > 0.6 && chance(&mut stage.random, 0.35) {
            for side in [-1.0, 1.0] {
                let yaw = -side * std::f32::consts::FRAC_PI_2;
                group.push((chair.clone(), Vec2::new(side * (half.x + out(stage)), 0.0), yaw));
            }
        }
    }
    let mut placed = stage.freely(&group, None, 0.25).or_else(|| stage.freely(&group, None, 0.02));
    while placed.is_none() && group.len() > 2 {
        group.truncate(group.len() / 2 + 1);
        placed = stage.freely(&group, None, 0.02).or_else(|| stage.against_wall(&group, Along::Anywhere));
    }
    if let Some(placed) = placed
        && chance(&mut stage.random, 0.3)
    {
        let at = center(stage, placed[0]);
        rug(stage, at, half + Vec2::splat(0.6));
    }
}

fn desk_group(stage: &mut Stage, on: bool) {
    let width = between(&mut stage.random, 1.1, 1.7);
    let desk = tables::desk(stage, width);
    let depth = desk.shape.bounds().1.z;
    let mut group = alone(desk);
    let chair = seating::office_chair(stage);
    let out = between(&mut stage.random, 0.25, 0.45);
    group.push((
        chair,
        Vec2::new(between(&mut stage.random, -0.2, 0.05), depth + out),
        std::f32::consts::PI + between(&mut stage.random, -0.5, 0.5),
    ));
    if stage.against_wall(&group, Along::Anywhere).is_some() {
        let top = stage.tops.len() - 1;
        let computer = clutter::computer(stage, on);
        let z = 0.5 * depth - 0.32;
        clutter::put_on(stage, top, &computer, Some((Vec2::new(-0.12, -z.max(-0.05)), 0.0)));
    }
}

fn office(stage: &mut Stage, clutter: f32, screens: bool) {
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

fn bathroom_room(stage: &mut Stage) {
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

fn corridor(stage: &mut Stage, clutter: f32) {
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

fn classroom(stage: &mut Stage) {
    let (least, most) = stage.plan.extent();
    let board = walls::school_board(stage);
    // The pupils look along −z or −x, at a wall that is free for the board.
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

/// Plants, boxes, pictures, towels: whatever the use.
fn extras(stage: &mut Stage, kind: RoomKind, clutter: f32) {
    if kind == RoomKind::Bathroom {
        for _ in 0..count(&mut stage.random, 1, 2) {
            let towel = walls::towel(stage);
            walls::hang(stage, &towel, 1.35, None);
        }
    } else {
        let number = (clutter * 5.0) as usize;
        let few = count(&mut stage.random, 0, 1 + number);
        walls::pictures(stage, few);
        if chance(&mut stage.random, 0.2) {
            let clock = walls::clock(stage);
            walls::hang(stage, &clock, 2.0, None);
        }
        if chance(&mut stage.random, 0.25 + 0.4 * clutter) {
            let shelf = walls::wall_shelf(stage);
            walls::hang(stage, &shelf, 1.35, None);
        }
    }
    let plants_most = if kind == RoomKind::Bathroom { 1 } else { 3 };
    for _ in 0..count(&mut stage.random, 0, plants_most) {
        let height = between(&mut stage.random, 0.5, 1.6);
        let plant = plants::potted(stage, height);
        stage.against_wall(&alone(plant), Along::Corner);
    }
    if clutter > 0.6 {
        for _ in 0..count(&mut stage.random, 1, 3) {
            let boxes = storage::boxes(stage);
            stage.against_wall(&alone(boxes), Along::Corner);
        }
    }
    if clutter > 0.4 && kind != RoomKind::Bathroom && chance(&mut stage.random, 0.3) {
        let pouf = seating::pouf(stage);
        stage.freely(&alone(pouf), None, 0.1);
    }
}

/// A rug about a place, as large as the walls allow; furniture stands on it.
fn rug(stage: &mut Stage, at: Vec2, half: Vec2) {
    let (least, most) = stage.plan.extent();
    let half = half.min((most - least) * 0.5 - Vec2::splat(0.25));
    if half.min_element() < 0.4 {
        return;
    }
    let at = at.clamp(least + half + Vec2::splat(0.2), most - half - Vec2::splat(0.2));
    let footprint = Footprint { center: at, along: Vec2::X, half };
    let corners = footprint.corners();
    if !corners.iter().all(|&c| stage.plan.contains(c, 0.1)) {
        return;
    }
    let paint = stage.palette.rug(&mut stage.random, [2.0 * half.x, 2.0 * half.y]);
    let mut shape = Shape::default();
    shape.board(Vec3::new(0.0, 0.0, 0.0), Vec3::new(2.0 * half.x, 0.008, 2.0 * half.y), paint);
    stage.fix("rug", Support::Floor, &shape, geometry::Quat::IDENTITY, Vec3::new(at.x - half.x, 0.0, at.y - half.y));
}
