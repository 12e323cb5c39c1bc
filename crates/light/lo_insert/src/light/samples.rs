//! Main lights, much brighter than the rest, as a fixed list of samples.
//!
//! Radiance is split at a cap, a few times the mean ([`lo_lights::split_octree`]). The part above it is represented
//! by light samples with shadow rays; the part below stays in the environment and is gathered by cones. Both add up
//! to the whole, so nothing is counted twice or lost.

use std::f32::consts::{PI, TAU};

use lo_geometry::{RigidTransform, Vec3};
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
    Point {
        position: Vec3,
        normal: Vec3,
    },
    /// Emits in all directions.
    Ball(Vec3),
    Direction(Vec3),
}

/// A light sample seen from a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Incidence {
    /// Unit direction towards the light.
    pub direction: Vec3,
    /// Distance; infinite for lights at infinity.
    pub distance_m: f32,
    /// Radiance × solid angle.
    pub irradiance: Vec3,
}

/// Origin of a light sample's rays.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Origin {
    Point(Vec3),
    /// Unit direction towards the light.
    Infinity(Vec3),
}

impl LightSample {
    pub fn origin(&self) -> Origin {
        match self.place {
            SampleOrigin::Point { position, .. } | SampleOrigin::Ball(position) => Origin::Point(position),
            SampleOrigin::Direction(direction) => Origin::Infinity(direction),
        }
    }

    /// Returns the incident light at `point`; `None` if the sample faces away.
    pub fn on(&self, point: Vec3) -> Option<Incidence> {
        match self.place {
            SampleOrigin::Direction(direction) => {
                Some(Incidence { direction, distance_m: f32::INFINITY, irradiance: self.power })
            }
            SampleOrigin::Ball(position) => {
                let offset = position - point;
                let squared = offset.length_squared();
                let distance_m = squared.sqrt();
                // A sphere appears as a disc of a quarter of its area.
                let seen = 0.25 / (squared + 0.25 * self.extent / PI);
                Some(Incidence { direction: offset / distance_m.max(1e-6), distance_m, irradiance: self.power * seen })
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

/// All light samples. Every equally spaced subset is a stratified sampling.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lights {
    samples: Vec<LightSample>,
}

impl Lights {
    /// Draws `count` samples of equal power, stratified along the order of the patches.
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
            // The second coordinate of the set increases with i; multiples of the golden ratio make it fill the
            // square.
            let jitter = [jitter.x, (i as f32 * 0.618_034).fract() - 0.5];
            let place = match patch.shape {
                PatchShape::Square { centre, normal, edge_m } => {
                    let basis = lo_geometry::orthonormal_basis(normal);
                    let position = centre + (basis.x_axis * jitter[0] + basis.y_axis * jitter[1]) * edge_m;
                    SampleOrigin::Point { position, normal }
                }
                PatchShape::Rectangle { centre, normal, edges_m } => {
                    let [u, v, _] = spread(i);
                    SampleOrigin::Point { position: centre + edges_m[0] * (u - 0.5) + edges_m[1] * (v - 0.5), normal }
                }
                PatchShape::Sphere { centre, radius_m } => {
                    // Points of density 1/√(R² − r²) are uniform on the sphere's visible disc from every side.
                    let [u, v, w] = spread(i);
                    let (z, turn) = (2.0 * u - 1.0, TAU * v);
                    let across = (1.0 - z * z).max(0.0).sqrt();
                    let direction = Vec3::new(across * turn.cos(), across * turn.sin(), z);
                    SampleOrigin::Ball(centre + direction * (radius_m * disc_radius(w)))
                }
                PatchShape::Disc { direction, radii } => {
                    let [u, v, _] = spread(i);
                    let (sin, cos) = (TAU * v).sin_cos();
                    let offset = (radii[0] * cos + radii[1] * sin) * u.sqrt();
                    SampleOrigin::Direction((direction + offset).normalize())
                }
                PatchShape::Infinity { direction, tangents } => {
                    SampleOrigin::Direction((direction + tangents[0] * jitter[0] + tangents[1] * jitter[1]).normalize())
                }
            };
            samples.push(LightSample { place, power: patch.radiance * share, extent: share });
        }
        Self { samples }
    }

    /// Returns `count` samples spread over the list: the `pattern`-th of `patterns` disjoint subsets. Each has the
    /// power and the extent of the samples that it replaces, so that a very near sample is no brighter than that
    /// extent could be.
    pub fn subset(&self, count: usize, pattern: usize, patterns: usize) -> impl Iterator<Item = LightSample> {
        let wanted = (count * patterns).clamp(1, self.samples.len().max(1));
        let stride = self.samples.len() / wanted;
        let stride = stride.max(1);
        let taken = self.samples.iter().skip(pattern * stride).step_by(stride * patterns);
        let scale = self.samples.len() as f32 / taken.len().max(1) as f32;
        taken.map(move |sample| LightSample { power: sample.power * scale, extent: sample.extent * scale, ..*sample })
    }

    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Returns the lights in other axes.
    pub fn moved(&self, to_from: &RigidTransform) -> Self {
        let moved = |sample: &LightSample| {
            let place = match sample.place {
                SampleOrigin::Point { position, normal } => {
                    SampleOrigin::Point { position: to_from.point(position), normal: to_from.direction(normal) }
                }
                SampleOrigin::Ball(position) => SampleOrigin::Ball(to_from.point(position)),
                SampleOrigin::Direction(direction) => SampleOrigin::Direction(to_from.direction(direction)),
            };
            LightSample { place, ..*sample }
        };
        Self { samples: self.samples.iter().map(moved).collect() }
    }
}

/// Returns point `i` of a sequence that fills the unit cube, as do its equally spaced subsequences; for lights that
/// are large by themselves.
/// R3 (Roberts 2018): multiples of the powers of 1/g with g⁴ = g + 1.
fn spread(i: usize) -> [f32; 3] {
    [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3]
        .map(|step: f64| (i as f64 * step).fract() as f32)
}

/// Returns sin θ with θ − sin θ cos θ = π/2 · `share`: the radius, of 1, that contains this share of the density
/// r²/√(1 − r²).
fn disc_radius(share: f32) -> f32 {
    let (mut low, mut high) = (0.0f32, PI / 2.0);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if middle - middle.sin() * middle.cos() < PI / 2.0 * share { low = middle } else { high = middle }
    }
    low.sin()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// However few samples represent a light, none is brighter from near than light from all directions.
    #[test]
    fn samples_that_stand_for_others_are_no_brighter_than_the_light_from_near() {
        let square = LightPatch {
            shape: PatchShape::Square { centre: Vec3::ZERO, normal: Vec3::Y, edge_m: 0.1 },
            radiance: Vec3::ONE,
            extent: 0.01,
        };
        let lights = Lights::sample(&[square], 1024);
        for (count, pattern, patterns) in [(1024, 0, 1), (128, 0, 1), (6, 0, 1), (3, 5, 16)] {
            for sample in lights.subset(count, pattern, patterns) {
                let Origin::Point(position) = sample.origin() else { panic!("{sample:?}") };
                let near = sample.on(position + Vec3::Y * 1e-4).expect("it faces up").irradiance.x;
                assert!((near / PI - 1.0).abs() < 0.05, "{count} of {patterns}: {near}");
            }
        }
    }

