//! Geometry of lamps. The origin is the mounting point of hanging lamps and the foot of standing ones.

use lo_geometry::{Quat, Vec2, Vec3};

use crate::chance::{between, chance, count};
use crate::furniture::WallObject;
use crate::palette::Finish;
use crate::photometry::{self, Glow};
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::{Paint, Shape};

/// A lamp, which is on if it has a glow.
pub(super) struct Lamp {
    pub name: &'static str,
    pub shape: Shape,
    pub glow: Option<Glow>,
}

/// Names of the materials that emit when a lamp is on.
const EMISSIVE_MATERIALS: [&str; 2] = ["bulb", "shade"];
/// Share of a shaded lamp's flux that passes through the shade. The rest leaves the open ends.
const SHADE_TRANSMITTED_SHARE: f32 = 0.45;

fn opal(builder: &mut RoomBuilder) -> Paint {
    builder.palette.paint(Finish::Matte).tinted([0.85, 0.84, 0.8])
}

/// Makes the triangles from `first` on emit, if there is a glow.
fn emit_if_on(builder: &mut RoomBuilder, shape: &mut Shape, first: usize, glow: Option<Glow>) {
    if let Some(glow) = glow {
        photometry::emit_from(&mut builder.palette, shape, first, &glow);
    }
}

/// Builds a flat panel in or under the ceiling.
pub(super) fn panel(builder: &mut RoomBuilder, half: Vec2, glow: Option<Glow>) -> Lamp {
    let metal = builder.palette.paint(Finish::Gloss).tinted([0.85; 3]);
    let (white, drop) = (opal(builder), 0.03);
    let mut shape = Shape::default();
    shape.cuboid(Vec3::new(-half.x, -drop, -half.y), Vec3::new(half.x, -0.0005, half.y), metal);
    let inner = half - Vec2::splat(0.012);
    let first = shape.triangles.len();
    shape.cuboid(Vec3::new(-inner.x, -drop - 0.004, -inner.y), Vec3::new(inner.x, -drop - 0.0005, inner.y), white);
    emit_if_on(builder, &mut shape, first, glow);
    Lamp { name: "ceiling panel", shape, glow }
}

/// Builds a small round recessed ceiling lamp.
pub(super) fn downlight(builder: &mut RoomBuilder, glow: Option<Glow>) -> Lamp {
    let metal = builder.palette.paint(Finish::Metal);
    let white = opal(builder);
    let mut shape = Shape::default();
    let ring = [[0.036, -0.004], [0.045, -0.005], [0.048, -0.0005]];
    shape.lathe(Vec3::ZERO, &ring, 20, metal);
    let first = shape.triangles.len();
    shape.lathe(Vec3::ZERO, &[[0.034, -0.0075], [0.036, -0.0065], [0.036, -0.0045]], 20, white);
    emit_if_on(builder, &mut shape, first, glow);
    Lamp { name: "downlight", shape, glow }
}

/// Builds a bowl of opal glass under the ceiling.
pub(super) fn dome(builder: &mut RoomBuilder, glow: Option<Glow>) -> Lamp {
    let metal = builder.palette.paint(Finish::Metal);
    let white = opal(builder);
    let r = between(&mut builder.random, 0.13, 0.24);
    let h = r * between(&mut builder.random, 0.3, 0.55);
    let mut shape = Shape::default();
    shape.lathe(Vec3::ZERO, &[[1.03 * r, -0.025], [1.03 * r, -0.0005]], 32, metal);
    let first = shape.triangles.len();
    let mut profile: Vec<[f32; 2]> = (0..=7)
        .map(|k| {
            let angle = std::f32::consts::FRAC_PI_2 * k as f32 / 7.0;
            [r * angle.sin(), -0.026 - h * angle.cos()]
        })
        .collect();
    profile[0][0] = 0.0;
    shape.lathe(Vec3::ZERO, &profile, 32, white);
    emit_if_on(builder, &mut shape, first, glow);
    Lamp { name: "ceiling lamp", shape, glow }
}

