//! Surfels: evenly distributed cache points on both sides of all surfaces, with a hash grid for lookups.

use lo_geometry::Vec3;
use rayon::prelude::*;

use crate::TransportError;
use crate::components::{ANY_COMPONENT, Components, OUTSIDE_COMPONENT};
use crate::lights::Emitters;
use crate::neighbours::Neighbours;
use crate::refinement::Refinement;
use crate::surface_samples::{self, SurfaceSample};
use crate::traced_world::TracedWorld;
use crate::transfer::{self, MeanScattering};

/// Candidate surface samples per surfel.
const CANDIDATES: f64 = 8.0;

/// Small piece of one side of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surfel {
    pub position: Vec3,
    /// Geometric normal on this side.
    pub normal: Vec3,
    pub component: u32,
    /// Its position on the triangle.
    pub sample: SurfaceSample,
    /// Distance to neighbouring surfels.
    pub spacing_m: f32,
    /// Mean scattering over directions and over its extent.
    pub scattering: MeanScattering,
}

impl Surfel {
    /// Returns the approximate surface area that it represents.
    pub(crate) fn area_m2(&self) -> f32 {
        self.spacing_m * self.spacing_m
    }

    /// Returns the cube face (0–5) that its normal points to.
    pub(crate) fn face(&self) -> usize {
        face(self.normal) as usize
    }
}

/// All surfels, and the hash grid over those in use.
pub(crate) struct Surfels {
    pub list: Vec<Surfel>,
    components: Components,
    refinement: Refinement,
    table: Table,
}

/// Candidate position of a surfel.
struct Candidate {
    key: u64,
    distance2: f32,
    sample: SurfaceSample,
}

impl Surfels {
    pub(crate) fn spread(world: &TracedWorld, emitters: &Emitters, spacing_m: f32) -> Result<Self, TransportError> {
        let model = world.prepared.model();
        let areas = surface_samples::areas(model);
        let density = CANDIDATES / f64::from(spacing_m * spacing_m);
        let total: f64 = areas.iter().sum();
        if total * density > surface_samples::MAX_SAMPLES {
            let limit = (surface_samples::MAX_SAMPLES / CANDIDATES) as usize;
            return Err(TransportError::TooLarge { area_m2: total as f32, spacing_m, limit });
        }
        let components = Components::find(world, emitters, &areas, 2.0 * f64::from(spacing_m * spacing_m));
        let refinement = Refinement::around_lamps(emitters, spacing_m);
        let mut candidates: Vec<Candidate> = surface_samples::distribute(world, density, &refinement)
            .flat_map_iter(|samples| samples.into_iter().filter(|sample| !components.faces_solid(sample)))
            .map(|sample| Candidate::new(sample, components.of(sample.triangle), &refinement))
            .collect();
        candidates.par_sort_unstable_by(|a, b| {
            (a.key.cmp(&b.key))
                .then(a.distance2.total_cmp(&b.distance2))
                .then(a.sample.triangle.cmp(&b.sample.triangle))
                .then(a.sample.barycentric[0].total_cmp(&b.sample.barycentric[0]))
        });
        candidates.dedup_by_key(|candidate| candidate.key);
        let surfel = |Candidate { sample, .. }: &Candidate| {
            let spacing_m = refinement.spacing_m(refinement.level_at(sample.position));
            let scattering = transfer::mean_scattering(&sample.interaction(world, spacing_m));
            let component = components.of(sample.triangle);
            Surfel {
                position: sample.position,
                normal: sample.normal,
                component,
                sample: *sample,
                spacing_m,
                scattering,
            }
        };
        let list: Vec<Surfel> = candidates.par_iter().map(surfel).collect();
        let mut surfels = Self { list, components, refinement, table: Table::new(0) };
        surfels.index();
        Ok(surfels)
    }

    /// Separates surfels outside from those of the same component inside.
    pub(crate) fn set_outside(&mut self, outside: &[bool]) {
        for (surfel, _) in self.list.iter_mut().zip(outside).filter(|(_, outside)| **outside) {
            surfel.component = OUTSIDE_COMPONENT;
        }
        self.index();
    }

    /// Removes the surfels that are not marked in `keep`.
    pub(crate) fn retain(&mut self, keep: &[bool]) {
        let mut keep = keep.iter();
        self.list.retain(|_| keep.next().copied().unwrap_or(false));
        self.index();
    }

