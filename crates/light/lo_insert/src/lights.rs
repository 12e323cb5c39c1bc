//! Main lights: what is much brighter than the rest, as a fixed list of samples.
//!
//! Radiance is split at a cap, a few times the mean: what lies above it is carried by the light samples and cast with shadow
//! rays, what lies below stays in the environment and is gathered by cones. The two add up to the whole, so nothing counts
//! twice and nothing is lost.

use std::f32::consts::PI;

use lo_geometry::Vec3;
use lo_octree::LightOctree;

use crate::pattern::hammersley;

/// Radiance above this multiple of the mean counts as light.
pub(crate) const CAP: f32 = 4.0;

/// A patch of light before sampling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Emitter {
    pub shape: EmitterShape,
    /// Linear RGB radiance above the cap.
    pub radiance: Vec3,
    /// Area in m² or, at infinity, solid angle in steradians.
    pub extent: f32,
}

/// Where light comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum EmitterShape {
    /// A square of the octree's grid that radiates to the side of `normal`.
    Square { centre: Vec3, normal: Vec3, edge_m: f32 },
    /// A direction at infinity with two tangents that span the texel.
    Infinity { direction: Vec3, tangents: [Vec3; 2] },
}

/// One sample of the lights.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSample {
    place: SampleOrigin,
    /// Radiance × extent of this sample's share.
    power: Vec3,
    /// This sample's share of all extent.
    extent: f32,
}

#[derive(Clone, Copy, Debug)]
enum SampleOrigin {
    Point { position: Vec3, normal: Vec3 },
    Direction(Vec3),
}

/// A light sample seen from a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Incidence {
    /// Unit direction towards the light.
    pub direction: Vec3,
    /// Infinite for lights at infinity.
    pub distance_m: f32,
    /// Radiance × solid angle.
    pub irradiance: Vec3,
}

/// Where the rays of a light sample start.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Origin {
    Point(Vec3),
    /// Unit direction towards it.
    Infinity(Vec3),
}

impl LightSample {
    pub fn origin(&self) -> Origin {
        match self.place {
            SampleOrigin::Point { position, .. } => Origin::Point(position),
            SampleOrigin::Direction(direction) => Origin::Infinity(direction),
        }
    }

    /// How the sample shines on `point`; `None` where it faces away.
    pub fn on(&self, point: Vec3) -> Option<Incidence> {
        match self.place {
            SampleOrigin::Direction(direction) => {
                Some(Incidence { direction, distance_m: f32::INFINITY, irradiance: self.power })
            }
            SampleOrigin::Point { position, normal } => {
                let offset = position - point;
                let squared = offset.length_squared();
                let distance_m = squared.sqrt();
                let direction = offset / distance_m.max(1e-6);
                let cosine = -normal.dot(direction);
                // A disc's exact on-axis form keeps the sample finite when it is very near.
                (cosine > 0.0).then(|| Incidence {
                    direction,
                    distance_m,
                    irradiance: self.power * (cosine / (squared + self.extent / PI)),
                })
            }
        }
    }
}

/// All light samples; every equally spaced subset is a stratified sampling of its own.
#[derive(Debug, Default)]
pub(crate) struct Lights {
    samples: Vec<LightSample>,
}

impl Lights {
    /// `count` samples of equal power, stratified along the order of the emitters.
    pub fn sample(emitters: &[Emitter], count: usize) -> Self {
        let power = |e: &Emitter| f64::from(luminance(e.radiance) * e.extent);
        let total: f64 = emitters.iter().map(power).sum();
        if total <= 0.0 || !total.is_finite() {
            return Self::default();
        }
        let mut samples = Vec::with_capacity(count);
        let (mut index, mut before) = (0, 0.0);
        for i in 0..count {
            let target = (i as f64 + 0.5) / count as f64 * total;
            while index + 1 < emitters.len() && before + power(&emitters[index]) <= target {
                before += power(&emitters[index]);
                index += 1;
            }
            let emitter = emitters[index];
            let share = (total / count as f64) as f32 / luminance(emitter.radiance);
            let jitter = hammersley(i, count) - 0.5;
            // The second coordinate of the set runs along with i; turned by the golden ratio it fills the square.
            let jitter = [jitter.x, (i as f32 * 0.618_034).fract() - 0.5];
            let place = match emitter.shape {
                EmitterShape::Square { centre, normal, edge_m } => {
                    let basis = lo_geometry::orthonormal_basis(normal);
                    let position = centre + (basis.x_axis * jitter[0] + basis.y_axis * jitter[1]) * edge_m;
                    SampleOrigin::Point { position, normal }
                }
                EmitterShape::Infinity { direction, tangents } => {
                    SampleOrigin::Direction((direction + tangents[0] * jitter[0] + tangents[1] * jitter[1]).normalize())
                }
            };
            samples.push(LightSample { place, power: emitter.radiance * share, extent: share });
        }
        Self { samples }
    }

