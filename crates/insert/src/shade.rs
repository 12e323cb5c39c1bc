//! From light gathered at fragments to the radiance that they send to the camera.

use std::f32::consts::PI;

use cone::Cone;
use geometry::{Mat3, Ray, Vec3};

use crate::brdf::{AlbedoTable, Brdf, LobeSample, cone_tangent, hammersley, sample_lobe};
use crate::environment::Part;
use crate::gather::{Gathered, Gatherer, Receiver};
use crate::shadow::quantised;
use crate::visibility::Fragment;

/// Perceptual roughness below which lobes are gathered from the whole environment, and above which light samples take over the
/// lights; in between both are mixed. Both give the same; the first needs narrow cones, the second wide lobes.
const LIGHT_SAMPLING_ROUGHNESS: (f32, f32) = (0.3, 0.5);

/// Widest cone of a glossy reflection.
const MAX_TANGENT: f32 = 0.8;

/// Index of the reflection that a cone belongs to, and its share.
type Owner = (usize, f32);

/// Shades fragments.
pub(crate) struct Shader<'a> {
    pub gatherer: Gatherer<'a>,
    pub table: &'a AlbedoTable,
    /// Cones per specular lobe; 1 takes the lobe's dominant direction.
    pub specular_cones: usize,
    /// Pixels along the side of the blocks that share gathered diffuse light.
    pub stride: usize,
}

/// One reflected direction of a fragment.
struct Reflection {
    fragment: usize,
    direction: Vec3,
    /// Fresnel and masking.
    weight: Vec3,
    tan_half_angle: f32,
}

