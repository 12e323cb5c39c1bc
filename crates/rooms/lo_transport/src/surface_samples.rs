//! Surface samples: points distributed evenly over both sides of all triangles.

use lo_geometry::{Ray, Vec2, Vec3};
use lo_mesh::{AlphaMode, Hit, Model};
use rayon::prelude::*;

use crate::pattern;
use crate::refinement::Refinement;
use crate::traced_world::{SurfaceInteraction, TracedWorld};

/// Maximum number of samples. Beyond it, the density is reduced.
pub(crate) const MAX_SAMPLES: f64 = 6e7;

/// Point on one side of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceSample {
    pub triangle: u32,
    pub barycentric: [f32; 2],
    pub position: Vec3,
    /// Geometric normal on this side.
    pub normal: Vec3,
    /// Whether this is the side on which the triangle's corners run counter-clockwise.
    pub is_front: bool,
}

impl SurfaceSample {
    /// Evaluates the material as seen along the normal, with textures averaged over `footprint_m`.
    pub(crate) fn interaction(&self, world: &TracedWorld, footprint_m: f32) -> SurfaceInteraction {
        let hit = Hit { distance_m: 0.0, triangle: self.triangle, barycentric: self.barycentric };
        let ray = Ray { origin: self.position + self.normal, direction: -self.normal };
        world.interaction(&hit, &ray, footprint_m)
    }

    /// Returns the samples on both sides of a triangle at a point. `None` for triangles without area.
    pub(crate) fn both_sides(world: &TracedWorld, triangle: u32, barycentric: [f32; 2]) -> Option<[Self; 2]> {
        let model = world.prepared.model();
        let normal = cross(model, triangle as usize).try_normalize()?;
        let position = point(model, triangle, barycentric);
        let side = |normal, is_front| Self { triangle, barycentric, position, normal, is_front };
        Some([side(normal, true), side(-normal, false)])
    }

    /// Returns the sample and up to eight others on the same triangle, about `distance_m` away along its edges.
    pub(crate) fn around(&self, world: &TracedWorld, distance_m: f32) -> impl Iterator<Item = Self> {
        let model = world.prepared.model();
        let [a, b, c] = model.triangles[self.triangle as usize].map(|v| model.positions[v as usize]);
        let step = [b - a, c - a].map(|edge| distance_m / edge.length().max(1e-9));
        let sample = *self;
        (0..9).filter_map(move |i| {
            let moved = [
                sample.barycentric[0] + step[0] * (i % 3 - 1) as f32,
                sample.barycentric[1] + step[1] * (i / 3 - 1) as f32,
            ];
            let inside = moved[0] >= 0.0 && moved[1] >= 0.0 && moved[0] + moved[1] <= 1.0;
            inside.then_some(Self { barycentric: moved, ..sample })
        })
    }
}

/// Distributes about `per_m2` samples per side and square metre, in the order of the triangles. Each halving by
/// `refinement` quadruples the density. Cut-out parts of surfaces get no samples.
pub(crate) fn distribute<'a>(
    world: &'a TracedWorld,
    per_m2: f64,
    refinement: &'a Refinement,
) -> impl IndexedParallelIterator<Item = Vec<SurfaceSample>> + 'a {
    let model = world.prepared.model();
    let areas = areas(model);
    let finest: Vec<u32> = (0..areas.len() as u32).map(|triangle| refinement.max_level_on(model, triangle)).collect();
    let total: f64 = areas.iter().zip(&finest).map(|(area, finest)| area * f64::from(1 << (2 * finest))).sum();
    let density = per_m2.min(MAX_SAMPLES / total.max(1e-9));
    // Each triangle gets the samples between two running sums, so that small triangles share them fairly.
    let running = |sum: &mut f64, (area, finest): (&f64, &u32)| {
        let from = *sum;
        *sum += area * density * f64::from(1 << (2 * finest));
        Some((from.ceil() as u32, sum.ceil() as u32, *finest))
    };
    let ranges: Vec<(u32, u32, u32)> = areas.iter().zip(&finest).scan(0.0, running).collect();
    ranges.into_par_iter().enumerate().map(move |(triangle, (from, to, finest))| {
        let mut samples = Vec::new();
        for index in from..to {
            push_at(
                world,
                triangle as u32,
                index,
                |position| finest - refinement.level_at(position).min(finest),
                &mut samples,
            );
        }
        samples
    })
}

/// Area of each triangle, in m².
pub(crate) fn areas(model: &Model) -> Vec<f64> {
    (0..model.triangles.len()).map(|t| f64::from(cross(model, t).length()) * 0.5).collect()
}

fn cross(model: &Model, triangle: usize) -> Vec3 {
    let [a, b, c] = model.triangles[triangle].map(|v| model.positions[v as usize]);
    (b - a).cross(c - a)
}

fn point(model: &Model, triangle: u32, barycentric: [f32; 2]) -> Vec3 {
    let [a, b, c] = model.triangles[triangle as usize].map(|v| model.positions[v as usize]);
    a + (b - a) * barycentric[0] + (c - a) * barycentric[1]
}

/// Adds the samples on both sides at point `index` of the pattern. Keeps one of four for each step of `coarser_by`.
fn push_at(
    world: &TracedWorld,
    triangle: u32,
    index: u32,
    coarser_by: impl Fn(Vec3) -> u32,
    samples: &mut Vec<SurfaceSample>,
) {
    let model = world.prepared.model();
    let Vec2 { x, y } = pattern::r2(index);
    // Folding the square onto the triangle preserves the even distribution.
    let barycentric = if x + y > 1.0 { [1.0 - x, 1.0 - y] } else { [x, y] };
    if !index.is_multiple_of(1 << (2 * coarser_by(point(model, triangle, barycentric)))) {
        return;
    }
    let hit = Hit { distance_m: 0.0, triangle, barycentric };
    let material = &model.materials[model.triangle_materials[triangle as usize] as usize];
    let there = material.alpha_mode == AlphaMode::Opaque || model.alpha(&hit) > 0.0;
    if there {
        samples.extend(SurfaceSample::both_sides(world, triangle, barycentric).into_iter().flatten());
    }
}
