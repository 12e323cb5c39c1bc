//! Differential rendering (Debevec 1998): the effect of objects on the light of real surfaces.
//!
//! At a real surface point, the photo's value is multiplied by `(E − Δ) / E`. E is the room's irradiance without the
//! object (`irradiance`), and `Δ = ∫ over the directions that meet an object of (radiance seen there before −
//! radiance of the object) cos θ dω`, plus the light samples that it hides. With several objects, each counts where a
//! direction meets it first. The radiance seen before comes from the [`Backdrop`].
//!
//! [`ShadowTerms::ratio`] keeps the ratio physically plausible where the octree contains less light than the photo
//! shows.

use std::f32::consts::PI;
use std::ops::{Add, Mul};

use lo_events::{Cancelled, OnEvent, Stage, ignore, stage_of_steps};
use lo_geometry::{Plane, Ray, Vec3};
use lo_imaging::Image;
use rayon::prelude::*;

use crate::batches::Batches;
use crate::light::environment::Environment;
use crate::light::irradiance::{RoomIrradiance, SurfaceIrradiance};
use crate::light::radiosity::Radiosity;
use crate::light::room_light::LightRay;
use crate::light::samples::Incidence;
use crate::objects::tracing::Objects;
use crate::quality::Counts;
use crate::shadow::backdrop::Backdrop;
use crate::shadow::cap::Cap;
use crate::shadow::ratio::ShadowRatio;
use crate::shadow::silhouette::Silhouettes;
use crate::stages;
use crate::surface::observed_surfaces::{Surface, SurfaceMap};
use crate::surface::receivers::{PATTERNS, Receivers, pattern_at};

/// Real surfaces as receivers of shadow, with their irradiance without the object.
pub(crate) struct ShadowField {
    receivers: Receivers,
    irradiance: RoomIrradiance,
    cones: usize,
    lights: usize,
    /// Largest share of a receiver's hemisphere that is neglected.
    negligible: f32,
}

/// The objects as shadow casters.
pub(crate) struct Caster<'a> {
    pub objects: &'a Objects<'a>,
    pub environment: &'a Environment,
    /// Silhouettes of each object.
    pub silhouettes: &'a [Silhouettes],
    /// Backdrop of each object.
    pub backdrops: &'a [Backdrop],
    /// Radiosity of each object, if already computed.
    pub radiosity: Option<&'a [Radiosity]>,
}

/// An object near enough to a real surface to change its light.
struct AffectingObject {
    object: usize,
    /// Start of rays from the surface against the object.
    start: Vec3,
    /// Fade factor; below 1 where its effect fades out.
    strength: f32,
}

/// Changes that objects make to the irradiance of a real surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ShadowTerms {
    /// Hidden irradiance of the room without its lights.
    ambient: Vec3,
    /// Hidden irradiance if the room behind each object were as bright as behind the brightest one.
    brightest: Vec3,
    /// Hidden irradiance of the light samples.
    lights: Vec3,
    /// Irradiance from the objects.
    given: Vec3,
    /// Form factor of the objects: their cosine-weighted share of the hemisphere, in [0, 1].
    form_factor: f32,
}

impl Add for ShadowTerms {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            ambient: self.ambient + other.ambient,
            brightest: self.brightest + other.brightest,
            lights: self.lights + other.lights,
            given: self.given + other.given,
            form_factor: self.form_factor + other.form_factor,
        }
    }
}

impl Mul<f32> for ShadowTerms {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        Self {
            ambient: self.ambient * factor,
            brightest: self.brightest * factor,
            lights: self.lights * factor,
            given: self.given * factor,
            form_factor: self.form_factor * factor,
        }
    }
}

