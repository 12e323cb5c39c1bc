//! Main lights: what is much brighter than the rest, as a fixed list of samples.
//!
//! Radiance is split at a cap, a few times the mean ([`lo_lights::split_octree`]): what lies above it is carried by the light samples and cast
//! with shadow rays, what lies below stays in the environment and is gathered by cones. The two add up to the whole, so nothing counts
//! twice and nothing is lost.

use std::f32::consts::{PI, TAU};

use lo_geometry::Vec3;
use lo_lights::{LightPatch, PatchShape, luminance};

use crate::pattern::hammersley;

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
    /// `count` samples of equal power, stratified along the order of the patches.
    pub fn sample(patches: &[LightPatch], count: usize) -> Self {
        let power = |e: &LightPatch| f64::from(luminance(e.radiance) * e.extent);
        let total: f64 = patches.iter().map(power).sum();
        if total <= 0.0 || !total.is_finite() {
            return Self::default();
        }
        let mut samples = Vec::with_capacity(count);
        let (mut index, mut before) = (0, 0.0);
        for i in 0..count {
            let target = (i as f64 + 0.5) / count as f64 * total;
            while index + 1 < patches.len() && before + power(&patches[index]) <= target {
                before += power(&patches[index]);
                index += 1;
            }
            let patch = patches[index];
            let share = (total / count as f64) as f32 / luminance(patch.radiance);
            let jitter = hammersley(i, count) - 0.5;
            // The second coordinate of the set runs along with i; turned by the golden ratio it fills the square.
            let jitter = [jitter.x, (i as f32 * 0.618_034).fract() - 0.5];
            let place = match patch.shape {
                PatchShape::Square { centre, normal, edge_m } => {
                    let basis = lo_geometry::orthonormal_basis(normal);
                    let position = centre + (basis.x_axis * jitter[0] + basis.y_axis * jitter[1]) * edge_m;
                    SampleOrigin::Point { position, normal }
                }
                PatchShape::Rectangle { centre, normal, edges_m } => {
                    SampleOrigin::Point { position: centre + edges_m[0] * jitter[0] + edges_m[1] * jitter[1], normal }
                }
                PatchShape::Sphere { centre, radius_m } => {
                    let (z, turn) = (2.0 * jitter[0], TAU * jitter[1]);
                    let across = (1.0 - z * z).max(0.0).sqrt();
                    let normal = Vec3::new(across * turn.cos(), across * turn.sin(), z);
                    SampleOrigin::Point { position: centre + normal * radius_m, normal }
                }
                PatchShape::Infinity { direction, tangents } => {
                    SampleOrigin::Direction((direction + tangents[0] * jitter[0] + tangents[1] * jitter[1]).normalize())
                }
            };
            samples.push(LightSample { place, power: patch.radiance * share, extent: share });
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
