//! Light from lamps outside the view, by energy balance.

use lo_geometry::{Vec3, cosine_hemisphere, orthonormal_basis};
use lo_imaging::luminance;
use lo_scene::Surfel;

use crate::extrapolate::Faces;
use crate::layout::{RoomBox, area};
use crate::visibility::CameraViews;
use crate::warning::CompletionWarning;

/// Mean albedo of the contents of a furnished room.
const MEAN_ALBEDO: f32 = 0.5;

/// Albedo of the brightest diffuse objects of a photo: paper, white paint.
const WHITE_ALBEDO: f32 = 0.85;

/// Number of points at which the balance is evaluated.
const RECEIVERS: usize = 96;

/// Assumed position of objects, as a share of the way from the camera to the observed surface.
pub(crate) const OBJECT_SHARE: f32 = 0.6;

/// Greatest irradiance of an upward-facing object there, as a multiple of the irradiance implied by the observed
/// surfaces. Below a ceiling lamp it gets more light than walls.
pub(crate) const MAX_LIGHT: f32 = 2.0;

/// Rays per point.
const RAYS: usize = 256;

/// Size of the light patch in the middle of the ceiling, as a share of both sides.
const PATCH_SHARE: f32 = 0.6;

/// Energy balance; all irradiances in units of radiance × sr.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LampReport {
    /// Irradiance implied by the brightness of the observed surfaces.
    pub implied_irradiance: f32,
    /// Irradiance of these surfaces without the lamp.
    pub other_irradiance: f32,
    /// Radiance in the middle of the lamp patch; 0 if no lamp is needed.
    pub lamp_radiance: f32,
}

impl LampReport {
    /// Returns the warning about an assumed lamp.
    pub fn warning(&self) -> Option<CompletionWarning> {
        (self.lamp_radiance > 0.0).then_some(CompletionWarning::AssumedLamp { radiance: self.lamp_radiance })
    }
}

/// Adds a soft, neutral patch of light to the unobserved part of the ceiling, so that observed surfaces receive as much
/// light as their brightness implies.
///
/// A diffuse surface of albedo ρ and radiance L receives E = π L / ρ. The albedo is unknown, so E is the geometric mean
/// of two estimates: the mean observed radiance with a mean albedo of 0.5, and the 95th percentile of radiance (white
/// objects, below the clipping level) with albedo 0.85.
///
/// The patch, the middle 60 % × 60 % of the ceiling, supplies the part of E that the shell (with observed and restored
/// lamps and windows) does not. An upward-facing surface in the middle of the view must not get more than [`MAX_LIGHT`]
/// E: walls see little of a ceiling and would imply lamps that are far too bright below them. Lower limits give half of
/// the light in a room with one ceiling lamp (`tests/it/shell.rs`, `docs/design/029-shell-lamp.md`).
///
/// External check: on 154 crops of 11 HDR panoramas of real interiors the mean radiance of the whole sphere is 2.4 ×
/// that of the clipped crop (quartiles 1.7 and 3.8). This estimate gives 2.4 × where white is 2.5 × the mean. Rays read
/// the photo where the camera sees the same point, and the extrapolated faces elsewhere.
pub(crate) fn add(faces: &mut Faces, room: &RoomBox, surfels: &[Surfel], views: &CameraViews) -> LampReport {
    let Some(implied_irradiance) = implied_irradiance(surfels) else { return LampReport::default() };
    let stride = surfels.len().div_ceil(RECEIVERS).max(1);
    let chosen = || surfels.iter().skip(stride / 2).step_by(stride);
    let balance = |receivers: &mut dyn Iterator<Item = Surfel>| balance(receivers, faces, room, views);
    let (Some(seen), Some(objects)) =
        (balance(&mut chosen().copied()), balance(&mut chosen().map(|seen| object_surfel(seen, room.inward(2)))))
    else {
        return LampReport::default();
    };
    // Where the receivers see hardly any of the patch, its radiance would be unreliable.
    let asked = (implied_irradiance - seen.other) / seen.patch.max(0.03);
    let bearable = (MAX_LIGHT * implied_irradiance - objects.other) / objects.patch.max(0.03);
    let lamp_radiance = asked.min(bearable).clamp(0.0, 50.0 * implied_irradiance);
    if lamp_radiance > 0.0 {
        faces.grids[3].brighten(|at| {
            let local = Faces::local(room, 3, at);
            let open = views.seen(room.world(local)).is_none();
            [if open { lamp_radiance * patch_weight(room, local) } else { 0.0 }; 3]
        });
    }
    LampReport { implied_irradiance, other_irradiance: seen.other, lamp_radiance }
}

