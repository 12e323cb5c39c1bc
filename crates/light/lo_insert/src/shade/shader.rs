//! Shading: from light gathered at fragments to their radiance towards the camera.

use std::collections::HashMap;
use std::f32::consts::PI;

use lo_bsdf::{GgxSample, MIN_COSINE, MetallicRoughness, fresnel, specular_albedo, specular_transmittance};
use lo_cone::Cone;
use lo_events::{Cancelled, OnEvent};
use lo_geometry::{Mat3, Ray, Vec3, smoothstep};
use rayon::prelude::*;

use crate::batches::Batches;
use crate::light::aperture::{cone_tangent, quantised};
use crate::light::environment::LightPart;
use crate::light::gather::{Gatherer, RECEIVERS_PER_TASK, Receiver};
use crate::objects::glass::{blocked_share, diffuse_share};
use crate::pattern::hammersley;
use crate::shade::blocks::Blocks;
use crate::shade::fragment_material::FragmentMaterial;
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

/// Fragments per task when reflections are gathered; the result does not depend on it.
const FRAGMENTS_PER_TASK: usize = 128;

/// Largest distance of neighbouring fragments on one surface, as a multiple of the pixel spacing.
const NEIGHBOURING: f32 = 4.0;

/// Index of a cone's reflection, and the cone's share of it.
type ConeOwner = (usize, f32);

/// Shades fragments.
pub(crate) struct Shader<'a> {
    pub gatherer: Gatherer<'a>,
    /// Cones per blurred reflection; with 1, its dominant direction is used.
    pub specular_cones: usize,
    /// Side in pixels of the blocks that share gathered diffuse light.
    pub stride: usize,
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
    pub fn shade(&self, fragments: &[Fragment], on_event: OnEvent<'_>) -> Result<Vec<Vec3>, Cancelled> {
        let materials: Vec<FragmentMaterial> = fragments
            .par_iter()
            .map(|f| {
                let bsdf = MetallicRoughness::new(Vec3::from(f.point.base_color), f.point.metallic, f.point.roughness);
                let faint = bsdf.f0.max_element() < FAINT_F0 && f.point.roughness > SHARED_ROUGHNESS;
                let diffuse = bsdf.diffuse != Vec3::ZERO;
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
        let mut batches = Batches::new(on_event, stages::SHADING, receivers.len() + wanted.len());
        let cones = self.gatherer.directions.len();
        let gathered = batches.each(receivers.len(), cones, RECEIVERS_PER_TASK, |range| {
            self.gatherer.gather_parallel(&receivers[range])
        })?;
        let spreads = spreads(fragments, &wanted);
        let means = batches.each(wanted.len(), self.specular_cones, FRAGMENTS_PER_TASK, |range| {
            let spreads = spreads[range.clone()].par_chunks(FRAGMENTS_PER_TASK);
            let chunks = wanted[range].par_chunks(FRAGMENTS_PER_TASK).zip(spreads);
            chunks
                .flat_map_iter(|(chunk, spreads)| self.reflected_means(chunk, spreads, fragments, &materials))
                .collect()
        })?;
        let mut reflected = vec![Vec3::ZERO; fragments.len()];
        for (&i, mean) in wanted.iter().zip(means) {
            reflected[i] = mean;
        }
        let shaded = (0..fragments.len())
            .into_par_iter()
            .map(|i| {
                let point = &fragments[i].point;
                if point.unlit {
                    return Vec3::from(point.base_color);
                }
                let light = blocks.light_of(i, fragments, &materials, &gathered, &reflected);
                let (bsdf, n_dot_v) = (&materials[i].bsdf, n_dot_v(&fragments[i]));
                let diffuse =
                    bsdf.diffuse * specular_transmittance(bsdf.f0, n_dot_v) * light.irradiance * (point.occlusion / PI);
                let specular = light.reflected * specular_albedo(bsdf.f0, bsdf.roughness, n_dot_v);
                let reflected = specular + light.highlights * sampled_share(point.roughness);
                let radiance = diffuse * diffuse_share(point) + reflected + Vec3::from(point.emissive);
                // Coverage multiplies it later, but the light of glass is not dimmed by what passes through.
                radiance / blocked_share(point, fragments[i].view)
            })
            .collect();
        Ok(shaded)
    }

    /// Returns the mean radiance that the specular layer of each `chosen` fragment reflects, without the light
    /// samples.
    fn reflected_means(
        &self,
        chosen: &[usize],
        spreads: &[f32],
        fragments: &[Fragment],
        materials: &[FragmentMaterial],
    ) -> Vec<Vec3> {
        let mut reflections: Vec<Reflection> = Vec::with_capacity(chosen.len() * self.specular_cones);
        for (slot, &i) in chosen.iter().enumerate() {
            self.reflections(slot, &fragments[i], &materials[i].bsdf, spreads[slot], &mut reflections);
        }
        // Cones of one aperture are adjacent. The sort is stable, so the order is deterministic.
        reflections.sort_by(|a, b| a.tan_half_angle.total_cmp(&b.tan_half_angle).then(a.sample.cmp(&b.sample)));
        let radiance = self.reflected(chosen, fragments, &reflections);
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
    fn reflected(&self, chosen: &[usize], fragments: &[Fragment], reflections: &[Reflection]) -> Vec<Vec3> {
        let gatherer = &self.gatherer;
        let mut radiance = vec![Vec3::ZERO; reflections.len()];
        // Requests to the environment: with its lights, and without.
        let mut asked: [(Vec<Cone>, Vec<ConeOwner>); 2] = Default::default();
        let mut apexes = Vec::new();
        for (i, reflection) in reflections.iter().enumerate() {
            let point = &fragments[chosen[reflection.slot]].point;
            let object = fragments[chosen[reflection.slot]].object;
            let origin = gatherer.ray_start(object, point.position, point.geometric_normal);
            let ray = Ray { origin, direction: reflection.direction };
            if let Some(met) = gatherer.objects.closest(&ray, f32::INFINITY) {
                if let Some(radiosity) = gatherer.radiosity {
                    let footprint_m = met.hit.distance_m * reflection.tan_half_angle;
                    let met_object = &gatherer.objects[met.object];
                    let point = met_object.surface(&ray, &met.hit, footprint_m);
                    radiance[i] = radiosity[met.object].radiance_of(met_object, &point);
                }
                continue;
            }
            let lifted = gatherer.lifted(object, point.position);
            let cone =
                Cone { origin: lifted, direction: reflection.direction, tan_half_angle: reflection.tan_half_angle };
            let sampled = if gatherer.environment.lights().is_empty() { 0.0 } else { sampled_share(point.roughness) };
            for (part, share) in [1.0 - sampled, sampled].into_iter().enumerate().filter(|(_, share)| *share > 0.0) {
                asked[part].0.push(cone);
                asked[part].1.push((i, share));
                if part == 0 {
                    apexes.push(origin);
                }
            }
        }
        let mut samples = Vec::new();
        for (part, (cones, owners)) in [LightPart::All, LightPart::Rest].into_iter().zip(&mut asked) {
            match part {
                LightPart::All => gatherer.environment.gather_reflected(&apexes, cones, &mut samples),
                LightPart::Rest => gatherer.environment.gather(part, cones, &mut samples),
            }
            for ((cone, sample), &mut (i, share)) in cones.iter().zip(&samples).zip(owners) {
                let object = fragments[chosen[reflections[i].slot]].object;
                radiance[i] += gatherer.shadowed(object, cone, sample) * share;
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
