//! Shading: from light gathered at fragments to their radiance towards the camera.

use std::collections::HashMap;
use std::f32::consts::PI;

use lo_bsdf::{
    GgxSample, MIN_COSINE, MetallicRoughness, fresnel, sheen_albedo, specular_albedo, specular_transmittance,
};
use lo_cone::{Cone, ConeSample};
use lo_events::{Cancelled, OnEvent};
use lo_geometry::{Camera, Mat3, Ray, Vec2, Vec3, smoothstep};
use lo_mesh::SurfacePoint;
use rayon::prelude::*;

use crate::batches::Batches;
use crate::light::aperture::{cone_tangent, quantised};
use crate::light::environment::Environment;
use crate::light::gather::{Gatherer, RECEIVERS_PER_TASK, Receiver};
use crate::light::room_light::LightPart;
use crate::objects::glass::{Sight, blocked_share, diffuse_share, sight, transmission};
use crate::pattern::hammersley;
use crate::shade::blocks::Blocks;
use crate::shade::fragment_material::{FragmentMaterial, bsdf_of, coat_of};
use crate::shade::refraction::{RayEnd, RefractedRays};
use crate::shade::visibility::Fragment;
use crate::stages;

/// Perceptual roughness below which reflections are gathered from the whole environment, and above which light
/// samples represent the lights; in between, both are mixed. Both are consistent; the first needs narrow cones, the
/// second wide reflections.
const LIGHT_SAMPLING_ROUGHNESS: (f32, f32) = (0.3, 0.5);

/// Widest cone of a glossy reflection.
const MAX_TANGENT: f32 = 0.8;

/// GGX α from which on a reflection uses all specular cones.
const WIDE_ALPHA: f32 = 0.12;

/// Largest reflectance at normal incidence of surfaces whose reflections neighbouring pixels may share: dielectrics.
const FAINT_F0: f32 = 0.1;

/// Smallest perceptual roughness at which reflections are shared.
const SHARED_ROUGHNESS: f32 = 0.2;

/// Half-angle tangent of a ray through glass as a multiple of the spread of its pixel's rays over their number.
const FOOTPRINT: f32 = 1.5;

/// Largest half-angle tangent of a pixel's footprint behind glass; neighbouring rays that part are no wide cone.
const MAX_PIXEL_TANGENT: f32 = 0.2;

/// Fragments per task when reflections are gathered; the result does not depend on it.
const FRAGMENTS_PER_TASK: usize = 128;

/// Largest distance of neighbouring fragments on one surface, as a multiple of the pixel spacing.
const NEIGHBOURING: f32 = 4.0;

/// Index of the request of a cone, and the cone's share of it.
type ConeOwner = (usize, f32);

/// Gathers light along cones: [`Environment::gather_reflected`] or [`Environment::gather_behind`].
type Gather = fn(&Environment, &[Vec3], &mut [Cone], &mut Vec<ConeSample>);

/// Radiance of a fragment towards the camera, by kind of light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shaded {
    /// Reflected diffusely.
    pub diffuse: Vec3,
    /// Reflected by the specular layer and the clear coat.
    pub specular: Vec3,
    /// Passed through glass.
    pub transmission: Vec3,
    /// Emitted.
    pub emission: Vec3,
}

impl Shaded {
    pub fn total(&self) -> Vec3 {
        self.diffuse + self.specular + self.transmission + self.emission
    }
}

/// Light through a fragment of glass.
#[derive(Clone, Copy)]
struct Transmitted {
    /// Radiance that passes it.
    light: Vec3,
    /// Share that it reflects, as a mean over the pixel.
    albedo: Vec3,
}

/// Light asked for at the end of a ray.
struct Request {
    /// Index of what the ray belongs to.
    owner: usize,
    end: RayEnd,
    tan_half_angle: f32,
    /// Share of the lights that comes from light samples instead.
    sampled: f32,
}

impl Request {
    /// Returns the half-angle tangent of its cone, widened by rough glass.
    fn aperture(&self) -> f32 {
        quantised(self.tan_half_angle.hypot(self.end.spread)).min(MAX_TANGENT)
    }
}

