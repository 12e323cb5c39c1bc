use lo_geometry::{Vec2, Vec3, smoothstep};
use lo_random::Stream;

use crate::chance::{between, chance, count, pick, tone};
use crate::photometry::{UNIT_CD_M2, luminance_color};
use crate::texture::{Noise, scaled};

use super::houses_and_trees::{House, Tree, intersect_box, intersect_sphere};
use super::sky::Sky;

/// The surroundings of the house: simple solids on level ground, lit by sky, sun and street lamps.
#[derive(Clone, Debug)]
pub(crate) struct Surroundings {
    /// Height of the viewpoint above the ground, metres.
    pub eye_m: f32,
    ground: [f32; 3],
    /// Road: perpendicular axis (0: x, 1: z) and positions of its two edges on that axis.
    road: Option<(usize, [f32; 2])>,
    skyline: Skyline,
    houses: Vec<House>,
    trees: Vec<Tree>,
    lamps: Vec<Vec3>,
    /// Colour of street lamps at luminance 1.
    lamp_color: [f32; 3],
    /// Share of windows that are lit.
    lit: f32,
    noise: Noise,
}

/// Distant hedges, woods and roofs: a rugged band along the horizon.
#[derive(Clone, Copy, Debug)]
struct Skyline {
    distance_m: f32,
    /// Minimum and maximum height above the ground, metres.
    height_m: [f32; 2],
    albedo: [f32; 3],
}

/// The sun as a directional light: direction and normal irradiance / π.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SunLight {
    pub direction: Vec3,
    pub radiosity: [f32; 3],
}

/// A surface point of the surroundings.
struct SurfaceHit {
    distance: f32,
    position: Vec3,
    normal: Vec3,
    albedo: [f32; 3],
    emission: [f32; 3],
}

impl Surroundings {
    /// Draws a street, a garden, a park or the roofs of a town.
    pub(crate) fn draw(random: &mut Stream, night: bool) -> Self {
        let storey = count(random, 0, 4);
        let eye_m = 1.4 + 3.0 * storey as f32;
        let rural = chance(random, 0.4);
        let grass = tone(between(random, 75.0, 100.0), 0.6, between(random, 0.06, 0.14));
        let paving = tone(40.0, 0.05, between(random, 0.15, 0.3));
        let mut houses = Vec::new();
        for _ in 0..if rural { count(random, 0, 4) } else { count(random, 6, 18) } {
            let angle = between(random, 0.0, std::f32::consts::TAU);
            let distance = between(random, 14.0, 70.0);
            let half = Vec2::new(between(random, 4.0, 9.0), between(random, 4.0, 9.0));
            let at = Vec2::new(angle.cos(), angle.sin()) * (distance + half.max_element());
            houses.push(House::draw(random, at, half, rural));
        }
        let mut trees = Vec::new();
        for _ in 0..if rural { count(random, 4, 16) } else { count(random, 0, 7) } {
            let angle = between(random, 0.0, std::f32::consts::TAU);
            let distance = between(random, 7.0, 40.0);
            trees.push(Tree::draw(random, Vec2::new(angle.cos(), angle.sin()) * distance));
        }
        let road = (!rural || chance(random, 0.4)).then(|| {
            let near = between(random, 6.0, 10.0) * pick(random, &[1.0, -1.0]);
            (count(random, 0, 1), [near, near + between(random, 6.0, 9.0)])
        });
        let mut lamps = Vec::new();
        if let (true, Some((axis, [near, _]))) = (night, road) {
            for k in -2..=2 {
                let along = 22.0 * k as f32 + between(random, -4.0, 4.0);
                let (x, z) = if axis == 0 { (near - 1.0, along) } else { (along, near - 1.0) };
                lamps.push(Vec3::new(x, 6.0, z));
            }
        }
        let lit = if night { between(random, 0.1, 0.5) } else { 0.0 };
        let ground = if rural { grass } else { paving };
        let skyline = if rural {
            let albedo = tone(between(random, 75.0, 110.0), 0.5, between(random, 0.04, 0.09));
            Skyline { distance_m: between(random, 90.0, 300.0), height_m: [2.0, between(random, 8.0, 22.0)], albedo }
        } else {
            let albedo = tone(between(random, 20.0, 45.0), 0.15, between(random, 0.15, 0.3));
            Skyline { distance_m: between(random, 90.0, 180.0), height_m: [7.0, between(random, 12.0, 28.0)], albedo }
        };
        Self {
            eye_m,
            lamp_color: luminance_color(2200.0),
            ground,
            road,
            skyline,
            houses,
            trees,
            lamps,
            lit,
            noise: Noise::new(count(random, 0, 1 << 30) as u64),
        }
    }

