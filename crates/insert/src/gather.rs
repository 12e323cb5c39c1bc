//! Light that arrives at points of the object: cones over the hemisphere and light samples, shadowed by the object itself.

use std::f32::consts::PI;

use cone::Cone;
use geometry::{Ray, Vec3};
use rayon::prelude::*;

use crate::brdf::{Brdf, cone_tangent};
use crate::environment::{Environment, Part, Scratch};
use crate::lights::luminance;
use crate::object::Object;
use crate::radiosity::Radiosity;
use crate::shadow::ShadowRatio;

/// Distance from a surface at which rays against the object start, as a share of the object's radius.
const RAY_START: f32 = 2e-4;

/// Receivers that one task serves; the result does not depend on it.
const RECEIVERS_PER_TASK: usize = 32;

/// A point of the object that light falls on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receiver {
    pub position: Vec3,
    /// Shading normal, unit length.
    pub normal: Vec3,
    /// Normal of the triangle, unit length, on the same side.
    pub geometric_normal: Vec3,
    /// For highlights of the light samples: direction to the viewer and BRDF.
    pub gloss: Option<(Vec3, Brdf)>,
}

/// Light gathered at a [`Receiver`].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Gathered {
    /// Linear RGB irradiance.
    pub irradiance: Vec3,
    /// Radiance towards the viewer from light samples by the specular layer.
    pub highlights: Vec3,
    /// Luminance over the sphere and its first moment, which say how irradiance changes with the normal.
    fluence: f32,
    flux: Vec3,
}

impl Gathered {
    /// Irradiance for another normal at the same place, relative to that of `from` (first-order spherical harmonics).
    pub fn irradiance_for(&self, from: Vec3, to: Vec3) -> Vec3 {
        let first_order = |normal: Vec3| 0.25 * self.fluence + 0.5 * self.flux.dot(normal);
        let (old, new) = (first_order(from).max(1e-6), first_order(to).max(0.0));
        self.irradiance * (new / old).clamp(0.3, 3.0)
    }
}

/// All that light depends on within one frame.
pub(crate) struct Gatherer<'a> {
    pub environment: &'a Environment,
    pub object: &'a Object<'a>,
    /// Light that the object gives off itself, once it is known.
    pub radiosity: Option<&'a Radiosity>,
    /// The object's shadow on real surfaces, once it is known.
    pub shadow: Option<&'a ShadowRatio<'a>>,
    /// Directions over the whole sphere.
    pub directions: &'a [Vec3],
    /// Light samples per receiver.
    pub lights: usize,
}

