//! Lamps: ceiling fixtures, floor, table and wall lamps, and which of them are on.

mod fixtures;

use lo_geometry::{Quat, Vec2, Vec3};

use crate::chance::{between, chance, count, pick, weighted};
use crate::description::{LampUse, RoomKind};
use crate::furniture::{hang, put_on};
use crate::layout::Footprint;
use crate::photometry::Glow;
use crate::stage::{Along, Stage, Support};
use fixtures::Lamp;

/// Type of ceiling fixture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ceiling {
    Panels,
    Tubes,
    Downlights,
    Dome,
    Pendant,
    Spots,
}

/// Utilisation factor: share of the lamps' flux that reaches the working plane.
const UTILISATION: f32 = 0.45;

/// Adds lamps and switches on those that `lighting` asks for.
pub(crate) fn light(stage: &mut Stage, kind: RoomKind, lighting: LampUse) {
    let kelvin = match kind {
        RoomKind::Office | RoomKind::Classroom | RoomKind::Laboratory | RoomKind::Workshop | RoomKind::Hall => {
            between(&mut stage.random, 3500.0, 5200.0)
        }
        _ => {
            weighted(&mut stage.random, &[(2700.0, 0.5), (3000.0, 0.3), (4000.0, 0.2)])
                + between(&mut stage.random, -150.0, 150.0)
        }
    };
    let burn = match lighting {
        LampUse::Daylight | LampUse::SingleLamp => 0.0,
        LampUse::Normal => 0.3,
        LampUse::OverLit | LampUse::Mixed => 1.0,
    };
    let mut switch = Switch {
        burn,
        single: lighting == LampUse::SingleLamp,
        gain: if lighting == LampUse::OverLit { 2.0 } else { 1.0 },
        kelvin: kelvin.min(3200.0),
        on: 0,
    };
    small_lamps(stage, kind, &mut switch);
    let main = match lighting {
        LampUse::Normal | LampUse::OverLit => true,
        LampUse::Mixed | LampUse::SingleLamp => switch.on == 0,
        LampUse::Daylight => false,
    };
    let before = stage.lamps_on;
    ceiling_lamps(stage, kind, kelvin, main, lighting);
    if main && stage.lamps_on == before {
        // Furniture or a slope left no room on the ceiling.
        wall_lamp(stage, &mut Switch { burn: 1.0, ..switch });
    }
}

/// Range of illuminance for a room's purpose (EN 12464-1 and common practice in homes), lux.
fn usual_lux(kind: RoomKind) -> [f32; 2] {
    match kind {
        RoomKind::Office | RoomKind::Classroom | RoomKind::Laboratory | RoomKind::Workshop => [300.0, 600.0],
        RoomKind::Hall => [150.0, 400.0],
        RoomKind::Kitchen | RoomKind::Bathroom => [150.0, 400.0],
        RoomKind::Corridor | RoomKind::Bedroom | RoomKind::Cellar => [60.0, 180.0],
        _ => [80.0, 250.0],
    }
}

