//! Rays through glass: refraction and reflection at each boundary (Snell, Fresnel), absorption inside (Beer).

use lo_bsdf::{Ggx, dielectric_reflectance, refracted};
use lo_geometry::{Mat3, Ray, Vec2, Vec3};
use lo_mesh::{SurfacePoint, Volume};

use crate::objects::glass::{Sight, sight, transmission};
use crate::objects::tracing::{ObjectHit, Objects};

/// Boundaries that a ray crosses at most.
const MAX_BOUNDARIES: usize = 16;

/// Smallest share of a ray that is followed beside the larger part of it.
const MIN_SHARE: f32 = 0.03;

/// Parts into which a ray is divided at most.
const MAX_PARTS: usize = 4;

/// Distance from a surface at which the next part of a ray starts, as a share of the object's radius.
const START: f32 = 2e-4;

/// GGX α below which a surface is smooth.
const SMOOTH_ALPHA: f32 = 0.002;

/// Step of the pattern of microfacets from one boundary to the next (R₂ sequence, Roberts 2018).
const NEXT_BOUNDARY: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);

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
    /// Half-angle tangent by which the roughness of the glass widens it.
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
pub(crate) struct RefractedRays<'a> {
    pub objects: &'a Objects<'a>,
    /// Number of rays that together sample rough glass.
    pub count: usize,
}

impl RefractedRays<'_> {
    /// Adds the ends of the ray that enters glass at a surface point that the camera sees from `view`, in order of
    /// their shares. They add up to what is not reflected there, apart from the glass's colour.
    ///
    /// `microfacet` in [0, 1)² chooses one of rough glass.
    pub fn enter(&self, object: usize, point: &SurfacePoint, view: Vec3, microfacet: Vec2, ends: &mut Vec<RayEnd>) {
        let normal = self.microfacet(point, view, microfacet);
        let (direction, inside) = passed_direction(point, -view, normal);
        let tint = Vec3::from(point.base_color);
        let part = Part {
            ray: self.start(object, point, direction, -point.geometric_normal),
            object,
            inside,
            share: if point.is_front || point.volume.is_none() { tint } else { Vec3::ONE },
            clear: 1.0,
            spread: self.spread(point),
            boundaries: 1,
        };
        self.follow(part, microfacet, ends);
    }

    /// Adds the ends of a ray that starts at an object, in order of their shares.
    pub fn from_surface(&self, object: usize, ray: Ray, ends: &mut Vec<RayEnd>) {
        let part = Part { ray, object, inside: None, share: Vec3::ONE, clear: 1.0, spread: 0.0, boundaries: 0 };
        self.follow(part, Vec2::splat(0.5), ends);
    }

    fn follow(&self, first: Part, microfacet: Vec2, ends: &mut Vec<RayEnd>) {
        let begin = ends.len();
        let mut parts = vec![first];
        let (mut kept, mut divided) = (0.0, 1);
        while let Some(part) = parts.pop() {
            let Part { ray, object, share, spread, .. } = part;
            let Some(met) = self.objects.first(&ray) else {
                kept += part.clear;
                ends.push(RayEnd { ray, object, met: None, share, spread });
                continue;
            };
            let point = self.objects[met.object].surface(&ray, &met.hit, 0.0);
            let distance_m = met.hit.distance_m;
            let absorbed = part.inside.map_or(Vec3::ONE, |volume| Vec3::from(volume.transmittance(distance_m)));
            let share = share * absorbed;
            let through = if sight(&point) == Sight::Opaque { 0.0 } else { transmission(&point) };
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
            self.divide(crossing, &point, &met, microfacet, &mut divided, &mut parts);
        }
        // What was not followed is like the rest.
        let lost = if kept > 1e-3 { first.clear / kept } else { 0.0 };
        ends[begin..].iter_mut().for_each(|end| end.share *= lost);
        ends[begin..].sort_by(|a, b| b.share.element_sum().total_cmp(&a.share.element_sum()));
    }

    /// Adds the parts of a ray that a boundary lets pass and reflects.
    fn divide(
        &self,
        part: Part,
        point: &SurfacePoint,
        met: &ObjectHit,
        microfacet: Vec2,
        divided: &mut usize,
        parts: &mut Vec<Part>,
    ) {
        let (object, direction) = (met.object, part.ray.direction);
        let spread = part.spread.max(self.spread(point));
        let next = |ray, inside, factor: f32, tint: Vec3| Part {
            ray,
            object,
            inside,
            share: part.share * factor * tint,
            clear: part.clear * factor,
            spread,
            boundaries: part.boundaries + 1,
        };
        if sight(point) == Sight::Opaque {
            // A hole in a mask.
            parts.push(next(
                self.start(object, point, direction, -point.geometric_normal),
                part.inside,
                1.0,
                Vec3::ONE,
            ));
            return;
        }
        let place = (microfacet + part.boundaries as f32 * NEXT_BOUNDARY).fract();
        let normal = self.microfacet(point, -direction, place);
        let eta = eta(point);
        let reflected = match point.volume {
            Some(_) => dielectric_reflectance(-normal.dot(direction), eta),
            None => dielectric_reflectance(-normal.dot(direction), point.ior),
        };
        let (passed, inside) = passed_direction(point, direction, normal);
        let tint = if point.is_front || point.volume.is_none() { Vec3::from(point.base_color) } else { Vec3::ONE };
        let mirrored = direction - 2.0 * normal.dot(direction) * normal;
        let mirrored =
            next(self.start(object, point, mirrored, point.geometric_normal), part.inside, reflected, Vec3::ONE);
        let passed = next(self.start(object, point, passed, -point.geometric_normal), inside, 1.0 - reflected, tint);
        let (major, minor) = if reflected > 0.5 { (mirrored, passed) } else { (passed, mirrored) };
        if minor.clear >= MIN_SHARE && *divided < MAX_PARTS {
            *divided += 1;
            parts.push(minor);
        }
        parts.push(major);
    }

    /// Returns a ray from just beside a surface point, on the side of `side`, in `direction`, which is kept on that
    /// side.
    fn start(&self, object: usize, point: &SurfacePoint, direction: Vec3, side: Vec3) -> Ray {
        let above = side.dot(direction);
        let direction = if above > 1e-3 { direction } else { (direction + side * (1e-3 - above)).normalize_or(side) };
        Ray { origin: point.position + side * (START * self.objects[object].radius_m), direction }
    }

    /// Returns the normal of one of the microfacets that are visible from `view`.
    fn microfacet(&self, point: &SurfacePoint, view: Vec3, place: Vec2) -> Vec3 {
        let (normal, ggx) = (point.shading_normal, Ggx::from_roughness(point.roughness));
        if ggx.alpha() < SMOOTH_ALPHA {
            return normal;
        }
        let tangent = (view - normal * normal.dot(view)).normalize_or(normal.any_orthonormal_vector());
        let frame = Mat3::from_cols(tangent, normal.cross(tangent), normal);
        let cosine = normal.dot(view).clamp(lo_bsdf::MIN_COSINE, 1.0);
        let local = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
        frame * (ggx.sample(local, place).light + local).normalize_or(Vec3::Z)
    }

    /// Returns the half-angle tangent of one of the rays that together sample a rough surface.
    fn spread(&self, point: &SurfacePoint) -> f32 {
        let alpha = Ggx::from_roughness(point.roughness).alpha();
        if alpha < SMOOTH_ALPHA { 0.0 } else { alpha / (self.count as f32).sqrt() }
    }
}

