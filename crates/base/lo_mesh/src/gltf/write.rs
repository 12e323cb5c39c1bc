//! Encodes a model as binary glTF 2.0: one mesh per object with one primitive per material, embedded PNG textures,
//! cameras and a sun.

use std::collections::BTreeMap;

use lo_bsdf::GLASS_IOR;
use lo_geometry::{Camera, Quat, RigidTransform, Vec3};
use serde_json::{Map, Value, json};

use crate::{AlphaMode, GlbTooLarge, GlbWriter, Material, Model, Texture, TextureRef, Wrap};

/// Lumens per watt of Blender's importer, which divides a sun's illuminance by it to match the scale of emissive
/// surfaces.
const LUMENS: f32 = 683.0;

/// Contents of a glTF file in addition to the model.
#[derive(Clone, Debug, Default)]
pub struct GlbScene {
    /// Name and triangle indices of each object. Every object becomes a mesh with its own node; without any, the whole
    /// model is one object.
    pub objects: Vec<(String, Vec<usize>)>,
    /// Name, lens and pose (world from camera) of each camera.
    pub cameras: Vec<(String, Camera, RigidTransform)>,
    /// The sun, if any.
    pub sun: Option<GlbSun>,
    /// The scene's `extras`.
    pub extras: Value,
}

/// A directional light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlbSun {
    /// Unit direction towards the light.
    pub direction: Vec3,
    /// Linear RGB irradiance on a surface that faces it, in units of emissive radiance times sr.
    pub irradiance: [f32; 3],
    /// Angular radius, stored in `extras`.
    pub angular_radius_rad: f32,
}

/// Encodes the whole file.
pub(crate) fn write(model: &Model, generator: &str, scene: &GlbScene) -> Result<Vec<u8>, GlbTooLarge> {
    let mut binary = GlbWriter::default();
    let whole = [("Scene".to_owned(), (0..model.triangles.len()).collect())];
    let objects = if scene.objects.is_empty() { &whole[..] } else { &scene.objects };
    let (mut meshes, mut nodes) = (Vec::new(), Vec::new());
    for (name, triangles) in objects.iter().filter(|(_, triangles)| !triangles.is_empty()) {
        let primitives: Vec<Value> = by_material(model, triangles)
            .into_iter()
            .map(|(material, triangles)| primitive(model, material, &triangles, &mut binary))
            .collect();
        nodes.push(json!({ "name": name, "mesh": meshes.len() }));
        meshes.push(json!({ "name": name, "primitives": primitives }));
    }
    let images: Vec<Value> = model.textures.iter().map(|texture| image(texture, &mut binary)).collect();
    let mut samplers = TextureLists::default();
    let mut extensions = BTreeMap::new();
    let materials: Vec<Value> =
        model.materials.iter().map(|m| material_json(m, &mut samplers, &mut extensions)).collect();
    let mut cameras = Vec::new();
    for (name, camera, world_from_camera) in &scene.cameras {
        nodes.push(json!({
            "name": name, "camera": cameras.len(),
            "rotation": world_from_camera.rotation.to_array(), "translation": world_from_camera.translation_m.to_array(),
        }));
        cameras.push(camera_json(name, camera));
    }
    let mut document =
        json!({ "asset": { "version": "2.0", "generator": generator }, "scene": 0, "materials": materials });
    if let Some(sun) = &scene.sun {
        extensions.insert("KHR_lights_punctual", ());
        nodes.push(json!({
            "name": "Sun",
            "rotation": Quat::from_rotation_arc(Vec3::Z, sun.direction).to_array(),
            "extensions": { "KHR_lights_punctual": { "light": 0 } },
        }));
        document["extensions"] = json!({ "KHR_lights_punctual": { "lights": [sun_json(sun)] } });
    }
    document["scenes"] = json!([{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }]);
    if !scene.extras.is_null() {
        document["scenes"][0]["extras"] = scene.extras.clone();
    }
    let lists = [
        ("nodes", nodes),
        ("meshes", meshes),
        ("cameras", cameras),
        ("images", images),
        ("samplers", samplers.samplers),
        ("textures", samplers.textures),
    ];
    for (name, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
        document[name] = list.into();
    }
    if !extensions.is_empty() {
        document["extensionsUsed"] = extensions.into_keys().collect::<Vec<_>>().into();
    }
    binary.finish(document)
}

