//! Places spread evenly over both sides of all triangles.

use lo_geometry::{Ray, Vec2, Vec3};
use lo_mesh::{AlphaMode, Hit, Model};
use rayon::prelude::*;

use crate::fineness::Fineness;
use crate::pattern;
use crate::traced_world::{Surface, TracedWorld};

/// Most places; sparser ones are taken where there would be more.
pub(crate) const MAX_PLACES: f64 = 6e7;

/// A place on one side of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub triangle: u32,
    pub barycentric: [f32; 2],
    pub position: Vec3,
    /// Geometric normal on its side.
    pub normal: Vec3,
    /// On the side that the triangle's corners go around counter-clockwise.
    pub is_front: bool,
}

impl Place {
    /// The surface seen along its normal, textures averaged over `footprint_m`.
    pub(crate) fn surface(&self, world: &TracedWorld, footprint_m: f32) -> Surface {
        let hit = Hit { distance_m: 0.0, triangle: self.triangle, barycentric: self.barycentric };
        let ray = Ray { origin: self.position + self.normal, direction: -self.normal };
        world.surface(&hit, &ray, footprint_m)
    }
}

impl Place {
    /// Both sides of a place; nothing on triangles without an area.
    pub(crate) fn at(world: &TracedWorld, triangle: u32, barycentric: [f32; 2]) -> Option<[Self; 2]> {
        let model = world.prepared.model();
        let normal = cross(model, triangle as usize).try_normalize()?;
        let position = point(model, triangle, barycentric);
        let side = |normal, is_front| Self { triangle, barycentric, position, normal, is_front };
        Some([side(normal, true), side(-normal, false)])
    }

    /// Itself and up to eight places of the same triangle about `distance_m` away along its edges.
    pub(crate) fn around(&self, world: &TracedWorld, distance_m: f32) -> impl Iterator<Item = Self> {
        let model = world.prepared.model();
        let [a, b, c] = model.triangles[self.triangle as usize].map(|v| model.positions[v as usize]);
        let step = [b - a, c - a].map(|edge| distance_m / edge.length().max(1e-9));
        let place = *self;
        (0..9).filter_map(move |i| {
            let moved = [
                place.barycentric[0] + step[0] * (i % 3 - 1) as f32,
                place.barycentric[1] + step[1] * (i / 3 - 1) as f32,
            ];
            let inside = moved[0] >= 0.0 && moved[1] >= 0.0 && moved[0] + moved[1] <= 1.0;
            inside.then_some(Self { barycentric: moved, ..place })
        })
    }
}

/// About `per_m2` places on each side, four times as many for each halving by `fineness`, in the order of the triangles; none
/// where a surface is cut out.
pub(crate) fn spread<'a>(
    world: &'a TracedWorld,
    per_m2: f64,
    fineness: &'a Fineness,
) -> impl IndexedParallelIterator<Item = Vec<Place>> + 'a {
    let model = world.prepared.model();
    let areas = areas(model);
    let finest: Vec<u32> = (0..areas.len() as u32).map(|triangle| fineness.most_on(model, triangle)).collect();
    let total: f64 = areas.iter().zip(&finest).map(|(area, finest)| area * f64::from(1 << (2 * finest))).sum();
    let density = per_m2.min(MAX_PLACES / total.max(1e-9));
    // Each triangle gets the places between two running sums, so that small ones share them fairly.
    let running = |sum: &mut f64, (area, finest): (&f64, &u32)| {
        let from = *sum;
        *sum += area * density * f64::from(1 << (2 * finest));
        Some((from.ceil() as u32, sum.ceil() as u32, *finest))
    };
    let ranges: Vec<(u32, u32, u32)> = areas.iter().zip(&finest).scan(0.0, running).collect();
    ranges.into_par_iter().enumerate().map(move |(triangle, (from, to, finest))| {
        let mut places = Vec::new();
        for index in from..to {
            push_at(world, triangle as u32, index, |position| finest - fineness.at(position).min(finest), &mut places);
        }
        places
    })
}

/// Area of each triangle, m².
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

/// Adds both sides of the place that belongs to `index`; of each four, `sparser` times, one.
fn push_at(world: &TracedWorld, triangle: u32, index: u32, sparser: impl Fn(Vec3) -> u32, places: &mut Vec<Place>) {
    let model = world.prepared.model();
    let Vec2 { x, y } = pattern::r2(index);
    // The square folded onto the triangle keeps the points as even as they are.
    let barycentric = if x + y > 1.0 { [1.0 - x, 1.0 - y] } else { [x, y] };
    if !index.is_multiple_of(1 << (2 * sparser(point(model, triangle, barycentric)))) {
        return;
    }
    let hit = Hit { distance_m: 0.0, triangle, barycentric };
    let material = &model.materials[model.triangle_materials[triangle as usize] as usize];
    let there = material.alpha_mode == AlphaMode::Opaque || model.alpha(&hit) > 0.0;
    if there {
        places.extend(Place::at(world, triangle, barycentric).into_iter().flatten());
    }
}
