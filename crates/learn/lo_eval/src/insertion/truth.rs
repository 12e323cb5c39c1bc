//! Path-traced reference: radiance of objects in the true room, and their shadows.

use lo_geometry::{Ray, Vec3};
use lo_mesh::{Model, PreparedModel};
use lo_synth::CameraPose;
use lo_transport::{PathTracer, TransportError, World};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::footprints::Footprint;
use super::level_surfaces::normal;
use super::objects::TestObject;

/// Every n-th pixel in each direction is compared.
pub(crate) const STRIDE: usize = 3;

/// Paths per pixel of an object, and per point of the floor with and without the object.
const OBJECT_PATHS: u64 = 192;
const FLOOR_PATHS: u64 = 128;

/// Groups of an object pixel's paths. Only the middle half by brightness counts: some paths hit lamps in shades by
/// chance (fireflies).
const PARTS: u64 = 8;

/// Distance from the base within which the shadow is compared, radii.
const REACH: f32 = 6.0;

/// Height tolerance of the supporting surface, metres.
const SUPPORT_M: f32 = 0.02;

/// Length of rays, metres: longer than any room.
const FAR_M: f32 = 1e3;

/// Reference for one object at one footprint.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct ObjectTruth {
    /// Pixels fully covered by the object, and its radiance in units of the photo's white.
    pub object: Vec<([usize; 2], [f32; 3])>,
    /// Pixels of the supporting surface, and the ratio of irradiance with the object to that without; 1 if unlit.
    pub shadow: Vec<([usize; 2], [f32; 3])>,
}

/// The path-traced room of one photo.
pub(crate) struct TrueRoom {
    world: World,
    bare: PreparedModel,
    empty: PathTracer,
    view: CameraPose,
    gains: [f32; 3],
    seed: u64,
}

impl TrueRoom {
    /// Prepares the room seen by a camera; `bare` is its model without objects.
    ///
    /// Radiance times `gains` is in units of the photo's white.
    ///
    /// # Errors
    /// Rooms that the path tracer rejects.
    pub fn new(
        world: World,
        bare: PreparedModel,
        view: CameraPose,
        gains: [f32; 3],
        seed: u64,
    ) -> Result<Self, TransportError> {
        let empty = PathTracer::new(world.clone(), seed)?;
        Ok(Self { world, bare, empty, view, gains, seed })
    }