/// Camera JSON; glTF cameras have a centred principal point.
fn camera_json(name: &str, camera: &Camera) -> Value {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    json!({
        "name": name,
        "type": "perspective",
        "perspective": {
            "yfov": 2.0 * (0.5 * height / camera.fy).atan(),
            "aspectRatio": (width / camera.fx) / (height / camera.fy),
            "znear": 0.01,
        },
    })
}

fn sun_json(sun: &GlbSun) -> Value {
    let strongest = sun.irradiance.into_iter().fold(f32::MIN_POSITIVE, f32::max);
    json!({
        "name": "Sun",
        "type": "directional",
        "color": sun.irradiance.map(|c| c / strongest),
        "intensity": LUMENS * strongest,
        "extras": { "angular_radius_rad": sun.angular_radius_rad },
    })
}

/// Groups triangles by material.
fn by_material(model: &Model, triangles: &[usize]) -> BTreeMap<u32, Vec<[u32; 3]>> {
    let mut groups: BTreeMap<u32, Vec<[u32; 3]>> = BTreeMap::new();
    for &triangle in triangles {
        groups.entry(model.triangle_materials[triangle]).or_default().push(model.triangles[triangle]);
    }
    groups
}

/// Encodes the triangles of one material with the vertices that they use.
fn primitive(model: &Model, material: u32, triangles: &[[u32; 3]], binary: &mut GlbWriter) -> Value {
    let mut new = vec![u32::MAX; model.positions.len()];
    let mut used = Vec::new();
    let mut indices = Vec::with_capacity(triangles.len() * 3);
    for &vertex in triangles.iter().flatten() {
        let slot = &mut new[vertex as usize];
        if *slot == u32::MAX {
            *slot = used.len() as u32;
            used.push(vertex as usize);
        }
        indices.push(*slot);
    }
    let floats = |values: &mut dyn Iterator<Item = f32>| values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    let mut attributes = Map::new();
    let mut add = |name: &str, kind: &str, data: Vec<u8>, extra: Value| {
        let accessor = binary.accessor(&data, used.len(), GlbWriter::FLOAT, kind, GlbWriter::ARRAY_BUFFER, extra);
        attributes.insert(name.to_owned(), accessor.into());
    };
    let bounds = |pick: fn(f32, f32) -> f32, start: f32| {
        used.iter().fold([start; 3], |a, &v| {
            let p = model.positions[v].to_array();
            std::array::from_fn(|c| pick(a[c], p[c]))
        })
    };
    let limits = json!({ "min": bounds(f32::min, f32::INFINITY), "max": bounds(f32::max, f32::NEG_INFINITY) });
    add("POSITION", "VEC3", floats(&mut used.iter().flat_map(|&v| model.positions[v].to_array())), limits);
    if !model.normals.is_empty() {
        add("NORMAL", "VEC3", floats(&mut used.iter().flat_map(|&v| model.normals[v].to_array())), json!({}));
    }
    let tangents = !model.tangents.is_empty() && model.materials[material as usize].normal_texture.is_some();
    if tangents {
        add("TANGENT", "VEC4", floats(&mut used.iter().flat_map(|&v| model.tangents[v])), json!({}));
    }
    for (set, uvs) in model.uvs.iter().enumerate().filter(|(_, uvs)| !uvs.is_empty()) {
        add(&format!("TEXCOORD_{set}"), "VEC2", floats(&mut used.iter().flat_map(|&v| uvs[v])), json!({}));
    }
    if !model.colors.is_empty() {
        add("COLOR_0", "VEC4", floats(&mut used.iter().flat_map(|&v| model.colors[v])), json!({}));
    }
    let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
    let indices = binary.accessor(
        &bytes,
        indices.len(),
        GlbWriter::UNSIGNED_INT,
        "SCALAR",
        GlbWriter::ELEMENT_ARRAY_BUFFER,
        json!({}),
    );
    json!({ "attributes": attributes, "indices": indices, "material": material })
}

fn image(texture: &Texture, binary: &mut GlbWriter) -> Value {
    let png = lo_imaging::encode_png_rgba(&texture.levels[0]);
    json!({ "mimeType": "image/png", "bufferView": binary.view(&png) })
}