    /// Returns the mean of `value` over all surfels, weighted by area.
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
            let (face, level) = (face(surfel.normal), self.refinement.level_at(surfel.position));
            table.insert(key(surfel.component, level, face, cell(surfel.position, surfel.spacing_m)), at as u32);
            table.insert(key(ANY_COMPONENT, 0, face, cell(surfel.position, self.coarse_m())), at as u32);
        }
        self.table = table;
    }

    /// Size of the cells of the fallback grid, which ignores components.
    fn coarse_m(&self) -> f32 {
        2.0 * self.refinement.spacing_m(0)
    }

    /// Whether a surface sample faces into a solid, where there is no light.
    pub(crate) fn faces_solid(&self, sample: &SurfaceSample) -> bool {
        self.components.faces_solid(sample)
    }

    pub(crate) fn component(&self, triangle: u32) -> u32 {
        self.components.of(triangle)
    }

    /// Returns the surfels from which light at a position is interpolated. `component` and the geometric `normal` are
    /// those of the surface there.
    pub(crate) fn near(&self, position: Vec3, normal: Vec3, component: u32) -> Neighbours {
        let mut found = Neighbours::none();
        let level = self.refinement.level_at(position);
        self.collect(position, normal, component, level, self.refinement.spacing_m(level), &mut found);
        if found.as_slice().is_empty() {
            found.from_other_components = true;
            self.collect(position, normal, ANY_COMPONENT, 0, self.coarse_m(), &mut found);
        }
        found
    }

    /// Returns a surfel near a position: that of its own cell if it has one, else the one with the largest weight.
    pub(crate) fn nearest(&self, position: Vec3, normal: Vec3, component: u32) -> Option<u32> {
        let level = self.refinement.level_at(position);
        let spacing_m = self.refinement.spacing_m(level);
        let own = self.table.find(key(component, level, face(normal), cell(position, spacing_m)));
        own.filter(|&surfel| self.weight(surfel, position, normal, spacing_m) > 0.0)
            .or_else(|| self.near(position, normal, component).best())
    }

    fn collect(&self, position: Vec3, normal: Vec3, component: u32, level: u32, cell_m: f32, found: &mut Neighbours) {
        let scaled = position / cell_m + Vec3::splat(GRID_OFFSET - 0.5);
        let base = scaled.floor();
        let base = [base.x as i32, base.y as i32, base.z as i32];
        for axis in 0..3 {
            // Curved surfaces continue on other faces of the cube of directions.
            if normal[axis].abs() < 0.4 {
                continue;
            }
            let face = 2 * axis as u32 + u32::from(normal[axis] < 0.0);
            for corner in 0..8 {
                let at = [base[0] + (corner & 1), base[1] + (corner >> 1 & 1), base[2] + (corner >> 2)];
                if let Some(surfel) = self.table.find(key(component, level, face, at)) {
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
        // Surfels in the same plane count far more than those of a layer in front or behind.
        let layer = above / (LAYER_SHARE * cell_m);
        if near <= 0.0 || above >= 0.6 * cell_m {
            return 0.0;
        }
        near * near * near * facing * facing / (1.0 + layer * layer).powi(2)
    }
}

/// Surfels this share of a cell in front of or behind the plane get a quarter of the weight.
const LAYER_SHARE: f32 = 0.1;

/// Offset of the grid, so that cell borders avoid round coordinates, where walls are.
const GRID_OFFSET: f32 = 0.381_966;

/// Returns the cube face (0–5) that a direction points to.
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

/// Builds a hash key. Cells 8192 apart share keys; positions distinguish them.
fn key(component: u32, level: u32, face: u32, [x, y, z]: [i32; 3]) -> u64 {
    let bits = |v: i32| (v & 0x1fff) as u64;
    u64::from(level) << 62
        | u64::from(component & ANY_COMPONENT) << 42
        | u64::from(face) << 39
        | bits(x) << 26
        | bits(y) << 13
        | bits(z)
}

impl Candidate {
    fn new(sample: SurfaceSample, component: u32, refinement: &Refinement) -> Self {
        let level = refinement.level_at(sample.position);
        let spacing_m = refinement.spacing_m(level);
        let [x, y, z] = cell(sample.position, spacing_m);
        let center = (Vec3::new(x as f32, y as f32, z as f32) + Vec3::splat(0.5 - GRID_OFFSET)) * spacing_m;
        let key = key(component, level, face(sample.normal), [x, y, z]);
        Self { key, distance2: sample.position.distance_squared(center), sample }
    }
}

/// Hash table with open addressing. A key keeps its first value.
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