    /// Traces an object and its shadow.
    ///
    /// # Errors
    /// Rooms that the path tracer rejects.
    pub fn trace(
        &self,
        kind: TestObject,
        object: &Model,
        footprint: &Footprint,
    ) -> Result<ObjectTruth, TransportError> {
        let first = self.world.model.triangles.len() as u32;
        let mut world = self.world.clone();
        append(&mut world.model, object, footprint);
        let full = PreparedModel::new(world.model.clone());
        let tracer = PathTracer::new(world, self.seed)?;
        let shows_object =
            |x: f32, y: f32| full.intersect_both_sides(&self.ray(x, y), FAR_M).is_some_and(|hit| hit.triangle >= first);
        let [from, to] = self.window(footprint, kind);
        let (mut object, mut floor) = (Vec::new(), Vec::new());
        let rows = (from[1]..to[1]).step_by(STRIDE);
        for [x, y] in rows.flat_map(|y| (from[0]..to[0]).step_by(STRIDE).map(move |x| [x, y])) {
            let at = |(dx, dy): (f32, f32)| shows_object(x as f32 + dx, y as f32 + dy);
            let shown = [(0.5, 0.5), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(at);
            if shown == [true; 5] {
                object.push([x, y]);
            } else if shown == [false; 5] && kind.casts() {
                floor.extend(self.support(x as f32 + 0.5, y as f32 + 0.5, footprint).map(|point| ([x, y], point)));
            }
        }
        let start = |i: usize, paths: u64| i as u64 * paths;
        let radiance = |(i, &[x, y]): (usize, &[usize; 2])| {
            let ray = self.ray(x as f32 + 0.5, y as f32 + 0.5);
            let part = |number: u64| -> Vec3 {
                let paths =
                    (0..OBJECT_PATHS / PARTS).map(|k| start(i, OBJECT_PATHS) + number * (OBJECT_PATHS / PARTS) + k);
                paths.map(|index| Vec3::from(tracer.radiance_by_path(ray, index))).sum::<Vec3>()
            };
            let mut parts: Vec<Vec3> = (0..PARTS).map(part).collect();
            parts.sort_by(|a, b| a.element_sum().total_cmp(&b.element_sum()));
            // Mean of the middle half.
            let quarter = parts.len() / 4;
            let middle = &parts[quarter..parts.len() - quarter];
            let mean = middle.iter().sum::<Vec3>() / (middle.len() as u64 * (OBJECT_PATHS / PARTS)) as f32;
            ([x, y], (mean * Vec3::from(self.gains)).to_array())
        };
        let object = object.par_iter().enumerate().map(radiance).collect();
        // The same random paths with and without the object, so that noise cancels where it occludes nothing.
        let ratio = |(i, &(pixel, point)): (usize, &([usize; 2], Vec3))| {
            let irradiance = |tracer: &PathTracer| -> Vec3 {
                let paths = (0..FLOOR_PATHS).map(|k| start(i, FLOOR_PATHS) + k);
                paths.map(|index| Vec3::from(tracer.irradiance_by_path(point, Vec3::Y, index))).sum()
            };
            let (with, without) = (irradiance(&tracer).to_array(), irradiance(&self.empty).to_array());
            let ratio = |c: usize| if without[c] > 0.0 { with[c] / without[c] } else { 1.0 };
            (pixel, [ratio(0), ratio(1), ratio(2)])
        };
        let shadow = floor.par_iter().enumerate().map(ratio).collect();
        Ok(ObjectTruth { object, shadow })
    }

    /// Returns the window of pixels to compare: first, end.
    fn window(&self, footprint: &Footprint, kind: TestObject) -> [[usize; 2]; 2] {
        let camera = &self.view.camera;
        let axis_m = (footprint.base_m - self.view.pose.position).dot(self.view.pose.rotation * Vec3::NEG_Z);
        let radius_px = camera.fx * f64::from(footprint.radius_m / axis_m);
        let [u, v] = footprint.pixel;
        let reach = f64::from(REACH) * radius_px;
        let above = f64::from(kind.height().max(REACH)) * radius_px;
        let clamp = |value: f64, most: u32| value.clamp(0.0, f64::from(most)) as usize;
        [
            [clamp(u - reach, camera.width), clamp(v - above, camera.height)],
            [clamp(u + reach, camera.width), clamp(v + reach, camera.height)],
        ]
    }

    /// Returns the camera ray through a pixel.
    fn ray(&self, u: f32, v: f32) -> Ray {
        let direction = self.view.camera.direction(f64::from(u), f64::from(v));
        Ray { origin: self.view.pose.position, direction: (self.view.pose.rotation * direction).normalize() }
    }

    /// Returns the point of the supporting surface at a pixel; `None` if the pixel shows something else.
    fn support(&self, u: f32, v: f32, footprint: &Footprint) -> Option<Vec3> {
        let ray = self.ray(u, v);
        let hit = self.bare.intersect_both_sides(&ray, FAR_M)?;
        let point = ray.origin + ray.direction * hit.distance_m;
        let near = (point.y - footprint.base_m.y).abs() < SUPPORT_M
            && (point - footprint.base_m).length() < REACH * footprint.radius_m
            && normal(&self.bare, hit.triangle).y.abs() > 0.99;
        near.then_some(point + Vec3::Y * 1e-3)
    }
}

/// Adds an object to a room at a footprint.
fn append(room: &mut Model, object: &Model, footprint: &Footprint) {
    let (vertices, materials) = (room.positions.len() as u32, room.materials.len() as u32);
    room.positions.extend(object.positions.iter().map(|&p| footprint.base_m + p * footprint.radius_m));
    room.normals.extend(&object.normals);
    if !room.tangents.is_empty() {
        room.tangents.resize(room.positions.len(), [1.0, 0.0, 0.0, 1.0]);
    }
    for uvs in room.uvs.iter_mut().filter(|uvs| !uvs.is_empty()) {
        uvs.resize(room.positions.len(), [0.0; 2]);
    }
    if !room.colors.is_empty() {
        room.colors.resize(room.positions.len(), [1.0; 4]);
    }
    room.triangles.extend(object.triangles.iter().map(|triangle| triangle.map(|v| v + vertices)));
    room.triangle_materials.extend(object.triangle_materials.iter().map(|&m| m + materials));
    room.materials.extend(object.materials.iter().cloned());
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Camera, Quat};
    use lo_imaging::RadianceImage;
    use lo_mesh::{LoadOptions, Material};
    use lo_transport::{Outdoors, Pose};