/// Returns the index of refraction beyond a solid's boundary divided by that before it.
fn eta(point: &SurfacePoint) -> f32 {
    if point.is_front { point.ior } else { point.ior.recip() }
}

/// Returns the direction in which a ray passes a surface, and the interior that it is in afterwards. Under total
/// reflection, the direction is unchanged.
fn passed_direction(point: &SurfacePoint, direction: Vec3, normal: Vec3) -> (Vec3, Option<Volume>) {
    match point.volume {
        Some(volume) => {
            let passed = refracted(direction, normal, eta(point)).unwrap_or(direction);
            (passed, point.is_front.then_some(volume))
        }
        None => {
            // As wide as the reflection by the same microfacets, on the other side.
            let mirrored = direction - 2.0 * normal.dot(direction) * normal;
            let passed = mirrored - 2.0 * point.shading_normal.dot(mirrored) * point.shading_normal;
            (passed, None)
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_mesh::{Material, Model, PreparedModel};

    use super::*;
    use crate::{Instance, Placement};

    fn ends(material: Material, place: Vec2) -> Vec<RayEnd> {
        let model = PreparedModel::new(Model::sphere(0.4, 6, material).unwrap());
        let position_m = Vec3::new(0.0, -0.4, -2.0);
        let placement = Placement { position_m, scale: 1.0, yaw_rad: 0.0, up: Vec3::Y, support: None };
        let objects = Objects::new(&[Instance::new(&model, placement)]).unwrap();
        let ray = Ray { origin: Vec3::ZERO, direction: Vec3::new(place.x, place.y, -2.0).normalize() };
        let met = objects.seen(&ray, 0.0).unwrap();
        let point = objects[0].surface(&ray, &met.hit, 0.0);
        let mut ends = Vec::new();
        RefractedRays { objects: &objects, count: 1 }.enter(0, &point, -ray.direction, Vec2::splat(0.5), &mut ends);
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
        for place in [Vec2::ZERO, Vec2::new(0.2, 0.1), Vec2::new(-0.1, 0.38)] {
            for ior in [1.0, 1.3, 1.5, 2.4] {
                let sum: Vec3 = ends(glass(ior, Volume::CLEAR), place).iter().map(|end| end.share).sum();
                assert!((sum - 1.0).abs().max_element() < 1e-5, "{place}, {ior}: {sum}");
            }
        }
    }

    #[test]
    fn interiors_absorb_along_the_path() {
        let volume = Volume { attenuation_color: [0.5, 0.9, 0.25], attenuation_distance_m: 0.4 };
        let found = ends(glass(1.0, volume), Vec2::ZERO);
        assert_eq!(found.len(), 1);
        let expected = Vec3::new(0.25, 0.81, 0.0625);
        assert!((found[0].share / expected - 1.0).abs().max_element() < 2e-3, "{}", found[0].share);
        assert!((found[0].ray.direction - Vec3::NEG_Z).length() < 1e-3);
    }
}
