//! Emitters that light is sampled from: pieces of emissive triangles, of portals, and of sheets lit from behind.

use lo_geometry::{Ray, Vec3};
use lo_mesh::Hit;

use crate::traced_world::TracedWorld;

/// Flat piece of a light.
#[derive(Clone, Debug)]
pub(crate) struct Emitter {
    pub corner: Vec3,
    pub edges: [Vec3; 2],
    /// Unit normal of the front side.
    pub normal: Vec3,
    pub area_m2: f32,
    /// Mean radiance leaving the front and the back.
    pub radiance: [Vec3; 2],
    pub shape: EmitterShape,
    /// Whether it emits light transmitted from behind.
    pub sheet: bool,
}

/// Geometry that an emitter is a piece of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum EmitterShape {
    /// Part of a triangle with these barycentric corners. `textured` if its radiance varies.
    Triangle { triangle: u32, corners: [[f32; 2]; 3], textured: bool },
    /// Parallelogram through which outdoor light enters.
    Portal,
}

/// Sampled point of an emitter, seen from a receiver.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSample {
    /// Unit direction towards the light.
    pub direction: Vec3,
    /// Length of the shadow ray: up to the light, or far away for portals.
    pub distance_m: f32,
    pub radiance: Vec3,
    /// Solid angle per area at the point: cos / distance².
    pub sr_per_m2: f32,
    /// Whether the emitter is a sheet lit from behind.
    pub sheet: bool,
}

impl Emitter {
    /// Returns the relative sampling weight: area times the luminance of both sides.
    pub(crate) fn weight(&self) -> f32 {
        self.area_m2 * luminance(self.radiance[0] + self.radiance[1])
    }

    /// Returns the corners of the convex hull.
    pub(crate) fn corners(&self) -> [Vec3; 4] {
        let [a, b] = self.edges;
        let last = if self.shape == EmitterShape::Portal { self.corner + a + b } else { self.corner };
        [self.corner, self.corner + a, self.corner + b, last]
    }

    /// Maps two numbers in [0, 1) to a point of the emitter, uniformly by area, as seen from `from`. `None` where no
    /// light is emitted towards `from`.
    pub(crate) fn sample(&self, world: &TracedWorld, from: Vec3, [u, v]: [f32; 2]) -> Option<LightSample> {
        let [a, b] = match self.shape {
            EmitterShape::Portal => [u, v],
            EmitterShape::Triangle { .. } => {
                let root = u.sqrt();
                [root * (1.0 - v), root * v]
            }
        };
        let offset = self.corner + self.edges[0] * a + self.edges[1] * b - from;
        let distance2 = offset.length_squared();
        if distance2 < 1e-12 {
            return None;
        }
        let distance_m = distance2.sqrt();
        let direction = offset / distance_m;
        let cosine = -direction.dot(self.normal);
        let side = usize::from(cosine < 0.0);
        if cosine == 0.0 || self.radiance[side] == Vec3::ZERO {
            return None;
        }
        let sr_per_m2 = cosine.abs() / distance2;
        let (radiance, distance_m) = match self.shape {
            EmitterShape::Portal => (world.sky.radiance(direction), world.far_m),
            EmitterShape::Triangle { triangle, corners: [p, q, r], textured } => {
                // The shadow ray ends before the light's own surface.
                let until = distance_m * (1.0 - 1e-4) - 1e-4;
                let radiance = if textured {
                    let at = |k: usize| p[k] + (q[k] - p[k]) * a + (r[k] - p[k]) * b;
                    let hit = Hit { distance_m, triangle, barycentric: [at(0), at(1)] };
                    world.interaction(&hit, &Ray { origin: from, direction }, 0.0).emission
                } else {
                    self.radiance[side]
                };
                (radiance, until)
            }
        };
        Some(LightSample { direction, distance_m, radiance, sr_per_m2, sheet: self.sheet })
    }
}

