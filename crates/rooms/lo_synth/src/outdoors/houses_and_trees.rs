//! Houses and trees with ray intersection.

use lo_geometry::{Vec2, Vec3};
use lo_random::Stream;

use crate::chance::{between, chance, count, tone};

/// A house: four walls under a flat or a pitched roof.
#[derive(Clone, Copy, Debug)]
pub(super) struct House {
    /// Minimum and maximum corner of the walls; `max.y` is the height of the eaves.
    pub min: Vec3,
    pub max: Vec3,
    /// Bounding sphere.
    center: Vec3,
    radius: f32,
    /// Outward normals and offsets of the four walls and of the two roof slopes (equal for a flat roof).
    planes: [(Vec3, f32); 6],
    pub wall: [f32; 3],
    pub roof: [f32; 3],
    /// Distance between windows and between storeys, metres.
    pub bay: [f32; 2],
    pub seed: u32,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Tree {
    /// Bounding sphere of the crown.
    pub center: Vec3,
    pub radius: f32,
    /// Centres and radii of the spheres that form the crown.
    pub crown: [(Vec3, f32); CROWN_SPHERES],
    pub leaves: [f32; 3],
}

/// Number of spheres in a crown.
const CROWN_SPHERES: usize = 9;

impl House {
    /// Distance and normal where a ray from outside hits the house.
    pub(super) fn intersect(&self, origin: Vec3, direction: Vec3) -> Option<(f32, Vec3)> {
        // Most rays miss the bounding sphere.
        let to = self.center - origin;
        let (along, squared) = (to.dot(direction), self.radius * self.radius);
        let behind = along < 0.0 && to.length_squared() > squared;
        if behind || to.length_squared() - along * along > squared {
            return None;
        }
        intersect_convex(origin, direction, &self.planes)
    }

