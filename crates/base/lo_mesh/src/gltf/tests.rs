#![allow(clippy::unwrap_used)]

use std::io::{Error, ErrorKind};

use base64::Engine;
use lo_geometry::Vec3;
use serde_json::{Value, json};

use crate::{AlphaMode, MeshError, MeshWarning, Model, Volume, Wrap};

fn read(bytes: &[u8]) -> Result<Model, MeshError> {
    Model::from_gltf_bytes(bytes, &|_| Err(Error::from(ErrorKind::NotFound)))
}

fn read_json(root: &Value) -> Result<Model, MeshError> {
    read(root.to_string().as_bytes())
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Collects accessors over one buffer.
#[derive(Default)]
struct Builder {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Builder {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.accessors.push(json!({"bufferView": view, "componentType": component, "type": kind, "count": count}));
        self.accessors.len() - 1
    }

    /// The file with one mesh and the given primitive and extra properties; data URI, or GLB with `as_glb`.
    fn root(&self, primitive: Value, extra: Value) -> Value {
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bytes);
        let mut root = json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [primitive]}],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bytes.len(), "uri": format!("data:application/octet-stream;base64,{data}")}],
        });
        for (key, value) in extra.as_object().unwrap() {
            root[key] = value.clone();
        }
        root
    }
}

