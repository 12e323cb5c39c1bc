//! Published meshes: one in the repository, and those of the data beside the checkout.

use std::path::Path;

use lo_geometry::{Ray, Vec3};
use lo_mesh::{AlphaMode, LoadOptions, Model, PreparedModel};
use lo_testdata::{asset, shared_data};

fn load(path: &Path) -> Model {
    Model::load(path, &LoadOptions::default()).unwrap()
}

fn load_beside(file: &str) -> Option<Model> {
    Some(load(&shared_data(&format!("meshes/{file}"), &format!("reading of {file}"))?))
}

fn assert_size(model: &Model, expected: [f32; 3], tolerance: f32) {
    let size = model.bounds().size();
    assert!((size - Vec3::from_array(expected)).abs().max_element() <= tolerance, "{size} against {expected:?}");
}

#[test]
fn tea_set() {
    let Some(model) = load_beside("tea_set_01/tea_set_01_1k.gltf") else { return };
    assert_eq!(model.triangles.len(), 40_296);
    assert_size(&model, [0.92, 0.17, 0.48], 0.0051);
    assert_eq!(model.warnings, Vec::new());
    assert_eq!(model.textures.len(), 3);
    assert_eq!(model.textures[0].levels.len(), 11, "1024 down to 1");
    let material = &model.materials[0];
    assert!(material.double_sided && material.alpha_mode == AlphaMode::Opaque);
    assert!(material.normal_texture.is_some() && material.base_color_texture.is_some());
    assert_eq!(model.tangents.len(), model.positions.len());
    // From above: a plate is some millimetres above the ground.
    let prepared = PreparedModel::new(model);
    let ray = Ray { origin: Vec3::new(-0.35, 1.0, -0.19), direction: Vec3::NEG_Y };
    let hit = prepared.intersect(&ray, 10.0).unwrap();
    assert!((0.97..1.0).contains(&hit.distance_m), "{hit:?}");
    let point = prepared.model().surface(&hit, ray.direction, 0.001);
    assert!(point.geometric_normal.y > 0.9 && point.shading_normal.y > 0.8, "{point:?}");
    assert!(point.base_color.iter().all(|c| (0.001..1.0).contains(c)));
}

#[test]
fn wooden_table() {
    let Some(model) = load_beside("wooden_table_02/wooden_table_02_1k.gltf") else { return };
    assert_eq!(model.triangles.len(), 196);
    assert_size(&model, [1.13, 0.80, 0.71], 0.006);
    assert!(model.warnings.is_empty());
}

#[test]
fn suzanne() {
    let model = load(&asset("suzanne.glb"));
    assert_eq!(model.triangles.len(), 15_744);
    // min and max of the file's accessor.
    assert_size(&model, [2.0 * 0.929_730_1, 0.668_253_5 + 0.669_794_8, 0.576_158_5 + 0.544_786_3], 1e-5);
    let material = &model.materials[model.triangle_materials[0] as usize];
    assert_eq!((material.base_color, material.metallic, material.roughness), ([1.0; 4], 1.0, 1.0));
    assert!(!material.double_sided);
    assert!(model.tangents.is_empty());
}

#[test]
fn spot() {
    let Some(model) = load_beside("spot/spot_triangulated.obj") else { return };
    assert_eq!(model.triangles.len(), 5_856);
    let size = model.bounds().size();
    assert!((size.max_element() - 1.7).abs() < 0.2, "{size}");
    assert_eq!(model.uvs[0].len(), model.positions.len());
    assert!(model.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5));
    assert!(model.warnings.is_empty(), "{:?}", model.warnings);
}

fn load_input(file: &str) -> Option<Model> {
    Some(load(&shared_data(&format!("inputs/meshes/{file}"), &format!("reading of {file}"))?))
}

#[test]
fn specular_glossiness() {
    let Some(model) = load_input("specgloss.glb") else { return };
    let material = &model.materials[0];
    assert!((material.roughness - 0.8).abs() < 1e-6 && material.metallic < 0.01, "{material:?}");
    let texture = material.base_color_texture.as_ref().unwrap().texture;
    assert_eq!(model.textures[texture].levels[0].width(), 64);
    assert_eq!(model.warnings, []);
}

#[test]
fn transmission() {
    let Some(model) = load_input("transm.glb") else { return };
    assert_eq!(model.materials[0].transmission, 1.0);
    assert!(model.materials[0].volume.is_some(), "a solid");
    assert_eq!(model.warnings, []);
}

#[test]
fn transparent_and_black_materials() {
    for (file, rgba) in [("tr1.obj", [1.0, 1.0, 1.0, 0.0]), ("d0.obj", [1.0, 1.0, 1.0, 0.0]), ("blackkd.obj", [1.0; 4])]
    {
        let Some(model) = load_input(file) else { return };
        assert_eq!(model.materials[0].base_color, rgba, "{file}");
        assert!(model.materials[0].base_color_texture.is_some(), "{file}");
        assert_eq!(model.warnings, [], "{file}");
    }
}