    /// `count` samples spread over the list, of the `pattern`-th of `patterns` disjoint such subsets, and the factor that
    /// makes them stand for all.
    pub fn subset(&self, count: usize, pattern: usize, patterns: usize) -> (impl Iterator<Item = &LightSample>, f32) {
        let wanted = (count * patterns).clamp(1, self.samples.len().max(1));
        let stride = self.samples.len() / wanted;
        let stride = stride.max(1);
        let taken = self.samples.iter().skip(pattern * stride).step_by(stride * patterns);
        let number = taken.len();
        (taken, if number == 0 { 0.0 } else { self.samples.len() as f32 / number as f32 })
    }

    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }
}

/// Rec. 709 luminance.
pub(crate) fn luminance(rgb: Vec3) -> f32 {
    lo_imaging::luminance(rgb.to_array())
}

/// Radiance at which light is cut off, given the mean luminance of the surroundings.
pub(crate) fn cap_luminance(mean: f32) -> f32 {
    CAP * mean
}

/// The part of `radiance` that lies above the cap, of the same colour.
pub(crate) fn excess(radiance: Vec3, cap: f32) -> Vec3 {
    let bright = luminance(radiance);
    if bright > cap { radiance * (1.0 - cap / bright) } else { Vec3::ZERO }
}

/// Splits a lighting octree at the cap: emitters, and the octree without their excess.
///
/// The emitters are the faces of bright leaves that border on empty space. On flat and slanted lamps alike their projections to
/// any direction add up to the lamp's own. `faces_room(position, normal)` tells faces that look into the room from those at the
/// back of the shell.
pub(crate) fn split_octree(
    light: &LightOctree,
    faces_room: impl Fn(Vec3, Vec3) -> bool,
) -> (Vec<Emitter>, LightOctree) {
    let levels = light.octree.levels();
    let is_leaf = |d: usize, node: usize| levels[d].children[node] < 0 && levels[d].rows[node] >= 0;
    let mut mean = (0.0f64, 0.0f64);
    for (d, level) in levels.iter().enumerate() {
        let area = f64::from(light.cube.node_edge_m(d as u32)).powi(2);
        for node in (0..level.len()).filter(|&node| is_leaf(d, node)) {
            let [r, g, b, a] = light.rgba[d][level.rows[node] as usize];
            mean.0 += f64::from(luminance(Vec3::new(r, g, b)) * a) * area;
            mean.1 += f64::from(a) * area;
        }
    }
    let cap = cap_luminance((mean.0 / mean.1.max(1e-30)) as f32);
    let mut dimmed = light.clone();
    let mut emitters = Vec::new();
    // From the leaves up: a parent's excess is its children's, weighted by opacity as its colour is.
    let mut below: Vec<Vec3> = Vec::new();
    for (d, level) in levels.iter().enumerate().rev() {
        let mut own = vec![Vec3::ZERO; level.len()];
        for (node, own) in own.iter_mut().enumerate() {
            let Ok(row) = usize::try_from(level.rows[node]) else { continue };
            let [r, g, b, _] = light.rgba[d][row];
            let radiance = Vec3::new(r, g, b);
            if is_leaf(d, node) {
                *own = excess(radiance, cap);
                if *own != Vec3::ZERO {
                    emitters.extend(exposed_faces(light, d as u32, level.keys[node], *own));
                }
            } else if level.children[node] >= 0 {
                let first = level.children[node] as usize;
                let opacity = |child: usize| light.node_rgba(d as u32 + 1, child).map_or(0.0, |rgba| rgba[3]);
                let weight: f32 = (first..first + 8).map(opacity).sum();
                let sum: Vec3 = (first..first + 8).map(|child| below[child] * opacity(child)).sum();
                *own = if weight > 0.0 { sum / weight } else { Vec3::ZERO };
            }
            let rest = (radiance - *own).max(Vec3::ZERO);
            dimmed.rgba[d][row][..3].copy_from_slice(&rest.to_array());
        }
        below = own;
    }
    let inside: Vec<Emitter> = emitters
        .iter()
        .filter(|e| matches!(e.shape, EmitterShape::Square { centre, normal, edge_m } if faces_room(centre + normal * 1.5 * edge_m, normal)))
        .copied()
        .collect();
    // An octree that is not closed has no inside; then every face may count.
    (if inside.is_empty() { emitters } else { inside }, dimmed)
}

/// The faces of a leaf that border on empty nodes, as emitters at the middle of the leaf: where in a leaf the surface lies
/// is not known.
fn exposed_faces(light: &LightOctree, depth: u32, key: u32, radiance: Vec3) -> Vec<Emitter> {
    let edge_m = light.cube.node_edge_m(depth);
    let [x, y, z] = lo_octree::xyz_from_key(key).map(|c| c as f32 + 0.5);
    let centre = light.cube.origin_m + Vec3::new(x, y, z) * edge_m;
    let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let empty = |normal: &Vec3| {
        light.locate(centre + *normal * edge_m, depth).is_none_or(|(d, node)| light.node_rgba(d, node).is_none())
    };
    axes.into_iter()
        .filter(empty)
        .map(|normal| Emitter {
            shape: EmitterShape::Square { centre, normal, edge_m },
            radiance,
            extent: edge_m * edge_m,
        })
        .collect()
}
