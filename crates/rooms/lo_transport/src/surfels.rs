//! Points spread evenly over both sides of all surfaces, and how to find those near a place.

use lo_geometry::Vec3;
use rayon::prelude::*;

use crate::TransportError;
use crate::fineness::Fineness;
use crate::lights::Emitters;
use crate::neighbours::Neighbours;
use crate::parts::{ANY_PART, OUTSIDE_PART, Parts};
use crate::places::{self, Place};
use crate::traced_world::TracedWorld;
use crate::transfer::{self, Scatter};

/// Places tried per surfel.
const CANDIDATES: f64 = 8.0;

/// One side of a small piece of surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surfel {
    pub position: Vec3,
    /// Geometric, on its side.
    pub normal: Vec3,
    pub part: u32,
    /// The same on its triangle.
    pub place: Place,
    /// Distance to the next surfels.
    pub spacing_m: f32,
    /// How it scatters light on the average over directions and over its extent.
    pub scatter: Scatter,
}

impl Surfel {
    /// About the area it stands for.
    pub(crate) fn area_m2(&self) -> f32 {
        self.spacing_m * self.spacing_m
    }

    /// Which of the six axes it faces.
    pub(crate) fn face(&self) -> usize {
        face(self.normal) as usize
    }
}

/// All surfels and the grid over those in use.
pub(crate) struct Surfels {
    pub list: Vec<Surfel>,
    parts: Parts,
    fineness: Fineness,
    table: Table,
}

/// A place where a surfel may be.
struct Candidate {
    key: u64,
    distance2: f32,
    place: Place,
}

impl Surfels {
    pub(crate) fn spread(world: &TracedWorld, emitters: &Emitters, spacing_m: f32) -> Result<Self, TransportError> {
        let model = world.prepared.model();
        let areas = places::areas(model);
        let density = CANDIDATES / f64::from(spacing_m * spacing_m);
        let total: f64 = areas.iter().sum();
        if total * density > places::MAX_PLACES {
            let most = (places::MAX_PLACES / CANDIDATES) as usize;
            return Err(TransportError::TooLarge { area_m2: total as f32, spacing_m, most });
        }
        let parts = Parts::find(world, emitters, &areas, 2.0 * f64::from(spacing_m * spacing_m));
        let fineness = Fineness::around_lamps(emitters, spacing_m);
        let mut candidates: Vec<Candidate> = places::spread(world, density, &fineness)
            .flat_map_iter(|places| places.into_iter().filter(|place| !parts.is_inside(place)))
            .map(|place| Candidate::new(place, parts.of(place.triangle), &fineness))
            .collect();
        candidates.par_sort_unstable_by(|a, b| {
            (a.key.cmp(&b.key))
                .then(a.distance2.total_cmp(&b.distance2))
                .then(a.place.triangle.cmp(&b.place.triangle))
                .then(a.place.barycentric[0].total_cmp(&b.place.barycentric[0]))
        });
        candidates.dedup_by_key(|candidate| candidate.key);
        let surfel = |Candidate { place, .. }: &Candidate| {
            let spacing_m = fineness.spacing_m(fineness.at(place.position));
            let scatter = transfer::scatter(&place.surface(world, spacing_m));
            let part = parts.of(place.triangle);
            Surfel { position: place.position, normal: place.normal, part, place: *place, spacing_m, scatter }
        };
        let list: Vec<Surfel> = candidates.par_iter().map(surfel).collect();
        let mut surfels = Self { list, parts, fineness, table: Table::new(0) };
        surfels.index();
        Ok(surfels)
    }

    /// Sets surfels apart from others of their part that are not outside.
    pub(crate) fn set_outside(&mut self, outside: &[bool]) {
        for (surfel, _) in self.list.iter_mut().zip(outside).filter(|(_, outside)| **outside) {
            surfel.part = OUTSIDE_PART;
        }
        self.index();
    }

    /// Drops all surfels but those to `keep`.
    pub(crate) fn retain(&mut self, keep: &[bool]) {
        let mut keep = keep.iter();
        self.list.retain(|_| keep.next().copied().unwrap_or(false));
        self.index();
    }

    /// Mean over all surfaces of what `value` gives for each surfel.
    pub(crate) fn mean(&self, value: impl Fn(usize) -> Vec3) -> Vec3 {
        let (mut sum, mut area_m2) = (Vec3::ZERO, 0.0);
        for (i, surfel) in self.list.iter().enumerate() {
            sum += value(i) * surfel.area_m2();
            area_m2 += surfel.area_m2();
        }
        sum / area_m2.max(f32::MIN_POSITIVE)
    }

    fn index(&mut self) {
        let mut table = Table::new(2 * self.list.len());
        for (at, surfel) in self.list.iter().enumerate() {
            let (face, level) = (face(surfel.normal), self.fineness.at(surfel.position));
            table.insert(key(surfel.part, level, face, cell(surfel.position, surfel.spacing_m)), at as u32);
            table.insert(key(ANY_PART, 0, face, cell(surfel.position, self.coarse_m())), at as u32);
        }
        self.table = table;
    }

    /// Size of the cells in which any surfel serves.
    fn coarse_m(&self) -> f32 {
        2.0 * self.fineness.spacing_m(0)
    }

    /// Whether a place faces into a solid, where no light is.
    pub(crate) fn is_inside(&self, place: &Place) -> bool {
        self.parts.is_inside(place)
    }

    pub(crate) fn part(&self, triangle: u32) -> u32 {
        self.parts.of(triangle)
    }