/// All emitters of a world, ordered by triangle.
pub(crate) struct Emitters {
    pub list: Vec<Emitter>,
    /// Per triangle of the model: first emitter and pieces per edge. 0 pieces if it does not emit.
    by_triangle: Vec<(u32, u32)>,
    /// Per portal: first emitter and pieces along both edges. Empty if the sky is dark.
    by_portal: Vec<(u32, [u32; 2])>,
}

/// Maximum edge length of a piece of a lamp.
const LAMP_PIECE_M: f32 = 0.4;

/// Maximum edge length of a piece of a portal.
const PORTAL_PIECE_M: f32 = 0.4;

/// Maximum number of pieces per edge. Bounds the cost of huge triangles.
const MAX_PIECES: f32 = 40.0;

impl Emitters {
    /// Creates emitters for emissive triangles and, if the sky is not dark, portals.
    pub(crate) fn new(world: &TracedWorld) -> Self {
        let mut emitters = Self::none(world);
        for triangle in 0..emitters.by_triangle.len() as u32 {
            emitters.push_lamp(world, triangle);
        }
        if !world.sky.is_dark() {
            emitters.push_portals(world);
        }
        emitters
    }

    /// Creates an empty set.
    pub(crate) fn none(world: &TracedWorld) -> Self {
        let by_triangle = vec![(0, 0); world.prepared.model().triangles.len()];
        Self { list: Vec::new(), by_triangle, by_portal: Vec::new() }
    }

    /// Whether a triangle has emitters.
    pub(crate) fn holds(&self, triangle: u32) -> bool {
        self.by_triangle[triangle as usize].1 > 0
    }

    /// Returns the mean radiance of an emitter on the side of `normal`.
    pub(crate) fn radiance(&self, emitter: u32, normal: Vec3) -> Vec3 {
        let emitter = &self.list[emitter as usize];
        emitter.radiance[usize::from(emitter.normal.dot(normal) < 0.0)]
    }

    fn push_lamp(&mut self, world: &TracedWorld, triangle: u32) {
        let model = world.prepared.model();
        let material = &model.materials[model.triangle_materials[triangle as usize] as usize];
        if material.emissive == [0.0; 3] || material.unlit {
            return;
        }
        let textured = material.emissive_texture.is_some();
        self.push_triangle(
            world,
            triangle,
            LAMP_PIECE_M,
            |emitter, centre| {
                let size = emitter.edges[0].length().max(emitter.edges[1].length());
                let side = |normal: Vec3| {
                    if !world.gives_off(triangle, normal) {
                        return Vec3::ZERO;
                    }
                    let ray = Ray { origin: emitter.corner, direction: -normal };
                    let hit = Hit { distance_m: 0.0, triangle, barycentric: centre };
                    world.interaction(&hit, &ray, if textured { size } else { 0.0 }).emission
                };
                emitter.radiance = [side(emitter.normal), side(-emitter.normal)];
            },
            textured,
        );
    }