/// Deduplicated samplers and textures.
#[derive(Default)]
struct TextureLists {
    samplers: Vec<Value>,
    textures: Vec<Value>,
}

impl TextureLists {
    /// Returns the `textureInfo` of a texture reference.
    fn info(&mut self, reference: &TextureRef, extensions: &mut BTreeMap<&'static str, ()>) -> Value {
        let wrap = reference.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 10497,
            Wrap::Mirror => 33648,
            Wrap::Clamp => 33071,
        });
        let magnify = if reference.nearest { 9728 } else { 9729 };
        let sampler = json!({ "wrapS": wrap[0], "wrapT": wrap[1], "magFilter": magnify, "minFilter": 9987 });
        let sampler = index_of(&mut self.samplers, sampler);
        let texture = index_of(&mut self.textures, json!({ "source": reference.texture, "sampler": sampler }));
        let mut info = json!({ "index": texture, "texCoord": reference.uv_set });
        if reference.uv_transform != [1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
            extensions.insert("KHR_texture_transform", ());
            info["extensions"] = json!({ "KHR_texture_transform": transform(&reference.uv_transform) });
        }
        info
    }
}

fn index_of(list: &mut Vec<Value>, value: Value) -> usize {
    list.iter().position(|known| *known == value).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}

/// Decomposes a 2×3 matrix `T · R · S` to offset, rotation and scale of `KHR_texture_transform`, whose R turns
/// clockwise in (u, v down).
fn transform(m: &[f32; 6]) -> Value {
    let scale_u = m[0].hypot(m[3]);
    let rotation = (-m[3]).atan2(m[0]);
    let determinant = m[0] * m[4] - m[1] * m[3];
    let scale_v = if scale_u > 0.0 { determinant / scale_u } else { 0.0 };
    json!({ "offset": [m[2], m[5]], "rotation": rotation, "scale": [scale_u, scale_v] })
}