    /// Surfels from which light at a place of part `part` with geometric normal `normal` is interpolated.
    pub(crate) fn near(&self, position: Vec3, normal: Vec3, part: u32) -> Neighbours {
        let mut found = Neighbours::none();
        let level = self.fineness.at(position);
        self.collect(position, normal, part, level, self.fineness.spacing_m(level), &mut found);
        if found.as_slice().is_empty() {
            found.of_others = true;
            self.collect(position, normal, ANY_PART, 0, self.coarse_m(), &mut found);
        }
        found
    }

    /// One surfel near a place: of its own cell where that has one, else the one that counts most.
    pub(crate) fn nearest(&self, position: Vec3, normal: Vec3, part: u32) -> Option<u32> {
        let level = self.fineness.at(position);
        let spacing_m = self.fineness.spacing_m(level);
        let own = self.table.find(key(part, level, face(normal), cell(position, spacing_m)));
        own.filter(|&surfel| self.weight(surfel, position, normal, spacing_m) > 0.0)
            .or_else(|| self.near(position, normal, part).best())
    }

    fn collect(&self, position: Vec3, normal: Vec3, part: u32, level: u32, cell_m: f32, found: &mut Neighbours) {
        let scaled = position / cell_m + Vec3::splat(GRID_OFFSET - 0.5);
        let base = scaled.floor();
        let base = [base.x as i32, base.y as i32, base.z as i32];
        for axis in 0..3 {
            // Curved surfaces go over from one face of the cube of directions to the next.
            if normal[axis].abs() < 0.4 {
                continue;
            }
            let face = 2 * axis as u32 + u32::from(normal[axis] < 0.0);
            for corner in 0..8 {
                let at = [base[0] + (corner & 1), base[1] + (corner >> 1 & 1), base[2] + (corner >> 2)];
                if let Some(surfel) = self.table.find(key(part, level, face, at)) {
                    let weight = self.weight(surfel, position, normal, cell_m);
                    if weight > 0.0 {
                        found.push(surfel, weight);
                    }
                }
            }
        }
    }

    fn weight(&self, surfel: u32, position: Vec3, normal: Vec3, cell_m: f32) -> f32 {
        let surfel = &self.list[surfel as usize];
        let offset = position - surfel.position;
        let facing = normal.dot(surfel.normal);
        if facing <= 0.2 {
            return 0.0;
        }
        let above = offset.dot(normal).abs().max(offset.dot(surfel.normal).abs());
        let near = 1.0 - offset.length_squared() / (2.25 * cell_m * cell_m);
        // What lies in the plane counts far more than another layer before or behind it.
        let layer = above / (LAYER_SHARE * cell_m);
        if near <= 0.0 || above >= 0.6 * cell_m {
            return 0.0;
        }
        near * near * near * facing * facing / (1.0 + layer * layer).powi(2)
    }
}

/// Surfels this share of a cell before or behind a place count a quarter.
const LAYER_SHARE: f32 = 0.1;

/// The grid lies askew to round coordinates, where walls are.
const GRID_OFFSET: f32 = 0.381_966;

/// The face of a cube that a direction points to.
fn face(normal: Vec3) -> u32 {
    let size = normal.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    2 * axis + u32::from(normal[axis as usize] < 0.0)
}

fn cell(position: Vec3, cell_m: f32) -> [i32; 3] {
    let scaled = (position / cell_m + Vec3::splat(GRID_OFFSET)).floor();
    [scaled.x as i32, scaled.y as i32, scaled.z as i32]
}

/// Cells 8192 apart share keys; positions tell them apart.
fn key(part: u32, level: u32, face: u32, [x, y, z]: [i32; 3]) -> u64 {
    let bits = |v: i32| (v & 0x1fff) as u64;
    u64::from(level) << 62
        | u64::from(part & ANY_PART) << 42
        | u64::from(face) << 39
        | bits(x) << 26
        | bits(y) << 13
        | bits(z)
}

impl Candidate {
    fn new(place: Place, part: u32, fineness: &Fineness) -> Self {
        let level = fineness.at(place.position);
        let spacing_m = fineness.spacing_m(level);
        let [x, y, z] = cell(place.position, spacing_m);
        let center = (Vec3::new(x as f32, y as f32, z as f32) + Vec3::splat(0.5 - GRID_OFFSET)) * spacing_m;
        let key = key(part, level, face(place.normal), [x, y, z]);
        Self { key, distance2: place.position.distance_squared(center), place }
    }
}

/// Open addressing; a key keeps the first value.
struct Table {
    slots: Vec<(u64, u32)>,
    mask: usize,
}

impl Table {
    const FREE: u64 = u64::MAX;

    fn new(entries: usize) -> Self {
        let size = (2 * entries).next_power_of_two().max(2);
        Self { slots: vec![(Self::FREE, 0); size], mask: size - 1 }
    }

    fn start(&self, key: u64) -> usize {
        // Fibonacci hashing; the upper bits are the good ones.
        (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as usize & self.mask
    }

    fn insert(&mut self, key: u64, value: u32) {
        let mut at = self.start(key);
        while self.slots[at].0 != Self::FREE {
            if self.slots[at].0 == key {
                return;
            }
            at = (at + 1) & self.mask;
        }
        self.slots[at] = (key, value);
    }

    fn find(&self, key: u64) -> Option<u32> {
        let mut at = self.start(key);
        loop {
            let (found, value) = self.slots[at];
            if found == key {
                return Some(value);
            }
            if found == Self::FREE {
                return None;
            }
            at = (at + 1) & self.mask;
        }
    }
}
