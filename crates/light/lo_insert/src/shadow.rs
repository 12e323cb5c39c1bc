//! Differential rendering (Debevec 1998): what the object takes from and gives to the light on real surfaces.
//!
//! For a real surface point with normal n, the photo's value is multiplied by
//! `(E − Δ) / E`, with the irradiance E of the room without the object (`irradiance`) and
//! `Δ = ∫ over the directions that meet the object of (what was seen there − what the object gives off) cos θ dω`, and the same
//! for the light samples that the object hides. What was seen there tells the [`Backdrop`].

use lo_events::{Cancelled, OnEvent, Stage, ignore, stage_of_steps};
use lo_geometry::{Ray, Vec3};
use lo_imaging::Image;
use rayon::prelude::*;

use crate::backdrop::Backdrop;
use crate::batches::Batches;
use crate::cap::Cap;
use crate::environment::Environment;
use crate::irradiance::RoomIrradiance;
use crate::object::Object;
use crate::quality::Counts;
use crate::radiosity::Radiosity;
use crate::receivers::{PATTERNS, Receivers, pattern_at};
use crate::shadow_ratio::ShadowRatio;
use crate::silhouette::Silhouettes;
use crate::surface::{Surface, SurfaceMap};

/// Real surfaces as receivers of shadow, with the light that they get without the object.
pub(crate) struct ShadowField {
    receivers: Receivers,
    irradiance: RoomIrradiance,
    cones: usize,
    lights: usize,
    /// Largest share of a receiver's hemisphere that is neglected.
    negligible: f32,
}

/// The object as real surfaces see it.
pub(crate) struct Caster<'a> {
    pub object: &'a Object<'a>,
    pub environment: &'a Environment,
    pub silhouettes: &'a Silhouettes,
    pub backdrop: &'a Backdrop,
    /// What the object gives off; nothing where it is not known.
    pub radiosity: Option<&'a Radiosity>,
}

impl ShadowField {
    pub fn new(map: SurfaceMap, counts: &Counts) -> Self {
        let receivers = Receivers::new(map);
        let (cones, lights) = (counts.background_cones, counts.background_lights);
        let irradiance = RoomIrradiance::new(&receivers, cones, lights);
        Self { receivers, irradiance, cones, lights, negligible: counts.negligible }
    }

    /// Computes the irradiance without the object of all pixels now, so that no frame has to.
    pub fn prepare(&self, environment: &Environment) {
        let (width, height) = (self.receivers.width(), self.receivers.height());
        let all = Image::new(width, height, vec![true; width * height]);
        let on_event: OnEvent<'_> = &mut ignore;
        let mut batches = Batches::new(on_event, Stage::CoarseShadow, height);
        self.irradiance.complete(&self.receivers, environment, &all, &mut batches).expect("nobody cancels");
    }