/// Shades fragments.
pub(crate) struct Shader<'a> {
    pub gatherer: Gatherer<'a>,
    /// Cones per blurred reflection; with 1, its dominant direction is used.
    pub specular_cones: usize,
    /// Side in pixels of the blocks that share gathered diffuse light.
    pub stride: usize,
    /// Camera in pixels of the photo.
    pub camera: Camera,
    /// Positions within a pixel of the rays through glass, see
    /// [`coverage_pattern`](crate::shade::visibility::coverage_pattern).
    pub glass_rays: &'a [Vec2],
}

/// One reflected direction of a fragment.
struct Reflection {
    /// Index of the fragment in the current batch.
    slot: usize,
    /// Index of the fragment's microfacet sample.
    sample: usize,
    direction: Vec3,
    /// Fresnel and masking terms.
    weight: Vec3,
    tan_half_angle: f32,
}

impl Shader<'_> {
    /// Returns the radiance of each fragment towards the camera. Fragments of one pixel are adjacent.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn shade(&self, fragments: &[Fragment], on_event: OnEvent<'_>) -> Result<Vec<Shaded>, Cancelled> {
        let materials: Vec<FragmentMaterial> = fragments
            .par_iter()
            .map(|f| {
                let bsdf = bsdf_of(&f.point);
                let faint = bsdf.f0.max_element() < FAINT_F0 && f.point.roughness > SHARED_ROUGHNESS;
                let diffuse = bsdf.diffuse != Vec3::ZERO && diffuse_share(&f.point) > 0.0 || f.point.sheen != [0.0; 3];
                let gloss = sampled_share(f.point.roughness) > 0.0;
                FragmentMaterial { bsdf, shares_reflection: self.stride > 1 && faint, diffuse, gloss }
            })
            .collect();
        let blocks = Blocks::new(fragments, &materials, self.stride);
        let receivers: Vec<Receiver> = blocks.sources.iter().map(|&i| receiver(&fragments[i], &materials[i])).collect();
        // Reflections are gathered at every fragment, or at the sources only for those that share.
        let mut is_source = vec![false; fragments.len()];
        for &i in &blocks.sources {
            is_source[i] = true;
        }
        let wanted: Vec<usize> = (0..fragments.len())
            .filter(|&i| !fragments[i].point.unlit && (is_source[i] || !materials[i].shares_reflection))
            .collect();
        let chosen = |is_chosen: fn(&Fragment) -> bool| -> Vec<usize> {
            (0..fragments.len()).filter(|&i| !fragments[i].point.unlit && is_chosen(&fragments[i])).collect()
        };
        let glass = chosen(|fragment| sight(&fragment.point) == Sight::Traced);
        if !glass.is_empty() {
            self.gatherer.environment.prepare_behind();
        }
        let coated = chosen(|fragment| fragment.point.clearcoat > 0.0);
        let steps = receivers.len() + wanted.len() + glass.len() + coated.len();
        let mut batches = Batches::new(on_event, stages::SHADING, steps);
        let cones = self.gatherer.directions.len();
        let gathered = batches.each(receivers.len(), cones, RECEIVERS_PER_TASK, |range| {
            self.gatherer.gather_parallel(&receivers[range])
        })?;
        let base = |i: usize| (materials[i].bsdf, sampled_share(fragments[i].point.roughness));
        let reflected = self.reflected_means(&wanted, fragments, base, &mut batches)?;
        let coat = |i: usize| (coat_of(&fragments[i].point), 0.0);
        let coat_reflected = self.reflected_means(&coated, fragments, coat, &mut batches)?;
        let lights = batches.each(glass.len(), 2 * self.glass_rays.len(), FRAGMENTS_PER_TASK, |range| {
            let chunks = glass[range].par_chunks(FRAGMENTS_PER_TASK);
            chunks.flat_map_iter(|chunk| self.transmitted(chunk, fragments)).collect()
        })?;
        let mut transmitted = vec![None; fragments.len()];
        for (&i, light) in glass.iter().zip(lights) {
            transmitted[i] = Some(light);
        }
        let shaded = (0..fragments.len())
            .into_par_iter()
            .map(|i| {
                let point = &fragments[i].point;
                if point.unlit {
                    let emission = Vec3::from(point.base_color);
                    return Shaded { diffuse: Vec3::ZERO, specular: Vec3::ZERO, transmission: Vec3::ZERO, emission };
                }
                let light = blocks.light_of(i, fragments, &materials, &gathered, &reflected);
                let (bsdf, n_dot_v) = (&materials[i].bsdf, n_dot_v(&fragments[i]));
                let diffuse =
                    bsdf.diffuse * specular_transmittance(bsdf.f0, n_dot_v) * light.irradiance * (point.occlusion / PI);
                let glass = transmitted[i].unwrap_or_else(|| Transmitted {
                    light: Vec3::ZERO,
                    albedo: specular_albedo(bsdf.f0, bsdf.roughness, n_dot_v),
                });
                let albedo = glass.albedo;
                let reflected = light.reflected * albedo + light.highlights * sampled_share(point.roughness);
                // Sheen is lit as if it were diffuse, and dims what is under it.
                let sheen = Vec3::from(point.sheen) * sheen_albedo(point.sheen_roughness, n_dot_v);
                let under_sheen = 1.0 - sheen.max_element();
                let coat = coat_of(point);
                let coat_albedo = specular_albedo(coat.f0, coat.roughness, n_dot_v) * point.clearcoat;
                // Coverage multiplies it later, but the light of a pane is not dimmed by what passes through.
                let pane = sight(point) == Sight::Pane;
                let brighter = if pane { 1.0 / blocked_share(point, fragments[i].view) } else { 1.0 };
                let under_coat = (Vec3::ONE - coat_albedo) * brighter;
                Shaded {
                    diffuse: diffuse * diffuse_share(point) * under_sheen * under_coat,
                    specular: (reflected * under_sheen + sheen * light.irradiance * (point.occlusion / PI))
                        * under_coat
                        + coat_reflected[i] * coat_albedo * brighter,
                    transmission: glass.light * transmission(point) * under_coat,
                    emission: Vec3::from(point.emissive) * under_coat,
                }
            })
            .collect();
        Ok(shaded)
    }

    /// Returns for each fragment the mean radiance that a specular layer of the `chosen` ones reflects, without the
    /// light samples. `layer` gives the layer's BSDF and the share of the lights' highlight that light samples make.
    fn reflected_means(
        &self,
        chosen: &[usize],
        fragments: &[Fragment],
        layer: impl Fn(usize) -> (MetallicRoughness, f32) + Sync,
        batches: &mut Batches<'_>,
    ) -> Result<Vec<Vec3>, Cancelled> {
        let spreads = spreads(fragments, chosen);
        let means = batches.each(chosen.len(), self.specular_cones, FRAGMENTS_PER_TASK, |range| {
            let spreads = spreads[range.clone()].par_chunks(FRAGMENTS_PER_TASK);
            let chunks = chosen[range].par_chunks(FRAGMENTS_PER_TASK).zip(spreads);
            chunks.flat_map_iter(|(chunk, spreads)| self.chunk_means(chunk, spreads, fragments, &layer)).collect()
        })?;
        let mut reflected = vec![Vec3::ZERO; fragments.len()];
        for (&i, mean) in chosen.iter().zip(means) {
            reflected[i] = mean;
        }
        Ok(reflected)
    }

    fn chunk_means(
        &self,
        chosen: &[usize],
        spreads: &[f32],
        fragments: &[Fragment],
        layer: &impl Fn(usize) -> (MetallicRoughness, f32),
    ) -> Vec<Vec3> {
        let mut reflections: Vec<Reflection> = Vec::with_capacity(chosen.len() * self.specular_cones);
        for (slot, &i) in chosen.iter().enumerate() {
            self.reflections(slot, &fragments[i], &layer(i).0, spreads[slot], &mut reflections);
        }
        // Cones of one aperture are adjacent. The sort is stable, so the order is deterministic.
        reflections.sort_by(|a, b| a.tan_half_angle.total_cmp(&b.tan_half_angle).then(a.sample.cmp(&b.sample)));
        let sampled: Vec<f32> = chosen.iter().map(|&i| layer(i).1).collect();
        let radiance = self.reflected(chosen, &sampled, fragments, &reflections);
        let mut sums = vec![(Vec3::ZERO, Vec3::ZERO); chosen.len()];
        for (reflection, radiance) in reflections.iter().zip(radiance) {
            let (light, weight) = &mut sums[reflection.slot];
            *light += radiance * reflection.weight;
            *weight += reflection.weight;
        }
        // The mean over the samples times the layer's exact albedo: a uniform environment is exact with any number of
        // cones.
        sums.iter()
            .map(|&(light, weight)| {
                Vec3::select(weight.cmpgt(Vec3::splat(1e-9)), light / weight.max(Vec3::splat(1e-9)), Vec3::ZERO)
            })
            .collect()
    }

    /// Adds the reflected directions of a fragment. `spread` is the half-angle tangent of a pixel's reflection due to
    /// the surface's curvature.
    fn reflections(
        &self,
        slot: usize,
        fragment: &Fragment,
        bsdf: &MetallicRoughness,
        spread: f32,
        out: &mut Vec<Reflection>,
    ) {
        let (point, n_dot_v) = (&fragment.point, n_dot_v(fragment));
        let (ggx, alpha) = (bsdf.ggx(), bsdf.ggx().alpha());
        let normal = point.shading_normal;
        let mirror = (2.0 * normal.dot(fragment.view) * normal - fragment.view).normalize_or(normal);
        if self.specular_cones == 1 || alpha < 0.002 {
            // Reflections of rough surfaces lean towards the normal (Lagarde and de Rousiers 2014, 4.9.3).
            let smooth = 1.0 - alpha;
            let lean = smooth * (smooth.sqrt() + alpha);
            let direction = above(normal.lerp(mirror, lean).normalize_or(normal), point.geometric_normal);
            // The top-hat cone with the density of the reflection's peak, 1 / (4 π α²) seen along the normal.
            let tan_half_angle = quantised(cone_tangent(4.0 * PI * alpha * alpha).max(spread).min(MAX_TANGENT));
            out.push(Reflection { slot, sample: 0, direction, weight: Vec3::ONE, tan_half_angle });
            return;
        }
        let tangent =
            (fragment.view - normal * normal.dot(fragment.view)).normalize_or(normal.any_orthonormal_vector());
        let frame = Mat3::from_cols(tangent, normal.cross(tangent), normal);
        let view = Vec3::new((1.0 - n_dot_v * n_dot_v).max(0.0).sqrt(), 0.0, n_dot_v);
        // Few cones are enough for a narrow reflection.
        let count = (self.specular_cones as f32 * (alpha / WIDE_ALPHA).min(1.0)).ceil().max(3.0) as usize;
        for i in 0..count {
            let GgxSample { light: direction, v_dot_h, weight, pdf_per_sr } = ggx.sample(view, hammersley(i, count));
            if weight <= 0.0 {
                continue;
            }
            let solid_angle = 1.0 / (count as f32 * pdf_per_sr);
            out.push(Reflection {
                slot,
                sample: i,
                direction: above(frame * direction, point.geometric_normal),
                weight: fresnel(bsdf.f0, v_dot_h) * weight,
                tan_half_angle: quantised(cone_tangent(solid_angle).min(MAX_TANGENT)),
            });
        }
    }

    /// Returns the radiance from each reflected direction: of an object, or of the environment.
    fn reflected(
        &self,
        chosen: &[usize],
        sampled: &[f32],
        fragments: &[Fragment],
        reflections: &[Reflection],
    ) -> Vec<Vec3> {
        let rays = self.rays();
        let (mut requests, mut ends) = (Vec::with_capacity(reflections.len()), Vec::new());
        for (owner, &Reflection { slot, direction, tan_half_angle, .. }) in reflections.iter().enumerate() {
            let Fragment { point, object, .. } = fragments[chosen[slot]];
            let origin = self.gatherer.ray_start(object, point.position, point.geometric_normal);
            let ray = Ray { origin, direction };
            ends.clear();
            if rays.0.have_glass() {
                rays.leave(object, ray, &mut ends);
            } else {
                let met = rays.0.closest(&ray, f32::INFINITY);
                ends.push(RayEnd { ray, object, met, share: Vec3::ONE, spread: 0.0 });
            }
            let sampled = sampled[slot];
            requests.extend(ends.drain(..).map(|end| Request { owner, end, tan_half_angle, sampled }));
        }
        self.arriving(&requests, reflections.len(), Environment::gather_reflected)
    }

    fn rays(&self) -> RefractedRays<'_> {
        RefractedRays(self.gatherer.objects)
    }

    /// Returns what each of the `chosen` fragments of glass lets pass.
    fn transmitted(&self, chosen: &[usize], fragments: &[Fragment]) -> Vec<Transmitted> {
        let rays = self.rays();
        let (mut requests, mut ends) = (Vec::new(), Vec::new());
        let mut albedos = vec![Vec3::ZERO; chosen.len()];
        let share = 1.0 / self.glass_rays.len() as f32;
        let mut main = Vec::with_capacity(self.glass_rays.len());
        for (owner, &i) in chosen.iter().enumerate() {
            main.clear();
            let first = requests.len();
            for &place in self.glass_rays {
                let (point, view) = self.point_within_pixel(&fragments[i], place);
                ends.clear();
                rays.enter(fragments[i].object, &point, view, &mut ends);
                main.extend(ends.first().map(|end| end.ray.direction));
                let (bsdf, cosine) = (bsdf_of(&point), point.shading_normal.dot(view).clamp(MIN_COSINE, 1.0));
                let albedo = specular_albedo(bsdf.f0, bsdf.roughness, cosine);
                albedos[owner] += albedo * share;
                requests.extend(ends.drain(..).map(|end| {
                    let end = RayEnd { share: end.share * (Vec3::ONE - albedo) * share, ..end };
                    Request { owner, end, tan_half_angle: 0.0, sampled: 0.0 }
                }));
            }
            // The pixel's footprint, shared by its rays.
            let mean = main.iter().copied().sum::<Vec3>() / main.len().max(1) as f32;
            let variance = main.iter().map(|&direction| (direction - mean).length_squared()).sum::<f32>();
            let pixel = FOOTPRINT * variance.sqrt() * share;
            for request in &mut requests[first..] {
                request.tan_half_angle = pixel.min(MAX_PIXEL_TANGENT).max(self.camera.pixel_angle_rad());
            }
        }
        // Cones of one aperture are adjacent.
        requests.sort_by(|a, b| a.aperture().total_cmp(&b.aperture()));
        let light = self.arriving(&requests, chosen.len(), Environment::gather_behind);
        light.into_iter().zip(albedos).map(|(light, albedo)| Transmitted { light, albedo }).collect()
    }

    /// Returns the surface at a place within a fragment's pixel, and the direction to the camera.
    fn point_within_pixel(&self, fragment: &Fragment, place: Vec2) -> (SurfacePoint, Vec3) {
        let (x, y) = fragment.pixel;
        let direction = self.camera.direction(x as f64 + f64::from(place.x), y as f64 + f64::from(place.y));
        let ray = Ray { origin: Vec3::ZERO, direction };
        let object = &self.gatherer.objects[fragment.object];
        let distance_m = fragment.point.position.length();
        let pixel_m = distance_m * self.camera.pixel_angle_rad();
        let reach_m = NEIGHBOURING * pixel_m / n_dot_v(fragment).max(0.1);
        match object.seen(&ray, (distance_m - reach_m).max(0.0)).filter(|hit| hit.distance_m < distance_m + reach_m) {
            Some(hit) => (object.surface(&ray, &hit, pixel_m), -direction),
            None => (fragment.point, fragment.view),
        }
    }

    /// Returns the sum of what arrives along the rays of each of `count` owners. `gather` is how the environment's
    /// light is gathered together with its lights.
    fn arriving(&self, requests: &[Request], count: usize, gather: Gather) -> Vec<Vec3> {
        let gatherer = &self.gatherer;
        let mut radiance = vec![Vec3::ZERO; count];
        // Cones to the environment: with its lights, and without.
        let mut asked: [(Vec<Cone>, Vec<ConeOwner>); 2] = Default::default();
        let mut apexes = Vec::new();
        for (i, request) in requests.iter().enumerate() {
            let (Request { owner, end, sampled, .. }, tan_half_angle) = (request, request.aperture());
            if let Some(met) = end.met {
                if let Some(radiosity) = gatherer.radiosity {
                    let footprint_m = met.hit.distance_m * tan_half_angle;
                    let met_object = &gatherer.objects[met.object];
                    let point = met_object.surface(&end.ray, &met.hit, footprint_m);
                    radiance[*owner] += radiosity[met.object].radiance_of(met_object, &point) * end.share;
                }
                continue;
            }
            let origin = gatherer.lifted(end.object, end.ray.origin);
            let cone = Cone { origin, direction: end.ray.direction, tan_half_angle };
            let sampled = if gatherer.environment.lights().is_empty() { 0.0 } else { *sampled };
            for (part, share) in [1.0 - sampled, sampled].into_iter().enumerate().filter(|(_, share)| *share > 0.0) {
                asked[part].0.push(cone);
                asked[part].1.push((i, share));
                if part == 0 {
                    apexes.push(end.ray.origin);
                }
            }
        }
        let mut samples = Vec::new();
        for (part, (cones, owners)) in [LightPart::All, LightPart::Rest].into_iter().zip(&mut asked) {
            match part {
                LightPart::All => gather(gatherer.environment, &apexes, cones, &mut samples),
                LightPart::Rest => gatherer.environment.gather(part, cones, &mut samples),
            }
            for ((cone, sample), &mut (i, share)) in cones.iter().zip(&samples).zip(owners) {
                let Request { owner, end, .. } = &requests[i];
                radiance[*owner] += gatherer.shadowed(end.object, cone, sample) * end.share * share;
            }
        }
        radiance
    }
}

