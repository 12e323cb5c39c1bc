//! Reference for insertion: a box room with a ceiling lamp and bodies in it, solved plainly in f64.

use std::f64::consts::PI;

pub type V = [f64; 3];

pub fn add(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
pub fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
pub fn scale(a: V, s: f64) -> V {
    [a[0] * s, a[1] * s, a[2] * s]
}
pub fn mul(a: V, b: V) -> V {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}
pub fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
pub fn unit(a: V) -> V {
    scale(a, 1.0 / dot(a, a).sqrt())
}

/// PCG32 (O'Neill 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0xD1B5_4A32_D192_ED03);
        random.next();
        random
    }
    pub fn next(&mut self) -> f64 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let word = (((old >> 18) ^ old) >> 27) as u32;
        f64::from(word.rotate_right((old >> 59) as u32)) / 4_294_967_296.0
    }
}

/// Walls in the order −x, +x, −y, +y, −z, +z; the lamp is a rectangle of the ceiling (+y).
pub struct Room {
    pub low: V,
    pub high: V,
    pub albedo: [V; 6],
    /// Lamp: smallest and largest x, smallest and largest z.
    pub lamp: [f64; 4],
    pub emission: V,
}

#[derive(Clone, Copy)]
pub enum Body {
    Sphere { centre: V, radius: f64 },
    Cuboid { low: V, high: V },
}

/// The body's glTF material (dielectric).
#[derive(Clone, Copy)]
pub struct Finish {
    pub base: V,
    pub roughness: f64,
}

pub struct Hit {
    pub distance: f64,
    pub position: V,
    pub normal: V,
    pub surface: Surface,
}

/// Surface that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    Wall(usize),
    Body(usize),
}

impl Body {
    /// Returns the distance from an outside point to its surface.
    pub fn distance_m(&self, point: V) -> f64 {
        match *self {
            Body::Sphere { centre, radius } => dot(sub(point, centre), sub(point, centre)).sqrt() - radius,
            Body::Cuboid { low, high } => {
                let outside: V = std::array::from_fn(|k| (low[k] - point[k]).max(point[k] - high[k]).max(0.0));
                dot(outside, outside).sqrt()
            }
        }
    }

    fn hit(&self, origin: V, direction: V) -> Option<(f64, V)> {
        match *self {
            Body::Sphere { centre, radius } => {
                let offset = sub(origin, centre);
                let b = dot(offset, direction);
                let root = b * b - dot(offset, offset) + radius * radius;
                if root < 0.0 {
                    return None;
                }
                let t = -b - root.sqrt();
                (t > 1e-9).then(|| (t, unit(add(offset, scale(direction, t)))))
            }
            Body::Cuboid { low, high } => {
                let (mut near, mut far, mut axis) = (f64::NEG_INFINITY, f64::INFINITY, 0);
                for i in 0..3 {
                    let (a, b) = ((low[i] - origin[i]) / direction[i], (high[i] - origin[i]) / direction[i]);
                    if a.min(b) > near {
                        near = a.min(b);
                        axis = i;
                    }
                    far = far.min(a.max(b));
                }
                let mut normal = [0.0; 3];
                normal[axis] = -direction[axis].signum();
                (near < far && near > 1e-9).then_some((near, normal))
            }
        }
    }
}

impl Room {
    /// Returns the intersection of a ray from inside with the walls.
    pub fn wall(&self, origin: V, direction: V) -> Hit {
        let mut best = (f64::INFINITY, 0);
        for wall in 0..6usize {
            let (axis, bound) = (wall / 2, if wall.is_multiple_of(2) { self.low } else { self.high });
            let t = (bound[axis] - origin[axis]) / direction[axis];
            let outwards = if wall % 2 == 1 { direction[axis] > 0.0 } else { direction[axis] < 0.0 };
            if outwards && t < best.0 {
                best = (t, wall);
            }
        }
        let mut normal = [0.0; 3];
        normal[best.1 / 2] = if best.1 % 2 == 0 { 1.0 } else { -1.0 };
        Hit {
            distance: best.0,
            position: add(origin, scale(direction, best.0)),
            normal,
            surface: Surface::Wall(best.1),
        }
    }

    pub fn on_lamp(&self, hit: &Hit) -> bool {
        let p = hit.position;
        hit.surface == Surface::Wall(3)
            && p[0] > self.lamp[0]
            && p[0] < self.lamp[1]
            && p[2] > self.lamp[2]
            && p[2] < self.lamp[3]
    }

    fn lamp_area(&self) -> f64 {
        (self.lamp[1] - self.lamp[0]) * (self.lamp[3] - self.lamp[2])
    }