/// Builds a bar with three or four spotlights, each a short can with a bright disc.
pub(super) fn spots(builder: &mut RoomBuilder, glow: Option<Glow>) -> Lamp {
    let metal = builder.palette.paint(Finish::SecondMetal);
    let white = opal(builder);
    let heads = count(&mut builder.random, 3, 4);
    let half = 0.16 * heads as f32;
    let mut shape = Shape::default();
    shape.board(Vec3::new(-half, -0.035, -0.02), Vec3::new(half, -0.0005, 0.02), metal);
    let each = glow.map(|g| Glow { flux_lm: g.flux_lm / heads as f32, ..g });
    for k in 0..heads {
        let x = -half + 2.0 * half * (k as f32 + 0.5) / heads as f32;
        let tilt = Quat::from_rotation_z(between(&mut builder.random, -0.5, 0.5))
            * Quat::from_rotation_x(between(&mut builder.random, -0.6, 0.6));
        let mut head = Shape::default();
        head.lathe(Vec3::ZERO, &[[0.03, -0.09], [0.032, -0.088], [0.028, 0.0]], 16, metal);
        let first = head.triangles.len();
        head.lathe(Vec3::ZERO, &[[0.026, -0.0935], [0.027, -0.0905]], 16, white);
        emit_if_on(builder, &mut head, first, each);
        shape.add(&head, tilt, Vec3::new(x, -0.055, 0.0));
        shape.bar(Vec3::new(x, -0.065, 0.0), Vec3::new(x, -0.03, 0.0), [0.006; 2], 8, metal);
    }
    Lamp { name: "spots", shape, glow }
}

/// Builds a pendant that reaches `length` below the ceiling: an opal ball, a shade or a metal bell.
pub(super) fn pendant(builder: &mut RoomBuilder, length: f32, glow: Option<Glow>) -> Lamp {
    let black = builder.palette.paint(Finish::Matte).tinted([0.05; 3]);
    let metal = builder.palette.paint(Finish::SecondMetal);
    let mut shape = Shape::default();
    shape.lathe(Vec3::ZERO, &[[0.05, -0.03], [0.05, -0.0005]], 16, metal);
    match count(&mut builder.random, 0, 2) {
        0 => {
            let r = between(&mut builder.random, 0.1, 0.2).min(0.4 * length);
            shape.bar(Vec3::Y * (2.0 * r - length), Vec3::Y * -0.02, [0.003; 2], 6, black);
            let white = opal(builder);
            let first = shape.triangles.len();
            shape.ball(Vec3::Y * (r - length), [r, r], 28, white);
            emit_if_on(builder, &mut shape, first, glow);
        }
        1 => {
            let r = between(&mut builder.random, 0.15, 0.27);
            let h = (r * between(&mut builder.random, 0.7, 1.1)).min(0.7 * length);
            let low = -length;
            shape.bar(Vec3::Y * (low + 0.6 * h), Vec3::Y * -0.02, [0.003; 2], 6, black);
            shaded_bulb(builder, &mut shape, Vec3::Y * low, [r, 0.85 * r, h], glow);
        }
        _ => {
            let r = between(&mut builder.random, 0.12, 0.22);
            let h = (1.1 * r).min(0.7 * length);
            let low = -length;
            shape.bar(Vec3::Y * (low + h), Vec3::Y * -0.02, [0.003; 2], 6, black);
            let t = 0.004;
            let profile = [[r, 0.0], [0.8 * r, 0.55 * h], [0.25 * r, h], [0.0, h]];
            shape.lathe(Vec3::Y * low, &profile_shell(&profile, t), 32, metal);
            bulb(builder, &mut shape, Vec3::Y * (low + 0.35 * h), 0.035, glow);
        }
    }
    Lamp { name: "pendant", shape, glow }
}