impl ShadowTerms {
    /// Returns the irradiance with the objects divided by that without them.
    ///
    /// If less light is known than the objects hide, or than the surface emits, the known irradiance is raised:
    /// hidden light was there before, light without samples is nowhere brighter than [`lo_lights::CAP`] times its
    /// mean, and missing light is distributed like the rest. The brightness behind one object also counts beside all
    /// others, so that shadows add up.
    fn ratio(&self, lit: &SurfaceIrradiance) -> Vec3 {
        let form_factor = self.form_factor.clamp(0.0, 1.0);
        let seen_past = (1.0 - form_factor) / (lo_lights::CAP * form_factor.max(1e-6));
        let ambient = lit.ambient.max(self.ambient + self.brightest * seen_past);
        let lights = lit.lights.max(self.lights);
        let all = (ambient + lights).max(lit.least).max(Vec3::splat(1e-9));
        let kept = Vec3::ONE - self.ambient / ambient.max(Vec3::splat(1e-9));
        ((all - lights) * kept + (lights - self.lights) + self.given) / all
    }
}

impl ShadowField {
    /// Creates the field of a room with the given up and floor.
    pub fn new(map: SurfaceMap, up: Vec3, floor: Option<Plane>, environment: &Environment, counts: &Counts) -> Self {
        let receivers = Receivers::new(map, up, floor);
        let (cones, lights) = (counts.background_cones, counts.background_lights);
        let irradiance = RoomIrradiance::new(&receivers, environment, cones, lights);
        Self { receivers, irradiance, cones, lights, negligible: counts.negligible }
    }

    /// Computes the irradiance without objects of all pixels in advance.
    pub fn prepare(&self, environment: &Environment) {
        let (width, height) = (self.receivers.width(), self.receivers.height());
        let all = Image::new(width, height, vec![true; width * height]);
        let on_event: OnEvent<'_> = &mut ignore;
        let mut batches = Batches::new(on_event, stages::COARSE_SHADOW, height);
        self.irradiance.complete(&self.receivers, environment, &all, &mut batches).expect("nobody cancels");
    }

    /// Computes the ratio with the objects, as a stage of its own.
    pub fn ratio(&self, caster: &Caster, stage: Stage, on_event: OnEvent<'_>) -> Result<ShadowRatio<'_>, Cancelled> {
        let (width, height) = (self.receivers.width(), self.receivers.height());
        stage_of_steps(on_event, stage.clone(), |on_event| {
            let all = Image::new(width, height, vec![true; width * height]);
            let unknown = Image::new(width, height, vec![Vec3::ONE; width * height]);
            self.ratio_where(&all, unknown, caster, &mut Batches::new(on_event, stage, 2 * height))
        })
    }

    /// Computes the ratio where a coarser one is not smooth; elsewhere that one is interpolated.
    pub fn refined(
        &self,
        coarse: &ShadowRatio<'_>,
        caster: &Caster,
        stage: Stage,
        on_event: OnEvent<'_>,
    ) -> Result<ShadowRatio<'_>, Cancelled> {
        let (width, height) = (self.receivers.width(), self.receivers.height());
        stage_of_steps(on_event, stage.clone(), |on_event| {
            let place = |x: usize, y: usize| ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let rough = coarse.rough();
            let wanted =
                Image::from_fn(width, height, |x, y| rough[(x * rough.width() / width, y * rough.height() / height)]);
            let rows: Vec<Vec<Vec3>> = (0..height)
                .into_par_iter()
                .map(|y| {
                    let at = |x: usize| {
                        let (u, v) = place(x, y);
                        let seen = || self.receivers.surfaces[(x, y)].map(|surface| surface.position_m);
                        if wanted[(x, y)] { Vec3::ONE } else { coarse.for_photo(u, v, seen) }
                    };
                    (0..width).map(at).collect()
                })
                .collect();
            let interpolated = Image::new(width, height, rows.into_iter().flatten().collect());
            self.ratio_where(&wanted, interpolated, caster, &mut Batches::new(on_event, stage, 2 * height))
        })
    }

