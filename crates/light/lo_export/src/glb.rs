//! glTF 2.0 binary: camera, unlit mesh or points with vertex colours, lamps (`KHR_lights_punctual`).

use lo_geometry::Camera;
use lo_mesh::{GlbTooLarge, GlbWriter};
use serde_json::{Map, Value, json};

use crate::ExportError;
use crate::header::{FRAME, GENERATOR, UNITS};
use crate::mesh::Mesh;
use crate::probe::ProbeFile;
use crate::sources::Source;

/// Modes of primitives.
const POINTS: u32 = 0;
const TRIANGLES: u32 = 4;

/// The whole file.
pub(crate) fn encode(
    mesh: &Mesh,
    camera: &Camera,
    lamps: &[Source],
    probe: Option<&ProbeFile>,
) -> Result<Vec<u8>, ExportError> {
    let mut binary = GlbWriter::default();
    let primitive = primitive(mesh, &mut binary);
    let mut nodes = vec![json!({ "name": "Camera", "camera": 0 }), json!({ "name": "Room", "mesh": 0 })];
    for (index, lamp) in lamps.iter().enumerate() {
        nodes.push(json!({
            "name": format!("Lamp {}", index + 1),
            "translation": lamp.position_m.to_array(),
            "extensions": { "KHR_lights_punctual": { "light": index } },
        }));
    }
    let mut scene_extras = json!({
        "frame": FRAME,
        "units": UNITS,
        "lamps": "point lights of the brightest leaf clusters; intensity = pi * radiance * area / solid angle, in cd for \
                  radiance in cd/m2; multiply all by the luminance of the photo's white in cd/m2",
    });
    if let Some(probe) = probe {
        scene_extras["lightProbe"] = json!({
            "file": probe.name, "position_m": probe.position_m.to_array(), "orientation": probe.convention,
        });
    }
    let mut document = json!({
        "asset": { "version": "2.0", "generator": GENERATOR },
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "name": "Scene", "nodes": (0..nodes.len()).collect::<Vec<_>>(), "extras": scene_extras }],
        "nodes": nodes,
        "cameras": [camera_json(camera)],
        "materials": [{
            "name": "Radiance",
            "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
            "extensions": { "KHR_materials_unlit": {} },
        }],
        "meshes": [{
            "name": "Room",
            "primitives": [primitive],
            "extras": { "_RADIANCE": "linear RGB radiance, never clipped; COLOR_0 is the same clipped at 1.0" },
        }],
    });
    if !lamps.is_empty() {
        document["extensionsUsed"] = json!(["KHR_lights_punctual", "KHR_materials_unlit"]);
        let lights: Vec<Value> = lamps.iter().enumerate().map(|(index, lamp)| lamp_json(index, lamp)).collect();
        document["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    }
    binary.finish(document).map_err(|GlbTooLarge { bytes }| ExportError::TooLarge { bytes })
}

/// The mesh's only primitive; its data goes to `binary`.
fn primitive(mesh: &Mesh, binary: &mut GlbWriter) -> Value {
    let mut attributes = Map::new();
    let bounds = |pick: fn(f32, f32) -> f32, start: f32| {
        mesh.positions_m.iter().fold([start; 3], |a, p| [pick(a[0], p[0]), pick(a[1], p[1]), pick(a[2], p[2])])
    };
    let limits = json!({ "min": bounds(f32::min, f32::INFINITY), "max": bounds(f32::max, f32::NEG_INFINITY) });
    let count = mesh.positions_m.len();
    let positions = bytemuck::cast_slice(&mesh.positions_m);
    let position = binary.accessor(positions, count, GlbWriter::FLOAT, "VEC3", GlbWriter::ARRAY_BUFFER, limits);
    attributes.insert("POSITION".to_owned(), position.into());
    // Linear, as the specification demands; 16 bits, because eight linear ones show bands in the dark. Alpha fills the alignment.
    let colors: Vec<[u16; 4]> = mesh
        .radiance
        .iter()
        .map(|rgb| {
            let [r, g, b] = rgb.map(|c| (c.clamp(0.0, 1.0) * f32::from(u16::MAX)).round() as u16);
            [r, g, b, u16::MAX]
        })
        .collect();
    let normalized = json!({ "normalized": true });
    let color = binary.accessor(
        bytemuck::cast_slice(&colors),
        count,
        GlbWriter::UNSIGNED_SHORT,
        "VEC4",
        GlbWriter::ARRAY_BUFFER,
        normalized,
    );
    attributes.insert("COLOR_0".to_owned(), color.into());
    let radiance = bytemuck::cast_slice(&mesh.radiance);
    let radiance = binary.accessor(radiance, count, GlbWriter::FLOAT, "VEC3", GlbWriter::ARRAY_BUFFER, json!({}));
    attributes.insert("_RADIANCE".to_owned(), radiance.into());
    let mut primitive = json!({ "attributes": attributes, "material": 0, "mode": POINTS });
    if !mesh.indices.is_empty() {
        let indices = bytemuck::cast_slice(&mesh.indices);
        let none = json!({});
        let indices = binary.accessor(
            indices,
            mesh.indices.len(),
            GlbWriter::UNSIGNED_INT,
            "SCALAR",
            GlbWriter::ELEMENT_ARRAY_BUFFER,
            none,
        );
        primitive["indices"] = indices.into();
        primitive["mode"] = TRIANGLES.into();
    }
    primitive
}

/// The photo's camera. glTF knows no principal point: one off the centre stands in the extras alone.
fn camera_json(camera: &Camera) -> Value {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    json!({
        "name": "Photo",
        "type": "perspective",
        "perspective": {
            "yfov": 2.0 * (0.5 * height / camera.fy).atan(),
            "aspectRatio": (width / camera.fx) / (height / camera.fy),
            "znear": 0.01,
        },
        "extras": {
            "fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy,
            "width": camera.width, "height": camera.height,
            "units": "pixels of the photo, u right, v down, pixel centres at +0.5",
            "principalPointOffset": [camera.cx - 0.5 * width, camera.cy - 0.5 * height],
        },
    })
}

/// A point light with the cluster's radiant intensity towards the room.
fn lamp_json(index: usize, lamp: &Source) -> Value {
    let intensity = lamp.intensity();
    let strongest = intensity.into_iter().fold(0.0, f32::max);
    json!({
        "name": format!("Lamp {}", index + 1),
        "type": "point",
        "color": intensity.map(|c| c / strongest),
        "intensity": strongest,
        "extras": {
            "area_m2": lamp.area_m2, "radiance": lamp.radiance, "power": lamp.power(),
            "direction": lamp.direction.to_array(), "flatness": lamp.flatness, "leaves": lamp.leaves,
        },
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gltf::{Gltf, Semantic};
    use lo_geometry::Vec3;

    use super::*;
    use crate::test_scene::box_room;
    use crate::{free_space, mesh, sources};

    fn room() -> Gltf {
        let scene = box_room();
        let leaves = free_space::leaves(&scene.light, None);
        let mesh = mesh::from_leaves(&leaves, &scene.light.cube, 3);
        let lamps = sources::sources(&leaves);
        // `from_slice` validates indices, accessors and required fields.
        Gltf::from_slice(&encode(&mesh, &scene.frame.camera, &lamps, None).unwrap()).unwrap()
    }

    #[test]
    fn the_mesh_is_the_inside_of_the_room() {
        let gltf = room();
        let primitive = gltf.meshes().next().unwrap().primitives().next().unwrap();
        assert!(primitive.material().unlit());
        let reader = primitive.reader(|_| gltf.blob.as_deref());
        let positions: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from).collect();
        // The lattice points on the surface of a box of 6³ cells.
        assert_eq!(positions.len(), 7usize.pow(3) - 5usize.pow(3));
        assert_eq!(primitive.bounding_box().min, [-1.5; 3]);
        assert_eq!(primitive.bounding_box().max, [1.5; 3]);
        let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        assert_eq!(indices.len(), 216 * 6);
        for triangle in indices.chunks(3) {
            let [a, b, c] = [0, 1, 2].map(|i| positions[triangle[i] as usize]);
            let normal = (b - a).cross(c - a);
            assert!(normal.dot(-(a + b + c)) > 0.0, "{triangle:?} is seen from inside");
        }
        // Corner-shared radiance: the middle of the lamp has the lamp's own, a corner of the room the wall's.
        let (_, accessor) = primitive.attributes().find(|(s, _)| *s == Semantic::Extras("RADIANCE".into())).unwrap();
        let start = accessor.view().unwrap().offset();
        let floats: &[u8] = &gltf.blob.as_ref().unwrap()[start..start + 12 * accessor.count()];
        let radiance: Vec<[f32; 3]> = floats
            .chunks(12)
            .map(|rgb| [0, 4, 8].map(|i| f32::from_le_bytes(rgb[i..i + 4].try_into().unwrap())))
            .collect();
        let at = |p: Vec3| positions.iter().position(|q| *q == p).unwrap();
        assert_eq!(radiance[at(Vec3::new(0.0, 1.5, 0.0))], [10.0, 8.0, 6.0]);
        assert_eq!(radiance[at(Vec3::splat(-1.5))], [0.5; 3]);
        // One of the four faces at a corner of the lamp is the lamp's.
        assert_eq!(radiance[at(Vec3::new(0.5, 1.5, 0.5))], [(10.0 + 1.5) / 4.0, (8.0 + 1.5) / 4.0, (6.0 + 1.5) / 4.0]);
        let colors: Vec<[f32; 4]> = reader.read_colors(0).unwrap().into_rgba_f32().collect();
        assert_eq!(colors[at(Vec3::new(0.0, 1.5, 0.0))], [1.0; 4]);
        assert!((colors[at(Vec3::splat(-1.5))][0] - 0.5).abs() < 1.0 / 65535.0);
    }

    #[test]
    fn camera_and_lamps_are_where_they_should() {
        let gltf = room();
        let camera = gltf.cameras().next().unwrap();
        let gltf::camera::Projection::Perspective(perspective) = camera.projection() else { panic!("no perspective") };
        // A camera of 8 × 6 pixels with f = 5: tan of the half angles 3/5 and 4/5.
        assert!((perspective.yfov() - 2.0 * 0.6f32.atan()).abs() < 1e-6);
        assert!((perspective.aspect_ratio().unwrap() - 8.0 / 6.0).abs() < 1e-6);
        let extras: Value = serde_json::from_str(camera.extras().as_ref().unwrap().get()).unwrap();
        assert_eq!(extras["principalPointOffset"], json!([0.5, -0.25]));
        let lights: Vec<_> = gltf.lights().unwrap().collect();
        assert_eq!(lights.len(), 1);
        // 1 m² of (10, 8, 6), flat: π L A / 2π.
        assert_eq!(lights[0].intensity(), 5.0);
        assert_eq!(lights[0].color(), [1.0, 0.8, 0.6]);
        let node = gltf.nodes().find(|node| node.light().is_some()).unwrap();
        assert_eq!(node.transform().decomposed().0, [0.0, 1.25, 0.0]);
    }
}