/// Closed profile of thickness `t`: down the inside, up the outside.
fn profile_shell(outside: &[[f32; 2]], t: f32) -> Vec<[f32; 2]> {
    let mut inside: Vec<[f32; 2]> =
        outside.iter().map(|&[r, y]| [(r - t).max(0.0), y - if r == 0.0 { t } else { 0.0 }]).collect();
    inside.reverse();
    inside.extend_from_slice(outside);
    inside
}

fn bulb(builder: &mut RoomBuilder, shape: &mut Shape, at: Vec3, r: f32, glow: Option<Glow>) {
    let paint = builder.palette.named("bulb", [0.85; 3]);
    let first = shape.triangles.len();
    shape.ball(at, [r, 1.15 * r], 14, paint);
    emit_if_on(builder, shape, first, glow);
}

/// Adds a cloth shade, open above and below, around a bulb. The array holds its lower and upper radius and height.
fn shaded_bulb(builder: &mut RoomBuilder, shape: &mut Shape, at: Vec3, [low, high, h]: [f32; 3], glow: Option<Glow>) {
    let paint = builder.palette.named("shade", [0.75, 0.72, 0.65]);
    let first = shape.triangles.len();
    let t = 0.0015;
    let profile = [[high - t, h], [low - t, 0.0], [low, 0.0], [high, h]];
    shape.ring(at, &profile, 32, paint);
    emit_if_on(builder, shape, first, glow.map(|g| Glow { flux_lm: SHADE_TRANSMITTED_SHARE * g.flux_lm, ..g }));
    let rest = glow.map(|g| Glow { flux_lm: (1.0 - SHADE_TRANSMITTED_SHARE) * g.flux_lm, ..g });
    bulb(builder, shape, at + Vec3::Y * 0.45 * h, 0.03, rest);
}

/// Builds a floor lamp, 140–175 cm high, switched off: a shade or a ball on a stem.
pub(super) fn floor_lamp(builder: &mut RoomBuilder) -> Piece {
    let metal = builder.palette.paint(Finish::SecondMetal);
    let h = between(&mut builder.random, 1.4, 1.75);
    let r = between(&mut builder.random, 0.16, 0.24);
    let shade = between(&mut builder.random, 0.22, 0.34);
    let mut shape = Shape::default();
    shape.lathe(Vec3::ZERO, &[[0.15, 0.0], [0.15, 0.018], [0.02, 0.026]], 28, metal);
    if chance(&mut builder.random, 0.25) {
        let r = between(&mut builder.random, 0.11, 0.16);
        shape.bar(Vec3::Y * 0.02, Vec3::Y * (h - 2.0 * r), [0.011; 2], 10, metal);
        let paint = builder.palette.named("bulb", [0.85; 3]);
        shape.ball(Vec3::Y * (h - r), [r, r], 28, paint);
    } else {
        shape.bar(Vec3::Y * 0.02, Vec3::Y * (h - 0.75 * shade), [0.011; 2], 10, metal);
        shaded_bulb(builder, &mut shape, Vec3::Y * (h - shade), [r, 0.8 * r, shade], None);
        spider(&mut shape, Vec3::Y * (h - 0.75 * shade), 0.84 * r, metal);
    }
    Piece::new("floor lamp", shape)
}

/// Adds the three wires that carry a shade.
fn spider(shape: &mut Shape, at: Vec3, r: f32, paint: Paint) {
    for k in 0..3 {
        let angle = std::f32::consts::TAU * k as f32 / 3.0;
        shape.bar(at, at + Vec3::new(angle.cos() * r, 0.0, angle.sin() * r), [0.002; 2], 5, paint);
    }
}

