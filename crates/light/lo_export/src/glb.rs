//! glTF 2.0 binary: camera, an emissive room (`KHR_materials_emissive_strength`) or points with vertex colours, and
//! lamps (`KHR_lights_punctual`).
//!
//! Units are those of Blender's importer, the only one with a common scale for both: an emissive texel of 1 is a
//! radiance of 1 W/(m² sr), and 683 cd are 1 W/sr.

use std::collections::BTreeMap;

use lo_geometry::{Camera, Vec3};
use lo_imaging::{Image, srgb8_from_linear};
use lo_mesh::{GlbTooLarge, GlbWriter};
use lo_scene::LightShape;
use serde_json::{Map, Value, json};

use crate::ExportError;
use crate::atlas::Atlas;
use crate::header::{FRAME, GENERATOR, LEVEL_FRAME, UNITS};
use crate::lamps::Lamp;
use crate::points::Point;
use crate::probe::ProbeFile;
use crate::room_mesh::RoomMesh;
use crate::world_frame::WorldFrame;

/// Primitive modes.
const POINTS: u32 = 0;
const TRIANGLES: u32 = 4;

/// Candela of 1 W/sr in Blender's importer (`PBR_WATTS_TO_LUMENS`).
const CANDELA: f32 = 683.0;

/// Largest area of a lamp, m²: a point light approximates a larger one badly at distances below its size.
const MAX_LAMP_AREA_M2: f32 = 1.0;

/// Base of emissive strengths, which are its powers. Eight-bit sRGB then has steps of at most 1 % of the quad's
/// brightest channel.
const STRENGTH_STEP: f32 = 4.0;

/// Smallest emissive strength.
const MIN_STRENGTH: f32 = 1.0 / 64.0;