    pub(super) fn draw(random: &mut Stream, at: Vec2, half: Vec2, rural: bool) -> Self {
        let tall = if rural { between(random, 3.0, 6.5) } else { between(random, 6.0, 20.0) };
        let min = Vec3::new(at.x - half.x, 0.0, at.y - half.y);
        let max = Vec3::new(at.x + half.x, tall, at.y + half.y);
        let plane = |normal: Vec3, point: Vec3| (normal, normal.dot(point));
        let walls = [(Vec3::NEG_X, min), (Vec3::X, max), (Vec3::NEG_Z, min), (Vec3::Z, max)];
        let pitched = chance(random, if rural { 0.9 } else { 0.55 });
        let pitch = between(random, 28.0_f32, 48.0).to_radians();
        // The ridge runs along the longer side. A flat roof is one plane, stored twice.
        let across = if half.x > half.y { Vec3::Z } else { Vec3::X };
        let slope = |side: f32| if pitched { across * side * pitch.sin() + Vec3::Y * pitch.cos() } else { Vec3::Y };
        let slopes = [(slope(-1.0), Vec3::new(min.x, tall, min.z)), (slope(1.0), max)];
        let [a, b, c, d] = walls.map(|(normal, point)| plane(normal, point));
        let [e, f] = slopes.map(|(normal, point)| plane(normal, point));
        let ridge = if pitched { half.min_element() * pitch.tan() } else { 0.0 };
        let span = max + Vec3::Y * ridge - min;
        Self {
            min,
            max,
            center: min + 0.5 * span,
            radius: 0.5 * span.length(),
            planes: [a, b, c, d, e, f],
            wall: tone(between(random, 10.0, 50.0), between(random, 0.0, 0.4), between(random, 0.25, 0.65)),
            roof: if chance(random, 0.6) {
                tone(between(random, 5.0, 20.0), 0.6, between(random, 0.08, 0.16))
            } else {
                tone(220.0, 0.06, between(random, 0.05, 0.12))
            },
            bay: [between(random, 1.8, 3.5), between(random, 2.8, 3.4)],
            seed: count(random, 0, 1 << 20) as u32,
        }
    }
}

impl Tree {
    /// Draws a tree with a crown about 3 to 9 m wide whose lower end is at 1.5 to 3 m.
    pub(super) fn draw(random: &mut Stream, at: Vec2) -> Self {
        let radius = between(random, 1.5, 4.5);
        let stretch = between(random, 0.9, 1.5);
        let center = Vec3::new(at.x, between(random, 1.5, 3.0) + radius * stretch, at.y);
        let mut reach: f32 = 0.0;
        let crown = std::array::from_fn(|k| {
            // Successive spheres turn by the golden angle and rise.
            let turn = 2.4 * k as f32 + between(random, -0.6, 0.6);
            let height = (k as f32 + 0.5) / CROWN_SPHERES as f32 * 2.0 - 1.0;
            let out = (1.0 - height * height).sqrt() * between(random, 0.35, 0.6);
            let offset = Vec3::new(turn.cos() * out, height * stretch * 0.6, turn.sin() * out) * radius;
            let ball = radius * between(random, 0.35, 0.6);
            reach = reach.max(offset.length() + ball);
            (center + offset, ball)
        });
        let leaves = tone(between(random, 70.0, 120.0), between(random, 0.4, 0.65), between(random, 0.05, 0.11));
        Self { center, radius: reach, crown, leaves }
    }
}

/// Distance and normal where a ray from outside enters a convex body, given by planes (outward normal, offset).
fn intersect_convex(origin: Vec3, direction: Vec3, planes: &[(Vec3, f32)]) -> Option<(f32, Vec3)> {
    let (mut near, mut far, mut normal) = (0.0, f32::INFINITY, Vec3::ZERO);
    for &(outward, offset) in planes {
        let (above, towards) = (outward.dot(origin) - offset, outward.dot(direction));
        let distance = -above / towards;
        if towards < 0.0 {
            if distance > near {
                (near, normal) = (distance, outward);
            }
        } else if towards > 0.0 {
            far = far.min(distance);
        } else if above > 0.0 {
            return None;
        }
    }
    (near > 0.0 && near <= far).then_some((near, normal))
}

/// Distance and normal where a ray from outside enters a box.
pub(super) fn intersect_box(origin: Vec3, direction: Vec3, min: Vec3, max: Vec3) -> Option<(f32, Vec3)> {
    let inverse = direction.recip();
    let (a, b) = ((min - origin) * inverse, (max - origin) * inverse);
    let (near, far) = (a.min(b), a.max(b));
    let distance = near.max_element();
    if !(distance > 0.0 && distance <= far.min_element()) {
        return None;
    }
    let mut normal = Vec3::ZERO;
    let axis = if near.x == distance {
        0
    } else if near.y == distance {
        1
    } else {
        2
    };
    normal[axis] = -direction[axis].signum();
    Some((distance, normal))
}

pub(super) fn intersect_sphere(origin: Vec3, direction: Vec3, center: Vec3, radius: f32) -> Option<f32> {
    let to = center - origin;
    let along = to.dot(direction);
    let squared = to.length_squared() - along * along;
    let depth = radius * radius - squared;
    let distance = along - depth.max(0.0).sqrt();
    (depth > 0.0 && distance > 0.0).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn houses_are_their_walls_and_roofs() {
        let mut random = lo_random::stream(3, "house", 0);
        for _ in 0..50 {
            let house = House::draw(&mut random, Vec2::new(20.0, 0.0), Vec2::new(4.0, 6.0), true);
            // A horizontal ray at half the walls' height hits the near wall.
            let eye = Vec3::new(0.0, 0.5 * house.max.y, 0.3);
            let (distance, normal) = house.intersect(eye, Vec3::X).unwrap_or_default();
            assert!((distance - 16.0).abs() < 1e-4 && normal == Vec3::NEG_X, "{distance} {normal}");
            // A vertical ray hits the roof, above the eaves and within the maximum pitch.
            let above = Vec3::new(21.0, 50.0, 1.0);
            let (distance, normal) = house.intersect(above, Vec3::NEG_Y).unwrap_or_default();
            assert!(50.0 - distance >= house.max.y - 1e-3 && normal.y > 48.1f32.to_radians().cos(), "{normal}");
            assert!(house.intersect(eye, Vec3::NEG_X).is_none(), "it lies behind");
            assert!(house.intersect(eye, Vec3::Z).is_none(), "beside it");
            // The bounding sphere rejects no hit.
            for k in 0..200 {
                let direction = Vec3::new(1.0, 0.006 * k as f32 - 0.3, 0.31 * (0.7 * k as f32).sin()).normalize();
                // The planes continue below the ground.
                let above = |hit: &(f32, Vec3)| eye.y + hit.0 * direction.y > 0.0;
                let exact = intersect_convex(eye, direction, &house.planes).filter(above);
                assert_eq!(house.intersect(eye, direction).filter(above), exact);
            }
        }
    }

    #[test]
    fn crowns_lie_within_their_ball_and_above_the_ground() {
        let mut random = lo_random::stream(3, "tree", 0);
        for _ in 0..200 {
            let tree = Tree::draw(&mut random, Vec2::new(10.0, 5.0));
            assert!(tree.crown.iter().all(|(c, r)| c.distance(tree.center) + r <= tree.radius * 1.0001));
            let lowest = tree.crown.iter().map(|(c, r)| c.y - r).fold(f32::INFINITY, f32::min);
            let highest = tree.crown.iter().map(|(c, r)| c.y + r).fold(0.0, f32::max);
            assert!(lowest > 0.5 && (3.0..20.0).contains(&highest), "{lowest} to {highest} m");
        }
    }
}
