//! Light from lamps outside of the view, by energy balance.

use lo_events::Warning;
use lo_geometry::{Vec3, cosine_hemisphere, orthonormal_basis};
use lo_imaging::luminance;
use lo_scene::Surfel;

use crate::extrapolate::Faces;
use crate::layout::{RoomBox, area};
use crate::visibility::Views;

/// Mean albedo of what is in a furnished room.
const MEAN_ALBEDO: f32 = 0.5;

/// Albedo of the brightest diffuse things of a photo: paper, white paint.
const WHITE_ALBEDO: f32 = 0.85;

/// Points at which the balance is drawn.
const RECEIVERS: usize = 96;

/// Objects stand at this share of the way from the camera to what is seen.
pub(crate) const OBJECT_SHARE: f32 = 0.6;

/// What lies there face up is lit at most by so many times what the seen surfaces ask for: below a lamp in the ceiling it gets more than walls.
pub(crate) const MAX_LIGHT: f32 = 2.0;

/// Rays per point.
const RAYS: usize = 256;

/// The patch of light covers the middle of the ceiling by this share along both sides.
const PATCH_SHARE: f32 = 0.6;

/// The energy balance, all irradiances in units of radiance × sr.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LampReport {
    /// Irradiance that the brightness of the seen surfaces asks for.
    pub wanted_irradiance: f32,
    /// Irradiance that they had without the lamp.
    pub other_irradiance: f32,
    /// Radiance in the middle of the lamp patch; 0 where none was needed.
    pub lamp_radiance: f32,
}

impl LampReport {
    /// What a user should know about it.
    pub fn warning(&self) -> Option<Warning> {
        (self.lamp_radiance > 0.0).then_some(Warning::AssumedLamp { radiance: self.lamp_radiance })
    }
}

/// Adds a soft, neutral patch of light to the unseen part of the ceiling so that seen surfaces are lit as brightly as they look.
///
/// A diffuse surface of albedo ρ and radiance L receives E = π L / ρ. The albedo is unknown, so E is the geometric mean of two estimates:
/// the mean radiance of everything seen with a mean albedo of 0.5, and the 95th percentile of radiance (white things, below the clipping level)
/// with albedo 0.85. What the shell (with seen and recovered lamps and windows in it) lacks of E comes from the patch, the middle
/// 60 % × 60 % of the ceiling, as long as what lies face up in the middle of the view does not get more than [`MAX_LIGHT`] E: walls
/// see little of a ceiling and would ask for lamps that are far too bright below them. Lower limits give half of the light in a room with one
/// lamp in its ceiling (`tests/it/shell.rs`, `docs/design/029-shell-lamp.md`). As a check from outside: on 154 crops of 11 HDR panoramas of real
/// interiors the mean radiance of the whole sphere is 2.4 × that of the clipped crop (quartiles 1.7 and 3.8), and this estimate says 2.4 × where
/// white is 2.5 × the mean. Rays see the photo where the camera sees the same place, the extrapolated faces elsewhere.
pub(crate) fn add(faces: &mut Faces, room: &RoomBox, surfels: &[Surfel], views: &Views) -> LampReport {
    let Some(wanted_irradiance) = wanted(surfels) else { return LampReport::default() };
    let stride = surfels.len().div_ceil(RECEIVERS).max(1);
    let receivers = || surfels.iter().skip(stride / 2).step_by(stride);
    let balance = |places: &mut dyn Iterator<Item = Surfel>| balance(places, faces, room, views);
    let (Some(seen), Some(standing)) =
        (balance(&mut receivers().copied()), balance(&mut receivers().map(|seen| standing(seen, room.inward(2)))))
    else {
        return LampReport::default();
    };
    // Where hardly anything of the patch is in sight of the receivers its radiance would be a wild guess.
    let asked = (wanted_irradiance - seen.other) / seen.patch.max(0.03);
    let bearable = (MAX_LIGHT * wanted_irradiance - standing.other) / standing.patch.max(0.03);
    let lamp_radiance = asked.min(bearable).clamp(0.0, 50.0 * wanted_irradiance);
    if lamp_radiance > 0.0 {
        faces.grids[3].brighten(|at| {
            let local = Faces::local(room, 3, at);
            let open = views.seen(room.world(local)).is_none();
            [if open { lamp_radiance * patch_weight(room, local) } else { 0.0 }; 3]
        });
    }
    LampReport { wanted_irradiance, other_irradiance: seen.other, lamp_radiance }
}

/// Mean irradiance of places.
struct Irradiance {
    /// By the room without the patch.
    other: f32,
    /// By a patch of radiance 1.
    patch: f32,
}

fn balance(
    places: &mut dyn Iterator<Item = Surfel>,
    faces: &Faces,
    room: &RoomBox,
    views: &Views,
) -> Option<Irradiance> {
    let directions = cosine_hemisphere(RAYS);
    let (mut other_sum, mut patch_sum, mut weights) = (0.0f32, 0.0f32, 0.0f32);
    for place in places {
        let basis = orthonormal_basis(place.normal);
        let origin = room.local(place.position_m + 0.02 * place.normal).clamp(room.low, room.high);
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
        let weight = area(&place);
        let scale = std::f32::consts::PI / RAYS as f32 * weight;
        other_sum += light * scale;
        patch_sum += patch * scale;
        weights += weight;
    }
    (weights > 0.0).then(|| Irradiance { other: other_sum / weights, patch: patch_sum / weights })
}

/// What would stand face up on the way from a camera to what it sees.
pub(crate) fn standing(seen: &Surfel, up: Vec3) -> Surfel {
    let position_m = seen.eye_m + OBJECT_SHARE * (seen.position_m - seen.eye_m);
    Surfel { position_m, normal: up, depth_m: OBJECT_SHARE * seen.depth_m, ..*seen }
}

/// Irradiance that the brightness of the seen surfaces asks for.
pub(crate) fn wanted(surfels: &[Surfel]) -> Option<f32> {
    let mut values: Vec<f32> = surfels.iter().map(|s| luminance(s.radiance)).collect();
    if values.is_empty() {
        return None;
    }
    let rank = (values.len() * 95 / 100).min(values.len() - 1);
    let white = *values.select_nth_unstable_by(rank, f32::total_cmp).1;
    // Lamps and windows are brighter than anything they light.
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

/// 1 in the middle of the patch, falling to 0 at its edges.
fn patch_weight(room: &RoomBox, local: Vec3) -> f32 {
    let centre = 0.5 * (room.low + room.high);
    let half = 0.5 * PATCH_SHARE * (room.high - room.low);
    let soft = |d: f32, half: f32| ((half - d.abs()) / (0.25 * half)).clamp(0.0, 1.0);
    soft(local.x - centre.x, half.x) * soft(local.z - centre.z, half.z)
}