    /// Returns emission times geometry term towards a point of the lamp, with direction and distance.
    fn lamp_term(&self, position: V, normal: V, s: f64, t: f64) -> (V, V, f64) {
        let lamp = [
            self.lamp[0] + (self.lamp[1] - self.lamp[0]) * s,
            self.high[1],
            self.lamp[2] + (self.lamp[3] - self.lamp[2]) * t,
        ];
        let offset = sub(lamp, position);
        // A point of the lamp itself receives nothing from it.
        let squared = dot(offset, offset).max(1e-12);
        let direction = scale(offset, 1.0 / squared.sqrt());
        let term = dot(normal, direction).max(0.0) * direction[1].max(0.0) / squared * self.lamp_area();
        (scale(self.emission, term), direction, squared.sqrt())
    }

    /// Returns the irradiance from the unoccluded lamp by an n × n midpoint rule.
    fn direct(&self, position: V, normal: V, n: usize) -> V {
        let mut sum = [0.0; 3];
        for i in 0..n * n {
            let (s, t) = (((i % n) as f64 + 0.5) / n as f64, ((i / n) as f64 + 0.5) / n as f64);
            sum = add(sum, self.lamp_term(position, normal, s, t).0);
        }
        scale(sum, 1.0 / (n * n) as f64)
    }
}

/// The empty room's indirect irradiance on a grid of each wall, by repeated final gathering.
pub struct Solution<'a> {
    pub room: &'a Room,
    indirect: Vec<Vec<V>>,
}

const GRID: usize = 17;

impl<'a> Solution<'a> {
    pub fn new(room: &'a Room) -> Self {
        let mut solution = Self { room, indirect: vec![vec![[0.0; 3]; GRID * GRID]; 6] };
        for bounce in 0..8 {
            let rays = if bounce < 6 { 256 } else { 1024 };
            solution.indirect =
                (0..6).map(|wall| (0..GRID * GRID).map(|i| solution.gather(wall, i, rays)).collect()).collect();
        }
        solution
    }

    fn gather(&self, wall: usize, i: usize, rays: usize) -> V {
        let room = self.room;
        let axis = wall / 2;
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut position = if wall.is_multiple_of(2) { room.low } else { room.high };
        // Just inside the edges, where neighbouring walls meet.
        let along = |k: usize| 0.002 + 0.996 * k as f64 / (GRID - 1) as f64;
        position[a] = room.low[a] + (room.high[a] - room.low[a]) * along(i % GRID);
        position[b] = room.low[b] + (room.high[b] - room.low[b]) * along(i / GRID);
        let mut normal = [0.0; 3];
        normal[axis] = if wall.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut sum = [0.0; 3];
        for ray in 0..rays {
            let squared = (ray as f64 + 0.5) / rays as f64;
            let angle = ray as f64 * 2.399_963_229_728_653;
            let mut direction = [0.0; 3];
            direction[a] = squared.sqrt() * angle.cos();
            direction[b] = squared.sqrt() * angle.sin();
            direction[axis] = normal[axis] * (1.0 - squared).sqrt();
            let hit = room.wall(add(position, scale(normal, 1e-6)), direction);
            if !room.on_lamp(&hit) {
                sum = add(sum, self.reflected(&hit, 4));
            }
        }
        scale(sum, PI / rays as f64)
    }

    fn reflected(&self, hit: &Hit, n: usize) -> V {
        let Surface::Wall(wall) = hit.surface else { panic!("only walls are asked") };
        let axis = wall / 2;
        let at = |k: usize| {
            let x = (hit.position[k] - self.room.low[k]) / (self.room.high[k] - self.room.low[k]);
            let x = x.clamp(0.0, 1.0) * (GRID - 1) as f64;
            let i = (x as usize).min(GRID - 2);
            (i, x - i as f64)
        };
        let ((i, fi), (j, fj)) = (at((axis + 1) % 3), at((axis + 2) % 3));
        let cell = |i: usize, j: usize| self.indirect[wall][j * GRID + i];
        let low = add(scale(cell(i, j), 1.0 - fi), scale(cell(i + 1, j), fi));
        let high = add(scale(cell(i, j + 1), 1.0 - fi), scale(cell(i + 1, j + 1), fi));
        let irradiance = add(self.room.direct(hit.position, hit.normal, n), add(scale(low, 1.0 - fj), scale(high, fj)));
        scale(mul(self.room.albedo[wall], irradiance), 1.0 / PI)
    }