    /// The ratio with the object; a stage of its own.
    pub fn ratio(&self, caster: &Caster, stage: Stage, on_event: OnEvent<'_>) -> Result<ShadowRatio<'_>, Cancelled> {
        stage_of_steps(on_event, stage.clone(), |on_event| {
            self.ratio_in_batches(caster, &mut Batches::new(on_event, stage, 2 * self.receivers.height()))
        })
    }

    fn ratio_in_batches(&self, caster: &Caster, batches: &mut Batches<'_>) -> Result<ShadowRatio<'_>, Cancelled> {
        let (width, height) = (self.receivers.width(), self.receivers.height());
        let rows = batches.each(height, width * self.cones, 1, |rows| {
            rows.into_par_iter().map(|y| self.loss_row(y, caster)).collect::<Vec<_>>()
        })?;
        let loss = Image::new(width, height, rows.into_iter().flatten().collect());
        let needed = near_nonzero(&loss);
        self.irradiance.complete(&self.receivers, caster.environment, &needed, batches)?;
        let rows: Vec<Vec<Vec3>> = (0..height)
            .into_par_iter()
            .map(|y| (0..width).map(|x| if needed[(x, y)] { self.filtered(&loss, x, y) } else { Vec3::ONE }).collect())
            .collect();
        Ok(ShadowRatio::new(&self.receivers, Image::new(width, height, rows.into_iter().flatten().collect())))
    }

    /// Δ of a row of pixels, each by one pattern.
    fn loss_row(&self, y: usize, caster: &Caster) -> Vec<Vec3> {
        let width = self.receivers.width();
        let mut loss = vec![Vec3::ZERO; width];
        let (mut rays, mut ray_owners, mut shares) = (Vec::new(), Vec::new(), Vec::new());
        for (x, loss) in loss.iter_mut().enumerate() {
            let Some(surface) = self.receivers.surfaces[(x, y)] else { continue };
            let Some(cap) = Cap::towards(caster.object, &surface) else { continue };
            // Effects fade out where they are too small to be seen, and nothing is computed beyond.
            let share = cap.share(&surface);
            let strength = (share / self.negligible - 1.0).clamp(0.0, 1.0);
            if strength <= 0.0 {
                continue;
            }
            let pattern = pattern_at(x, y);
            let start = surface.position_m + surface.normal * (1e-3 * caster.object.radius_m);
            *loss = self.hidden_room(caster, &surface, start, &cap, pattern) * strength;
            let (lights, scale) = caster.environment.lights().subset(self.lights, pattern, PATTERNS);
            for (i, light) in lights.enumerate() {
                let Some(incidence) = light.on(surface.position_m) else { continue };
                let cosine = surface.normal.dot(incidence.direction);
                if cosine <= 0.0 {
                    continue;
                }
                let blocked = caster.silhouettes.blocked(pattern, i, surface.position_m).unwrap_or_else(|| {
                    let ray = Ray { origin: start, direction: incidence.direction };
                    if caster.object.blocks(&ray, incidence.distance_m) { 1.0 } else { 0.0 }
                });
                if blocked > 0.0 {
                    let apex = surface.position_m + surface.normal * caster.environment.lift_m;
                    rays.push((apex, incidence.direction, incidence.distance_m));
                    ray_owners.push((x, incidence.irradiance * (scale * cosine * strength * blocked)));
                }
            }
        }
        caster.environment.free_share(&rays, &mut shares);
        for ((x, irradiance), share) in ray_owners.into_iter().zip(&shares) {
            loss[x] += irradiance * *share;
        }
        loss
    }

    /// Irradiance that the object takes away without that of the light samples, less what it gives off.
    fn hidden_room(&self, caster: &Caster, surface: &Surface, start: Vec3, cap: &Cap, pattern: usize) -> Vec3 {
        // The error of a few directions in a small cap is small. The last one counts in part, so that nothing jumps where their
        // number changes.
        let cones = self.cones as f32;
        let count = (cones * 2.0 * cap.share(surface)).clamp(0.25 * cones, cones);
        let solid_angle = cap.solid_angle_sr() / count;
        let mut hidden = Vec3::ZERO;
        for (i, direction) in cap.directions(count.ceil() as usize, pattern, surface.normal).enumerate() {
            let cosine = surface.normal.dot(direction);
            if cosine <= 0.0 {
                continue;
            }
            let ray = Ray { origin: start, direction };
            let weight = cosine * solid_angle * (count - i as f32).min(1.0);
            let given = match caster.radiosity {
                Some(radiosity) => {
                    let Some(hit) = caster.object.closest(&ray, f32::INFINITY) else { continue };
                    radiosity.radiance(caster.object, &ray, &hit)
                }
                None if caster.object.blocks(&ray, f32::INFINITY) => Vec3::ZERO,
                None => continue,
            };
            hidden += (caster.backdrop.radiance(start, direction) - given) * weight;
        }
        hidden
    }

    /// `1 − Δ / E`, with Δ the mean over the neighbourhood.
    fn filtered(&self, loss: &Image<Vec3>, x: usize, y: usize) -> Vec3 {
        let Some(lit) = self.irradiance.at(y * self.receivers.width() + x) else { return Vec3::ONE };
        let (lost, total) = self.receivers.filtered(loss, x, y);
        if lost == Vec3::ZERO {
            return Vec3::ONE;
        }
        let ratio = |lost: f32, lit: f32| if lit > 1e-9 { (1.0 - lost / (total * lit)).clamp(0.0, 16.0) } else { 1.0 };
        Vec3::new(ratio(lost.x, lit.x), ratio(lost.y, lit.y), ratio(lost.z, lit.z))
    }
}

/// Where a 5 × 5 window holds anything but zero.
fn near_nonzero(loss: &Image<Vec3>) -> Image<bool> {
    let (width, height) = (loss.width(), loss.height());
    let along_x = Image::from_fn(width, height, |x, y| {
        (x.saturating_sub(2)..(x + 3).min(width)).any(|px| loss[(px, y)] != Vec3::ZERO)
    });
    Image::from_fn(width, height, |x, y| (y.saturating_sub(2)..(y + 3).min(height)).any(|py| along_x[(x, py)]))
}
