//! Radiosity: diffuse light that leaves the objects, for its bounce on real surfaces and between objects.

use lo_bsdf::{specular_albedo, specular_transmittance};
use lo_geometry::{Ray, Vec3};
use lo_mesh::{Hit, SurfacePoint};

use crate::objects::glass::diffuse_share;
use crate::objects::object::Object;
use crate::shade::fragment_material::bsdf_of;

/// Cells along the longest edge of the object's box.
const CELLS: f32 = 8.0;

/// Irradiance and exitant radiance of an object's surface on a coarse grid, for six directions of the normal.
///
/// Lit points, spread evenly over the surface, are splatted into the grid. A lookup divides by the splatted weights,
/// so that cells without points take the values of their neighbours.
pub(crate) struct Radiosity {
    low: Vec3,
    per_metre: f32,
    size: [usize; 3],
    cells: Vec<[Share; 6]>,
    /// Sum over all points, for normals and positions without any.
    all: [Share; 6],
}

#[derive(Clone, Copy, Debug, Default)]
struct Share {
    irradiance: Vec3,
    exitance: Vec3,
    weight: f32,
}

/// Returns the albedo, with the specular layer taken as diffuse, and the emission.
pub(crate) fn diffuse_albedo_and_emission(point: &SurfacePoint) -> (Vec3, Vec3) {
    if point.unlit {
        return (Vec3::ZERO, Vec3::from(point.base_color));
    }
    let bsdf = bsdf_of(point);
    let n_dot_v = 0.7;
    let albedo = bsdf.diffuse * specular_transmittance(bsdf.f0, n_dot_v) * diffuse_share(point)
        + specular_albedo(bsdf.f0, bsdf.roughness, n_dot_v);
    (albedo, Vec3::from(point.emissive))
}

impl Radiosity {
    /// Creates the radiosity of an object that emits and reflects nothing yet.
    pub fn dark(object: &Object) -> Self {
        let (low, size_m) = (object.low_m, object.high_m - object.low_m);
        let per_metre = CELLS / size_m.max_element();
        let size = (size_m * per_metre).to_array().map(|cells| cells.ceil().clamp(1.0, CELLS) as usize + 1);
        Self { low, per_metre, size, cells: vec![Default::default(); size.iter().product()], all: Default::default() }
    }

    /// Splats the irradiance and exitance of a surface point into the grid.
    pub fn add(&mut self, object: &Object, position: Vec3, normal: Vec3, irradiance: Vec3, exitance: Vec3) {
        let share = Share { irradiance, exitance, weight: 1.0 };
        let sides = sides(object.to_local(normal));
        for (cell, weight) in self.corners(object.to_local_point(position)) {
            for (side, side_weight) in sides {
                self.cells[cell][side].add(share, weight * side_weight);
            }
        }
        for (side, side_weight) in sides {
            self.all[side].add(share, side_weight);
        }
    }

    /// Returns the radiance that leaves the object where a ray meets it, as if it were diffuse.
    pub fn radiance(&self, object: &Object, ray: &Ray, hit: &Hit) -> Vec3 {
        let normal = object.local_triangle_normal(hit.triangle);
        let normal = if normal.dot(object.to_local(ray.direction)) > 0.0 { -normal } else { normal };
        self.look_up(object.to_local_point(ray.at(hit.distance_m)), normal).exitance
    }

    /// Returns the radiance that leaves a surface point with its material, as if it were diffuse.
    pub fn radiance_of(&self, object: &Object, point: &SurfacePoint) -> Vec3 {
        let irradiance =
            self.look_up(object.to_local_point(point.position), object.to_local(point.shading_normal)).irradiance;
        let (albedo, emissive) = diffuse_albedo_and_emission(point);
        albedo * irradiance / std::f32::consts::PI + emissive
    }

    /// Interpolates the grid, in the object's own axes.
    fn look_up(&self, position: Vec3, normal: Vec3) -> Share {
        let sides = sides(normal);
        let mut sum = Share::default();
        for (cell, weight) in self.corners(position) {
            for (side, side_weight) in sides {
                let share = self.cells[cell][side];
                sum.add_scaled(share, weight * side_weight);
            }
        }
        if sum.weight < 1e-4 {
            for (side, side_weight) in sides {
                sum.add_scaled(self.all[side], side_weight);
            }
        }
        let scale = if sum.weight > 0.0 { 1.0 / sum.weight } else { 0.0 };
        Share { irradiance: sum.irradiance * scale, exitance: sum.exitance * scale, weight: 1.0 }
    }

    fn corners(&self, local: Vec3) -> [(usize, f32); 8] {
        let limit = Vec3::from(self.size.map(|n| (n - 1) as f32));
        let p = ((local - self.low) * self.per_metre).clamp(Vec3::ZERO, limit);
        let base = p.to_array().map(|c| c as usize);
        let f = p - p.floor();
        std::array::from_fn(|corner| {
            let mut index = 0;
            let mut weight = 1.0;
            for axis in 0..3 {
                let step = corner >> axis & 1;
                let cell = (base[axis] + step).min(self.size[axis] - 1);
                index = index * self.size[axis] + cell;
                weight *= if step == 1 { f[axis] } else { 1.0 - f[axis] };
            }
            (index, weight)
        })
    }
}

impl Share {
    fn add(&mut self, value: Share, weight: f32) {
        self.irradiance += value.irradiance * weight;
        self.exitance += value.exitance * weight;
        self.weight += weight;
    }

    fn add_scaled(&mut self, sum: Share, weight: f32) {
        self.irradiance += sum.irradiance * weight;
        self.exitance += sum.exitance * weight;
        self.weight += sum.weight * weight;
    }
}

/// Returns the three sides of a cube that a unit normal faces, weighted by its squared components (ambient cube).
fn sides(normal: Vec3) -> [(usize, f32); 3] {
    std::array::from_fn(|axis| (2 * axis + usize::from(normal[axis] < 0.0), normal[axis] * normal[axis]))
}