fn glb(mut root: Value, binary: &[u8]) -> Vec<u8> {
    root["buffers"][0].as_object_mut().unwrap().remove("uri");
    let mut json = root.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend((12 + 8 + json.len() as u32 + 8 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json[..]), (b"BIN\0", binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

const SQUARE: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];

fn square() -> Builder {
    let mut builder = Builder::default();
    builder.accessor(&floats(&SQUARE), 5126, "VEC3", 4);
    builder
}

#[test]
fn lists_strips_fans_and_index_types() {
    for (mode, order) in [(4, vec![0, 1, 2, 1, 3, 2]), (5, vec![0, 1, 2, 3]), (6, vec![0, 1, 3, 2])] {
        for component in [5121, 5123, 5125] {
            let mut builder = square();
            let bytes: Vec<u8> = order
                .iter()
                .flat_map(|&i: &u32| i.to_le_bytes()[..[1, 0, 2, 0, 4][component as usize - 5121]].to_vec())
                .collect();
            let indices = builder.accessor(&bytes, component, "SCALAR", order.len());
            let primitive = json!({"attributes": {"POSITION": 0}, "indices": indices, "mode": mode});
            let model = read_json(&builder.root(primitive, json!({}))).unwrap();
            assert_eq!(model.triangles.len(), 2, "mode {mode}");
            assert!(model.normals.iter().all(|&n| n == Vec3::Z), "mode {mode}: {:?}", model.normals);
            assert_eq!(model.positions.len(), 6, "flat without normals");
        }
    }
    let lines = square().root(json!({"attributes": {"POSITION": 0}, "mode": 1}), json!({}));
    assert_eq!(
        read_json(&lines).unwrap_err().to_string(),
        "the mesh has no triangles: primitives of points or lines ignored: 1"
    );
    let unindexed = square().root(json!({"attributes": {"POSITION": 0}, "mode": 5}), json!({}));
    assert_eq!(read_json(&unindexed).unwrap().triangles.len(), 2);
}

#[test]
fn glb_equals_json() {
    let builder = square();
    let root = builder.root(json!({"attributes": {"POSITION": 0}, "mode": 5}), json!({}));
    let (a, b) = (read_json(&root).unwrap(), read(&glb(root, &builder.bytes)).unwrap());
    assert_eq!((a.positions, a.triangles), (b.positions, b.triangles));
}

#[test]
fn nodes_move_and_mirrors_turn_the_winding() {
    let nodes = json!({"nodes": [
        {"children": [1, 2], "translation": [10, 0, 0], "scale": [2, 2, 2]},
        {"mesh": 0, "scale": [-1, 1, 1]},
        {"mesh": 0, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
    ]});
    let mut builder = square();
    let normals = builder.accessor(&floats(&[0.0, 0.0, 1.0].repeat(4)), 5126, "VEC3", 4);
    let root = builder.root(json!({"attributes": {"POSITION": 0, "NORMAL": normals}, "mode": 5}), nodes);
    let model = read_json(&root).unwrap();
    assert_eq!(model.triangles.len(), 4);
    let bounds = model.bounds();
    assert_eq!((bounds.min, bounds.max), (Vec3::new(8.0, 0.0, 0.0), Vec3::new(10.0, 2.0, 10.0)));
    for triangle in &model.triangles {
        let face = crate::repair::face_normal(triangle.map(|v| model.positions[v as usize]));
        assert!(face.distance(Vec3::Z) < 1e-6 && model.normals[triangle[0] as usize].distance(Vec3::Z) < 1e-6);
    }
}

#[test]
fn attributes_normalised_sparse_and_coloured() {
    let mut builder = square();
    // Sparse without a base view: zeros except for the last two.
    let at = builder.view(&[2, 3]);
    let values = builder.view(&floats(&[0.5, 0.25, 1.0, 0.75]));
    builder.accessors.push(json!({"componentType": 5126, "type": "VEC2", "count": 4, "sparse": {"count": 2,
        "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values}}}));
    let uv = builder.accessors.len() - 1;
    let color = builder.accessor(&[255, 0, 51, 0].repeat(4), 5121, "VEC3", 4);
    builder.accessors[color]["normalized"] = json!(true);
    builder.views.last_mut().unwrap()["byteStride"] = json!(4);
    let normal = builder.accessor(&[0, 0, 127, 0].repeat(4), 5120, "VEC3", 4);
    builder.accessors[normal]["normalized"] = json!(true);
    builder.views.last_mut().unwrap()["byteStride"] = json!(4);
    let attributes = json!({"POSITION": 0, "TEXCOORD_1": uv, "COLOR_0": color, "NORMAL": normal});
    let model = read_json(&builder.root(json!({"attributes": attributes, "mode": 5}), json!({}))).unwrap();
    assert_eq!(model.uvs[1], [[0.0, 0.0], [0.0, 0.0], [0.5, 0.25], [1.0, 0.75]]);
    assert!(model.uvs[0].is_empty());
    assert_eq!(model.colors[1], [1.0, 0.0, 0.2, 1.0]);
    assert_eq!(model.normals[3], Vec3::Z);
}

#[test]
fn materials_and_textures() {
    let mut builder = square();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.png");
    lo_imaging::write_rgba8(&path, &lo_imaging::Image::new(1, 1, vec![[255, 0, 0, 255]]), lo_imaging::GENERATOR)
        .unwrap();
    let picture = builder.view(&std::fs::read(&path).unwrap());
    let uv = builder.accessor(&floats(&[0.0; 8]), 5126, "VEC2", 4);
    let extra = json!({
        "extensionsRequired": ["KHR_texture_transform"],
        "images": [{"bufferView": picture, "mimeType": "image/png"}, {"uri": "gone%20away.png"}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
        "textures": [{"source": 0, "sampler": 0}, {"source": 1}],
        "materials": [{
            "name": "lamp",
            "pbrMetallicRoughness": {"metallicFactor": 0.25, "roughnessFactor": 0.5, "baseColorTexture": {"index": 0,
                "texCoord": 1, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.25], "scale": [2, 3],
                "rotation": std::f32::consts::FRAC_PI_2, "texCoord": 0}}}},
            "normalTexture": {"index": 1, "scale": 0.5},
            "emissiveFactor": [1, 0.5, 0],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 8}, "KHR_materials_unlit": {}},
            "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": true,
        }],
    });
    let primitive = json!({"attributes": {"POSITION": 0, "TEXCOORD_0": uv}, "mode": 5, "material": 0});
    let model = read_json(&builder.root(primitive, extra)).unwrap();
    let material = &model.materials[0];
    assert_eq!((material.metallic, material.roughness, material.emissive), (0.25, 0.5, [8.0, 4.0, 0.0]));
    assert!(material.unlit && material.double_sided && material.alpha_mode == AlphaMode::Mask { cutoff: 0.3 });
    let texture = material.base_color_texture.as_ref().unwrap();
    assert_eq!((texture.uv_set, texture.wrap, texture.nearest), (0, [Wrap::Clamp, Wrap::Mirror], true));
    // The extension's own example matrix: offset · rotation · scale of (1, 0) and (0, 1).
    for (given, expected) in [([1.0, 0.0], [0.5, 0.25 - 2.0]), ([0.0, 1.0], [0.5 + 3.0, 0.25])] {
        let [u, v] = texture.transform(given);
        assert!((u - expected[0]).abs() < 1e-6 && (v - expected[1]).abs() < 1e-6, "{u} {v}");
    }
    assert_eq!(model.textures[texture.texture].levels[0].pixels(), [[255, 0, 0, 255]]);
    assert!(material.normal_texture.is_none());
    assert_eq!(model.warnings.len(), 1);
    assert!(
        model.warnings[0].to_string().starts_with("texture gone%20away.png ignored: cannot read gone away.png: "),
        "{:?}",
        model.warnings
    );
}

/// Reads a square with one material and one image of the given pixels.
fn with_material(material: Value, width: usize, pixels: Vec<[u8; 4]>, extra: Value) -> Result<Model, MeshError> {
    let mut builder = square();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.png");
    let image = lo_imaging::Image::new(width, pixels.len() / width, pixels);
    lo_imaging::write_rgba8(&path, &image, lo_imaging::GENERATOR).unwrap();
    let view = builder.view(&std::fs::read(&path).unwrap());
    let mut root = builder.root(json!({"attributes": {"POSITION": 0}, "mode": 5, "material": 0}), extra);
    root["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
    root["textures"] = json!([{"source": 0}]);
    root["materials"] = json!([material]);
    read_json(&root)
}

#[test]
fn specular_glossiness_is_converted() {
    let convert = |value: Value, width: usize, pixels: Vec<[u8; 4]>| {
        let material = json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": value}});
        let required = json!({"extensionsRequired": ["KHR_materials_pbrSpecularGlossiness"]});
        with_material(material, width, pixels, required).unwrap()
    };
    // A dielectric keeps its image, whose factor is unchanged by a reflectance of 4 %.
    let plastic =
        json!({"diffuseTexture": {"index": 0}, "glossinessFactor": 0.2, "specularFactor": [0.04, 0.04, 0.04]});
    let model = convert(plastic, 1, vec![[255, 0, 0, 255]]);
    let material = &model.materials[0];
    assert_eq!((material.metallic, material.metallic_roughness_texture.is_some()), (0.0, false));
    assert!((material.roughness - 0.8).abs() < 1e-6);
    assert!(material.base_color.iter().all(|c| (c - 1.0).abs() < 1e-6), "{:?}", material.base_color);
    assert!(material.base_color_texture.is_some() && model.warnings.is_empty(), "{:?}", model.warnings);

    // Gold and dull blue plastic in one image of specular colour and glossiness, over a black diffuse colour.
    let gold = [255, 226, 155, 204];
    let both = json!({"diffuseFactor": [0, 0, 0, 0.5], "specularGlossinessTexture": {"index": 0}});
    let model = convert(both, 2, vec![gold, [0, 0, 0, 51]]);
    let material = &model.materials[0];
    let texels = |reference: &Option<crate::TextureRef>| {
        model.textures[reference.as_ref().unwrap().texture].levels[0].pixels().to_vec()
    };
    let base = texels(&material.base_color_texture);
    assert_eq!((&base[0][..3], &base[1][..3]), (&gold[..3], &[0, 0, 0][..]));
    // Roughness 1 − glossiness in green, metalness in blue.
    let surface = texels(&material.metallic_roughness_texture);
    assert_eq!((&surface[0][1..3], &surface[1][1..3]), (&[51, 255][..], &[204, 0][..]));
    assert_eq!((material.metallic, material.roughness, material.base_color), (1.0, 1.0, [1.0, 1.0, 1.0, 0.5]));
}

#[test]
fn glass_has_an_interior_if_it_has_a_thickness() {
    let glass = |transmission: Value, other: Value| {
        let mut extensions = other;
        extensions["KHR_materials_transmission"] = transmission;
        with_material(json!({"name": "pane", "extensions": extensions}), 1, vec![[102, 0, 0, 255]], json!({})).unwrap()
    };
    let volume = |thickness: f32| {
        let volume = json!({
            "thicknessFactor": thickness, "attenuationDistance": 0.5, "attenuationColor": [0.25, 0.5, 1]
        });
        json!({"KHR_materials_volume": volume, "KHR_materials_ior": {"ior": 1.25}})
    };
    let model = glass(json!({"transmissionFactor": 0.75}), volume(0.1));
    let material = &model.materials[0];
    assert_eq!((material.transmission, material.ior), (0.75, 1.25));
    let interior = Volume { attenuation_color: [0.25, 0.5, 1.0], attenuation_distance_m: 0.5 };
    assert_eq!(material.volume, Some(interior));
    assert_eq!(model.warnings, []);
    let model = glass(json!({"transmissionFactor": 0.75}), volume(0.0));
    assert_eq!(model.materials[0].volume, None);
    assert_eq!(model.warnings, [MeshWarning::ThinGlass { materials: vec!["pane".to_owned()] }]);
    // The mean of its image counts: 102 of 255.
    let model = glass(json!({"transmissionFactor": 0.5, "transmissionTexture": {"index": 0}}), json!({}));
    assert!((model.materials[0].transmission - 0.2).abs() < 1e-6);
}

#[test]
fn layers_and_reflectance_of_dielectrics_are_read() {
    let read = |extensions: Value| {
        let model = with_material(json!({ "extensions": extensions }), 1, vec![[0; 4]], json!({})).unwrap();
        (model.materials[0].clone(), model.warnings)
    };
    let (material, warnings) = read(json!({
        "KHR_materials_clearcoat": {"clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.25},
        "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 2]},
        "KHR_materials_ior": {"ior": 0},
        "KHR_materials_sheen": {"sheenColorFactor": [0.5, 0.25, 0], "sheenRoughnessFactor": 0.75},
    }));
    assert_eq!((material.clearcoat, material.clearcoat_roughness), (0.75, 0.25));
    assert_eq!((material.specular, material.ior), ([0.5, 0.25, 1.0], 100.0));
    assert_eq!((material.sheen, material.sheen_roughness), ([0.5, 0.25, 0.0], 0.75));
    assert_eq!(warnings, []);
    // Extensions and textures that are not applied are named once; those without effect are not.
    let (_, warnings) = read(json!({
        "KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatTexture": {"index": 0}},
        "KHR_materials_sheen": {"sheenColorFactor": [0, 0, 0], "sheenColorTexture": {"index": 0}},
        "KHR_materials_iridescence": {"iridescenceFactor": 1}, "EXT_materials_glitter": {},
    }));
    let names = ["EXT_materials_glitter", "KHR_materials_iridescence", "clearcoatTexture", "sheenColorTexture"];
    let names = names.map(str::to_owned).to_vec();
    assert_eq!(warnings, [MeshWarning::MaterialExtensions { names }]);
}

#[test]
fn errors_say_what_to_do() {
    let error = |root: Value| read_json(&root).unwrap_err().to_string();
    let plain = || square().root(json!({"attributes": {"POSITION": 0}, "mode": 5}), json!({}));
    let with = |path: &str, value: Value| {
        let mut root = plain();
        *root.pointer_mut(path).unwrap() = value;
        root
    };
    let mut draco = plain();
    draco["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    assert_eq!(
        error(draco),
        "the file requires the unsupported glTF extension KHR_draco_mesh_compression: export without Draco \
         compression, or decompress the file with `gltf-transform cp in.glb out.glb`"
    );
    assert_eq!(
        error(with("/buffers/0/uri", json!("data%201.bin"))),
        "cannot read data 1.bin, which contains the mesh's vertices: entity not found"
    );
    let huge = error(with("/accessors/0/count", json!(4_000_000_000_u64)));
    assert!(huge.starts_with("the mesh expands to 4000000000 vertices, more than the limit of 20"), "{huge}");
    assert_eq!(
        error(with("/accessors/0/count", json!(5))),
        "invalid glTF file at accessor 0: 5 elements do not fit into bufferView 0 (48 bytes)"
    );
    assert_eq!(
        error(with("/nodes/0/mesh", json!(3))),
        "invalid glTF file at mesh 3: the index is out of range, the file has 1"
    );
    assert_eq!(
        error(with("/nodes/0", json!({"mesh": 0, "children": [0]}))),
        "invalid glTF file at node 0: it has several parents, or the hierarchy is too deep"
    );
    assert_eq!(
        error(with("/asset/version", json!("1.0"))),
        "invalid glTF file at asset.version: unsupported glTF version 1.0; only 2.0 is supported"
    );
    let mut wrong = square();
    let indices = wrong.accessor(&[0, 1, 9], 5121, "SCALAR", 3);
    let root = wrong.root(json!({"attributes": {"POSITION": 0}, "indices": indices}), json!({}));
    assert_eq!(error(root), "mesh 0 '', primitive 0 refers to vertex 9, but there are 4 vertices (counted from 0)");
    assert!(error(json!({"asset": 3})).starts_with("invalid glTF file at line 1, column "));
}

#[test]
fn instances_of_instances_stay_within_the_budget() {
    // 2000 nodes instantiate one mesh of 4000 triangles that share three vertices.
    let mut builder = square();
    let indices = builder.accessor(&[0, 1, 2].repeat(4000), 5121, "SCALAR", 12_000);
    let nodes: Vec<Value> = (0..2000).map(|_| json!({"mesh": 0})).collect();
    let scenes = json!([{"nodes": (0..2000).collect::<Vec<_>>()}]);
    let root = builder
        .root(json!({"attributes": {"POSITION": 0}, "indices": indices}), json!({"nodes": nodes, "scenes": scenes}));
    assert!(matches!(read_json(&root).unwrap_err(), MeshError::TooLarge { .. }));
}

#[test]
fn truncation_never_panics() {
    let builder = square();
    let root = builder.root(json!({"attributes": {"POSITION": 0}, "mode": 5}), json!({}));
    let (text, binary) = (root.to_string(), glb(root, &builder.bytes));
    for end in 0..text.len() {
        assert!(read(&text.as_bytes()[..end]).is_err());
    }
    for end in 0..binary.len() {
        assert!(read(&binary[..end]).is_err());
    }
    // One byte wrong anywhere: any answer but a panic.
    for at in 0..binary.len() {
        for value in [0, 1, 0x7f, 0xff, b'9'] {
            let mut bytes = binary.clone();
            bytes[at] = value;
            let _ = read(&bytes);
        }
    }
}

#[test]
fn emission_stays_finite() {
    let strength = json!({"KHR_materials_emissive_strength": {"emissiveStrength": 3e38}});
    let extra = json!({"materials": [{"emissiveFactor": [1.0, 1e30, 0.0], "extensions": strength}]});
    let model =
        read_json(&square().root(json!({"attributes": {"POSITION": 0}, "mode": 5, "material": 0}), extra)).unwrap();
    assert_eq!(model.materials[0].emissive, [3e38, f32::MAX, 0.0]);
}

#[test]
fn a_file_that_many_buffers_name_is_read_once() {
    let mut root = square().root(json!({"attributes": {"POSITION": 0}, "mode": 5}), json!({}));
    root["buffers"] = (0..500).map(|_| json!({"byteLength": 48, "uri": "a.bin"})).collect();
    root["bufferViews"][0]["buffer"] = json!(499);
    let reads = std::cell::Cell::new(0);
    let model = Model::from_gltf_bytes(root.to_string().as_bytes(), &|_| {
        reads.set(reads.get() + 1);
        Ok(floats(&SQUARE))
    });
    assert_eq!((model.unwrap().triangles.len(), reads.get()), (2, 1));
}

#[cfg(unix)]
#[test]
fn a_device_is_no_file_beside_the_mesh() {
    let mut root = square().root(json!({"attributes": {"POSITION": 0}, "mode": 5}), json!({}));
    root["buffers"][0]["uri"] = json!("/dev/zero");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, root.to_string()).unwrap();
    let error = Model::load(&path, &crate::LoadOptions::default()).unwrap_err();
    let error = std::error::Error::source(&error).unwrap().to_string();
    assert!(error.ends_with("only regular files are read"), "{error}");
    let error = Model::load("/dev/zero", &crate::LoadOptions::default()).unwrap_err().to_string();
    assert!(error.starts_with("cannot read /dev/zero") && error.ends_with("only regular files are read"), "{error}");
}