fn material_json(m: &Material, lists: &mut TextureLists, used: &mut BTreeMap<&'static str, ()>) -> Value {
    let mut pbr = json!({
        "baseColorFactor": m.base_color, "metallicFactor": m.metallic, "roughnessFactor": m.roughness,
    });
    if let Some(texture) = &m.base_color_texture {
        pbr["baseColorTexture"] = lists.info(texture, used);
    }
    if let Some(texture) = &m.metallic_roughness_texture {
        pbr["metallicRoughnessTexture"] = lists.info(texture, used);
    }
    let mut json = json!({ "name": m.name, "pbrMetallicRoughness": pbr, "doubleSided": m.double_sided });
    if let Some(texture) = &m.normal_texture {
        json["normalTexture"] = lists.info(texture, used);
        json["normalTexture"]["scale"] = m.normal_scale.into();
    }
    if let Some(texture) = &m.occlusion_texture {
        json["occlusionTexture"] = lists.info(texture, used);
        json["occlusionTexture"]["strength"] = m.occlusion_strength.into();
    }
    match m.alpha_mode {
        AlphaMode::Opaque => {}
        AlphaMode::Mask { cutoff } => {
            json["alphaMode"] = "MASK".into();
            json["alphaCutoff"] = cutoff.into();
        }
        AlphaMode::Blend => json["alphaMode"] = "BLEND".into(),
    }
    let mut extensions = Map::new();
    let mut extend = |name: &'static str, value: Value| {
        used.insert(name, ());
        extensions.insert(name.to_owned(), value);
    };
    let brightest = m.emissive.iter().copied().fold(0.0, f32::max);
    if brightest > 0.0 {
        // The factor is limited to 1; brighter values go into the strength.
        let strength = brightest.max(1.0);
        json["emissiveFactor"] = json!(m.emissive.map(|c| c / strength));
        if strength > 1.0 {
            extend("KHR_materials_emissive_strength", json!({ "emissiveStrength": strength }));
        }
    }
    if m.unlit {
        extend("KHR_materials_unlit", json!({}));
    }
    if m.transmission > 0.0 {
        extend("KHR_materials_transmission", json!({ "transmissionFactor": m.transmission }));
    }
    if let Some(volume) = m.volume {
        // Any thickness says that the mesh is a solid.
        let mut value = json!({ "thicknessFactor": 1.0, "attenuationColor": volume.attenuation_color });
        if volume.attenuation_distance_m.is_finite() {
            value["attenuationDistance"] = volume.attenuation_distance_m.into();
        }
        extend("KHR_materials_volume", value);
    }
    if m.ior != GLASS_IOR {
        extend("KHR_materials_ior", json!({ "ior": m.ior }));
    }
    if m.specular != [1.0; 3] {
        extend("KHR_materials_specular", json!({ "specularColorFactor": m.specular }));
    }
    if m.clearcoat > 0.0 {
        let value = json!({ "clearcoatFactor": m.clearcoat, "clearcoatRoughnessFactor": m.clearcoat_roughness });
        extend("KHR_materials_clearcoat", value);
    }
    if m.sheen != [0.0; 3] {
        let value = json!({ "sheenColorFactor": m.sheen, "sheenRoughnessFactor": m.sheen_roughness });
        extend("KHR_materials_sheen", value);
    }
    if m.diffuse_transmission > 0.0 {
        let [r, g, b, _] = m.base_color;
        let value = json!({
            "diffuseTransmissionFactor": m.diffuse_transmission, "diffuseTransmissionColorFactor": [r, g, b],
        });
        extend("KHR_materials_diffuse_transmission", value);
    }
    if !extensions.is_empty() {
        json["extensions"] = extensions.into();
    }
    if let Some(texture) = &m.emissive_texture {
        json["emissiveTexture"] = lists.info(texture, used);
    }
    json
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_imaging::Image;

    use super::*;
    use crate::Volume;

    /// Two materials, one with a rotated texture, one emissive; one unused vertex.
    fn model() -> Model {
        let picture = Image::from_fn(4, 2, |x, y| [(40 * x) as u8, (90 * y) as u8, 7, 255]);
        let (sin, cos) = 0.3_f32.sin_cos();
        let reference = TextureRef {
            uv_transform: [cos * 2.0, sin * 0.5, 0.1, -sin * 2.0, cos * 0.5, 0.2],
            wrap: [Wrap::Mirror, Wrap::Clamp],
            nearest: true,
            ..TextureRef::new(0)
        };
        let cloth = Material {
            name: "cloth".to_owned(),
            base_color: [0.5, 0.4, 0.3, 1.0],
            base_color_texture: Some(reference),
            roughness: 0.7,
            diffuse_transmission: 0.25,
            alpha_mode: AlphaMode::Mask { cutoff: 0.25 },
            ..Material::default()
        };
        let lamp = Material {
            name: "lamp".to_owned(),
            emissive: [300.0, 200.0, 100.0],
            transmission: 0.5,
            volume: Some(Volume { attenuation_color: [0.5, 0.75, 0.25], attenuation_distance_m: 0.125 }),
            ior: 1.25,
            specular: [0.5, 0.25, 1.5],
            clearcoat: 0.75,
            clearcoat_roughness: 0.25,
            sheen: [0.25, 0.5, 0.75],
            sheen_roughness: 0.5,
            double_sided: false,
            ..Material::default()
        };
        Model {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(9.0), Vec3::Z],
            normals: vec![Vec3::Z, Vec3::Z, Vec3::Z, Vec3::X, Vec3::X],
            tangents: Vec::new(),
            uvs: [vec![[0.0, 0.5], [1.0, 0.0], [0.25, 2.0], [0.0; 2], [3.0, 4.0]], Vec::new()],
            colors: vec![[1.0, 0.5, 0.25, 1.0]; 5],
            triangles: vec![[0, 1, 2], [0, 2, 4]],
            triangle_materials: vec![1, 0],
            materials: vec![cloth, lamp],
            textures: vec![Texture::from_image(picture, true)],
            warnings: Vec::new(),
        }
    }

    #[test]
    fn the_reader_finds_what_was_written() {
        let written = model();
        let read =
            Model::from_gltf_bytes(&written.to_glb("tests").unwrap(), &|_| Err(std::io::Error::other("no files")))
                .unwrap();
        assert_eq!(read.textures, written.textures);
        assert_eq!(read.warnings, []);
        // glTF's default material comes last.
        for (read, written) in read.materials.iter().zip(&written.materials) {
            let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-6 * b.abs().max(1.0));
            assert!(close(&read.emissive, &written.emissive), "{:?}", read.emissive);
            let transform = |m: &Material| m.base_color_texture.as_ref().map_or([0.0; 6], |t| t.uv_transform);
            assert!(close(&transform(read), &transform(written)), "{:?}", transform(read));
            let bare = |m: &Material| {
                let mut m = Material { emissive: [0.0; 3], ..m.clone() };
                if let Some(texture) = &mut m.base_color_texture {
                    texture.uv_transform = [0.0; 6];
                }
                m
            };
            assert_eq!(bare(read), bare(written));
        }
        // Triangles are grouped by material; corners are equal, and the unused vertex is omitted.
        assert_eq!(read.triangle_materials, [0, 1]);
        assert_eq!(read.positions.len(), 6);
        for (t, original) in read.triangles.iter().zip([written.triangles[1], written.triangles[0]]) {
            for (&v, o) in t.iter().zip(original.map(|o| o as usize)) {
                let v = v as usize;
                assert_eq!(read.positions[v], written.positions[o]);
                assert_eq!(read.normals[v], written.normals[o]);
                assert_eq!(read.uvs[0][v], written.uvs[0][o]);
                assert_eq!(read.colors[v], written.colors[o]);
            }
        }
    }

    #[test]
    fn objects_cameras_and_the_sun_are_there() {
        let camera = Camera::new(500.0, 500.0, 400.0, 300.0, 800, 600).unwrap();
        let rotation = Quat::from_rotation_y(0.3);
        let pose = RigidTransform { rotation, translation_m: Vec3::new(1.0, 2.0, 3.0) };
        let direction = Vec3::new(0.3, 0.8, -0.2).normalize();
        let scene = GlbScene {
            objects: vec![("cloth".to_owned(), vec![1]), ("nothing".to_owned(), vec![]), ("lamp".to_owned(), vec![0])],
            cameras: vec![("Photo 1".to_owned(), camera, pose)],
            sun: Some(GlbSun { direction, irradiance: [8.0, 4.0, 2.0], angular_radius_rad: 0.005 }),
            extras: Value::Null,
        };
        let gltf = gltf::Gltf::from_slice(&model().to_glb_scene("tests", &scene).unwrap()).unwrap();
        let names: Vec<_> = gltf.meshes().map(|mesh| mesh.name().unwrap().to_owned()).collect();
        assert_eq!(names, ["cloth", "lamp"]);
        assert!(gltf.meshes().all(|mesh| mesh.primitives().len() == 1));
        let node = |name: &str| gltf.nodes().find(|node| node.name() == Some(name)).unwrap();
        let (translation, quaternion, _) = node("Photo 1").transform().decomposed();
        assert_eq!((translation, quaternion), ([1.0, 2.0, 3.0], rotation.to_array()));
        let camera = gltf.cameras().next().unwrap();
        let gltf::camera::Projection::Perspective(lens) = camera.projection() else { panic!("no perspective") };
        assert!((lens.yfov() - 2.0 * 0.6f32.atan()).abs() < 1e-6);
        // The light shines along the node's −Z, away from the sun.
        let matrix = node("Sun").transform().matrix();
        assert!((Vec3::from_slice(&matrix[2][..3]) - direction).length() < 1e-6);
        // The gltf crate is built without lights: check the JSON.
        let glb = model().to_glb_scene("tests", &scene).unwrap();
        let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        let root: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
        let light = &root["extensions"]["KHR_lights_punctual"]["lights"][0];
        assert_eq!((&light["intensity"], &light["color"]), (&json!(683.0 * 8.0), &json!([1.0, 0.5, 0.25])));
    }

    #[test]
    fn the_file_names_its_maker_and_its_extensions() {
        let glb = model().to_glb("tests").unwrap();
        let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        let root: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
        assert_eq!(root["asset"]["generator"], "tests");
        let expected = [
            "KHR_materials_clearcoat",
            "KHR_materials_diffuse_transmission",
            "KHR_materials_emissive_strength",
            "KHR_materials_ior",
            "KHR_materials_sheen",
            "KHR_materials_specular",
            "KHR_materials_transmission",
            "KHR_materials_volume",
            "KHR_texture_transform",
        ];
        assert_eq!(root["extensionsUsed"], json!(expected));
        assert_eq!(u32::from_le_bytes(glb[8..12].try_into().unwrap()) as usize, glb.len());
    }
}
