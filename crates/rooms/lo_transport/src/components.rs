//! Connected components of a model, and the detection of solids among them.

use std::collections::{HashMap, HashSet};

use lo_geometry::{Ray, Vec3};
use lo_mesh::{Model, offset_origin};

use crate::lights::{EmitterShape, Emitters};
use crate::surface_samples::SurfaceSample;
use crate::traced_world::TracedWorld;

/// Index that stands for all components.
pub(crate) const ANY_COMPONENT: u32 = 0xf_ffff;

/// Index of surfaces under the open sky.
pub(crate) const OUTSIDE_COMPONENT: u32 = ANY_COMPONENT - 1;

/// Number of components that are distinguished.
const MAX_COMPONENTS: u32 = OUTSIDE_COMPONENT - 1;

/// Maximum number of emitters that are tested for being enclosed.
const MAX_EMITTERS: usize = 256;

/// Maximum number of surfaces that an enclosure ray crosses.
const MAX_CROSSED: usize = 1024;

/// Components: triangles that share corner positions.
pub(crate) struct Components {
    /// Component of each triangle. Small components share 0, and with it their surfels.
    index: Vec<u32>,
    /// Side of each triangle that faces into a solid.
    solid_side: Vec<SolidSide>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SolidSide {
    None,
    Front,
    Back,
}

impl Components {
    /// Finds the components. Those with less area than `least_m2` get index 0.
    pub(crate) fn find(world: &TracedWorld, emitters: &Emitters, areas: &[f64], least_m2: f64) -> Self {
        let model = world.prepared.model();
        let corners = corners(model);
        let roots = roots(model, &corners);
        let mut size: HashMap<u32, f64> = HashMap::new();
        for (root, area) in roots.iter().zip(areas) {
            *size.entry(*root).or_default() += area;
        }
        let mut indices: HashMap<u32, u32> = HashMap::new();
        let indexed = |root: &u32| {
            if size[root] < least_m2 {
                return 0;
            }
            let next = indices.len() as u32 % MAX_COMPONENTS + 1;
            *indices.entry(*root).or_insert(next)
        };
        let index = roots.iter().map(indexed).collect();
        let mut solids = closed(model, &corners, &roots);
        for lit in enclosing_lights(world, emitters, &roots) {
            solids.remove(&lit);
        }
        let solid_side = |(triangle, root): (usize, &u32)| {
            let material = &model.materials[model.triangle_materials[triangle] as usize];
            match solids.get(root) {
                // Light enters glass and passes through cloth.
                Some(_) if material.transmission > 0.0 || material.diffuse_transmission > 0.0 => SolidSide::None,
                Some(&volume_m3) if volume_m3 > 0.0 => SolidSide::Back,
                Some(_) => SolidSide::Front,
                None => SolidSide::None,
            }
        };
        let solid_side = roots.iter().enumerate().map(solid_side).collect();
        Self { index, solid_side }
    }

    /// Returns the component of a triangle.
    pub(crate) fn of(&self, triangle: u32) -> u32 {
        self.index[triangle as usize]
    }

