//! Figures of people, built from round bars and balls.

use std::f32::consts::TAU;

use lo_geometry::{Quat, Vec3};

use super::groups::single;
use super::seating;
use crate::chance::{between, chance, count, tone};
use crate::palette::Finish;
use crate::room_builder::{Piece, RoomBuilder, WallPosition};
use crate::solids::{Paint, Shape};

/// Places one to three people where they fit.
pub(super) fn people(builder: &mut RoomBuilder) {
    for _ in 0..count(&mut builder.random, 1, 3) {
        let figure = if chance(&mut builder.random, 0.55) { standing(builder) } else { seated(builder) };
        if builder.place_freely(&single(figure.clone()), None, 0.03).is_none() {
            builder.place_against_wall(&single(figure), WallPosition::Anywhere);
        }
    }
}

/// Appearance of a person.
struct Appearance {
    skin: Paint,
    hair: Paint,
    upper: Paint,
    lower: Paint,
    shoes: Paint,
    long_sleeves: bool,
    long_hair: bool,
}

fn draw_appearance(builder: &mut RoomBuilder) -> Appearance {
    let matte = builder.palette.paint(Finish::Matte);
    let r = &mut builder.random;
    let skin = tone(between(r, 15.0, 28.0), between(r, 0.4, 0.6), between(r, 0.06, 0.5));
    let hair = tone(between(r, 20.0, 45.0), between(r, 0.1, 0.7), between(r, 0.01, 0.25));
    let lower = tone(between(r, 180.0, 260.0), between(r, 0.0, 0.6), between(r, 0.02, 0.2));
    let shoes = [between(r, 0.02, 0.6); 3];
    let (long_sleeves, long_hair) = (chance(r, 0.5), chance(r, 0.4));
    let upper = builder.palette.clothing(&mut builder.random);
    let jeans = chance(&mut builder.random, 0.6);
    let lower = if jeans { matte.tinted(lower) } else { builder.palette.clothing(&mut builder.random) };
    Appearance {
        skin: matte.tinted(skin),
        hair: matte.tinted(hair),
        upper,
        lower,
        shoes: matte.tinted(shoes),
        long_sleeves,
        long_hair,
    }
}

/// Adds a limb through three joints with a radius at each.
fn limb(shape: &mut Shape, joints: [Vec3; 3], radii: [f32; 3], paints: [Paint; 2]) {
    for k in 0..2 {
        shape.bar(joints[k], joints[k + 1], [radii[k], radii[k + 1]], 14, paints[k]);
        shape.ball(joints[k], [radii[k], radii[k]], 14, paints[k]);
    }
    shape.ball(joints[2], [radii[2], radii[2]], 12, paints[1]);
}

/// Builds torso, neck, head and arms. The hips are at the origin, the hands at `hands`.
fn upper_body(builder: &mut RoomBuilder, appearance: &Appearance, hands: [Vec3; 2]) -> Shape {
    let mut shape = Shape::default();
    let wide = between(&mut builder.random, 0.9, 1.15);
    let mut torso = Shape::default();
    let profile = [
        [0.05, -0.13],
        [0.14, -0.08],
        [0.155, 0.02],
        [0.14, 0.14],
        [0.165, 0.3],
        [0.18, 0.42],
        [0.14, 0.5],
        [0.06, 0.535],
    ];
    torso.lathe(Vec3::ZERO, &profile, 24, appearance.upper);
    shape.add_at(&torso.scaled_by(Vec3::new(1.08 * wide, 1.0, 0.68 * wide)), Vec3::ZERO);
    for (side, hand) in [-1.0, 1.0].into_iter().zip(hands) {
        let shoulder = Vec3::new(0.185 * side * wide, 0.455, 0.0);
        // The elbow is below, outside and behind the midpoint of shoulder and hand.
        let elbow = (shoulder + hand) * 0.5 + Vec3::new(0.06 * side, -0.09, -0.04);
        let sleeve = if appearance.long_sleeves { appearance.upper } else { appearance.skin };
        limb(&mut shape, [shoulder, elbow, hand], [0.062, 0.045, 0.034], [appearance.upper, sleeve]);
        shape.ball(hand + Vec3::new(0.0, -0.03, 0.03), [0.042, 0.055], 12, appearance.skin);
    }
    let tilt = Quat::from_rotation_x(between(&mut builder.random, -0.1, 0.45))
        * Quat::from_rotation_y(between(&mut builder.random, -0.6, 0.6));
    let mut head = Shape::default();
    let mut skull = Shape::default();
    skull.ball(Vec3::ZERO, [0.078, 0.112], 22, appearance.skin);
    head.add_at(&skull.scaled_by(Vec3::new(1.0, 1.0, 1.18)), Vec3::Y * 0.11);
    head.ball(Vec3::new(0.0, 0.1, 0.094), [0.014, 0.02], 8, appearance.skin);
    for side in [-1.0, 1.0] {
        head.ball(Vec3::new(0.03 * side, 0.125, 0.082), [0.009, 0.006], 8, appearance.hair);
        head.ball(Vec3::new(0.08 * side, 0.105, 0.0), [0.013, 0.026], 8, appearance.skin);
    }
    let mut hair = Shape::default();
    hair.ball(Vec3::ZERO, [0.083, 0.098], 20, appearance.hair);
    head.add_at(&hair.scaled_by(Vec3::new(1.02, 1.0, 1.12)), Vec3::new(0.0, 0.145, -0.02));
    if appearance.long_hair {
        head.rounded(Vec3::new(-0.082, -0.08, -0.105), Vec3::new(0.082, 0.15, -0.015), 0.04, 3, appearance.hair);
    }
    shape.bar(Vec3::Y * 0.48, Vec3::Y * 0.6, [0.055, 0.048], 14, appearance.skin);
    shape.add(&head, tilt, Vec3::new(0.0, 0.57, 0.015));
    shape
}