impl Shader<'_> {
    /// Radiance of each fragment towards the camera. Fragments of one pixel lie together.
    pub fn shade(&self, fragments: &[Fragment]) -> Vec<Vec3> {
        let brdfs: Vec<Brdf> = fragments
            .iter()
            .map(|f| Brdf::new(Vec3::from(f.point.base_color), f.point.metallic, f.point.roughness))
            .collect();
        let gathered = self.gather_shared(fragments, &brdfs);
        let specular = self.specular(fragments, &brdfs);
        fragments
            .iter()
            .enumerate()
            .map(|(i, fragment)| {
                let point = &fragment.point;
                if point.unlit {
                    return Vec3::from(point.base_color);
                }
                let (brdf, n_dot_v) = (&brdfs[i], self.n_dot_v(fragment));
                let diffuse = brdf.diffuse
                    * self.table.diffuse(brdf.f0, n_dot_v)
                    * gathered[i].irradiance
                    * (point.occlusion / PI);
                let highlights = gathered[i].highlights * sampled_share(point.roughness);
                diffuse + specular[i] + highlights + Vec3::from(point.emissive)
            })
            .collect()
    }

    fn n_dot_v(&self, fragment: &Fragment) -> f32 {
        fragment.point.shading_normal.dot(fragment.view).clamp(1e-3, 1.0)
    }

    fn receiver(&self, fragment: &Fragment, brdf: &Brdf) -> Receiver {
        let point = &fragment.point;
        let gloss = (sampled_share(point.roughness) > 0.0).then_some((fragment.view, *brdf));
        Receiver {
            position: point.position,
            normal: point.shading_normal,
            geometric_normal: point.geometric_normal,
            gloss,
        }
    }

    /// Gathers once for all fragments of a block of pixels that lie on about the same surface, and interpolates between blocks
    /// of one tile.
    fn gather_shared(&self, fragments: &[Fragment], brdfs: &[Brdf]) -> Vec<Gathered> {
        let lit = |f: &Fragment| !f.point.unlit;
        let mut source: Vec<usize> = Vec::with_capacity(fragments.len());
        let mut sources: Vec<usize> = Vec::new();
        let mut block_sources: std::collections::HashMap<(usize, usize), Vec<usize>> = std::collections::HashMap::new();
        for (i, fragment) in fragments.iter().enumerate() {
            let block = (fragment.pixel.0 / self.stride, fragment.pixel.1 / self.stride);
            let candidates = block_sources.entry(block).or_default();
            let shared = candidates
                .iter()
                .copied()
                .find(|&slot| self.stride > 1 && on_same_surface(&fragments[sources[slot]], fragment));
            source.push(shared.unwrap_or_else(|| {
                sources.push(i);
                candidates.push(sources.len() - 1);
                sources.len() - 1
            }));
        }
        let receivers: Vec<Receiver> = sources
            .iter()
            .map(|&i| if lit(&fragments[i]) { self.receiver(&fragments[i], &brdfs[i]) } else { Receiver::dark() })
            .collect();
        let gathered = self.gatherer.gather(&receivers);
        fragments
            .iter()
            .zip(source)
            .enumerate()
            .map(|(i, (fragment, slot))| {
                let mut own = gathered[slot];
                if self.stride == 1 {
                    return own;
                }
                // Between the points of the blocks around, so that blocks do not show.
                let (column, row) = (fragment.pixel.0 / self.stride, fragment.pixel.1 / self.stride);
                let blocks = (row.saturating_sub(1)..=row + 1)
                    .flat_map(|row| (column.saturating_sub(1)..=column + 1).map(move |column| (column, row)));
                let mut sum = (Vec3::ZERO, 0.0);
                for &near in blocks.filter_map(|block| block_sources.get(&block)).flatten() {
                    let other = &fragments[sources[near]];
                    let offset = |a: usize, b: usize| a.abs_diff(b) as f32 / (1.5 * self.stride as f32);
                    let weight = (1.0 - offset(other.pixel.0, fragment.pixel.0)).max(0.0)
                        * (1.0 - offset(other.pixel.1, fragment.pixel.1)).max(0.0);
                    if weight > 0.0 && lit(other) && (sources[near] == i || on_same_surface(other, fragment)) {
                        let from = receivers[near].normal;
                        sum.0 += gathered[near].irradiance_for(from, fragment.point.shading_normal) * weight;
                        sum.1 += weight;
                    }
                }
                if sum.1 > 0.0 {
                    own.irradiance = sum.0 / sum.1;
                }
                own
            })
            .collect()
    }

    /// Radiance by the specular layer, without what light samples carry.
    fn specular(&self, fragments: &[Fragment], brdfs: &[Brdf]) -> Vec<Vec3> {
        let mut reflections: Vec<Reflection> = Vec::with_capacity(fragments.len() * self.specular_cones);
        for (i, fragment) in fragments.iter().enumerate().filter(|(_, f)| !f.point.unlit) {
            self.reflections(i, fragment, &brdfs[i], &mut reflections);
        }
        // Cones of one aperture next to each other; the sort is stable, so the order does not depend on anything else.
        reflections.sort_by(|a, b| a.tan_half_angle.total_cmp(&b.tan_half_angle));
        let radiance = self.reflected(fragments, &reflections);
        let mut sums = vec![(Vec3::ZERO, Vec3::ZERO); fragments.len()];
        for (reflection, radiance) in reflections.iter().zip(radiance) {
            let (light, weight) = &mut sums[reflection.fragment];
            *light += radiance * reflection.weight;
            *weight += reflection.weight;
        }
        sums.iter()
            .enumerate()
            .map(|(i, &(light, weight))| {
                let albedo = self.table.specular(brdfs[i].f0, self.n_dot_v(&fragments[i]), brdfs[i].alpha);
                // The mean over the lobe times its exact albedo: a uniform environment comes out right with any number of cones.
                let mean =
                    Vec3::select(weight.cmpgt(Vec3::splat(1e-9)), light / weight.max(Vec3::splat(1e-9)), Vec3::ZERO);
                mean * albedo
            })
            .collect()
    }

    fn reflections(&self, index: usize, fragment: &Fragment, brdf: &Brdf, out: &mut Vec<Reflection>) {
        let (point, n_dot_v) = (&fragment.point, self.n_dot_v(fragment));
        let normal = point.shading_normal;
        let mirror = (2.0 * normal.dot(fragment.view) * normal - fragment.view).normalize_or(normal);
        if self.specular_cones == 1 || brdf.alpha < 0.002 {
            // Lobes of rough surfaces lean towards the normal (Lagarde and de Rousiers 2014, 4.9.3).
            let smooth = 1.0 - brdf.alpha;
            let lean = smooth * (smooth.sqrt() + brdf.alpha);
            let direction = above(normal.lerp(mirror, lean).normalize_or(normal), point.geometric_normal);
            // The top-hat cone that is as dense as the lobe's peak.
            let peak = sample_lobe(Vec3::new(0.0, 0.0, 1.0), brdf.alpha, geometry::Vec2::ZERO).pdf_per_sr;
            let tan_half_angle = quantised(cone_tangent(1.0 / peak).min(MAX_TANGENT));
            out.push(Reflection { fragment: index, direction, weight: Vec3::ONE, tan_half_angle });
            return;
        }
        let tangent =
            (fragment.view - normal * normal.dot(fragment.view)).normalize_or(normal.any_orthonormal_vector());
        let frame = Mat3::from_cols(tangent, normal.cross(tangent), normal);
        let view = Vec3::new((1.0 - n_dot_v * n_dot_v).max(0.0).sqrt(), 0.0, n_dot_v);
        for i in 0..self.specular_cones {
            let LobeSample { direction, v_dot_h, weight, pdf_per_sr } =
                sample_lobe(view, brdf.alpha, hammersley(i, self.specular_cones));
            if weight <= 0.0 {
                continue;
            }
            let solid_angle = 1.0 / (self.specular_cones as f32 * pdf_per_sr);
            out.push(Reflection {
                fragment: index,
                direction: above(frame * direction, point.geometric_normal),
                weight: brdf.fresnel(v_dot_h) * weight,
                tan_half_angle: quantised(cone_tangent(solid_angle).min(MAX_TANGENT)),
            });
        }
    }

    /// Radiance from each reflected direction: the object itself, or the environment.
    fn reflected(&self, fragments: &[Fragment], reflections: &[Reflection]) -> Vec<Vec3> {
        let gatherer = &self.gatherer;
        let mut radiance = vec![Vec3::ZERO; reflections.len()];
        // What is asked of the environment: with its lights, and without.
        let mut asked: [(Vec<Cone>, Vec<Owner>); 2] = Default::default();
        for (i, reflection) in reflections.iter().enumerate() {
            let point = &fragments[reflection.fragment].point;
            let receiver = Receiver {
                position: point.position,
                normal: point.shading_normal,
                geometric_normal: point.geometric_normal,
                gloss: None,
            };
            let ray = Ray { origin: gatherer.ray_start(&receiver), direction: reflection.direction };
            if let Some(hit) = gatherer.object.closest(&ray, f32::INFINITY) {
                if let Some(radiosity) = gatherer.radiosity {
                    let footprint_m = hit.distance_m * reflection.tan_half_angle;
                    let point = gatherer.object.surface(&ray, &hit, footprint_m);
                    radiance[i] = radiosity.radiance_of(gatherer.object, self.table, &point);
                }
                continue;
            }
            let origin = gatherer.environment.lifted(point.position, gatherer.object.support);
            let cone = Cone { origin, direction: reflection.direction, tan_half_angle: reflection.tan_half_angle };
            let sampled = if gatherer.environment.lights().is_empty() { 0.0 } else { sampled_share(point.roughness) };
            for (part, share) in [1.0 - sampled, sampled].into_iter().enumerate().filter(|(_, share)| *share > 0.0) {
                asked[part].0.push(cone);
                asked[part].1.push((i, share));
            }
        }
        let mut samples = Vec::new();
        for (part, (cones, owners)) in [Part::Whole, Part::Dimmed].into_iter().zip(&asked) {
            gatherer.environment.gather(part, cones, &mut samples);
            for ((cone, sample), &(i, share)) in cones.iter().zip(&samples).zip(owners) {
                radiance[i] += gatherer.shadowed(cone, sample) * share;
            }
        }
        radiance
    }
}

/// Whether two fragments of neighbouring pixels get about the same light.
fn on_same_surface(a: &Fragment, b: &Fragment) -> bool {
    let (near, far) = (a.point.position.z.abs(), b.point.position.z.abs());
    a.point.geometric_normal.dot(b.point.geometric_normal) > 0.7 && (near - far).abs() < 0.02 * far
}

/// Share of the lights' highlight that comes from light samples.
fn sampled_share(roughness: f32) -> f32 {
    let (low, high) = LIGHT_SAMPLING_ROUGHNESS;
    let t = ((roughness - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A direction that does not go into the triangle that it starts from.
fn above(direction: Vec3, geometric_normal: Vec3) -> Vec3 {
    let depth = geometric_normal.dot(direction);
    if depth >= 0.01 {
        direction
    } else {
        (direction + geometric_normal * (0.01 - depth)).normalize_or(geometric_normal)
    }
}
