//! Lamps: ceiling fixtures, floor, table and wall lamps, and which of them are on.

mod fixtures;

use lo_geometry::{Quat, Vec2, Vec3};

use crate::chance::{between, chance, count, pick, weighted};
use crate::description::{LightingMode, RoomKind};
use crate::furniture::{hang, put_on};
use crate::occupancy::Footprint;
use crate::photometry::Glow;
use crate::room_builder::{RoomBuilder, Support, WallPosition};
use fixtures::Lamp;

/// Type of ceiling fixture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CeilingFixture {
    Panels,
    Tubes,
    Downlights,
    Dome,
    Pendant,
    Spots,
}

/// Utilisation factor: share of the lamps' flux that reaches the working plane.
const UTILISATION_FACTOR: f32 = 0.45;

/// Adds lamps and switches on those that `lighting` asks for.
pub(crate) fn add_lamps(builder: &mut RoomBuilder, kind: RoomKind, lighting: LightingMode) {
    let kelvin = match kind {
        RoomKind::Office | RoomKind::Classroom | RoomKind::Laboratory | RoomKind::Workshop | RoomKind::Hall => {
            between(&mut builder.random, 3500.0, 5200.0)
        }
        _ => {
            weighted(&mut builder.random, &[(2700.0, 0.5), (3000.0, 0.3), (4000.0, 0.2)])
                + between(&mut builder.random, -150.0, 150.0)
        }
    };
    let on_probability = match lighting {
        LightingMode::Daylight | LightingMode::SingleLamp => 0.0,
        LightingMode::Normal => 0.3,
        LightingMode::OverLit | LightingMode::Mixed => 1.0,
    };
    let mut switch = LampSwitch {
        on_probability,
        single: lighting == LightingMode::SingleLamp,
        gain: if lighting == LightingMode::OverLit { 2.0 } else { 1.0 },
        kelvin: kelvin.min(3200.0),
        on_count: 0,
    };
    small_lamps(builder, kind, &mut switch);
    let main = match lighting {
        LightingMode::Normal | LightingMode::OverLit => true,
        LightingMode::Mixed | LightingMode::SingleLamp => switch.on_count == 0,
        LightingMode::Daylight => false,
    };
    let before = builder.lamps_on;
    ceiling_lamps(builder, kind, kelvin, main, lighting);
    if main && builder.lamps_on == before {
        // Furniture or a slope left no room on the ceiling.
        wall_lamp(builder, &mut LampSwitch { on_probability: 1.0, ..switch });
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

fn ceiling_lamps(builder: &mut RoomBuilder, kind: RoomKind, kelvin: f32, on: bool, lighting: LightingMode) {
    let sloped = builder.plan.slope.is_some();
    let kinds: &[(CeilingFixture, f32)] = match kind {
        RoomKind::Workshop | RoomKind::Hall => {
            &[(CeilingFixture::Tubes, 0.7), (CeilingFixture::Panels, 0.15), (CeilingFixture::Pendant, 0.15)]
        }
        RoomKind::Cellar => {
            &[(CeilingFixture::Tubes, 0.4), (CeilingFixture::Dome, 0.4), (CeilingFixture::Pendant, 0.2)]
        }
        RoomKind::Office | RoomKind::Classroom | RoomKind::Laboratory => {
            &[(CeilingFixture::Panels, 0.5), (CeilingFixture::Tubes, 0.4), (CeilingFixture::Downlights, 0.1)]
        }
        RoomKind::Kitchen | RoomKind::Bathroom | RoomKind::Corridor => &[
            (CeilingFixture::Downlights, 0.4),
            (CeilingFixture::Dome, 0.35),
            (CeilingFixture::Spots, 0.15),
            (CeilingFixture::Panels, 0.1),
        ],
        _ => &[
            (CeilingFixture::Pendant, 0.45),
            (CeilingFixture::Dome, 0.2),
            (CeilingFixture::Spots, 0.15),
            (CeilingFixture::Downlights, 0.2),
        ],
    };
    let fixture = if sloped { CeilingFixture::Pendant } else { weighted(&mut builder.random, kinds) };
    let [low, high] = usual_lux(kind);
    let lux = between(&mut builder.random, low, high)
        * match lighting {
            LightingMode::OverLit => between(&mut builder.random, 3.0, 6.0),
            LightingMode::SingleLamp => 0.3,
            _ => 1.0,
        };
    let positions = fixture_positions(builder, fixture);
    let number = if lighting == LightingMode::SingleLamp { 1 } else { positions.len().max(1) };
    let flux_lm =
        (lux * builder.plan.area_m2() / UTILISATION_FACTOR / number as f32).clamp(120.0, 12_000.0) * builder.dimming;
    for (index, position) in positions.into_iter().enumerate() {
        let lit = on && index < number;
        let glow = lit.then(|| Glow { flux_lm, kelvin: builder.lamp_kelvin(kelvin) });
        mount_fixture(builder, fixture, position, glow);
    }
}

/// Draws the positions (x, z) of the ceiling fixtures.
fn fixture_positions(builder: &mut RoomBuilder, fixture: CeilingFixture) -> Vec<Vec2> {
    let spacing = match fixture {
        CeilingFixture::Downlights => between(&mut builder.random, 1.1, 1.8),
        CeilingFixture::Panels | CeilingFixture::Tubes => between(&mut builder.random, 2.0, 2.8),
        _ => 4.2,
    } * builder.plan.size_factor;
    let table = builder.objects.iter().position(|o| o.name == "dining table");
    let mut positions = Vec::new();
    if let (CeilingFixture::Pendant, Some(table)) = (fixture, table) {
        let (min, max) = builder.object_bounds(table);
        positions.push(Vec2::new(0.5 * (min.x + max.x), 0.5 * (min.z + max.z)));
        if builder.plan.area_m2() < 16.0 {
            return positions;
        }
    }
    for [a, b] in builder.plan.rectangles.clone() {
        let size = b - a;
        let cells = (size / spacing).round().max(Vec2::ONE);
        for (i, j) in (0..cells.x as usize).flat_map(|i| (0..cells.y as usize).map(move |j| (i, j))) {
            let p = a + size * Vec2::new((i as f32 + 0.5) / cells.x, (j as f32 + 0.5) / cells.y);
            if positions.iter().all(|q: &Vec2| q.distance(p) > 0.9) {
                positions.push(p);
            }
        }
    }
    positions.truncate(24);
    positions
}

fn mount_fixture(builder: &mut RoomBuilder, fixture: CeilingFixture, at: Vec2, glow: Option<Glow>) {
    let lamp = match fixture {
        CeilingFixture::Panels => fixtures::panel(builder, Vec2::splat(0.3), glow),
        CeilingFixture::Tubes => {
            let half = pick(&mut builder.random, &[Vec2::new(0.62, 0.06), Vec2::new(0.75, 0.1)]);
            fixtures::panel(builder, half, glow)
        }
        CeilingFixture::Downlights => fixtures::downlight(builder, glow),
        CeilingFixture::Dome => fixtures::dome(builder, glow),
        CeilingFixture::Spots => fixtures::spots(builder, glow),
        CeilingFixture::Pendant => {
            let top = builder.plan.ceiling(at);
            let over_table = builder.objects.iter().enumerate().any(|(k, o)| {
                let (min, max) =
                    if o.name == "dining table" { builder.object_bounds(k) } else { (Vec3::MAX, Vec3::MIN) };
                at.x > min.x && at.x < max.x && at.y > min.z && at.y < max.z
            });
            // Low above a table; elsewhere with headroom for walking.
            let low = if over_table { between(&mut builder.random, 1.4, 1.6) } else { 2.0 };
            fixtures::pendant(builder, (top - low).max(0.25), glow)
        }
    };
    let top = builder.plan.ceiling(at);
    let (min, max) = lamp.shape.bounds();
    let footprint = Footprint::of_box(min, max, 0.0, at);
    // Pendants can hang from a slope, flat fixtures cannot.
    let pendant = fixture == CeilingFixture::Pendant;
    let low = (top + min.y).min(top - 0.012);
    let y = [low, if pendant { low + 0.3 } else { top - 0.01 }];
    let level = footprint.corners().iter().all(|&c| builder.plan.ceiling(c) > top - 0.01);
    if (pendant || level) && builder.occupancy.is_clear(&builder.plan, &footprint, y) {
        builder.occupancy.occupy(footprint, y);
        add_lamp(builder, &lamp, Support::Ceiling, Quat::IDENTITY, Vec3::new(at.x, top, at.y));
    }
}

/// Adds a lamp and updates the counts.
fn add_lamp(builder: &mut RoomBuilder, lamp: &Lamp, support: Support, rotation: Quat, offset: Vec3) {
    builder.add_shape(lamp.name, support, &lamp.shape, rotation, offset);
    builder.lamps += 1;
    if let Some(glow) = lamp.glow {
        builder.lamps_on += 1;
        builder.flux_lm += glow.flux_lm;
    }
}

/// Decides which small lamps are on.
struct LampSwitch {
    /// Probability that a lamp is on.
    on_probability: f32,
    /// Whether only the first lamp is on, regardless of the probability.
    single: bool,
    gain: f32,
    kelvin: f32,
    /// Number of lamps switched on so far.
    on_count: usize,
}

impl LampSwitch {
    /// Counts a lamp of the room and switches it on or leaves it off.
    fn apply(&mut self, builder: &mut RoomBuilder, object: usize, [low, high]: [f32; 2]) {
        let on = if self.single { self.on_count == 0 } else { chance(&mut builder.random, self.on_probability) };
        let flux_lm = between(&mut builder.random, low, high) * self.gain * builder.dimming;
        builder.lamps += 1;
        if on {
            let kelvin = builder.lamp_kelvin(self.kelvin);
            fixtures::switch_on(builder, object, &Glow { flux_lm, kelvin });
            self.on_count += 1;
            builder.lamps_on += 1;
            builder.flux_lm += flux_lm;
        }
    }
}

/// Adds floor lamps, table and desk lamps, and sconces.
fn small_lamps(builder: &mut RoomBuilder, kind: RoomKind, switch: &mut LampSwitch) {
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
    if homely && (switch.single || chance(&mut builder.random, 0.6)) {
        for _ in 0..count(&mut builder.random, 1, 2) {
            let lamp = fixtures::floor_lamp(builder);
            if let Some(object) = builder.place_against_wall(&vec![(lamp, Vec2::ZERO, 0.0)], WallPosition::Corner) {
                switch.apply(builder, object[0], [500.0, 1500.0]);
            }
        }
    }
    for surface in 0..builder.surfaces.len() {
        let name = builder.surfaces[surface].name;
        let share = match name {
            "night table" => 0.75,
            "desk" | "workbench" => 0.5,
            "side table" | "sideboard" | "chest" => 0.35,
            _ => 0.0,
        };
        if !chance(&mut builder.random, share) {
            continue;
        }
        let lamp = if matches!(name, "desk" | "workbench") {
            fixtures::desk_lamp(builder)
        } else {
            fixtures::table_lamp(builder)
        };
        if put_on(builder, surface, &lamp, None) {
            let object = builder.objects.len() - 1;
            switch.apply(builder, object, [250.0, 800.0]);
        }
    }
    let share = if kind == RoomKind::Bathroom { 0.6 } else { 0.2 };
    if (homely || kind == RoomKind::Bathroom) && chance(&mut builder.random, share) {
        wall_lamp(builder, switch);
    }
}

fn wall_lamp(builder: &mut RoomBuilder, switch: &mut LampSwitch) {
    let sconce = fixtures::sconce(builder);
    if hang(builder, &sconce, 1.95, None) {
        let object = builder.objects.len() - 1;
        switch.apply(builder, object, [300.0, 900.0]);
    }
}