    /// Every subset of a large light's samples has its centre, size and power.
    #[test]
    fn subsets_of_large_lights_are_spread_over_them() {
        let sphere = LightPatch {
            shape: PatchShape::Sphere { centre: Vec3::Y, radius_m: 0.5 },
            radiance: Vec3::ONE,
            extent: PI,
        };
        let lights = Lights::sample(&[sphere], 1024);
        let far = Vec3::new(0.0, 1.0, 50.0);
        for (count, pattern, patterns) in [(1024, 0, 1), (64, 0, 1), (32, 0, 1), (16, 3, 16), (8, 5, 16)] {
            let (mut irradiance, mut mean, mut squares, mut number) = (0.0, Vec3::ZERO, 0.0, 0.0);
            for sample in lights.subset(count, pattern, patterns) {
                let incidence = sample.on(far).expect("it shines everywhere");
                irradiance += incidence.irradiance.x;
                let offset = far + incidence.direction * incidence.distance_m - Vec3::Y;
                mean += offset;
                squares += offset.x * offset.x + offset.y * offset.y;
                number += 1.0;
            }
            // π L (r/d)²; the disc's mean square of the radius is r²/2.
            assert!((irradiance / (PI * 1e-4) - 1.0).abs() < 0.02, "{irradiance}");
            assert!((mean / number).length() < 0.12, "{count} of {patterns}: {}", mean / number);
            assert!((squares / number / 0.125 - 1.0).abs() < 0.3, "{count} of {patterns}: {}", squares / number);
        }
    }
}
