//! Export of a room as glTF: one mesh per object, sky, sun and cameras.

use std::f32::consts::PI;

use lo_geometry::{RigidTransform, Vec3, direction_from_uv};
use lo_imaging::srgb8_from_linear;
use lo_mesh::{AlphaMode, GlbScene, GlbSun, GlbTooLarge, Material, Model, Texture, TextureRef};
use lo_transport::{Outdoors, Sun};
use serde_json::json;

use crate::camera::CameraPose;
use crate::interior::Interior;
use crate::photometry::UNIT_CD_M2;

/// Radius of the sky sphere: large enough that the sun stays in the sky's gap from anywhere in the room.
const SKY_RADIUS_M: f32 = 1000.0;

/// Cosine of the half angle (4°) of the gap in the sky through which the directional light shines.
const SUN_GAP: f32 = 0.997_56;

/// Faces of the sky sphere, around and from top to bottom.
const SKY_COLUMNS: usize = 96;
const SKY_ROWS: usize = 48;

impl Interior {
    /// Encodes the room as binary glTF 2.0. `generator` names the writing program.
    ///
    /// The file holds a mesh per object, the sky as an emissive sphere, the sun as a directional light and `cameras`.
    /// Window panes are alpha-blended sheets: renderers take transmissive sheets for solid glass, which casts a shadow.
    ///
    /// # Errors
    /// If the file would exceed 4 GiB.
    pub fn to_glb(&self, generator: &str, cameras: &[CameraPose]) -> Result<Vec<u8>, GlbTooLarge> {
        let mut model = self.world.model.clone();
        model.materials.iter_mut().for_each(make_alpha_blended);
        let mut objects: Vec<(String, Vec<usize>)> = self
            .objects
            .iter()
            .enumerate()
            .map(|(n, object)| (format!("{} {n}", object.name), object.parts.iter().cloned().flatten().collect()))
            .collect();
        if !self.world.portals.is_empty() {
            let begin = model.triangles.len();
            add_sky(&mut model, &self.world.outdoors);
            objects.push(("sky".to_owned(), (begin..model.triangles.len()).collect()));
        }
        let named = |(n, view): (usize, &CameraPose)| {
            let place = RigidTransform { rotation: view.pose.rotation, translation_m: view.pose.position };
            (format!("Photo {n}"), view.camera, place)
        };
        let scene = GlbScene {
            objects,
            cameras: cameras.iter().enumerate().map(named).collect(),
            sun: self.world.outdoors.sun.as_ref().map(sun),
            extras: json!({
                "id": self.id,
                "units": format!(
                    "metres, +Y up; emissive radiance: 1 is {UNIT_CD_M2} cd/m2; the sun's intensity is 683 times its irradiance in \
                     the same units, which Blender takes back"
                ),
            }),
        };
        model.to_glb_scene(generator, &scene)
    }
}

/// Turns a transmissive material into an alpha-blended one of equal transmittance.
fn make_alpha_blended(material: &mut Material) {
    if material.transmission > 0.0 {
        material.base_color[3] *= 1.0 - material.transmission;
        material.transmission = 0.0;
        material.alpha_mode = AlphaMode::Blend;
    }
}

/// Converts the sun's disc to a directional light of irradiance ∫ L cos θ dω = π L sin² r.
fn sun(sun: &Sun) -> GlbSun {
    let factor = PI * sun.angular_radius_rad.sin().powi(2);
    GlbSun {
        direction: sun.direction,
        irradiance: sun.radiance.map(|c| c * factor),
        angular_radius_rad: sun.angular_radius_rad,
    }
}

