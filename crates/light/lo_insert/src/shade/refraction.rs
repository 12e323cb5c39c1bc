//! Rays through glass: refraction and reflection at each boundary (Snell, Fresnel), absorption inside (Beer).
//!
//! Rough boundaries bend rays as smooth ones do and widen them.

use lo_bsdf::{Ggx, dielectric_reflectance, refracted};
use lo_geometry::{Ray, Vec3};
use lo_mesh::{SurfacePoint, Volume};

use crate::objects::glass::transmission;
use crate::objects::tracing::{ObjectHit, Objects};

/// Boundaries that a ray crosses at most.
const MAX_BOUNDARIES: usize = 16;

/// Smallest share of a ray that is followed beside the larger part of it.
const MIN_SHARE: f32 = 0.03;

/// Parts into which a ray is divided at most.
const MAX_PARTS: usize = 4;

/// GGX α below which a surface is smooth.
const SMOOTH_ALPHA: f32 = 0.002;

/// Half-angle of the cone that stands for microfacets tilted by α, as a multiple of the angle by which these turn a
/// ray.
const TURNS: f32 = 1.0;

/// The end of a ray through glass: it meets a surface that is no glass, or leaves the objects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayEnd {
    /// The last part of the ray.
    pub ray: Ray,
    /// The object that it comes from.
    pub object: usize,
    /// Surface that it meets.
    pub met: Option<ObjectHit>,
    /// Share of the ray's light, linear RGB.
    pub share: Vec3,
    /// Half-angle tangent of the cone to which the roughness of the glass widens it.
    pub spread: f32,
}

/// A part of a ray that is still to be followed.
#[derive(Clone, Copy)]
struct Part {
    ray: Ray,
    object: usize,
    inside: Option<Volume>,
    share: Vec3,
    /// The share without colours.
    clear: f32,
    spread: f32,
    boundaries: usize,
}

/// Rays through the objects' glass.
#[derive(Clone, Copy)]
pub(crate) struct RefractedRays<'a>(pub &'a Objects<'a>);

impl RefractedRays<'_> {
    /// Adds the ends of the ray that enters glass at a surface point that the camera sees from `view`, in order of
    /// their shares. They add up to what is not reflected there, apart from the glass's colour.
    pub fn enter(&self, object: usize, point: &SurfacePoint, view: Vec3, ends: &mut Vec<RayEnd>) {
        let whole = Part {
            ray: Ray { origin: point.position, direction: -view },
            object,
            inside: None,
            share: Vec3::ONE,
            clear: 1.0,
            spread: 0.0,
            boundaries: 0,
        };
        self.follow(self.passed(&whole, object, point, 1.0), ends);
    }

    /// Adds the ends of a ray that starts at an object, in order of their shares.
    pub fn leave(&self, object: usize, ray: Ray, ends: &mut Vec<RayEnd>) {
        let part = Part { ray, object, inside: None, share: Vec3::ONE, clear: 1.0, spread: 0.0, boundaries: 0 };
        self.follow(part, ends);
    }

    fn follow(&self, first: Part, ends: &mut Vec<RayEnd>) {
        let begin = ends.len();
        let mut parts = vec![first];
        let (mut kept, mut divided) = (0.0, 1);
        while let Some(part) = parts.pop() {
            let Part { ray, object, share, spread, .. } = part;
            let Some(met) = self.0.first(&ray) else {
                kept += part.clear;
                ends.push(RayEnd { ray, object, met: None, share, spread });
                continue;
            };
            let point = self.0[met.object].surface(&ray, &met.hit, 0.0);
            let distance_m = met.hit.distance_m;
            let absorbed = part.inside.map_or(Vec3::ONE, |volume| Vec3::from(volume.transmittance(distance_m)));
            let share = share * absorbed;
            let through = transmission(&point);
            if through < 1.0 && (through > 0.0 || point.alpha >= 0.5) {
                kept += part.clear * (1.0 - through);
                ends.push(RayEnd { ray, object, met: Some(met), share: share * (1.0 - through), spread });
                if through == 0.0 {
                    continue;
                }
            }
            let through = if through == 0.0 { 1.0 } else { through };
            if part.boundaries >= MAX_BOUNDARIES {
                // Caught in a thin wall: it leaves somewhere.
                kept += part.clear * through;
                ends.push(RayEnd { ray, object, met: None, share: share * through, spread });
                continue;
            }
            let crossing = Part { share: share * through, clear: part.clear * through, ..part };
            self.divide(crossing, met.object, &point, &mut divided, &mut parts);
        }
        // What was not followed is like the rest.
        let lost = if kept > 1e-3 { first.clear / kept } else { 0.0 };
        ends[begin..].iter_mut().for_each(|end| end.share *= lost);
        ends[begin..].sort_by(|a, b| b.share.element_sum().total_cmp(&a.share.element_sum()));
    }

    /// Adds the parts of a ray that a boundary lets pass and reflects.
    fn divide(&self, part: Part, object: usize, point: &SurfacePoint, divided: &mut usize, parts: &mut Vec<Part>) {
        let (direction, normal) = (part.ray.direction, point.shading_normal);
        if transmission(point) == 0.0 {
            // A hole in a mask.
            let ray = self.start(object, point, direction, -point.geometric_normal);
            parts.push(Part { ray, object, boundaries: part.boundaries + 1, ..part });
            return;
        }
        let eta = if point.volume.is_some() { eta(point) } else { point.ior };
        let reflected = dielectric_reflectance(-normal.dot(direction), eta);
        let mirrored = Part {
            ray: self.start(object, point, direction - 2.0 * normal.dot(direction) * normal, point.geometric_normal),
            object,
            share: part.share * reflected,
            clear: part.clear * reflected,
            spread: part.spread.hypot(turned(point, 2.0)),
            boundaries: part.boundaries + 1,
            ..part
        };
        let passed = self.passed(&part, object, point, 1.0 - reflected);
        let (major, minor) = if reflected > 0.5 { (mirrored, passed) } else { (passed, mirrored) };
        if minor.clear >= MIN_SHARE && *divided < MAX_PARTS {
            *divided += 1;
            parts.push(minor);
        }
        parts.push(major);
    }

    /// Returns the `factor` of a ray that passes a boundary.
    fn passed(&self, part: &Part, object: usize, point: &SurfacePoint, factor: f32) -> Part {
        let before = part.ray.direction;
        let (direction, inside, spread) = match point.volume {
            Some(volume) => {
                let eta = eta(point);
                let direction = refracted(before, point.shading_normal, eta).unwrap_or(before);
                // Near the normal, angles behind the boundary are 1 / η of those before it.
                let spread = (part.spread / eta).hypot(turned(point, (1.0 - 1.0 / eta).abs()));
                (direction, point.is_front.then_some(volume), spread)
            }
            // Of the two faces of a sheet.
            None => (before, None, part.spread.hypot(turned(point, 2.0 * (point.ior - 1.0)))),
        };
        let is_tinted = point.is_front || point.volume.is_none();
        let tint = if is_tinted { Vec3::from(point.base_color) } else { Vec3::ONE };
        Part {
            ray: self.start(object, point, direction, -point.geometric_normal),
            object,
            inside,
            share: part.share * factor * tint,
            clear: part.clear * factor,
            spread,
            boundaries: part.boundaries + 1,
        }
    }

    /// Returns a ray from just beside a surface point, on the side of `side`, in `direction`, which is kept on that
    /// side.
    fn start(&self, object: usize, point: &SurfacePoint, direction: Vec3, side: Vec3) -> Ray {
        let above = side.dot(direction);
        let direction = if above > 1e-3 { direction } else { (direction + side * (1e-3 - above)).normalize_or(side) };
        Ray { origin: self.0.ray_start(object, point.position, side), direction }
    }
}