fn ceiling_lamps(stage: &mut Stage, kind: RoomKind, kelvin: f32, burns: bool, lighting: LampUse) {
    let sloped = stage.plan.slope.is_some();
    let kinds: &[(Ceiling, f32)] = match kind {
        RoomKind::Workshop | RoomKind::Hall => {
            &[(Ceiling::Tubes, 0.7), (Ceiling::Panels, 0.15), (Ceiling::Pendant, 0.15)]
        }
        RoomKind::Cellar => &[(Ceiling::Tubes, 0.4), (Ceiling::Dome, 0.4), (Ceiling::Pendant, 0.2)],
        RoomKind::Office | RoomKind::Classroom | RoomKind::Laboratory => {
            &[(Ceiling::Panels, 0.5), (Ceiling::Tubes, 0.4), (Ceiling::Downlights, 0.1)]
        }
        RoomKind::Kitchen | RoomKind::Bathroom | RoomKind::Corridor => {
            &[(Ceiling::Downlights, 0.4), (Ceiling::Dome, 0.35), (Ceiling::Spots, 0.15), (Ceiling::Panels, 0.1)]
        }
        _ => &[(Ceiling::Pendant, 0.45), (Ceiling::Dome, 0.2), (Ceiling::Spots, 0.15), (Ceiling::Downlights, 0.2)],
    };
    let ceiling = if sloped { Ceiling::Pendant } else { weighted(&mut stage.random, kinds) };
    let [low, high] = usual_lux(kind);
    let lux = between(&mut stage.random, low, high)
        * match lighting {
            LampUse::OverLit => between(&mut stage.random, 3.0, 6.0),
            LampUse::SingleLamp => 0.3,
            _ => 1.0,
        };
    let places = places(stage, ceiling);
    let number = if lighting == LampUse::SingleLamp { 1 } else { places.len().max(1) };
    let flux_lm = (lux * stage.plan.area_m2() / UTILISATION / number as f32).clamp(120.0, 12_000.0) * stage.dim;
    for (index, place) in places.into_iter().enumerate() {
        let burning = burns && index < number;
        let glow = burning.then(|| Glow { flux_lm, kelvin: stage.kelvin(kelvin) });
        mount(stage, ceiling, place, glow);
    }
}

/// Draws the positions (x, z) of the ceiling fixtures.
fn places(stage: &mut Stage, ceiling: Ceiling) -> Vec<Vec2> {
    let spacing = match ceiling {
        Ceiling::Downlights => between(&mut stage.random, 1.1, 1.8),
        Ceiling::Panels | Ceiling::Tubes => between(&mut stage.random, 2.0, 2.8),
        _ => 4.2,
    } * stage.plan.grown;
    let table = stage.objects.iter().position(|o| o.name == "dining table");
    let mut places = Vec::new();
    if let (Ceiling::Pendant, Some(table)) = (ceiling, table) {
        let (least, most) = stage.box_of(table);
        places.push(Vec2::new(0.5 * (least.x + most.x), 0.5 * (least.z + most.z)));
        if stage.plan.area_m2() < 16.0 {
            return places;
        }
    }
    for [a, b] in stage.plan.rectangles.clone() {
        let size = b - a;
        let cells = (size / spacing).round().max(Vec2::ONE);
        for (i, j) in (0..cells.x as usize).flat_map(|i| (0..cells.y as usize).map(move |j| (i, j))) {
            let p = a + size * Vec2::new((i as f32 + 0.5) / cells.x, (j as f32 + 0.5) / cells.y);
            if places.iter().all(|q: &Vec2| q.distance(p) > 0.9) {
                places.push(p);
            }
        }
    }
    places.truncate(24);
    places
}

fn mount(stage: &mut Stage, ceiling: Ceiling, at: Vec2, glow: Option<Glow>) {
    let lamp = match ceiling {
        Ceiling::Panels => fixtures::panel(stage, Vec2::splat(0.3), glow),
        Ceiling::Tubes => {
            let half = pick(&mut stage.random, &[Vec2::new(0.62, 0.06), Vec2::new(0.75, 0.1)]);
            fixtures::panel(stage, half, glow)
        }
        Ceiling::Downlights => fixtures::downlight(stage, glow),
        Ceiling::Dome => fixtures::dome(stage, glow),
        Ceiling::Spots => fixtures::spots(stage, glow),
        Ceiling::Pendant => {
            let top = stage.plan.ceiling(at);
            let over_table = stage.objects.iter().enumerate().any(|(k, o)| {
                let (least, most) = if o.name == "dining table" { stage.box_of(k) } else { (Vec3::MAX, Vec3::MIN) };
                at.x > least.x && at.x < most.x && at.y > least.z && at.y < most.z
            });
            // Low above a table; elsewhere with headroom for walking.
            let low = if over_table { between(&mut stage.random, 1.4, 1.6) } else { 2.0 };
            fixtures::pendant(stage, (top - low).max(0.25), glow)
        }
    };
    let top = stage.plan.ceiling(at);
    let (least, most) = lamp.shape.bounds();
    let footprint = Footprint::of_box(least, most, 0.0, at);
    // Pendants can hang from a slope, flat fixtures cannot.
    let pendant = ceiling == Ceiling::Pendant;
    let low = (top + least.y).min(top - 0.012);
    let y = [low, if pendant { low + 0.3 } else { top - 0.01 }];
    let level = footprint.corners().iter().all(|&c| stage.plan.ceiling(c) > top - 0.01);
    if (pendant || level) && stage.layout.is_clear(&stage.plan, &footprint, y) {
        stage.layout.take(footprint, y);
        fix(stage, &lamp, Support::Ceiling, Quat::IDENTITY, Vec3::new(at.x, top, at.y));
    }
}