impl Gatherer<'_> {
    /// Start of rays against the object from a point on it.
    pub fn ray_start(&self, receiver: &Receiver) -> Vec3 {
        receiver.position + receiver.geometric_normal * (RAY_START * self.object.radius_m)
    }

    /// Radiance of an environment sample, darkened where it shows a real surface in the object's shadow.
    pub fn shadowed(&self, cone: &Cone, sample: &cone::Sample) -> Vec3 {
        let radiance = Vec3::from(sample.radiance);
        let Some(shadow) = self.shadow else { return radiance };
        let distance_m = if sample.distance_m.is_finite() {
            sample.distance_m
        } else {
            // A map at infinity knows no surfaces; the one under the object is known all the same.
            let ray = Ray { origin: cone.origin, direction: cone.direction };
            match self.object.support.and_then(|plane| plane.intersect(&ray)) {
                Some(distance_m) => distance_m,
                None => return radiance,
            }
        };
        if distance_m > 8.0 * self.object.radius_m {
            return radiance;
        }
        radiance * shadow.at(cone.origin + cone.direction * distance_m)
    }

    /// Light at each receiver; the directions are fixed in the world, so neighbours and frames share them.
    pub fn gather(&self, receivers: &[Receiver]) -> Vec<Gathered> {
        let mut gathered = vec![Gathered::default(); receivers.len()];
        self.gather_cones(receivers, &mut gathered);
        self.gather_lights(receivers, &mut gathered);
        gathered
    }

    /// [`Gatherer::gather`] on all threads.
    pub fn gather_parallel(&self, receivers: &[Receiver]) -> Vec<Gathered> {
        receivers.par_chunks(RECEIVERS_PER_TASK).flat_map_iter(|chunk| self.gather(chunk)).collect()
    }

    fn gather_cones(&self, receivers: &[Receiver], gathered: &mut [Gathered]) {
        let tan_half_angle = cone_tangent(4.0 * PI / self.directions.len() as f32);
        let (mut cones, mut owners, mut samples) = (Vec::new(), Vec::new(), Vec::new());
        for (index, (receiver, gathered)) in receivers.iter().zip(gathered.iter_mut()).enumerate() {
            // Weights are scaled so that a uniform environment of radiance 1 gives π exactly.
            let total: f32 = self.directions.iter().map(|d| receiver.normal.dot(*d).max(0.0)).sum();
            if total <= 0.0 {
                continue;
            }
            let start = self.ray_start(receiver);
            let apex = self.environment.lifted(receiver.position, self.object.support);
            for &direction in self.directions {
                let cosine = receiver.normal.dot(direction);
                if cosine <= 0.0 {
                    continue;
                }
                // Below the triangle's own plane there is nothing to meet: the smooth surface is meant to bulge.
                let above = receiver.geometric_normal.dot(direction) > 0.0;
                let ray = Ray { origin: start, direction };
                match self.object.closest(&ray, f32::INFINITY).filter(|_| above) {
                    Some(hit) => {
                        let radiance = self.radiosity.map_or(Vec3::ZERO, |r| r.radiance(self.object, &ray, &hit));
                        gathered.add(radiance, direction, cosine * PI / total, PI / total);
                    }
                    None => {
                        cones.push(Cone { origin: apex, direction, tan_half_angle });
                        owners.push((index, cosine * PI / total, PI / total));
                    }
                }
            }
        }
        self.environment.gather(Part::Dimmed, &cones, &mut samples);
        for ((cone, sample), (index, weight, solid_angle)) in cones.iter().zip(&samples).zip(owners) {
            gathered[index].add(self.shadowed(cone, sample), cone.direction, weight, solid_angle);
        }
    }

    fn gather_lights(&self, receivers: &[Receiver], gathered: &mut [Gathered]) {
        let lights = self.environment.lights();
        if lights.is_empty() {
            return;
        }
        let (mut rays, mut owners, mut shares) = (Vec::new(), Vec::new(), Vec::new());
        for (index, receiver) in receivers.iter().enumerate() {
            let start = self.ray_start(receiver);
            let apex = self.environment.lifted(receiver.position, self.object.support);
            let (samples, scale) = lights.subset(self.lights, 0, 1);
            for light in samples {
                let Some(incidence) = light.on(receiver.position) else { continue };
                let cosine = receiver.normal.dot(incidence.direction);
                let above = receiver.geometric_normal.dot(incidence.direction) > 0.0;
                if cosine <= 0.0
                    || (above
                        && self
                            .object
                            .blocks(&Ray { origin: start, direction: incidence.direction }, incidence.distance_m))
                {
                    continue;
                }
                rays.push((apex, incidence.direction, incidence.distance_m));
                owners.push((index, incidence.direction, incidence.irradiance * scale, cosine));
            }
        }
        self.environment.free_share(&rays, &mut Scratch::default(), &mut shares);
        for ((index, direction, irradiance, cosine), share) in owners.into_iter().zip(&shares) {
            let irradiance = irradiance * *share;
            gathered[index].add(irradiance, direction, cosine, 1.0);
            if let Some((view, brdf)) = receivers[index].gloss {
                gathered[index].highlights += brdf.specular_cos(receivers[index].normal, view, direction) * irradiance;
            }
        }
    }
}

impl Receiver {
    /// A stand-in for a point that needs no light.
    pub fn dark() -> Self {
        Self { position: Vec3::ZERO, normal: Vec3::ZERO, geometric_normal: Vec3::ZERO, gloss: None }
    }
}

impl Gathered {
    fn add(&mut self, radiance: Vec3, direction: Vec3, weight: f32, solid_angle: f32) {
        self.irradiance += radiance * weight;
        let bright = luminance(radiance) * solid_angle;
        self.fluence += bright;
        self.flux += direction * bright;
    }
}