/// Mean irradiance of points.
struct Irradiance {
    /// From the room without the patch.
    other: f32,
    /// From a patch of radiance 1.
    patch: f32,
}

fn balance(
    receivers: &mut dyn Iterator<Item = Surfel>,
    faces: &Faces,
    room: &RoomBox,
    views: &CameraViews,
) -> Option<Irradiance> {
    let directions = cosine_hemisphere(RAYS);
    let (mut other_sum, mut patch_sum, mut weights) = (0.0f32, 0.0f32, 0.0f32);
    for receiver in receivers {
        let basis = orthonormal_basis(receiver.normal);
        let origin = room.local(receiver.position_m + 0.02 * receiver.normal).clamp(room.low, room.high);
        let (mut light, mut patch) = (0.0, 0.0);
        for direction in &directions {
            let (face, hit) = room.exit(origin, room.local(basis * *direction));
            let seen = views.seen(room.world(hit));
            let radiance = seen.unwrap_or_else(|| faces.radiance(room, face, hit));
            light += luminance(radiance);
            if face == 3 && seen.is_none() {
                patch += patch_weight(room, hit);
            }
        }
        let weight = area(&receiver);
        let scale = std::f32::consts::PI / RAYS as f32 * weight;
        other_sum += light * scale;
        patch_sum += patch * scale;
        weights += weight;
    }
    (weights > 0.0).then(|| Irradiance { other: other_sum / weights, patch: patch_sum / weights })
}

/// Returns an upward-facing surfel on the way from a camera to an observed surfel.
pub(crate) fn object_surfel(seen: &Surfel, up: Vec3) -> Surfel {
    let position_m = seen.eye_m + OBJECT_SHARE * (seen.position_m - seen.eye_m);
    Surfel { position_m, normal: up, depth_m: OBJECT_SHARE * seen.depth_m, ..*seen }
}

/// Returns the irradiance implied by the brightness of the observed surfaces.
pub(crate) fn implied_irradiance(surfels: &[Surfel]) -> Option<f32> {
    let mut values: Vec<f32> = surfels.iter().map(|s| luminance(s.radiance)).collect();
    if values.is_empty() {
        return None;
    }
    let rank = (values.len() * 95 / 100).min(values.len() - 1);
    let white = *values.select_nth_unstable_by(rank, f32::total_cmp).1;
    // Lamps and windows are brighter than the surfaces that they light.
    let limit = 2.0 * white;
    let (mut sum, mut total) = (0.0, 0.0);
    for surfel in surfels {
        let value = luminance(surfel.radiance);
        if value <= limit {
            sum += area(surfel) * value;
            total += area(surfel);
        }
    }
    let mean = sum / total.max(1e-12);
    Some(std::f32::consts::PI * ((mean / MEAN_ALBEDO) * (white / WHITE_ALBEDO)).sqrt())
}

/// Returns 1 in the middle of the patch, falling to 0 at its edges.
fn patch_weight(room: &RoomBox, local: Vec3) -> f32 {
    let centre = 0.5 * (room.low + room.high);
    let half = 0.5 * PATCH_SHARE * (room.high - room.low);
    let soft = |d: f32, half: f32| ((half - d.abs()) / (0.25 * half)).clamp(0.0, 1.0);
    soft(local.x - centre.x, half.x) * soft(local.z - centre.z, half.z)
}