    /// Radiance from a direction. `ambient` is the sky's mean radiance.
    pub(crate) fn radiance(&self, direction: Vec3, sky: &Sky, ambient: [f32; 3], sun: Option<SunLight>) -> [f32; 3] {
        let eye = Vec3::new(0.0, self.eye_m, 0.0);
        if let Some(glow) = self.lamp_glow(eye, direction) {
            return glow;
        }
        let Some(hit) = self.nearest_hit(eye, direction) else {
            return sky.radiance(Vec3::new(direction.x, direction.y.max(0.0), direction.z));
        };
        // A wall sees half of the sky and half of the ground.
        let up = 0.5 + 0.5 * hit.normal.y;
        let mut light = ambient.map(|c| c * (up + (1.0 - up) * 0.2));
        if let Some(sun) = sun {
            let cosine = hit.normal.dot(sun.direction);
            let start = hit.position + hit.normal * 0.02;
            if cosine > 0.0 && !self.is_shadowed(start, sun.direction) {
                light = std::array::from_fn(|c| light[c] + sun.radiosity[c] * cosine);
            }
        }
        for lamp in &self.lamps {
            let to = *lamp - hit.position;
            let squared = to.length_squared();
            // 6,000 lm into the lower hemisphere: about 950 cd.
            let lux = 950.0 * hit.normal.dot(to / squared.sqrt()).max(0.0) / squared.max(1.0);
            let gain = lux / (std::f32::consts::PI * UNIT_CD_M2);
            light = std::array::from_fn(|c| light[c] + self.lamp_color[c] * gain);
        }
        let haze = (1.0 - (-hit.distance / 900.0).exp()).min(0.6);
        let horizon = sky.radiance(Vec3::new(direction.x, 0.02, direction.z).normalize_or(Vec3::X));
        std::array::from_fn(|c| (hit.albedo[c] * light[c] + hit.emission[c]) * (1.0 - haze) + horizon[c] * haze * 0.8)
    }

    /// Nearest surface along a ray.
    fn nearest_hit(&self, eye: Vec3, direction: Vec3) -> Option<SurfaceHit> {
        let mut best: Option<SurfaceHit> = None;
        let mut offer = |hit: SurfaceHit| {
            if best.as_ref().is_none_or(|b| hit.distance < b.distance) {
                best = Some(hit);
            }
        };
        if direction.y < -1e-3 {
            let distance = -eye.y / direction.y;
            if distance < 4000.0 {
                let position = eye + direction * distance;
                offer(SurfaceHit {
                    distance,
                    position,
                    normal: Vec3::Y,
                    albedo: self.ground_albedo(position),
                    emission: [0.0; 3],
                });
            }
        }
        if let Some(hit) = self.intersect_skyline(eye, direction) {
            offer(hit);
        }
        for house in &self.houses {
            if let Some((distance, normal)) = house.intersect(eye, direction) {
                let position = eye + direction * distance;
                let (albedo, emission) = self.facade(house, position, normal);
                offer(SurfaceHit { distance, position, normal, albedo, emission });
            }
        }
        for tree in &self.trees {
            if let Some(hit) = self.intersect_crown(tree, eye, direction) {
                offer(hit);
            }
            let foot = Vec3::new(tree.center.x, 0.0, tree.center.z);
            let thick = Vec3::new(0.03, 0.0, 0.03) * tree.radius;
            let max = foot + thick + Vec3::Y * tree.center.y;
            if let Some((distance, normal)) = intersect_box(eye, direction, foot - thick, max) {
                let position = eye + direction * distance;
                offer(SurfaceHit { distance, position, normal, albedo: [0.08, 0.06, 0.045], emission: [0.0; 3] });
            }
        }
        best
    }

    /// Intersects a crown: leaves roughly aligned with its spheres, with gaps towards their rims.
    fn intersect_crown(&self, tree: &Tree, eye: Vec3, direction: Vec3) -> Option<SurfaceHit> {
        intersect_sphere(eye, direction, tree.center, tree.radius)?;
        let hits = tree.crown.iter().filter_map(|&(center, radius)| {
            let distance = intersect_sphere(eye, direction, center, radius)?;
            let position = eye + direction * distance;
            let normal = (position - center) / radius;
            let clump = self.clumps(position);
            let rim = 1.0 + normal.dot(direction);
            (clump > 0.2 + 0.35 * rim * rim).then_some((distance, position, normal, clump))
        });
        let (distance, position, normal, clump) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        // Mixes the normals of the sphere and of the whole crown with noise.
        let stray = Vec3::new(clump, self.clumps(position + 7.0), self.clumps(position + 13.0)) * 2.0 - 1.0;
        let normal = (normal + (position - tree.center) / tree.radius + stray).normalize_or(Vec3::Y);
        // Darkens the depth of the crown, its lower part and the gaps between clumps.
        let height = ((position.y - tree.center.y) / tree.radius).clamp(-1.0, 1.0);
        let albedo = scaled(tree.leaves, (0.1 + 1.8 * clump) * (0.75 + 0.35 * height));
        Some(SurfaceHit { distance, position, normal, albedo, emission: [0.0; 3] })
    }