/// Adds a lamp and updates the counts.
fn fix(stage: &mut Stage, lamp: &Lamp, support: Support, rotation: Quat, offset: Vec3) {
    stage.fix(lamp.name, support, &lamp.shape, rotation, offset);
    stage.lamps += 1;
    if let Some(glow) = lamp.glow {
        stage.lamps_on += 1;
        stage.flux_lm += glow.flux_lm;
    }
}

/// Decides which small lamps are on.
struct Switch {
    /// Probability that a lamp is on.
    burn: f32,
    /// Whether only the first lamp is on, regardless of the probability.
    single: bool,
    gain: f32,
    kelvin: f32,
    /// Number of lamps switched on so far.
    on: usize,
}

impl Switch {
    /// Counts a lamp of the room and switches it on or leaves it off.
    fn throw(&mut self, stage: &mut Stage, object: usize, [low, high]: [f32; 2]) {
        let burns = if self.single { self.on == 0 } else { chance(&mut stage.random, self.burn) };
        let flux_lm = between(&mut stage.random, low, high) * self.gain * stage.dim;
        stage.lamps += 1;
        if burns {
            let kelvin = stage.kelvin(self.kelvin);
            fixtures::ignite(stage, object, &Glow { flux_lm, kelvin });
            self.on += 1;
            stage.lamps_on += 1;
            stage.flux_lm += flux_lm;
        }
    }
}

/// Adds floor lamps, table and desk lamps, and sconces.
fn small_lamps(stage: &mut Stage, kind: RoomKind, switch: &mut Switch) {
    let homely = !matches!(
        kind,
        RoomKind::Bathroom
            | RoomKind::Classroom
            | RoomKind::Corridor
            | RoomKind::Kitchen
            | RoomKind::Laboratory
            | RoomKind::Cellar
            | RoomKind::Workshop
            | RoomKind::Hall
    );
    if homely && (switch.single || chance(&mut stage.random, 0.6)) {
        for _ in 0..count(&mut stage.random, 1, 2) {
            let lamp = fixtures::floor_lamp(stage);
            if let Some(object) = stage.against_wall(&vec![(lamp, Vec2::ZERO, 0.0)], Along::Corner) {
                switch.throw(stage, object[0], [500.0, 1500.0]);
            }
        }
    }
    for top in 0..stage.tops.len() {
        let name = stage.tops[top].name;
        let share = match name {
            "night table" => 0.75,
            "desk" | "workbench" => 0.5,
            "side table" | "sideboard" | "chest" => 0.35,
            _ => 0.0,
        };
        if !chance(&mut stage.random, share) {
            continue;
        }
        let lamp =
            if matches!(name, "desk" | "workbench") { fixtures::desk_lamp(stage) } else { fixtures::table_lamp(stage) };
        if put_on(stage, top, &lamp, None) {
            let object = stage.objects.len() - 1;
            switch.throw(stage, object, [250.0, 800.0]);
        }
    }
    let share = if kind == RoomKind::Bathroom { 0.6 } else { 0.2 };
    if (homely || kind == RoomKind::Bathroom) && chance(&mut stage.random, share) {
        wall_lamp(stage, switch);
    }
}

fn wall_lamp(stage: &mut Stage, switch: &mut Switch) {
    let sconce = fixtures::sconce(stage);
    if hang(stage, &sconce, 1.95, None) {
        let object = stage.objects.len() - 1;
        switch.throw(stage, object, [300.0, 900.0]);
    }
}
