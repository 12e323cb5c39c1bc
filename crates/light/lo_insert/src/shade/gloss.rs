//! Reflection of the objects in glossy supporting surfaces.

use lo_bsdf::{DIELECTRIC_F0, Ggx, fresnel};
use lo_cone::Cone;
use lo_geometry::{Camera, Mat3, Plane, Ray, Vec3};
use lo_imaging::Image;
use rayon::prelude::*;

use crate::light::environment::Environment;
use crate::light::radiosity::Radiosity;
use crate::light::room_light::LightPart;
use crate::objects::tracing::Objects;
use crate::pattern::hammersley;
use crate::surface::occluders::Occluders;

/// Largest share of a pixel's radiance that can be the reflection hidden by the object.
const MAX_REFLECTED: f32 = 0.8;

/// Largest distance of a reading from its plane, as a multiple of the depth's error.
const ON_PLANE: f32 = 3.0;

/// A polished, clear coat on each supporting plane: a dielectric of index 1.5.
///
/// Objects on one surface have slightly different estimates of its plane. An object is mirrored in its own plane
/// wherever a pixel lies on that, so that it meets its reflection, and else in the plane nearest to the pixel's
/// reading.
pub(crate) struct Gloss<'a> {
    pub objects: &'a Objects<'a>,
    pub environment: &'a Environment,
    /// Radiosity of each object.
    pub radiosity: &'a [Radiosity],
    pub occluders: &'a Occluders,
    /// Camera in pixels of the photo.
    pub camera: Camera,
    /// Perceptual roughness.
    pub roughness: f32,
    /// Directions per pixel.
    pub samples: usize,
}

impl Gloss<'_> {
    /// Returns the radiance that the reflection adds to each pixel of the photo, which shows `seen` there: the
    /// objects' minus that of the reflection which they hide. It is zero where no plane is visible or none mirrors an
    /// object.
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
                self.environment.gather(LightPart::All, &cones, &mut samples);
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

    /// Adds the objects' reflection to a pixel, and requests cones to what they hide.
    fn pixel(&self, (x, y): (usize, usize), sum: &mut Vec3, cones: &mut Vec<Cone>, owners: &mut Vec<(usize, Vec3)>) {
        let (u, v) = (x as f64 + 0.5, y as f64 + 0.5);
        let eye = Ray { origin: Vec3::ZERO, direction: self.camera.direction(u, v) };
        let (width, height) = (f64::from(self.camera.width), f64::from(self.camera.height));
        // For each object its plane, if the pixel lies on it, and the distance of the reading from it.
        let on_plane = |(index, plane): (usize, Plane)| {
            let point = eye.at(plane.intersect(&eye)?);
            if plane.normal.dot(eye.direction) >= 0.0 || !self.may_mirror(&plane, point, eye.direction, &|_| true) {
                return None;
            }
            let surface = self.occluders.at(u / width, v / height)?;
            let off_m = plane.signed_distance_m(surface.position_m).abs();
            (off_m < ON_PLANE * self.occluders.bias_m(-surface.position_m.z)).then_some((index, plane, off_m))
        };
        let supports = self.objects.iter().enumerate().filter_map(|(i, object)| Some((i, object.support?)));
        let planes: Vec<(usize, Plane, f32)> = supports.filter_map(on_plane).collect();
        let Some(&(nearest, ..)) = planes.iter().min_by(|a, b| a.2.total_cmp(&b.2)) else { return };
        for &(own, plane, _) in &planes {
            let is_here = |object: usize| planes.iter().any(|&(index, ..)| index == object);
            let mirrors = |object: usize| if is_here(object) { object == own } else { own == nearest };
            self.mirrored(&eye, &plane, &mirrors, |cone, weight, radiance| {
                *sum += radiance * weight;
                cones.push(cone);
                owners.push((x, weight));
            });
        }
    }

    /// Traces a plane's reflection of the objects that it `mirrors`: for each direction the cone to what they hide,
    /// the mirrored share, and their radiance.
    fn mirrored(
        &self,
        eye: &Ray,
        plane: &Plane,
        mirrors: &impl Fn(usize) -> bool,
        mut add: impl FnMut(Cone, Vec3, Vec3),
    ) {
        let Some(distance_m) = plane.intersect(eye) else { return };
        let (point, normal, view) = (eye.at(distance_m), plane.normal, -eye.direction);
        if !self.may_mirror(plane, point, eye.direction, mirrors) {
            return;
        }
        let n_dot_v = normal.dot(view);
        let tangent = (view - normal * n_dot_v).normalize_or(normal.any_orthonormal_vector());
        let frame = Mat3::from_cols(tangent, normal.cross(tangent), normal);
        let local_view = Vec3::new((1.0 - n_dot_v * n_dot_v).max(0.0).sqrt(), 0.0, n_dot_v);
        let ggx = Ggx::from_roughness(self.roughness);
        let mirrored: Vec<usize> = (0..self.objects.len()).filter(|&object| mirrors(object)).collect();
        let least_radius_m = self.objects.iter().map(|object| object.radius_m).fold(f32::INFINITY, f32::min);
        let origin = point + normal * (1e-3 * least_radius_m);
        for i in 0..self.samples {
            let sample = ggx.sample(local_view, hammersley(i, self.samples));
            if sample.weight <= 0.0 {
                continue;
            }
            let ray = Ray { origin, direction: frame * sample.light };
            // Other objects only occlude these.
            let met = |&object: &usize| Some((object, self.objects.closest_of(object, &ray)?));
            let Some((object, hit)) = mirrored.iter().find_map(met) else { continue };
            let weight = fresnel(Vec3::splat(DIELECTRIC_F0), sample.v_dot_h) * sample.weight / self.samples as f32;
            let footprint_m = (distance_m + hit.distance_m) * self.camera.pixel_angle_rad();
            let placed = &self.objects[object];
            let radiance = self.radiosity[object].radiance_of(placed, &placed.surface(&ray, &hit, footprint_m));
            let solid_angle = 1.0 / (self.samples as f32 * sample.pdf_per_sr);
            let tan_half_angle = (solid_angle / std::f32::consts::PI).sqrt().clamp(1e-3, 0.5);
            let origin = self.environment.lifted(point, Some(*plane));
            add(Cone { origin, direction: ray.direction, tan_half_angle }, weight, radiance);
        }
    }

    /// Returns whether the mirrored ray, widened by the roughness, comes near one of the `asked` objects.
    fn may_mirror(&self, plane: &Plane, point: Vec3, direction: Vec3, asked: &impl Fn(usize) -> bool) -> bool {
        let mirrored = direction - 2.0 * direction.dot(plane.normal) * plane.normal;
        let spread = 2.0 * self.roughness * self.roughness;
        self.objects.iter().enumerate().filter(|&(i, _)| asked(i)).any(|(_, object)| {
            let offset = object.centre_m - point;
            let along_m = offset.dot(mirrored).max(0.0);
            (offset - mirrored * along_m).length() < object.radius_m + spread * offset.length()
        })
    }
}