    /// Computes the ratio of the `wanted` pixels and replaces those of `ratio`.
    fn ratio_where(
        &self,
        wanted: &Image<bool>,
        mut ratio: Image<Vec3>,
        caster: &Caster,
        batches: &mut Batches<'_>,
    ) -> Result<ShadowRatio<'_>, Cancelled> {
        let (width, height) = (self.receivers.width(), self.receivers.height());
        let sampled = widened(wanted, |&wanted| wanted);
        let rows = batches.each(height, width * self.cones, 1, |rows| {
            rows.into_par_iter().map(|y| self.change_row(y, caster, &sampled)).collect::<Vec<_>>()
        })?;
        // Rows without samples are empty; these images are the largest of a rendering.
        let mut changes = Vec::with_capacity(width * height);
        for (y, row) in rows.into_iter().enumerate() {
            changes.extend(row);
            changes.resize((y + 1) * width, ShadowTerms::default());
        }
        let changes = Image::new(width, height, changes);
        let changed = widened(&changes, |change| *change != ShadowTerms::default());
        let needed = Image::from_fn(width, height, |x, y| wanted[(x, y)] && changed[(x, y)]);
        self.irradiance.complete(&self.receivers, caster.environment, &needed, batches)?;
        ratio.pixels_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, ratio) in row.iter_mut().enumerate().filter(|&(x, _)| needed[(x, y)]) {
                *ratio = self.filtered(&changes, x, y);
            }
        });
        Ok(ShadowRatio::new(&self.receivers, ratio))
    }

    /// Computes the changes of a row's `sampled` pixels, each by one pattern; empty without any.
    fn change_row(&self, y: usize, caster: &Caster, sampled: &Image<bool>) -> Vec<ShadowTerms> {
        let width = self.receivers.width();
        if !(0..width).any(|x| sampled[(x, y)]) {
            return Vec::new();
        }
        let mut changes = vec![ShadowTerms::default(); width];
        let (mut rays, mut ray_owners, mut shares) = (Vec::new(), Vec::new(), Vec::new());
        let mut near = Vec::new();
        for (x, change) in changes.iter_mut().enumerate().filter(|&(x, _)| sampled[(x, y)]) {
            let Some(surface) = self.receivers.surfaces[(x, y)] else { continue };
            let pattern = pattern_at(x, y);
            near.clear();
            let mut brightest = Vec3::ZERO;
            for (index, object) in caster.objects.iter().enumerate() {
                let Some(cap) = Cap::towards(object, &surface) else { continue };
                // Effects fade out where they are negligible; nothing is computed beyond.
                let share = cap.share(&surface);
                let strength = (share / self.negligible - 1.0).clamp(0.0, 1.0);
                if strength <= 0.0 {
                    continue;
                }
                let start = surface.position_m + surface.normal * (1e-3 * object.radius_m);
                let of_object = AffectingObject { object: index, start, strength };
                let hidden = self.hidden_room(caster, &surface, &of_object, &cap, pattern);
                brightest = brightest.max(hidden.ambient * (strength / hidden.form_factor.max(1e-6)));
                *change = *change + hidden * strength;
                near.push(of_object);
            }
            if near.is_empty() {
                continue;
            }
            change.brightest = change.ambient.max(brightest * change.form_factor);
            let lights = caster.environment.lights().subset(self.lights, pattern, PATTERNS);
            for (i, light) in lights.enumerate() {
                let Some(incidence) = light.on(surface.position_m) else { continue };
                let cosine = surface.normal.dot(incidence.direction);
                if cosine <= 0.0 {
                    continue;
                }
                // Each object takes its share of what the others leave.
                let (mut weight, mut left) = (Vec3::ZERO, Vec3::ONE);
                for &AffectingObject { object, start, strength } in &near {
                    let silhouettes = &caster.silhouettes[object];
                    let blocked = silhouettes.blocked(pattern, i, surface.position_m).unwrap_or_else(|| {
                        let ray = Ray { origin: start, direction: incidence.direction };
                        let placed = &caster.objects[object];
                        if placed.blocks(&ray, incidence.distance_m) {
                            Vec3::ONE
                        } else {
                            Vec3::ONE - placed.passed(&ray, incidence.distance_m).share
                        }
                    });
                    weight += cosine * strength * blocked * left;
                    left *= Vec3::ONE - strength * blocked;
                }
                if weight != Vec3::ZERO {
                    let apex = surface.position_m + surface.normal * caster.environment.lift_m;
                    let Incidence { direction, distance_m, .. } = incidence;
                    rays.push(LightRay { place: surface.position_m, apex, direction, distance_m });
                    ray_owners.push((x, incidence.irradiance * weight));
                }
            }
        }
        caster.environment.unoccluded_share(&rays, &mut shares);
        for ((x, irradiance), share) in ray_owners.into_iter().zip(&shares) {
            changes[x].lights += irradiance * *share;
        }
        changes
    }

    /// Computes the change by one object without that of the light samples.
    fn hidden_room(
        &self,
        caster: &Caster,
        surface: &Surface,
        near: &AffectingObject,
        cap: &Cap,
        pattern: usize,
    ) -> ShadowTerms {
        let &AffectingObject { object, start, .. } = near;
        // A few directions in a small cap have a small error. The last one counts in part, so that nothing jumps when
        // their number changes.
        let cones = self.cones as f32;
        let count = (cones * 2.0 * cap.share(surface)).clamp(0.25 * cones, cones);
        let solid_angle = cap.solid_angle_sr() / count;
        let mut change = ShadowTerms::default();
        for (i, direction) in cap.directions(count.ceil() as usize, pattern, surface.normal).enumerate() {
            let cosine = surface.normal.dot(direction);
            if cosine <= 0.0 {
                continue;
            }
            let ray = Ray { origin: start, direction };
            let weight = cosine * solid_angle * (count - i as f32).min(1.0);
            let placed = &caster.objects[object];
            let (hidden, given) = match caster.radiosity {
                Some(radiosity) => match caster.objects.closest_of(object, &ray) {
                    Some(hit) => {
                        let passed = placed.passed(&ray, hit.distance_m).share;
                        (Vec3::ONE, radiosity[object].radiance(placed, &ray, &hit) * passed)
                    }
                    None => self.hidden_by_glass(caster, object, &ray),
                },
                None if caster.objects.blocked_by(object, &ray) => (Vec3::ONE, Vec3::ZERO),
                None => self.hidden_by_glass(caster, object, &ray),
            };
            if hidden == Vec3::ZERO {
                continue;
            }
            let seen = caster.backdrops[object].radiance(start, direction);
            let (ambient, given) = (seen * hidden * weight, given * weight);
            let form_factor = weight / PI * hidden.element_sum() / 3.0;
            change = change + ShadowTerms { ambient, given, form_factor, ..ShadowTerms::default() };
        }
        change
    }

    /// Returns the share of the room behind an object that its glass hides along a ray, and the radiance that it
    /// reflects instead.
    fn hidden_by_glass(&self, caster: &Caster, object: usize, ray: &Ray) -> (Vec3, Vec3) {
        let Some(hit) = caster.objects.glass_of(object, ray) else { return (Vec3::ZERO, Vec3::ZERO) };
        let placed = &caster.objects[object];
        let passed = placed.passed(ray, f32::INFINITY);
        let normal = placed.triangle_normal(hit.triangle);
        let mirrored = ray.direction - 2.0 * normal.dot(ray.direction) * normal;
        let reflected = caster.backdrops[object].radiance(ray.at(hit.distance_m), mirrored);
        (Vec3::ONE - passed.share, reflected * (1.0 - passed.clear))
    }

    /// Computes the ratio from the mean change over the neighbourhood.
    fn filtered(&self, changes: &Image<ShadowTerms>, x: usize, y: usize) -> Vec3 {
        let Some(lit) = self.irradiance.at(y * self.receivers.width() + x) else { return Vec3::ONE };
        let (change, total) = self.receivers.filtered(changes, x, y);
        if change == ShadowTerms::default() {
            return Vec3::ONE;
        }
        let ratio = (change * (1.0 / total)).ratio(&lit).min(Vec3::splat(16.0));
        Vec3::ONE + (ratio - 1.0) * self.receivers.trust[(x, y)]
    }
}

