//! Light that arrives at points of the objects: cones over the hemisphere and light samples, shadowed by the objects.

use std::f32::consts::PI;

use lo_bsdf::{MetallicRoughness, specular_cos};
use lo_cone::Cone;
use lo_geometry::{Ray, Vec3};
use lo_lights::luminance;
use rayon::prelude::*;

use crate::light::environment::Environment;
use crate::light::radiosity::Radiosity;
use crate::light::room_light::{LightPart, LightRay};
use crate::light::samples::{Incidence, LightSample};
use crate::objects::object::Object;
use crate::objects::tracing::{ObjectHit, Objects};
use crate::shadow::ratio::ShadowRatio;

/// Reach of an object's shadow on real surfaces, as a multiple of its radius.
const SHADOW_REACH: f32 = 8.0;

/// Receivers per task; the result does not depend on it.
pub(crate) const RECEIVERS_PER_TASK: usize = 32;

/// A point of an object that receives light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receiver {
    /// Index of the object.
    pub object: usize,
    pub position: Vec3,
    /// Shading normal, unit length.
    pub normal: Vec3,
    /// Unit normal of the triangle, on the same side.
    pub geometric_normal: Vec3,
    /// Whether it reflects diffusely; otherwise no cones are traced.
    pub diffuse: bool,
    /// Direction to the viewer and BSDF, for highlights of the light samples.
    pub gloss: Option<(Vec3, MetallicRoughness)>,
}

/// Light gathered at a [`Receiver`].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Gathered {
    /// Linear RGB irradiance.
    pub irradiance: Vec3,
    /// Radiance towards the viewer that the specular layer reflects from the light samples.
    pub highlights: Vec3,
    /// Luminance of the cones' light over the hemisphere, and its first moment.
    fluence: f32,
    flux: Vec3,
    /// The values for a uniform environment of luminance 1.
    uniform_fluence: f32,
    uniform_flux: Vec3,
    /// Luminance of the light samples' irradiance, and its first moment.
    light_fluence: f32,
    light_flux: Vec3,
}

impl Gathered {
    /// Returns the irradiance for a nearby normal `to`, relative to that of `from` (first-order spherical harmonics).
    /// Light below the first normal's horizon is unknown and counts as the mean of that above.
    pub fn irradiance_for(&self, from: Vec3, to: Vec3) -> Vec3 {
        let mean = self.fluence / self.uniform_fluence.max(1e-6);
        let flux = self.flux - self.uniform_flux * mean + self.light_flux;
        let first_order = |normal: Vec3| PI * mean + 0.25 * self.light_fluence + 0.5 * flux.dot(normal);
        let (old, new) = (first_order(from).max(1e-6), first_order(to).max(0.0));
        self.irradiance * (new / old).clamp(0.3, 3.0)
    }
}

/// Inputs of light gathering within one frame.
pub(crate) struct Gatherer<'a> {
    pub environment: &'a Environment,
    pub objects: &'a Objects<'a>,
    /// Light that each object emits and reflects, if already computed.
    pub radiosity: Option<&'a [Radiosity]>,
    /// The objects' shadow on real surfaces, if already computed.
    pub shadow: Option<&'a ShadowRatio<'a>>,
    /// Directions over the whole sphere.
    pub directions: &'a [Vec3],
    /// Half-angle tangent of the cones along them.
    pub tan_half_angle: f32,
    /// Light samples for all receivers.
    pub lights: &'a [ObjectLight],
}

/// A light sample that shines on the objects.
#[derive(Clone, Debug)]
pub(crate) struct ObjectLight {
    sample: LightSample,
    /// Per object, the share of the sample that real surfaces do not occlude, if it is the same for the whole object.
    free: Vec<Option<f32>>,
}

