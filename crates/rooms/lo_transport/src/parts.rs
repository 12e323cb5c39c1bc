//! Connected parts of a model, and which of them are solid.

use std::collections::{HashMap, HashSet};

use lo_geometry::{Ray, Vec3};
use lo_mesh::{Model, offset_origin};

use crate::lights::{Emitters, Source};
use crate::places::Place;
use crate::traced_world::TracedWorld;

/// Number that stands for all parts.
pub(crate) const ANY_PART: u32 = 0xf_ffff;

/// Number of what lies under the open sky.
pub(crate) const OUTSIDE_PART: u32 = ANY_PART - 1;

/// Parts are told apart up to this number.
const MAX_PARTS: u32 = OUTSIDE_PART - 1;

/// Most lights that are looked for in closed surfaces.
const MAX_LIGHTS: usize = 256;

/// Most surfaces that a ray out of closed surfaces crosses.
const MAX_CROSSED: usize = 1024;

/// Triangles that share corners, by position.
pub(crate) struct Parts {
    /// Number of each triangle's part; 0 for small ones, which share their surfels.
    number: Vec<u32>,
    /// The side of each triangle that faces into a solid.
    inside: Vec<Inside>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Inside {
    None,
    Front,
    Back,
}

impl Parts {
    /// Finds the parts; those smaller than `least_m2` get number 0.
    pub(crate) fn find(world: &TracedWorld, emitters: &Emitters, areas: &[f64], least_m2: f64) -> Self {
        let model = world.prepared.model();
        let corners = corners(model);
        let roots = roots(model, &corners);
        let mut size: HashMap<u32, f64> = HashMap::new();
        for (root, area) in roots.iter().zip(areas) {
            *size.entry(*root).or_default() += area;
        }
        let mut numbers: HashMap<u32, u32> = HashMap::new();
        let numbered = |root: &u32| {
            if size[root] < least_m2 {
                return 0;
            }
            let next = numbers.len() as u32 % MAX_PARTS + 1;
            *numbers.entry(*root).or_insert(next)
        };
        let number = roots.iter().map(numbered).collect();
        let mut solids = closed(model, &corners, &roots);
        for lit in around_lights(world, emitters, &roots) {
            solids.remove(&lit);
        }
        let inside = |(triangle, root): (usize, &u32)| {
            let material = &model.materials[model.triangle_materials[triangle] as usize];
            match solids.get(root) {
                // Light gets into glass and behind cloth.
                Some(_) if material.transmission > 0.0 || material.diffuse_transmission > 0.0 => Inside::None,
                Some(&volume_m3) if volume_m3 > 0.0 => Inside::Back,
                Some(_) => Inside::Front,
                None => Inside::None,
            }
        };
        let inside = roots.iter().enumerate().map(inside).collect();
        Self { number, inside }
    }

    /// Number of a triangle's part.
    pub(crate) fn of(&self, triangle: u32) -> u32 {
        self.number[triangle as usize]
    }

    /// Whether a place faces into a solid.
    pub(crate) fn is_inside(&self, place: &Place) -> bool {
        match self.inside[place.triangle as usize] {
            Inside::None => false,
            Inside::Front => place.is_front,
            Inside::Back => !place.is_front,
        }
    }
}

/// For each vertex the first one at its position.
fn corners(model: &Model) -> Vec<u32> {
    let mut at_position: HashMap<[u32; 3], u32> = HashMap::with_capacity(model.positions.len());
    let first = |(vertex, position): (usize, &Vec3)| {
        // Adding zero makes -0 and 0 one.
        let bits = (*position + Vec3::ZERO).to_array().map(f32::to_bits);
        *at_position.entry(bits).or_insert(vertex as u32)
    };
    model.positions.iter().enumerate().map(first).collect()
}

/// A vertex of each triangle's part, the same for the whole part.
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

/// Parts that are closed, with their volume: positive where the fronts of the triangles look out. In a closed part each edge is
/// passed as often one way as the other.
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

/// Parts that are wound around lights: rooms, lanterns.
fn around_lights(world: &TracedWorld, emitters: &Emitters, roots: &[u32]) -> HashSet<u32> {
    let model = world.prepared.model();
    let mut found = HashSet::new();
    let step = emitters.list.len().div_ceil(MAX_LIGHTS).max(1);
    let sides = emitters.list.iter().step_by(step).flat_map(|emitter| {
        let center = match emitter.source {
            Source::Triangle { .. } => emitter.corner + (emitter.edges[0] + emitter.edges[1]) / 3.0,
            Source::Portal => emitter.corner + (emitter.edges[0] + emitter.edges[1]) / 2.0,
        };
        let sides = [emitter.normal, -emitter.normal].into_iter().zip(emitter.radiance);
        sides.filter(|(_, radiance)| *radiance != Vec3::ZERO).map(move |(normal, _)| offset_origin(center, normal))
    });
    for origin in sides {
        // Askew, so that it passes between the edges of what people build.
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