    /// Noise of leaf clumps, 40 cm and smaller, in [0, 1] with mean ½.
    fn clumps(&self, p: Vec3) -> f32 {
        let p = p / 25.6;
        let planes = [(p.x, p.y, 0), (p.y, p.z, 1), (p.z, p.x, 2)];
        let sum: f32 = planes.iter().map(|&(u, v, k)| self.noise.derived(k + 9).octaves(u, v, [64, 64], 3)).sum();
        (0.5 + 1.5 * (sum / 3.0 - 0.5)).clamp(0.0, 1.0)
    }

    fn intersect_skyline(&self, eye: Vec3, direction: Vec3) -> Option<SurfaceHit> {
        let level = Vec2::new(direction.x, direction.z);
        let distance = self.skyline.distance_m / level.length().max(1e-3);
        let position = eye + direction * distance;
        let turn = level.y.atan2(level.x) / std::f32::consts::TAU + 0.5;
        let [low, high] = self.skyline.height_m;
        let rugged = self.noise.octaves(turn, 0.3, [48, 4], 4);
        if position.y < 0.0 || position.y > low + (high - low) * smoothstep(0.15, 0.85, rugged) {
            return None;
        }
        let normal = Vec3::new(-direction.x, 0.3, -direction.z).normalize_or(Vec3::Y);
        let mottle = 0.6 + 0.8 * self.noise.octaves(turn, position.y / 64.0, [512, 64], 2);
        let albedo = scaled(self.skyline.albedo, mottle);
        Some(SurfaceHit { distance, position, normal, albedo, emission: [0.0; 3] })
    }

    fn is_shadowed(&self, start: Vec3, direction: Vec3) -> bool {
        self.houses.iter().any(|h| h.intersect(start, direction).is_some())
            || self.trees.iter().any(|t| {
                intersect_sphere(start, direction, t.center, t.radius).is_some()
                    && t.crown
                        .iter()
                        .any(|&(center, radius)| intersect_sphere(start, direction, center, radius).is_some())
            })
    }

    fn ground_albedo(&self, p: Vec3) -> [f32; 3] {
        let mottle = 0.7 + 0.6 * self.noise.octaves(p.x / 64.0, p.z / 64.0, [32, 32], 3);
        if let Some((axis, [a, b])) = self.road {
            let (across, along) = if axis == 0 { (p.x, p.z) } else { (p.z, p.x) };
            let (low, high) = (a.min(b), a.max(b));
            if across > low && across < high {
                let middle = (across - 0.5 * (low + high)).abs() < 0.08 && along.rem_euclid(6.0) < 3.0;
                return if middle { [0.6; 3] } else { scaled([0.09, 0.09, 0.095], mottle) };
            }
            if across > low - 2.0 && across < high + 2.0 {
                return scaled([0.3, 0.29, 0.27], mottle);
            }
        }
        scaled(self.ground, mottle)
    }

    fn facade(&self, house: &House, p: Vec3, normal: Vec3) -> ([f32; 3], [f32; 3]) {
        if normal.y > 0.3 {
            let mottle = 0.75 + 0.5 * self.noise.octaves(p.x / 64.0, (p.z + p.y) / 64.0, [128, 128], 2);
            return (scaled(house.roof, mottle), [0.0; 3]);
        }
        if p.y > house.max.y - 0.5 {
            // Eaves and gables have no windows.
            return (scaled(house.wall, 0.8), [0.0; 3]);
        }
        let across = if normal.x.abs() > 0.5 { p.z - house.min.z } else { p.x - house.min.x };
        let (column, row) = ((across / house.bay[0]).floor(), (p.y / house.bay[1]).floor());
        let (fx, fy) = (across / house.bay[0] - column, p.y / house.bay[1] - row);
        if (fx - 0.5).abs() < 0.22 && (fy - 0.55).abs() < 0.24 {
            let side = if normal.x.abs() > 0.5 { 7 } else { 0 } + if normal.x + normal.z > 0.0 { 3 } else { 0 };
            let draw = self.noise.derived(house.seed).at(column as i32 * 16 + side, row as i32);
            if draw < self.lit {
                let bright = 0.15 + 1.5 * self.noise.derived(house.seed + 1).at(column as i32, row as i32 + side);
                return ([0.1; 3], luminance_color(2400.0 + 1500.0 * draw / self.lit).map(|c| c * bright));
            }
            return ([0.05, 0.055, 0.06], [0.0; 3]);
        }
        let frame = smoothstep(0.27, 0.25, (fx - 0.5).abs()) * smoothstep(0.29, 0.27, (fy - 0.55).abs());
        (crate::texture::mix(house.wall, [0.6; 3], 0.5 * frame), [0.0; 3])
    }

    fn lamp_glow(&self, eye: Vec3, direction: Vec3) -> Option<[f32; 3]> {
        self.lamps.iter().find_map(|lamp| {
            intersect_sphere(eye, direction, *lamp, 0.25)?;
            // 6,000 lm from the lower half of a sphere of radius 25 cm.
            Some(self.lamp_color.map(|c| c * 6000.0 / (std::f32::consts::PI * 0.39) / UNIT_CD_M2))
        })
    }
}