/// Returns `count` light samples for the objects.
///
/// With `shared`, a light that is visible from the centre and all corners of an object's box, or from none of them,
/// has that visibility for the whole object.
pub(crate) fn object_lights(
    environment: &Environment,
    objects: &Objects,
    count: usize,
    shared: bool,
) -> Vec<ObjectLight> {
    let samples = environment.lights().subset(count, 0, 1);
    let mut lights: Vec<ObjectLight> =
        samples.map(|sample| ObjectLight { sample, free: vec![None; objects.len()] }).collect();
    if !shared {
        return lights;
    }
    let (mut rays, mut shares) = (Vec::new(), Vec::new());
    for (index, object) in objects.iter().enumerate() {
        let places = object.corners().into_iter().chain([object.centre_m]);
        let places: Vec<(Vec3, Vec3)> =
            places.map(|place| (place, environment.lifted(place, object.support))).collect();
        for light in &mut lights {
            rays.clear();
            let ray = |&(place, apex): &(Vec3, Vec3)| {
                let Incidence { direction, distance_m, .. } = light.sample.on(apex)?;
                Some(LightRay { place, apex, direction, distance_m })
            };
            rays.extend(places.iter().filter_map(ray));
            environment.unoccluded_share(&rays, &mut shares);
            light.free[index] = if shares.iter().all(|&share| share > 0.99) {
                Some(1.0)
            } else if shares.iter().all(|&share| share < 0.01) {
                Some(0.0)
            } else {
                None
            };
        }
    }
    lights.retain(|light| light.free.iter().any(|&free| free != Some(0.0)));
    lights
}

impl Gatherer<'_> {
    /// Returns the start of rays against the objects from a point on one of them.
    pub fn ray_start(&self, object: usize, position: Vec3, geometric_normal: Vec3) -> Vec3 {
        self.objects.ray_start(object, position, geometric_normal)
    }

    /// Returns the point from which to gather light for a point of an object: see [`Environment::lifted`].
    pub fn lifted(&self, object: usize, position: Vec3) -> Vec3 {
        self.environment.lifted(position, self.objects[object].support)
    }

    /// Returns the radiance of an environment sample at an object, darkened where it shows a real surface in the
    /// objects' shadow.
    pub fn shadowed(&self, object: usize, cone: &Cone, sample: &lo_cone::ConeSample) -> Vec3 {
        let radiance = Vec3::from(sample.radiance);
        let Some(shadow) = self.shadow else { return radiance };
        let own = &self.objects[object];
        let distance_m = if sample.distance_m.is_finite() {
            sample.distance_m
        } else {
            // A map at infinity has no surfaces, but the one under the object is known.
            let ray = Ray { origin: cone.origin, direction: cone.direction };
            match own.support.and_then(|plane| plane.intersect(&ray)) {
                Some(distance_m) => distance_m,
                None => return radiance,
            }
        };
        let point = cone.origin + cone.direction * distance_m;
        let is_near = |other: &Object| (point - other.centre_m).length() <= SHADOW_REACH * other.radius_m;
        let others = || self.objects.iter().enumerate().filter(|&(i, _)| i != object);
        let in_reach = distance_m <= SHADOW_REACH * own.radius_m || others().any(|(_, other)| is_near(other));
        if in_reach { radiance * shadow.at(point) } else { radiance }
    }

    /// Gathers the light at each receiver. The directions are fixed in the world, so neighbours and frames share
    /// them.
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
        let (mut cones, mut owners, mut samples) = (Vec::new(), Vec::new(), Vec::new());
        // Weights are scaled so that a uniform environment of radiance 1 gives π exactly.
        let total = |r: &Receiver| self.directions.iter().map(|d| r.normal.dot(*d).max(0.0)).sum::<f32>();
        let scales: Vec<f32> = receivers.iter().map(|r| if r.diffuse { PI / total(r) } else { 0.0 }).collect();
        let apex = |r: &Receiver| self.lifted(r.object, r.position);
        let apexes: Vec<Vec3> = receivers.iter().map(apex).collect();
        // Direction by direction: rays and cones of neighbouring receivers are coherent.
        for &direction in self.directions {
            for (index, (receiver, gathered)) in receivers.iter().zip(gathered.iter_mut()).enumerate() {
                let cosine = receiver.normal.dot(direction);
                if cosine <= 0.0 || !receiver.diffuse {
                    continue;
                }
                // Directions below the triangle's plane are not shadowed: the smooth surface is meant to bulge.
                let above = receiver.geometric_normal.dot(direction) > 0.0;
                let ray = Ray { origin: receiver.ray_start(self), direction };
                let met = if above { self.objects.closest(&ray, f32::INFINITY) } else { None };
                let passed = if above {
                    self.objects.passed_share(&ray, met.map_or(f32::INFINITY, |met| met.hit.distance_m))
                } else {
                    Vec3::ONE
                };
                match met {
                    Some(ObjectHit { object, hit }) => {
                        let exitant_radiance = |r: &[Radiosity]| r[object].radiance(&self.objects[object], &ray, &hit);
                        let radiance = self.radiosity.map_or(Vec3::ZERO, exitant_radiance);
                        gathered.add(radiance * passed, direction, cosine, scales[index]);
                    }
                    None => {
                        cones.push(Cone { origin: apexes[index], direction, tan_half_angle: self.tan_half_angle });
                        owners.push((index, cosine, scales[index], passed));
                    }
                }
            }
        }
        self.environment.gather(LightPart::Rest, &cones, &mut samples);
        for ((cone, sample), (index, weight, solid_angle, passed)) in cones.iter().zip(&samples).zip(owners) {
            let radiance = self.shadowed(receivers[index].object, cone, sample) * passed;
            gathered[index].add(radiance, cone.direction, weight, solid_angle);
        }
    }

    fn gather_lights(&self, receivers: &[Receiver], gathered: &mut [Gathered]) {
        if self.lights.is_empty() {
            return;
        }
        let (mut rays, mut owners, mut shares) = (Vec::new(), Vec::new(), Vec::new());
        for light in self.lights {
            for (index, receiver) in receivers.iter().enumerate() {
                let free = light.free[receiver.object];
                if free == Some(0.0) {
                    continue;
                }
                let Some(incidence) = light.sample.on(receiver.position) else { continue };
                let direction = incidence.direction;
                if receiver.normal.dot(direction) <= 0.0 {
                    continue;
                }
                let above = receiver.geometric_normal.dot(direction) > 0.0;
                let ray = Ray { origin: receiver.ray_start(self), direction };
                if above && self.objects.blocks(&ray, incidence.distance_m) {
                    continue;
                }
                let passed = if above { self.objects.passed_share(&ray, incidence.distance_m) } else { Vec3::ONE };
                let irradiance = incidence.irradiance * passed;
                match free {
                    Some(share) => gathered[index].add_light(receiver, direction, irradiance * share),
                    None => {
                        let apex = self.lifted(receiver.object, receiver.position);
                        rays.push(LightRay {
                            place: receiver.position,
                            apex,
                            direction,
                            distance_m: incidence.distance_m,
                        });
                        owners.push((index, direction, irradiance));
                    }
                }
            }
        }
        self.environment.unoccluded_share(&rays, &mut shares);
        for ((index, direction, irradiance), share) in owners.into_iter().zip(&shares) {
            gathered[index].add_light(&receivers[index], direction, irradiance * *share);
        }
    }
}