/// Returns the index of refraction beyond a solid's boundary divided by that before it.
fn eta(point: &SurfacePoint) -> f32 {
    if point.is_front { point.ior } else { point.ior.recip() }
}

/// Returns the half-angle tangent of rays that microfacets turn by `times` their tilt.
fn turned(point: &SurfacePoint, times: f32) -> f32 {
    let alpha = Ggx::from_roughness(point.roughness).alpha();
    if alpha < SMOOTH_ALPHA { 0.0 } else { TURNS * times * alpha }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_mesh::{Material, Model, PreparedModel};

    use super::*;
    use crate::{Instance, Placement};

    fn ends(material: Material, place: [f32; 2]) -> Vec<RayEnd> {
        let model = PreparedModel::new(Model::sphere(0.4, 6, material).unwrap());
        let position_m = Vec3::new(0.0, -0.4, -2.0);
        let placement = Placement { position_m, scale: 1.0, yaw_rad: 0.0, up: Vec3::Y, support: None };
        let objects = Objects::new(&[Instance::new(&model, placement)]).unwrap();
        let ray = Ray { origin: Vec3::ZERO, direction: Vec3::new(place[0], place[1], -2.0).normalize() };
        let met = objects.seen(&ray, 0.0).unwrap();
        let point = objects[0].surface(&ray, &met.hit, 0.0);
        let mut ends = Vec::new();
        RefractedRays(&objects).enter(0, &point, -ray.direction, &mut ends);
        ends
    }

    fn glass(ior: f32, volume: Volume) -> Material {
        Material {
            base_color: [1.0; 4],
            roughness: 0.0,
            transmission: 1.0,
            volume: Some(volume),
            ior,
            double_sided: false,
            ..Material::default()
        }
    }

    #[test]
    fn shares_add_up_to_what_enters() {
        for place in [[0.0, 0.0], [0.2, 0.1], [-0.1, 0.38]] {
            for ior in [1.0, 1.3, 1.5, 2.4] {
                let sum: Vec3 = ends(glass(ior, Volume::CLEAR), place).iter().map(|end| end.share).sum();
                assert!((sum - 1.0).abs().max_element() < 1e-5, "{place:?}, {ior}: {sum}");
            }
        }
    }

    #[test]
    fn interiors_absorb_along_the_path() {
        let volume = Volume { attenuation_color: [0.5, 0.9, 0.25], attenuation_distance_m: 0.4 };
        let found = ends(glass(1.0, volume), [0.0, 0.0]);
        assert_eq!(found.len(), 1);
        let expected = Vec3::new(0.25, 0.81, 0.0625);
        assert!((found[0].share / expected - 1.0).abs().max_element() < 2e-3, "{}", found[0].share);
        assert!((found[0].ray.direction - Vec3::NEG_Z).length() < 1e-3);
    }
}