    /// Cuts a triangle into pieces with edges of at most `piece_m`. `light` sets the radiance of each, given its
    /// barycentric centre.
    pub(crate) fn push_triangle(
        &mut self,
        world: &TracedWorld,
        triangle: u32,
        piece_m: f32,
        mut light: impl FnMut(&mut Emitter, [f32; 2]),
        textured: bool,
    ) {
        let model = world.prepared.model();
        let [a, b, c] = model.triangles[triangle as usize].map(|v| model.positions[v as usize]);
        let (ab, ac) = (b - a, c - a);
        let longest = ab.length().max(ac.length()).max((c - b).length());
        let cross = ab.cross(ac);
        if cross.length_squared() < 1e-18 {
            return;
        }
        let pieces = (longest / piece_m).ceil().clamp(1.0, MAX_PIECES);
        let first = self.list.len();
        for row in 0..pieces as u32 {
            for column in 0..2 * (pieces as u32 - row) - 1 {
                let (i, j, flip) = (row as f32, (column / 2) as f32, column % 2 == 1);
                // An upright piece and the inverted one beside it.
                let corners = if flip {
                    [[i + 1.0, j + 1.0], [i, j + 1.0], [i + 1.0, j]]
                } else {
                    [[i, j], [i + 1.0, j], [i, j + 1.0]]
                };
                let corners = corners.map(|p| p.map(|x| x / pieces));
                let sign = if flip { -1.0 } else { 1.0 };
                let mut emitter = Emitter {
                    corner: a + ab * corners[0][0] + ac * corners[0][1],
                    edges: [ab * (sign / pieces), ac * (sign / pieces)],
                    normal: cross.normalize(),
                    area_m2: 0.5 * cross.length() / (pieces * pieces),
                    radiance: [Vec3::ZERO; 2],
                    shape: EmitterShape::Triangle { triangle, corners, textured },
                    sheet: false,
                };
                light(&mut emitter, [0, 1].map(|k| corners.iter().map(|p| p[k]).sum::<f32>() / 3.0));
                self.list.push(emitter);
            }
        }
        if self.list[first..].iter().all(|emitter| emitter.radiance == [Vec3::ZERO; 2]) {
            self.list.truncate(first);
        } else {
            self.by_triangle[triangle as usize] = (first as u32, pieces as u32);
        }
    }

    fn push_portals(&mut self, world: &TracedWorld) {
        const DIRECTIONS: usize = 256;
        let hemisphere = lo_geometry::cosine_hemisphere(DIRECTIONS);
        for opening in &world.sky.portals {
            let [a, b] = opening.portal.edges;
            let basis = lo_geometry::orthonormal_basis(-opening.normal);
            let mean = hemisphere.iter().map(|&d| world.sky.radiance(basis * d)).sum::<Vec3>() / DIRECTIONS as f32;
            // A sky that is dark in all sampled directions may still contain a light.
            let mean = mean.max(Vec3::splat(1e-6));
            let count = [a, b].map(|edge| (edge.length() / PORTAL_PIECE_M).ceil().clamp(1.0, MAX_PIECES));
            let edges = [a / count[0], b / count[1]];
            self.by_portal.push((self.list.len() as u32, count.map(|count| count as u32)));
            for i in 0..count[0] as u32 * count[1] as u32 {
                let (row, column) = (i / count[0] as u32, i % count[0] as u32);
                self.list.push(Emitter {
                    corner: opening.portal.corner + edges[0] * column as f32 + edges[1] * row as f32,
                    edges,
                    normal: opening.normal,
                    area_m2: edges[0].cross(edges[1]).length(),
                    radiance: [mean, Vec3::ZERO],
                    shape: EmitterShape::Portal,
                    sheet: false,
                });
            }
        }
    }

    /// Returns the emitter at a point of a portal.
    pub(crate) fn of_portal(&self, portal: usize, along: [f32; 2]) -> Option<u32> {
        let &(first, count) = self.by_portal.get(portal)?;
        let [column, row] = [0, 1].map(|k| ((along[k] * count[k] as f32) as u32).min(count[k] - 1));
        Some(first + row * count[0] + column)
    }

    /// Returns the emitter that was hit.
    pub(crate) fn of(&self, hit: &Hit) -> Option<u32> {
        let (first, pieces) = self.by_triangle[hit.triangle as usize];
        if pieces == 0 {
            return None;
        }
        let last = (pieces - 1) as f32;
        let [x, y] = hit.barycentric.map(|b| b * pieces as f32);
        let row = x.floor().clamp(0.0, last);
        let column = y.floor().clamp(0.0, last - row);
        let flip = (x - row) + (y - column) > 1.0 && row + column < last;
        let (row, column) = (row as u32, column as u32);
        Some(first + row * (2 * pieces - row) + 2 * column + u32::from(flip))
    }
}

/// Luminance used for importance weights.
pub(crate) fn luminance(rgb: Vec3) -> f32 {
    lo_imaging::luminance(rgb.into())
}