/// Returns for each `wanted` fragment half of the angle, as a tangent, between its reflected direction and those of
/// neighbouring pixels (ray differentials, Igehy 1999): the footprint of a pixel on a curved mirror.
fn spreads(fragments: &[Fragment], wanted: &[usize]) -> Vec<f32> {
    let first: HashMap<(usize, usize), usize> =
        fragments.iter().enumerate().rev().map(|(i, fragment)| (fragment.pixel, i)).collect();
    let spread = |&i: &usize| {
        let own = &fragments[i];
        let (x, y) = own.pixel;
        // A mirror rotated by an angle rotates its reflection by twice that; half of it is the cone's half-angle.
        let turned = |pixel: Option<(usize, usize)>| {
            let other = &fragments[*first.get(&pixel?)?];
            let apart_m = (other.point.position - own.point.position).length();
            let pixel_m = own.point.position.length() * own.view.angle_between(other.view);
            let is_near = other.object == own.object && apart_m * n_dot_v(own) < NEIGHBOURING * pixel_m;
            is_near.then(|| other.point.shading_normal.angle_between(own.point.shading_normal))
        };
        let along = |a: Option<(usize, usize)>, b: Option<(usize, usize)>| match (turned(a), turned(b)) {
            (Some(a), Some(b)) => a.min(b),
            (a, b) => a.or(b).unwrap_or(0.0),
        };
        let columns = along(x.checked_sub(1).map(|x| (x, y)), Some((x + 1, y)));
        let rows = along(y.checked_sub(1).map(|y| (x, y)), Some((x, y + 1)));
        columns.max(rows).min(1.0).tan()
    };
    wanted.par_iter().map(spread).collect()
}

fn n_dot_v(fragment: &Fragment) -> f32 {
    fragment.point.shading_normal.dot(fragment.view).clamp(MIN_COSINE, 1.0)
}

fn receiver(fragment: &Fragment, material: &FragmentMaterial) -> Receiver {
    let point = &fragment.point;
    if point.unlit || !material.gathers() {
        return Receiver::dark();
    }
    let gloss = material.gloss.then_some((fragment.view, material.bsdf));
    let (position, normal, geometric_normal) = (point.position, point.shading_normal, point.geometric_normal);
    Receiver { object: fragment.object, position, normal, geometric_normal, diffuse: material.diffuse, gloss }
}

/// Returns the share of the lights' highlight that comes from light samples.
fn sampled_share(roughness: f32) -> f32 {
    let (low, high) = LIGHT_SAMPLING_ROUGHNESS;
    smoothstep(low, high, roughness)
}

/// Clamps a direction to the front side of its triangle.
fn above(direction: Vec3, geometric_normal: Vec3) -> Vec3 {
    let depth = geometric_normal.dot(direction);
    if depth >= 0.01 {
        direction
    } else {
        (direction + geometric_normal * (0.01 - depth)).normalize_or(geometric_normal)
    }
}