/// Builds a table lamp, 34–50 cm high, switched off: a shade on a foot.
pub(super) fn table_lamp(builder: &mut RoomBuilder) -> Piece {
    let gloss = builder.palette.paint(Finish::Gloss).tinted(builder.palette.tint(&mut builder.random));
    let h = between(&mut builder.random, 0.34, 0.5);
    let (r, shade) = (0.28 * h, 0.4 * h);
    let mut shape = Shape::default();
    let belly = between(&mut builder.random, 0.3, 0.75) * r;
    let foot = [
        [0.6 * r, 0.0],
        [0.6 * r, 0.012],
        [0.2 * r, 0.03],
        [belly, 0.26 * h],
        [0.12 * r, 0.5 * h],
        [0.1 * r, 0.72 * h],
    ];
    shape.lathe(Vec3::ZERO, &foot, 24, gloss);
    shaded_bulb(builder, &mut shape, Vec3::Y * (h - shade), [r, 0.7 * r, shade], None);
    spider(&mut shape, Vec3::Y * 0.715 * h, 0.82 * r, gloss);
    Piece::new("table lamp", shape)
}

/// Builds a desk lamp, switched off: a jointed arm with a small bell.
pub(super) fn desk_lamp(builder: &mut RoomBuilder) -> Piece {
    let metal = builder.palette.paint(Finish::SecondMetal);
    let mut shape = Shape::default();
    shape.lathe(Vec3::ZERO, &[[0.085, 0.0], [0.085, 0.015], [0.02, 0.022]], 24, metal);
    let elbow = Vec3::new(0.0, 0.3, -0.06);
    let head = Vec3::new(0.0, 0.42, 0.14);
    shape.pipe(&[Vec3::Y * 0.02, elbow, head], 0.007, 8, metal);
    let mut bell = Shape::default();
    let profile = [[0.066, -0.09], [0.07, -0.09], [0.035, -0.015], [0.02, 0.005], [0.0, 0.005]];
    bell.lathe(Vec3::ZERO, &profile_inner(&profile), 24, metal);
    let paint = builder.palette.named("bulb", [0.85; 3]);
    bell.ball(Vec3::Y * -0.06, [0.022, 0.025], 12, paint);
    shape.add(&bell, Quat::from_rotation_x(-0.35), head);
    Piece::new("desk lamp", shape)
}

/// Profile of a bell closed by its inner side.
fn profile_inner(outside: &[[f32; 2]]) -> Vec<[f32; 2]> {
    let mut profile = vec![[0.0, -0.02], [0.03, -0.03]];
    profile.extend_from_slice(outside);
    profile
}

/// Builds a wall lamp, switched off: a bowl that shines up and into the room.
pub(super) fn sconce(builder: &mut RoomBuilder) -> WallObject {
    let metal = builder.palette.paint(Finish::Metal);
    let white = builder.palette.named("bulb", [0.85; 3]);
    let half = between(&mut builder.random, 0.06, 0.25);
    let mut shape = Shape::default();
    shape.board(Vec3::new(-half - 0.01, -0.05, 0.001), Vec3::new(half + 0.01, 0.05, 0.025), metal);
    shape.rounded(Vec3::new(-half, -0.04, 0.027), Vec3::new(half, 0.04, 0.085), 0.02, 2, white);
    WallObject { name: "wall lamp", shape }
}

/// Switches on a lamp of the room: its bulb and its shade, if it has one.
pub(super) fn switch_on(builder: &mut RoomBuilder, object: usize, glow: &Glow) {
    let parts = builder.objects[object].parts.clone();
    let of = |builder: &RoomBuilder, name: &str| -> Vec<std::ops::Range<usize>> {
        let parts = builder.shape.parts[parts.clone()].iter().map(|part| part.triangles.clone());
        parts.filter(|t| builder.palette.materials[builder.shape.materials[t.start] as usize].name == name).collect()
    };
    let [bulbs, shades] = EMISSIVE_MATERIALS.map(|name| of(builder, name));
    let through = if shades.is_empty() { 0.0 } else { SHADE_TRANSMITTED_SHARE };
    for (ranges, share) in [(bulbs, 1.0 - through), (shades, through)] {
        for range in ranges {
            let glow = Glow { flux_lm: share * glow.flux_lm, ..*glow };
            photometry::emit_range(&mut builder.palette, &mut builder.shape, range, &glow);
        }
    }
}