impl Receiver {
    /// Creates a placeholder for a point that needs no light.
    pub fn dark() -> Self {
        let nowhere = Vec3::ZERO;
        Self { object: 0, position: nowhere, normal: nowhere, geometric_normal: nowhere, diffuse: false, gloss: None }
    }

    fn ray_start(&self, gatherer: &Gatherer) -> Vec3 {
        gatherer.ray_start(self.object, self.position, self.geometric_normal)
    }
}

impl Gathered {
    fn add_light(&mut self, receiver: &Receiver, direction: Vec3, irradiance: Vec3) {
        self.irradiance += irradiance * receiver.normal.dot(direction);
        let bright = luminance(irradiance);
        self.light_fluence += bright;
        self.light_flux += direction * bright;
        if let Some((view, bsdf)) = receiver.gloss {
            self.highlights += specular_cos(bsdf.f0, bsdf.ggx(), receiver.normal, view, direction) * irradiance;
        }
    }

    /// Adds the radiance of a solid angle in `direction`, whose angle with the normal has the given cosine.
    fn add(&mut self, radiance: Vec3, direction: Vec3, cosine: f32, solid_angle: f32) {
        self.irradiance += radiance * (cosine * solid_angle);
        let bright = luminance(radiance) * solid_angle;
        self.fluence += bright;
        self.flux += direction * bright;
        self.uniform_fluence += solid_angle;
        self.uniform_flux += direction * solid_angle;
    }
}
