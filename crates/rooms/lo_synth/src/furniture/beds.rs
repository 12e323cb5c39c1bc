//! Beds with bedding.

use lo_geometry::{Quat, Vec2, Vec3};

use crate::chance::{between, chance, pick};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::{Paint, Shape};
use crate::texture::Noise;
use lo_random::RngExt;

/// Builds a bed of 90–180 × 200 cm with the mattress at 44–58 cm; head at z = 0.
pub(super) fn bed(builder: &mut RoomBuilder, wide: bool) -> Piece {
    let width =
        if wide { pick(&mut builder.random, &[1.4, 1.6, 1.8]) } else { pick(&mut builder.random, &[0.9, 1.0, 1.2]) };
    let (half, length) = (0.5 * width, 2.0);
    let top = between(&mut builder.random, 0.44, 0.58);
    let upholstered = chance(&mut builder.random, 0.35);
    let frame = builder.palette.paint(if upholstered { Finish::Upholstery } else { Finish::Wood });
    let linen = builder.palette.paint(Finish::Linen);
    let mut shape = Shape::default();
    let head_m = 0.06;
    let base = [0.12, top - 0.18];
    for x in [-half + 0.06, half - 0.06] {
        for z in [0.1, length - 0.02] {
            shape.board(Vec3::new(x - 0.03, 0.0, z - 0.03), Vec3::new(x + 0.03, base[0] + 0.01, z + 0.03), frame);
        }
    }
    let edge = if upholstered { 0.02 } else { 0.004 };
    let (min, max) =
        (Vec3::new(-half - 0.03, base[0], head_m), Vec3::new(half + 0.03, base[1] + 0.04, head_m + length + 0.03));
    shape.rounded(min, max, edge, 2, frame);
    let head = between(&mut builder.random, 0.75, 1.2).max(top + 0.25);
    if chance(&mut builder.random, 0.9) {
        let (min, max) = (Vec3::new(-half - 0.03, 0.1, 0.0), Vec3::new(half + 0.03, head, head_m));
        shape.rounded(min, max, edge, 2, frame);
    }
    let mattress = [Vec3::new(-half, base[1], head_m + 0.005), Vec3::new(half, top, head_m + length)];
    shape.rounded(mattress[0], mattress[1], 0.05, 3, linen);
    let pillows = if wide { 2 } else { 1 };
    for k in 0..pillows {
        let x = if pillows == 2 { (k as f32 - 0.5) * width * 0.5 } else { 0.0 };
        let size = Vec3::new(between(&mut builder.random, 0.58, 0.7).min(0.47 * width + 0.2), 0.17, 0.42);
        let mut pillow = Shape::default();
        pillow.pillow(Vec3::ZERO, size, 12, linen);
        let turn = Quat::from_rotation_y(between(&mut builder.random, -0.08, 0.08)) * Quat::from_rotation_x(0.18);
        shape.add(&pillow, turn, Vec3::new(x, top + 0.085, head_m + 0.29));
    }
    let cover = if chance(&mut builder.random, 0.5) { linen } else { builder.palette.paint(Finish::SecondUpholstery) };
    let from = between(&mut builder.random, 0.5, 0.75);
    duvet(builder, &mut shape, half, [head_m + from, head_m + length + 0.035], [base[0] + 0.1, top], cover);
    Piece::new("bed", shape).with_front(0.0)
}

/// Adds a cover over the mattress that hangs down at the sides and the foot.
fn duvet(builder: &mut RoomBuilder, shape: &mut Shape, half: f32, z: [f32; 2], [low, top]: [f32; 2], paint: Paint) {
    let noise = Noise::new(builder.random.random());
    let thick = between(&mut builder.random, 0.035, 0.07);
    let hang = between(&mut builder.random, 0.12, (top - low).max(0.14));
    let first = shape.triangles.len();
    let (across, along) = (2.0 * (half + hang), z[1] - z[0] + hang);
    let radius = 0.05;
    // Beyond the flat top, the cloth follows a quarter circle and hangs down, in a cone at the corners.
    let flat = Vec2::new(half + 0.045 - radius, z[1] - z[0] + 0.025 - radius);
    let arc = radius * std::f32::consts::FRAC_PI_2;
    let fall = move |s: f32| -> (f32, f32) {
        if s < arc {
            (radius * (s / radius).sin(), radius * (1.0 - (s / radius).cos()))
        } else {
            (radius, radius + s - arc)
        }
    };
    shape.grid([36, 30], Vec2::new(across, along), paint, |u, v| {
        let s = Vec2::new((u - 0.5) * across, (1.0 - v) * along);
        let edge = Vec2::new(s.x.clamp(-flat.x, flat.x), s.y.min(flat.y));
        let beyond = s - edge;
        let (out, down) = fall(beyond.length());
        let wrinkle = noise.octaves(u, v, [5, 6], 3) - 0.4;
        let swell = thick * (1.0 + 0.9 * wrinkle);
        let ripple = if down > radius { 0.015 * wrinkle } else { 0.0 };
        let p = edge + beyond.normalize_or_zero() * (out + ripple);
        // The open edge rests on the sheet.
        let lip = (s.y / 0.08).min(1.0);
        Vec3::new(p.x, top + swell * lip - down, z[0] + p.y)
    });
    shape.close_part(first);
}