    /// Returns the radiance that leaves a wall; of the lamp, its emission only.
    pub fn radiance(&self, hit: &Hit) -> V {
        if self.room.on_lamp(hit) { self.room.emission } else { self.reflected(hit, 12) }
    }
}

/// Path tracer of the room with the bodies.
pub struct Tracer<'a> {
    pub room: &'a Room,
    pub bodies: &'a [(Body, Finish)],
}

impl Tracer<'_> {
    pub fn hit(&self, origin: V, direction: V) -> Hit {
        let mut nearest = self.room.wall(origin, direction);
        for (i, (body, _)) in self.bodies.iter().enumerate() {
            if let Some((distance, normal)) = body.hit(origin, direction).filter(|(t, _)| *t < nearest.distance) {
                let position = add(origin, scale(direction, distance));
                nearest = Hit { distance, position, normal, surface: Surface::Body(i) };
            }
        }
        nearest
    }

    fn brdf(&self, hit: &Hit, view: V, light: V) -> V {
        let finish = match hit.surface {
            Surface::Wall(wall) => return scale(self.room.albedo[wall], 1.0 / PI),
            Surface::Body(body) => self.bodies[body].1,
        };
        // glTF 2.0, appendix B.3, for metalness 0
        let half = unit(add(view, light));
        let (nl, nv) = (dot(hit.normal, light).max(1e-6), dot(hit.normal, view).max(1e-6));
        let (nh, vh) = (dot(hit.normal, half), dot(view, half));
        let a2 = finish.roughness.powi(4);
        let f = 0.04 + 0.96 * (1.0 - vh).powi(5);
        let d = a2 / (PI * (nh * nh * (a2 - 1.0) + 1.0).powi(2));
        let g = |x: f64| 2.0 * x / (x + (a2 + (1.0 - a2) * x * x).sqrt());
        let specular = f * d * g(nl) * g(nv) / (4.0 * nl * nv);
        add(scale(finish.base, (1.0 - f) / PI), [specular; 3])
    }

    /// Returns the mean radiance towards `view` of `paths` paths (a square number) that begin at a surface point
    /// outside the lamp.
    pub fn reflected(&self, hit: &Hit, view: V, paths: usize, random: &mut Random) -> V {
        let side = (paths as f64).sqrt() as usize;
        let mut sum = [0.0; 3];
        for path in 0..side * side {
            let strata = [(path % side) as f64, (path / side) as f64];
            sum = add(sum, self.path(hit, view, strata, side as f64, random));
        }
        scale(sum, 1.0 / (side * side) as f64)
    }

    fn path(&self, start: &Hit, view: V, strata: [f64; 2], side: f64, random: &mut Random) -> V {
        let mut radiance = [0.0; 3];
        let mut throughput = [1.0; 3];
        let mut hit = Hit { ..*start };
        let mut view = view;
        for bounce in 0..7 {
            let mut pair = || {
                if bounce == 0 {
                    [(strata[0] + random.next()) / side, (strata[1] + random.next()) / side]
                } else {
                    [random.next(), random.next()]
                }
            };
            let (lamp, around) = (pair(), pair());
            let origin = add(hit.position, scale(hit.normal, 1e-6));
            let (irradiance, direction, distance) = self.room.lamp_term(hit.position, hit.normal, lamp[0], lamp[1]);
            if irradiance != [0.0; 3] && self.hit(origin, direction).distance > distance - 1e-4 {
                radiance = add(radiance, mul(throughput, mul(irradiance, self.brdf(&hit, view, direction))));
            }
            // The next direction, cosine-weighted.
            let (radius, angle) = (around[0].sqrt(), 2.0 * PI * around[1]);
            let helper = if hit.normal[0].abs() > 0.5 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
            let n = hit.normal;
            let s = unit([
                n[1] * helper[2] - n[2] * helper[1],
                n[2] * helper[0] - n[0] * helper[2],
                n[0] * helper[1] - n[1] * helper[0],
            ]);
            let t = [n[1] * s[2] - n[2] * s[1], n[2] * s[0] - n[0] * s[2], n[0] * s[1] - n[1] * s[0]];
            let flat = add(scale(s, radius * angle.cos()), scale(t, radius * angle.sin()));
            let direction = unit(add(flat, scale(n, (1.0 - around[0]).max(1e-12).sqrt())));
            throughput = scale(mul(throughput, self.brdf(&hit, view, direction)), PI);
            let next = self.hit(origin, direction);
            if self.room.on_lamp(&next) {
                // Its light was counted by the sample on the lamp.
                break;
            }
            view = scale(direction, -1.0);
            hit = next;
        }
        radiance
    }
}