    use super::*;

    /// Returns a grey floor under a uniform sky of radiance 1, seen from above.
    fn open_floor() -> TrueRoom {
        let corners = [(-20.0, -20.0), (-20.0, 20.0), (20.0, 20.0), (20.0, -20.0)];
        let positions = corners.map(|(x, z)| Vec3::new(x, 0.0, z)).to_vec();
        let grey = Material { base_color: [0.5, 0.5, 0.5, 1.0], roughness: 1.0, ..Material::default() };
        let triangles = vec![[0, 1, 2], [0, 2, 3]];
        let model = Model::from_triangles(positions, triangles, grey, &LoadOptions::default()).unwrap();
        let sky = RadianceImage::new(2, 1, vec![[1.0; 3]; 2]);
        let world = World { model, outdoors: Outdoors { radiance: sky, sun: None }, portals: Vec::new() };
        let rotation = Quat::from_rotation_x(-0.6);
        let pose = Pose { position: Vec3::new(0.0, 1.4, 2.0), rotation };
        let camera = Camera::from_hfov_deg(60.0, 240, 160).unwrap();
        let bare = PreparedModel::new(world.model.clone());
        TrueRoom::new(world, bare, CameraPose { pose, camera }, [1.0, 2.0, 0.5], 3).unwrap()
    }

    fn footprint() -> Footprint {
        let room = open_floor();
        let base_m = Vec3::new(0.05, 0.0, -0.1);
        let local = room.view.pose.rotation.inverse() * (base_m - room.view.pose.position);
        let (u, v, _) = room.view.camera.project(local).unwrap();
        Footprint { pixel: [u, v], base_m, radius_m: 0.2 }
    }

    #[test]
    fn a_black_sphere_takes_from_the_floor_what_it_hides_of_the_sky() {
        let (room, footprint) = (open_floor(), footprint());
        let mut black = TestObject::Diffuse.model().unwrap();
        black.materials[0].base_color = [0.0, 0.0, 0.0, 1.0];
        let truth = room.trace(TestObject::Diffuse, &black, &footprint).unwrap();
        assert!(truth.shadow.len() > 100 && truth.object.len() > 20, "{} {}", truth.shadow.len(), truth.object.len());
        let mut sum = 0.0;
        for ([x, y], ratio) in &truth.shadow {
            let point = room.support(*x as f32 + 0.5, *y as f32 + 0.5, &footprint).unwrap();
            // Form factor of a sphere above the horizon: cos θ (R / d)². Its specular reflection adds a little light.
            let centre_m = footprint.base_m + Vec3::Y * footprint.radius_m;
            let distance_m = (centre_m - point).length();
            let expected = 1.0 - footprint.radius_m / distance_m * (footprint.radius_m / distance_m).powi(2);
            assert!((ratio[1] - expected).abs() < 0.2, "{ratio:?} {expected}");
            sum += ratio[1] - expected;
        }
        let mean = sum / truth.shadow.len() as f32;
        assert!((-0.01..0.03).contains(&mean), "{mean}");
    }

    #[test]
    fn a_mirror_shows_the_sky_in_units_of_the_photo() {
        let (room, footprint) = (open_floor(), footprint());
        let truth = room.trace(TestObject::Mirror, &TestObject::Mirror.model().unwrap(), &footprint).unwrap();
        assert!(truth.shadow.is_empty());
        // Reflectance 0.8 at normal incidence, more towards the edge; reflections of the floor have half of it.
        let of_sky = truth.object.iter().filter(|(_, rgb)| rgb[0] > 0.7).count();
        assert!(of_sky * 4 > truth.object.len(), "{of_sky} of {}", truth.object.len());
        for (_, rgb) in &truth.object {
            assert!(rgb[0] < 1.01 && rgb[0] > 0.25, "{rgb:?}");
            assert!((rgb[1] / rgb[0] - 2.0).abs() < 1e-3 && (rgb[2] / rgb[0] - 0.5).abs() < 1e-3, "{rgb:?}");
        }
    }
}
