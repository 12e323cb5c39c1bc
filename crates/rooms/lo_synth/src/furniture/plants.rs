//! Potted plants.

use lo_geometry::{Vec2, Vec3};

use crate::chance::{between, count, weighted};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder};
use crate::solids::Shape;

/// Builds a potted plant up to `height` metres high, including the pot.
pub(super) fn potted(builder: &mut RoomBuilder, height: f32) -> Piece {
    let mut shape = Shape::default();
    let pot_h = (0.28 * height).clamp(0.06, 0.34);
    let r = pot_h * between(&mut builder.random, 0.45, 0.62);
    let tint = builder.palette.tint(&mut builder.random);
    let pot = builder.palette.paint(Finish::Gloss).tinted(tint);
    let soil = builder.palette.paint(Finish::Soil);
    let inner = 0.9 * r;
    let profile = [[0.75 * r, 0.0], [r, 0.97 * pot_h], [r, pot_h], [inner, pot_h], [inner, 0.93 * pot_h]];
    shape.lathe(Vec3::ZERO, &profile, 24, pot);
    shape.lathe(Vec3::ZERO, &[[0.99 * inner, 0.88 * pot_h], [0.99 * inner, 0.935 * pot_h]], 16, soil);
    let leaf = builder.palette.paint(Finish::Leaf);
    let base = Vec3::Y * 0.93 * pot_h;
    let free = height - pot_h;
    let first = shape.triangles.len();
    match weighted(&mut builder.random, &[(0, 0.4), (1, 0.25), (2, 0.35)]) {
        0 => {
            // Rosette of arching leaves.
            for k in 0..count(&mut builder.random, 14, 30) {
                let angle = 2.4 * k as f32 + between(&mut builder.random, -0.3, 0.3);
                let out = between(&mut builder.random, 0.25, 0.8) * free * 0.8;
                let up = between(&mut builder.random, 0.6, 1.0) * free;
                let reach = Vec3::new(angle.cos() * out, up, angle.sin() * out);
                let shade = between(&mut builder.random, 0.5, 1.0);
                let width = 0.14 * free;
                shape.leaf(base, reach, width, 0.35 * out / free, leaf.tinted([shade, shade, shade * 0.9]));
            }
        }
        1 => {
            // Upright sword-shaped leaves.
            for k in 0..count(&mut builder.random, 7, 14) {
                let angle = 2.4 * k as f32;
                let foot = Vec2::new(angle.cos(), angle.sin()) * 0.5 * inner;
                let up = between(&mut builder.random, 0.55, 1.0) * free;
                let reach = Vec3::new(0.25 * foot.x, up, 0.25 * foot.y);
                let shade = between(&mut builder.random, 0.5, 0.9);
                shape.leaf(
                    base + Vec3::new(foot.x, 0.0, foot.y),
                    reach,
                    0.09 * free.max(0.3),
                    0.0,
                    leaf.tinted([shade; 3]),
                );
            }
        }
        _ => {
            // Stem with leaves around its top.
            let wood = builder.palette.paint(Finish::Wood);
            let top = base + Vec3::new(0.03, 0.55 * free, 0.02);
            shape.bar(base - Vec3::Y * 0.01, top, [0.06 * r + 0.006, 0.004 + 0.03 * r], 8, wood);
            for k in 0..count(&mut builder.random, 24, 44) {
                let angle = 2.4 * k as f32 + between(&mut builder.random, -0.4, 0.4);
                let lift = between(&mut builder.random, -0.3, 1.0);
                let from = base.lerp(top, between(&mut builder.random, 0.45, 1.0));
                let long = 0.38 * free * between(&mut builder.random, 0.7, 1.1);
                let flat = (1.0 - 0.6 * lift.abs()).max(0.2);
                let reach = Vec3::new(angle.cos() * flat, lift, angle.sin() * flat) * long;
                let shade = between(&mut builder.random, 0.5, 1.0);
                shape.leaf(from, reach, 0.4 * long, 0.25, leaf.tinted([shade, shade, 0.85 * shade]));
            }
        }
    }
    shape.close_part(first);
    Piece::new("plant", shape)
}