    /// Whether a surface sample faces into a solid.
    pub(crate) fn faces_solid(&self, sample: &SurfaceSample) -> bool {
        match self.solid_side[sample.triangle as usize] {
            SolidSide::None => false,
            SolidSide::Front => sample.is_front,
            SolidSide::Back => !sample.is_front,
        }
    }
}

/// Maps each vertex to the first vertex at the same position.
fn corners(model: &Model) -> Vec<u32> {
    let mut at_position: HashMap<[u32; 3], u32> = HashMap::with_capacity(model.positions.len());
    let first = |(vertex, position): (usize, &Vec3)| {
        // Adding zero turns -0 into 0.
        let bits = (*position + Vec3::ZERO).to_array().map(f32::to_bits);
        *at_position.entry(bits).or_insert(vertex as u32)
    };
    model.positions.iter().enumerate().map(first).collect()
}

/// Returns a representative vertex per triangle, equal for all triangles of a component.
fn roots(model: &Model, corners: &[u32]) -> Vec<u32> {
    let mut parent = corners.to_vec();
    fn root(parent: &mut [u32], mut vertex: u32) -> u32 {
        while parent[vertex as usize] != vertex {
            parent[vertex as usize] = parent[parent[vertex as usize] as usize];
            vertex = parent[vertex as usize];
        }
        vertex
    }
    for triangle in &model.triangles {
        let first = root(&mut parent, triangle[0]);
        for &vertex in &triangle[1..] {
            let other = root(&mut parent, vertex);
            parent[other as usize] = first;
        }
    }
    model.triangles.iter().map(|triangle| root(&mut parent, triangle[0])).collect()
}

/// Returns the closed components with their signed volume: positive if the triangles' fronts face outwards. In a closed
/// component each edge is traversed equally often in both directions.
fn closed(model: &Model, corners: &[u32], roots: &[u32]) -> HashMap<u32, f64> {
    let mut passed: HashMap<(u32, u32), (u32, i32)> = HashMap::with_capacity(3 * roots.len() / 2);
    let mut volumes: HashMap<u32, f64> = HashMap::new();
    for (triangle, &root) in model.triangles.iter().zip(roots) {
        let [a, b, c] = triangle.map(|vertex| corners[vertex as usize]);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let (_, count) = passed.entry((from.min(to), from.max(to))).or_insert((root, 0));
            *count += if from < to { 1 } else { -1 };
        }
        let origin = model.positions[root as usize].as_dvec3();
        let [a, b, c] = triangle.map(|vertex| model.positions[vertex as usize].as_dvec3() - origin);
        *volumes.entry(root).or_default() += a.dot(b.cross(c)) / 6.0;
    }
    for (root, count) in passed.into_values() {
        if count != 0 {
            volumes.remove(&root);
        }
    }
    volumes.retain(|_, volume_m3| volume_m3.abs() > 0.0);
    volumes
}

/// Returns the components that enclose emitters: rooms, lanterns.
fn enclosing_lights(world: &TracedWorld, emitters: &Emitters, roots: &[u32]) -> HashSet<u32> {
    let model = world.prepared.model();
    let mut found = HashSet::new();
    let step = emitters.list.len().div_ceil(MAX_EMITTERS).max(1);
    let sides = emitters.list.iter().step_by(step).flat_map(|emitter| {
        let center = match emitter.shape {
            EmitterShape::Triangle { .. } => emitter.corner + (emitter.edges[0] + emitter.edges[1]) / 3.0,
            EmitterShape::Portal => emitter.corner + (emitter.edges[0] + emitter.edges[1]) / 2.0,
        };
        let sides = [emitter.normal, -emitter.normal].into_iter().zip(emitter.radiance);
        sides.filter(|(_, radiance)| *radiance != Vec3::ZERO).map(move |(normal, _)| offset_origin(center, normal))
    });
    for origin in sides {
        // An oblique direction is unlikely to hit edges of man-made geometry.
        let direction = Vec3::new(0.267_3, 0.801_8, 0.534_5).normalize();
        let mut ray = Ray { origin, direction };
        let mut winding: HashMap<u32, i32> = HashMap::new();
        for _ in 0..MAX_CROSSED {
            let Some(hit) = world.hit(&ray) else { break };
            let root = roots[hit.triangle as usize];
            let [a, b, c] = model.triangles[hit.triangle as usize].map(|v| model.positions[v as usize]);
            *winding.entry(root).or_default() += if (b - a).cross(c - a).dot(direction) > 0.0 { 1 } else { -1 };
            ray.origin = ray.at(hit.distance_m) + direction * 1e-4;
        }
        found.extend(winding.into_iter().filter(|&(_, sum)| sum != 0).map(|(root, _)| root));
    }
    found
}