/// Geometry of the file.
pub(crate) enum SceneGeometry<'a> {
    /// The room as an emissive mesh.
    Room(&'a RoomMesh),
    /// Points with vertex colours.
    Points(&'a [Point]),
}

/// Returns whether a glTF lamp, a point light, can represent it. Others are left to the mesh.
pub(crate) fn has_lamp(lamp: &Lamp) -> bool {
    lamp.light.extent() <= MAX_LAMP_AREA_M2
}

/// Encodes the whole file.
pub(crate) fn encode(
    shown: &SceneGeometry,
    camera: &Camera,
    level: WorldFrame,
    lamps: &[Lamp],
    probes: &[ProbeFile],
) -> Result<Vec<u8>, ExportError> {
    let mut binary = GlbWriter::default();
    let levelled = level != WorldFrame::CAMERA;
    let mut scene_extras = json!({
        "frame": if levelled { LEVEL_FRAME } else { FRAME },
        "units": UNITS,
        "lamps": "radiant intensity in W/sr of radiance in W/(m2 sr), times 683: what Blender takes back; the faces of a lamp keep \
                  what the photo's white allows, so that lamps and mesh together are the light",
    });
    if !probes.is_empty() {
        let probe_json = |probe: &ProbeFile| {
            json!({
                "file": probe.file.name, "position_m": probe.position_m.to_array(), "orientation": probe.convention,
            })
        };
        scene_extras["lightProbes"] = probes.iter().map(probe_json).collect();
    }
    let mut world = json!({ "name": "World", "children": (1..3 + lamps.len()).collect::<Vec<_>>() });
    if levelled {
        world["matrix"] = json!(level.columns().as_flattened());
    }
    let mut nodes = vec![world, json!({ "name": "Camera", "camera": 0 }), json!({ "name": "Room", "mesh": 0 })];
    nodes.extend(lamps.iter().enumerate().map(|(index, lamp)| lamp_node(index, lamp)));
    let mut document = json!({
        "asset": { "version": "2.0", "generator": GENERATOR },
        "scene": 0,
        "scenes": [{ "name": "Scene", "nodes": [0], "extras": scene_extras }],
        "nodes": nodes,
        "cameras": [camera_json(camera)],
    });
    let mut extensions = match shown {
        SceneGeometry::Room(mesh) => room(mesh, &mut document, &mut binary),
        SceneGeometry::Points(points) => cloud(points, &mut document, &mut binary),
    };
    if !lamps.is_empty() {
        extensions.insert(0, "KHR_lights_punctual");
        let lights: Vec<Value> = lamps.iter().enumerate().map(|(index, lamp)| lamp_json(index, lamp)).collect();
        document["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    }
    document["extensionsUsed"] = json!(extensions);
    binary.finish(document).map_err(|GlbTooLarge { bytes }| ExportError::TooLarge { bytes })
}

/// Adds the quads, with one primitive and one material per strength, and one texture.
fn room(mesh: &RoomMesh, document: &mut Value, binary: &mut GlbWriter) -> Vec<&'static str> {
    let strengths: Vec<i32> = mesh.radiance.iter().map(strength_step).collect();
    let mut quads_of: BTreeMap<i32, Vec<usize>> = BTreeMap::new();
    for (quad, &step) in strengths.iter().enumerate() {
        quads_of.entry(step).or_default().push(quad);
    }
    let atlas = Atlas::new(mesh.quads.len());
    let (mut primitives, mut materials) = (Vec::new(), Vec::new());
    for (&step, quads) in &quads_of {
        let corners: Vec<Vec3> =
            quads.iter().flat_map(|&quad| mesh.quads[quad].map(|i| mesh.positions_m[i as usize])).collect();
        let uvs: Vec<[f32; 2]> = quads.iter().flat_map(|&quad| atlas.uvs(quad)).collect();
        let indices: Vec<u32> =
            (0..quads.len() as u32).flat_map(|quad| [0, 1, 2, 0, 2, 3].map(|corner| 4 * quad + corner)).collect();
        let position = vertices(&corners, binary);
        let uv = bytemuck::cast_slice(&uvs);
        let uv = binary.accessor(uv, uvs.len(), GlbWriter::FLOAT, "VEC2", GlbWriter::ARRAY_BUFFER, json!({}));
        let index = bytemuck::cast_slice(&indices);
        let (kind, target) = (GlbWriter::UNSIGNED_INT, GlbWriter::ELEMENT_ARRAY_BUFFER);
        let index = binary.accessor(index, indices.len(), kind, "SCALAR", target, json!({}));
        primitives.push(json!({
            "attributes": { "POSITION": position, "TEXCOORD_0": uv },
            "indices": index, "material": materials.len(), "mode": TRIANGLES,
        }));
        let strength = STRENGTH_STEP.powi(step);
        materials.push(json!({
            "name": format!("Radiance to {strength}"),
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0,
            },
            "emissiveFactor": [1.0, 1.0, 1.0],
            "emissiveTexture": { "index": 0 },
            "extensions": {
                "KHR_materials_emissive_strength": { "emissiveStrength": strength },
                // It only emits and reflects nothing.
                "KHR_materials_specular": { "specularFactor": 0.0 },
            },
        }));
    }
    let texel = |quad: usize, corner: usize| {
        let strength = STRENGTH_STEP.powi(strengths[quad]);
        mesh.radiance[quad][corner].map(|c| srgb8_from_linear((c / strength).clamp(0.0, 1.0)))
    };
    let texture: Image<[u8; 3]> = atlas.image(mesh.quads.len(), [0; 3], texel);
    let view = binary.view(&lo_imaging::encode_png(&texture));
    document["images"] = json!([{ "name": "Radiance", "mimeType": "image/png", "bufferView": view }]);
    document["samplers"] = json!([{ "magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071 }]);
    document["textures"] = json!([{ "source": 0, "sampler": 0 }]);
    document["materials"] = materials.into();
    document["meshes"] = json!([{ "name": "Room", "primitives": primitives }]);
    vec!["KHR_materials_emissive_strength", "KHR_materials_specular"]
}

/// Returns the exponent of [`STRENGTH_STEP`] for a quad's brightest value.
fn strength_step(corners: &[[f32; 3]; 4]) -> i32 {
    let brightest = corners.as_flattened().iter().copied().fold(MIN_STRENGTH, f32::max);
    brightest.log(STRENGTH_STEP).ceil() as i32
}

/// Adds loose points: unlit, because points have no shading.
fn cloud(points: &[Point], document: &mut Value, binary: &mut GlbWriter) -> Vec<&'static str> {
    let mut attributes = Map::new();
    let positions: Vec<Vec3> = points.iter().map(|point| point.position_m).collect();
    attributes.insert("POSITION".to_owned(), vertices(&positions, binary).into());
    // Linear, as the specification requires; 16 bits, because 8 linear bits would show banding in dark regions. Alpha
    // fills the alignment.
    let colors: Vec<[u16; 4]> = points
        .iter()
        .map(|point| {
            let [r, g, b] = point.radiance.map(|c| (c.clamp(0.0, 1.0) * f32::from(u16::MAX)).round() as u16);
            [r, g, b, u16::MAX]
        })
        .collect();
    let color = binary.accessor(
        bytemuck::cast_slice(&colors),
        points.len(),
        GlbWriter::UNSIGNED_SHORT,
        "VEC4",
        GlbWriter::ARRAY_BUFFER,
        json!({ "normalized": true }),
    );
    attributes.insert("COLOR_0".to_owned(), color.into());
    let radiance: Vec<[f32; 3]> = points.iter().map(|point| point.radiance).collect();
    let radiance = bytemuck::cast_slice(&radiance);
    let radiance =
        binary.accessor(radiance, points.len(), GlbWriter::FLOAT, "VEC3", GlbWriter::ARRAY_BUFFER, json!({}));
    attributes.insert("_RADIANCE".to_owned(), radiance.into());
    document["materials"] = json!([{
        "name": "Radiance",
        "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
        "extensions": { "KHR_materials_unlit": {} },
    }]);
    document["meshes"] = json!([{
        "name": "Photo points",
        "primitives": [{ "attributes": attributes, "material": 0, "mode": POINTS }],
        "extras": { "_RADIANCE": "linear RGB radiance, never clipped; COLOR_0 is the same clipped at 1.0" },
    }]);
    vec!["KHR_materials_unlit"]
}

/// Adds the accessor of positions with their bounds.
fn vertices(positions_m: &[Vec3], binary: &mut GlbWriter) -> usize {
    let least = positions_m.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let most = positions_m.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
    let limits = json!({ "min": least.to_array(), "max": most.to_array() });
    let positions: Vec<[f32; 3]> = positions_m.iter().map(|p| p.to_array()).collect();
    let data = bytemuck::cast_slice(&positions);
    binary.accessor(data, positions.len(), GlbWriter::FLOAT, "VEC3", GlbWriter::ARRAY_BUFFER, limits)
}

/// Encodes the photo's camera. glTF has no principal point: one off the centre is stored in the extras only.
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

/// Encodes a lamp's position, and its rotation if it shines along its node's −Z.
fn lamp_node(index: usize, lamp: &Lamp) -> Value {
    let mut node = json!({
        "name": format!("Lamp {}", lamp.label(index)),
        "extensions": { "KHR_lights_punctual": { "light": index } },
    });
    let matrix = |across: Vec3, direction: Vec3, at: Vec3| {
        let [x, y, z] = [across, across.cross(direction), -direction].map(|axis| axis.extend(0.0).to_array());
        json!([x, y, z, at.extend(1.0).to_array()].as_flattened())
    };
    match lamp.light.shape {
        LightShape::Rectangle { centre_m, direction, across, .. } => {
            node["matrix"] = matrix(across, direction, centre_m);
        }
        LightShape::Sphere { centre_m, .. } => node["translation"] = json!(centre_m.to_array()),
        LightShape::Sun { direction, .. } => {
            node["matrix"] = matrix(lo_geometry::orthonormal_basis(direction).x_axis, -direction, Vec3::ZERO);
        }
    }
    node
}

/// Encodes a lamp: a rectangle as a 180° spot that fades towards its sides, close to a cosine and of equal power; a
/// sphere as a point light; a sun as a directional light of 683 times its irradiance.
fn lamp_json(index: usize, lamp: &Lamp) -> Value {
    let intensity = lamp.intensity();
    let strongest = intensity.into_iter().fold(0.0, f32::max);
    let area_m2 = lamp.light.extent();
    let (kind, size) = match lamp.light.shape {
        LightShape::Rectangle { .. } => {
            ("spot", json!({ "area_m2": area_m2, "radius_m": (area_m2 / std::f32::consts::PI).sqrt() }))
        }
        LightShape::Sphere { radius_m, .. } => ("point", json!({ "area_m2": area_m2, "radius_m": radius_m })),
        LightShape::Sun { angular_radius_deg, .. } => ("directional", json!({ "angle_deg": 2.0 * angular_radius_deg })),
    };
    let mut light = json!({
        "name": format!("Lamp {}", lamp.label(index)),
        "type": kind,
        "color": intensity.map(|c| c / strongest),
        "intensity": CANDELA * strongest,
        "extras": size,
    });
    light["extras"]["radiance"] = json!(lamp.light.radiance);
    if kind != "directional" {
        light["extras"]["power_w"] = json!(lamp.power());
    }
    if kind == "spot" {
        light["spot"] = json!({ "innerConeAngle": 0.0, "outerConeAngle": std::f64::consts::FRAC_PI_2 });
    }
    light
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gltf::Gltf;
    use gltf::khr_lights_punctual::Kind;

    use super::*;
    use crate::test_scene::box_room;
    use crate::{free_space, lamps, room_mesh};

    fn room() -> Gltf {
        let scene = box_room();
        let leaves = free_space::leaves(&scene.light, None);
        let lamps = lamps::find_lamps(&leaves);
        let mesh = room_mesh::from_leaves(&leaves, &lamps::face_emission(&leaves, &[]), &scene.light.cube, 3);
        // `from_slice` validates indices, accessors and required fields.
        let bytes = encode(&SceneGeometry::Room(&mesh), &scene.frame.camera, WorldFrame::CAMERA, &lamps, &[]).unwrap();
        Gltf::from_slice(&bytes).unwrap()
    }

    /// Returns the linear emission that a renderer finds at each corner of each primitive.
    fn emission(gltf: &Gltf) -> Vec<(Vec3, [f32; 3])> {
        let blob = gltf.blob.as_deref().unwrap();
        let gltf::image::Source::View { view, .. } = gltf.images().next().unwrap().source() else { panic!("no view") };
        let png = lo_imaging::rgba8_from_bytes(&blob[view.offset()..view.offset() + view.length()], "png").unwrap();
        let mut found = Vec::new();
        for primitive in gltf.meshes().next().unwrap().primitives() {
            let strength = primitive.material().emissive_strength().unwrap();
            let reader = primitive.reader(|_| Some(blob));
            let uvs = reader.read_tex_coords(0).unwrap().into_f32();
            for (position, [u, v]) in reader.read_positions().unwrap().zip(uvs) {
                let at = ((u * png.width() as f32) as usize, (v * png.height() as f32) as usize);
                let [r, g, b, _] = png[at];
                found.push((position.into(), [r, g, b].map(|c| lo_imaging::linear_from_srgb8(c) * strength)));
            }
        }
        found
    }

    #[test]
    fn the_room_emits_its_radiance() {
        let gltf = room();
        let emission = emission(&gltf);
        assert_eq!(emission.len(), 4 * 216);
        let at = |p: Vec3| emission.iter().find(|(q, _)| *q == p).unwrap().1;
        let close = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a / b - 1.0).abs() < 0.015);
        // The middle of the lamp, beyond the range of eight bits, and a corner of the room.
        assert!(close(at(Vec3::new(0.0, 1.5, 0.0)), [10.0, 8.0, 6.0]), "{:?}", at(Vec3::new(0.0, 1.5, 0.0)));
        assert!(close(at(Vec3::splat(-1.5)), [0.5; 3]));
    }

    #[test]
    fn every_radiance_finds_a_strength() {
        for (radiance, strength) in
            [(0.0, MIN_STRENGTH), (0.01, MIN_STRENGTH), (0.25, 0.25), (0.3, 1.0), (900.0, 1024.0)]
        {
            let step = strength_step(&[[0.0; 3], [radiance, 0.0, 0.0], [0.0; 3], [0.0; 3]]);
            assert_eq!(STRENGTH_STEP.powi(step), strength, "{radiance}");
        }
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
        // 1 m² of (9, 7.2, 5.4) straight ahead.
        assert!((lights[0].intensity() / (683.0 * 9.0) - 1.0).abs() < 1e-5);
        assert!(lights[0].color().iter().zip([1.0, 0.8, 0.6]).all(|(a, b)| (a - b).abs() < 1e-5));
        assert!(matches!(lights[0].kind(), Kind::Spot { .. }));
        let node = gltf.nodes().find(|node| node.light().is_some()).unwrap();
        let matrix = node.transform().matrix();
        assert_eq!(matrix[3], [0.0, 1.25, 0.0, 1.0]);
        // A spot shines along its −Z: down.
        assert_eq!(matrix[2], [0.0, 1.0, 0.0, 0.0]);
        let [x, y, z] = [0, 1, 2].map(|i| Vec3::from_slice(&matrix[i][..3]));
        assert!((x.cross(y) - z).length() < 1e-6);
    }
}