/// Returns whether the 5 × 5 window around each pixel has one that is `set`.
fn widened<T>(image: &Image<T>, set: impl Fn(&T) -> bool) -> Image<bool> {
    let (width, height) = (image.width(), image.height());
    let along_x =
        Image::from_fn(width, height, |x, y| (x.saturating_sub(2)..(x + 3).min(width)).any(|px| set(&image[(px, y)])));
    Image::from_fn(width, height, |x, y| (y.saturating_sub(2)..(y + 3).min(height)).any(|py| along_x[(x, py)]))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn colour(max: f32) -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(0.0..max).prop_map(Vec3::from)
    }

    fn change() -> impl Strategy<Value = ShadowTerms> {
        (colour(5.0), colour(20.0), colour(2.0), 0.0f32..1.0).prop_map(|(ambient, lights, given, form_factor)| {
            ShadowTerms { ambient, brightest: ambient, lights, given, form_factor }
        })
    }

    fn lit() -> impl Strategy<Value = SurfaceIrradiance> {
        (colour(5.0), colour(20.0), colour(10.0)).prop_map(|(ambient, lights, least)| SurfaceIrradiance {
            ambient,
            lights,
            least,
        })
    }

    proptest! {
        /// Whatever light is known, the result is between fully lit and the ambient light that passes the object.
        #[test]
        fn receivers_stay_between_lit_and_ambient(change in change(), lit in lit()) {
            let ratio = ShadowTerms { given: Vec3::ZERO, ..change }.ratio(&lit);
            let past = (1.0 - change.form_factor) / (1.0 + (lo_lights::CAP - 1.0) * change.form_factor);
            for c in 0..3 {
                let lights = lit.lights[c].max(change.lights[c]);
                // At least the light seen past the object remains beside the lights.
                let ambient = lit.ambient[c].max(lit.least[c] - lights).max(change.ambient[c] / (1.0 - past).max(1e-3));
                let least = past * ambient / (ambient + lights).max(1e-9);
                prop_assert!(ratio[c] <= 1.0 + 1e-5 && ratio[c] >= least - 1e-4, "{ratio} {least}");
            }
            prop_assert!(change.ratio(&lit).cmpge(ratio).all(), "bounced light only adds");
        }

        /// If all light is known, the ratio is (E − Δ) / E.
        #[test]
        fn known_light_is_subtracted(lit in lit(), hidden in 0.0f32..0.99, blocked in 0.0f32..1.0, given in colour(1.0)) {
            let lit = SurfaceIrradiance { ambient: lit.ambient + 0.01, least: Vec3::ZERO, ..lit };
            // As bright as the mean where it is hidden.
            let ambient = lit.ambient * hidden;
            let change = ShadowTerms { ambient, brightest: ambient, lights: lit.lights * blocked, given, form_factor: hidden };
            let all = lit.ambient + lit.lights;
            let expected = (all - change.ambient - change.lights + given) / all;
            prop_assert!((change.ratio(&lit) - expected).abs().max_element() < 1e-3);
        }

        /// White light leaves no coloured fringe, however much of it is missing.
        #[test]
        fn white_light_gives_grey_shadows(values in prop::array::uniform6(0.0f32..10.0), form_factor in 0.0f32..1.0) {
            let [ambient, lights, least, hidden, blocked, given] = values.map(Vec3::splat);
            let change = ShadowTerms { ambient: hidden, brightest: hidden, lights: blocked, given, form_factor };
            let ratio = change.ratio(&SurfaceIrradiance { ambient, lights, least });
            prop_assert!(ratio.max_element() - ratio.min_element() < 1e-5);
        }
    }
}