fn shoe(shape: &mut Shape, ankle: Vec3, turn: f32, paint: Paint) {
    let mut shoe = Shape::default();
    shoe.rounded(Vec3::new(-0.047, 0.0, -0.08), Vec3::new(0.047, 0.085, 0.17), 0.035, 2, paint);
    shape.add(&shoe, Quat::from_rotation_y(turn), Vec3::new(ankle.x, 0.0, ankle.z));
}

/// Builds a standing person, 1.5 to 1.95 m tall, with a random yaw.
fn standing(builder: &mut RoomBuilder) -> Piece {
    let appearance = draw_appearance(builder);
    let scale = between(&mut builder.random, 0.88, 1.13);
    let mut figure = Shape::default();
    for side in [-1.0, 1.0] {
        let step = between(&mut builder.random, -0.09, 0.09);
        let hip = Vec3::new(0.09 * side, 0.93, 0.0);
        let knee = Vec3::new(0.1 * side, 0.5, 0.4 * step + 0.02);
        let ankle = Vec3::new(0.105 * side, 0.09, step);
        limb(&mut figure, [hip, knee, ankle], [0.092, 0.064, 0.045], [appearance.lower; 2]);
        shoe(&mut figure, ankle, 0.25 * side, appearance.shoes);
    }
    let hand = |builder: &mut RoomBuilder, side: f32| {
        if chance(&mut builder.random, 0.5) {
            Vec3::new(0.27 * side, -0.12, between(&mut builder.random, -0.02, 0.1))
        } else {
            let r = &mut builder.random;
            Vec3::new(between(r, 0.02, 0.22) * side, between(r, 0.1, 0.32), between(r, 0.25, 0.36))
        }
    };
    let hands = [hand(builder, -1.0), hand(builder, 1.0)];
    let upper = upper_body(builder, &appearance, hands);
    figure.add_at(&upper, Vec3::Y * 0.98);
    let mut shape = Shape::default();
    shape.add(
        &figure.scaled_by(Vec3::splat(scale)),
        Quat::from_rotation_y(between(&mut builder.random, 0.0, TAU)),
        Vec3::ZERO,
    );
    Piece::new("person", shape)
}

/// Builds a person seated on a chair.
fn seated(builder: &mut RoomBuilder) -> Piece {
    let appearance = draw_appearance(builder);
    let style = seating::chair_style(builder);
    let mut shape = seating::chair(builder, style).shape;
    let pelvis = Vec3::new(0.0, 0.57, -0.04);
    for side in [-1.0, 1.0] {
        let hip = pelvis + Vec3::new(0.09 * side, -0.02, 0.02);
        let knee = Vec3::new(between(&mut builder.random, 0.08, 0.18) * side, 0.53, 0.4);
        let ankle = Vec3::new(0.12 * side, 0.09, between(&mut builder.random, 0.3, 0.55));
        limb(&mut shape, [hip, knee, ankle], [0.088, 0.066, 0.045], [appearance.lower; 2]);
        shoe(&mut shape, ankle, 0.2 * side, appearance.shoes);
    }
    let hand = |builder: &mut RoomBuilder, side: f32| {
        let r = &mut builder.random;
        Vec3::new(between(r, 0.03, 0.2) * side, between(r, 0.03, 0.25), between(r, 0.24, 0.4))
    };
    let hands = [hand(builder, -1.0), hand(builder, 1.0)];
    let upper = upper_body(builder, &appearance, hands);
    shape.add(&upper, Quat::from_rotation_x(between(&mut builder.random, -0.08, 0.25)), pelvis);
    Piece::new("person", shape)
}
