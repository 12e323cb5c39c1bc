//! The object's mirror image on the surface that carries it, where that is glossy.

use lo_bsdf::{DIELECTRIC_F0, Ggx, fresnel};
use lo_cone::Cone;
use lo_geometry::{Camera, Mat3, Plane, Ray, Vec3};
use lo_imaging::Image;
use rayon::prelude::*;

use crate::environment::{Environment, Part};
use crate::object::Object;
use crate::occluders::Occluders;
use crate::pattern::hammersley;
use crate::radiosity::Radiosity;

/// Most of a pixel's radiance that can be the reflection which the object hides.
const MAX_REFLECTED: f32 = 0.8;

/// A reading this many times its depth's error from the plane belongs to something else.
const ON_PLANE: f32 = 3.0;

/// A polished, clear coat on a plane: a dielectric of index 1.5.
pub(crate) struct Gloss<'a> {
    pub object: &'a Object<'a>,
    pub environment: &'a Environment,
    pub radiosity: &'a Radiosity,
    pub occluders: &'a Occluders,
    /// In pixels of the photo.
    pub camera: Camera,
    pub plane: Plane,
    /// Perceptual roughness.
    pub roughness: f32,
    /// Directions for each pixel.
    pub samples: usize,
}

impl Gloss<'_> {
    /// Radiance that the reflection adds to each pixel of the photo, which sees `seen` there: the object's less what was mirrored in its place.
    /// Zero where the plane is not seen or does not mirror the object.
    pub fn reflection(&self, seen: impl Fn((usize, usize)) -> Vec3 + Sync) -> Image<Vec3> {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let rows: Vec<Vec<Vec3>> = (0..height)
            .into_par_iter()
            .map(|y| {
                let (mut row, mut cones, mut owners) = (vec![Vec3::ZERO; width], Vec::new(), Vec::new());
                for (x, pixel) in row.iter_mut().enumerate() {
                    self.pixel((x, y), pixel, &mut cones, &mut owners);
                }
                let (mut samples, mut hidden) = (Vec::new(), vec![Vec3::ZERO; width]);
                self.environment.gather(Part::Whole, &cones, &mut samples);
                for ((x, weight), sample) in owners.into_iter().zip(&samples) {
                    hidden[x] += Vec3::from(sample.radiance) * weight;
                }
                for (x, (pixel, hidden)) in row.iter_mut().zip(hidden).enumerate() {
                    if hidden != Vec3::ZERO {
                        *pixel -= hidden.min(seen((x, y)) * MAX_REFLECTED);
                    }
                }
                row
            })
            .collect();
        Image::new(width, height, rows.into_iter().flatten().collect())
    }

    /// Adds the object's part to a pixel, and asks for what it hides.
    fn pixel(&self, (x, y): (usize, usize), sum: &mut Vec3, cones: &mut Vec<Cone>, owners: &mut Vec<(usize, Vec3)>) {
        let (u, v) = (x as f64 + 0.5, y as f64 + 0.5);
        let eye = Ray { origin: Vec3::ZERO, direction: self.camera.direction(u, v) };
        let Some(distance_m) = self.plane.intersect(&eye) else { return };
        let (point, normal, view) = (eye.at(distance_m), self.plane.normal, -eye.direction);
        let n_dot_v = normal.dot(view);
        if n_dot_v <= 0.0 || !self.may_mirror(point, eye.direction) {
            return;
        }
        let (width, height) = (f64::from(self.camera.width), f64::from(self.camera.height));
        let on_plane = self.occluders.at(u / width, v / height).is_some_and(|surface| {
            self.plane.signed_distance_m(surface.position_m).abs()
                < ON_PLANE * self.occluders.bias_m(-surface.position_m.z)
        });
        if !on_plane {
            return;
        }
        let tangent = (view - normal * n_dot_v).normalize_or(normal.any_orthonormal_vector());
        let frame = Mat3::from_cols(tangent, normal.cross(tangent), normal);
        let local_view = Vec3::new((1.0 - n_dot_v * n_dot_v).max(0.0).sqrt(), 0.0, n_dot_v);
        let ggx = Ggx::from_roughness(self.roughness);
        let origin = point + normal * (1e-3 * self.object.radius_m);
        for i in 0..self.samples {
            let sample = ggx.sample(local_view, hammersley(i, self.samples));
            let ray = Ray { origin, direction: frame * sample.light };
            let Some(hit) = self.object.closest(&ray, f32::INFINITY).filter(|_| sample.weight > 0.0) else { continue };
            let weight = fresnel(Vec3::splat(DIELECTRIC_F0), sample.v_dot_h) * sample.weight / self.samples as f32;
            let footprint_m = (distance_m + hit.distance_m) * self.camera.pixel_angle_rad();
            *sum += self.radiosity.radiance_of(self.object, &self.object.surface(&ray, &hit, footprint_m)) * weight;
            let solid_angle = 1.0 / (self.samples as f32 * sample.pdf_per_sr);
            let tan_half_angle = (solid_angle / std::f32::consts::PI).sqrt().clamp(1e-3, 0.5);
            let origin = self.environment.lifted(point, Some(self.plane));
            cones.push(Cone { origin, direction: ray.direction, tan_half_angle });
            owners.push((x, weight));
        }
    }

    /// Whether the mirrored ray, spread by the roughness, comes near the object.
    fn may_mirror(&self, point: Vec3, direction: Vec3) -> bool {
        let normal = self.plane.normal;
        let mirrored = direction - 2.0 * direction.dot(normal) * normal;
        let offset = self.object.centre_m - point;
        let along_m = offset.dot(mirrored).max(0.0);
        let spread = 2.0 * self.roughness * self.roughness;
        (offset - mirrored * along_m).length() < self.object.radius_m + spread * offset.length()
    }
}