/// Adds an inward-facing sphere that emits the outdoors, with a gap at the sun.
fn add_sky(model: &mut Model, outdoors: &Outdoors) {
    let (sun, outdoors) = (outdoors.sun, &outdoors.radiance);
    let brightest = outdoors.pixels().iter().flatten().copied().fold(f32::MIN_POSITIVE, f32::max);
    let picture = outdoors.map(|rgb| {
        let [r, g, b] = rgb.map(|c| srgb8_from_linear(c / brightest));
        [r, g, b, u8::MAX]
    });
    let texture = model.textures.len();
    model.textures.push(Texture::from_image(picture, true));
    let material = model.materials.len() as u32;
    model.materials.push(Material {
        name: "sky".to_owned(),
        base_color: [0.0, 0.0, 0.0, 1.0],
        roughness: 1.0,
        emissive: [brightest; 3],
        emissive_texture: Some(TextureRef::new(texture)),
        ..Material::default()
    });
    let first = model.positions.len() as u32;
    for (row, column) in (0..=SKY_ROWS).flat_map(|row| (0..=SKY_COLUMNS).map(move |column| (row, column))) {
        let uv = [column as f32 / SKY_COLUMNS as f32, row as f32 / SKY_ROWS as f32];
        let direction = direction_from_uv(uv.into());
        model.positions.push(direction * SKY_RADIUS_M);
        model.normals.push(-direction);
        model.uvs[0].push(uv);
        model.colors.push([1.0; 4]);
    }
    let corner = |row: usize, column: usize| first + (row * (SKY_COLUMNS + 1) + column) as u32;
    let covers_sun = |model: &Model, triangle: [u32; 3]| {
        let middle: Vec3 = triangle.iter().map(|&v| model.positions[v as usize]).sum();
        sun.is_some_and(|sun| sun.direction.dot(middle.normalize()) > SUN_GAP)
    };
    for (row, column) in (0..SKY_ROWS).flat_map(|row| (0..SKY_COLUMNS).map(move |column| (row, column))) {
        let [a, b, c, d] =
            [corner(row, column), corner(row + 1, column), corner(row + 1, column + 1), corner(row, column + 1)];
        // Columns run to the right as seen from inside. At the poles one of the two triangles is degenerate.
        let triangles = [(row + 1 < SKY_ROWS, [a, b, c]), (row > 0, [a, c, d])];
        for (has_area, triangle) in triangles {
            if has_area && !covers_sun(model, triangle) {
                model.triangles.push(triangle);
                model.triangle_materials.push(material);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::f32::consts::TAU;

    use lo_geometry::Ray;
    use lo_imaging::RadianceImage;
    use lo_mesh::PreparedModel;
    use lo_transport::Portal;

    use super::*;
    use crate::SynthConfig;

    fn room(index: u64) -> Interior {
        Interior::generate(5, index, &SynthConfig::default()).unwrap()
    }

    #[test]
    fn the_sky_is_seen_where_it_is() {
        let outdoors = RadianceImage::from_fn(64, 32, |x, y| [x as f32, y as f32, 63.0]);
        let mut model = Model { materials: Vec::new(), ..Model::default() };
        add_sky(&mut model, &Outdoors { radiance: outdoors, sun: None });
        assert_eq!(model.triangles.len(), 2 * SKY_COLUMNS * (SKY_ROWS - 1));
        for triangle in &model.triangles {
            let [a, b, c] = triangle.map(|v| model.positions[v as usize]);
            assert!((b - a).cross(c - a).dot(a + b + c) < 0.0, "seen from inside");
        }
        // Texture coordinates follow the equirectangular convention: each direction shows its own pixel.
        for (position, uv) in model.positions.iter().zip(&model.uvs[0]) {
            if position.x.hypot(position.z) > 1.0 {
                let expected = lo_geometry::uv_from_direction(*position);
                assert!((expected.x - uv[0]).rem_euclid(1.0).min((uv[0] - expected.x).rem_euclid(1.0)) < 1e-4);
                assert!((expected.y - uv[1]).abs() < 1e-4);
            }
        }
        assert_eq!(model.materials[0].emissive, [63.0; 3]);
    }

    #[test]
    fn the_sun_shines_through_the_sky() {
        let direction = Vec3::new(0.5, 0.6, -0.4).normalize();
        let sun = Sun { direction, angular_radius_rad: 0.004_65, radiance: [1e4; 3] };
        let outdoors = RadianceImage::new(2, 1, vec![[1.0; 3]; 2]);
        let mut model = Model { materials: Vec::new(), ..Model::default() };
        add_sky(&mut model, &Outdoors { radiance: outdoors, sun: Some(sun) });
        model.textures.clear();
        model.materials[0].emissive_texture = None;
        let sky = PreparedModel::new(model);
        let open = |direction: Vec3, origin: Vec3| sky.intersect_both_sides(&Ray { origin, direction }, 2e3).is_none();
        for origin in [Vec3::ZERO, Vec3::new(9.0, 2.0, -9.0), Vec3::new(-9.0, 0.0, 5.0)] {
            assert!(open(direction, origin));
            // The sky is closed ten degrees beside the sun.
            assert!(!open((direction + 0.18 * direction.any_orthonormal_vector()).normalize(), origin));
        }
    }

    #[test]
    fn a_disc_gives_its_solid_angle_times_its_radiance() {
        let disc = Sun { direction: Vec3::Y, angular_radius_rad: 0.004_65, radiance: [1e4; 3] };
        // The solid angle of the real sun, 6.8e-5 sr.
        assert!((sun(&disc).irradiance[0] / 0.68 - 1.0).abs() < 0.01);
    }

    #[test]
    fn the_file_holds_every_object_and_camera() {
        let room = room(1);
        let cameras = room.camera_poses(2);
        let model = Model::from_gltf_bytes(&room.to_glb("tests", &cameras).unwrap(), &|_| {
            Err(std::io::Error::other("no files"))
        })
        .unwrap();
        // The gap at the sun removes a few triangles.
        let sky = model.triangles.len() - room.world.model.triangles.len();
        let whole = if room.world.portals.is_empty() { 0 } else { 2 * SKY_COLUMNS * (SKY_ROWS - 1) };
        assert!(sky <= whole && sky + 20 >= whole, "{sky} of {whole}");
        assert!(model.materials.iter().all(|m| m.transmission == 0.0));
    }

    /// Whether a ray passes through a portal.
    fn through(portal: &Portal, ray: &Ray) -> bool {
        let [u, v] = portal.edges;
        let normal = u.cross(v);
        let t = normal.dot(portal.corner - ray.origin) / normal.dot(ray.direction);
        let at = ray.origin + ray.direction * t - portal.corner;
        // Tolerates a few centimetres of frame and reveal around the opening.
        let within = |edge: Vec3| {
            let slack = 0.05 / edge.length();
            (-slack..=1.0 + slack).contains(&(at.dot(edge) / edge.length_squared()))
        };
        t > 0.0 && within(u) && within(v)
    }

    #[test]
    fn light_enters_by_the_windows_alone() {
        let (mut rays, mut leaks) = (0, Vec::new());
        for index in 0..6 {
            let room = room(index);
            let mut bare = room.world.model.clone();
            let pane = |m: u32| bare.materials[m as usize].transmission > 0.0;
            let solid: Vec<usize> = (0..bare.triangles.len()).filter(|&t| !pane(bare.triangle_materials[t])).collect();
            bare.triangles = solid.iter().map(|&t| bare.triangles[t]).collect();
            bare.triangle_materials = vec![0; solid.len()];
            let bare = PreparedModel::new(bare);
            for view in room.camera_poses(3) {
                for n in 0..4000 {
                    let (a, b) = ((n as f32 + 0.5) / 4000.0, n as f32 * 0.618_034);
                    let (y, angle) = (1.0 - 2.0 * a, b.fract() * TAU);
                    let side = (1.0 - y * y).sqrt();
                    let direction = Vec3::new(side * angle.cos(), y, side * angle.sin());
                    let ray = Ray { origin: view.pose.position, direction };
                    rays += 1;
                    let open = bare.intersect_both_sides(&ray, 100.0).is_none();
                    if open && !room.world.portals.iter().any(|portal| through(portal, &ray)) {
                        leaks.push((index, direction));
                    }
                }
            }
        }
        assert!(leaks.is_empty(), "{} of {rays} rays leak, such as {:?}", leaks.len(), &leaks[..leaks.len().min(5)]);
    }
}
