#![allow(clippy::unwrap_used)]

use lo_geometry::{Ray, Vec3};
use lo_imaging::Image;

use crate::{AlphaMode, LoadOptions, Material, Model, PreparedModel, Texture, TextureRef};

/// A unit square in the XY plane seen from +Z, with an upright texture.
fn square(material: Material) -> Model {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    let mut model =
        Model::from_triangles(positions, vec![[0, 1, 2], [0, 2, 3]], material, &LoadOptions::default()).unwrap();
    model.uvs[0] = model.positions.iter().map(|p| [p.x, 1.0 - p.y]).collect();
    model
}

fn down(x: f32, y: f32) -> Ray {
    Ray { origin: Vec3::new(x, y, 2.0), direction: Vec3::NEG_Z }
}

#[test]
fn colours_multiply_and_the_picture_stands_upright() {
    let mut model = square(Material { base_color: [0.5, 1.0, 1.0, 1.0], ..Material::default() });
    // Left column red above blue, right column green above white.
    let pixels = vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255; 4]];
    model.textures.push(Texture::from_image(Image::new(2, 2, pixels), true));
    model.materials[0].base_color_texture = Some(TextureRef { nearest: true, ..TextureRef::new(0) });
    model.colors = vec![[0.5, 0.5, 0.5, 1.0]; 4];
    let prepared = PreparedModel::new(model);
    let color = |x, y| {
        let ray = down(x, y);
        let hit = prepared.intersect(&ray, 9.0).unwrap();
        assert!((hit.distance_m - 2.0).abs() < 1e-6);
        prepared.model().surface(&hit, ray.direction, 0.0).base_color
    };
    assert_eq!(color(0.2, 0.8), [0.25, 0.0, 0.0]);
    assert_eq!(color(0.8, 0.8), [0.0, 0.5, 0.0]);
    assert_eq!(color(0.2, 0.2), [0.0, 0.0, 0.5]);
    assert_eq!(color(0.8, 0.2), [0.25, 0.5, 0.5]);
}

#[test]
fn the_footprint_chooses_the_mip_level() {
    let mut model = square(Material::default());
    model.materials[0].base_color = [1.0; 4];
    let pixels = (0..64 * 64).map(|i| if (i + i / 64) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] }).collect();
    model.textures.push(Texture::from_image(Image::new(64, 64, pixels), false));
    model.materials[0].base_color_texture = Some(TextureRef { nearest: true, ..TextureRef::new(0) });
    let prepared = PreparedModel::new(model);
    let ray = down(0.5078, 0.5078);
    let hit = prepared.intersect(&ray, 9.0).unwrap();
    let value = |footprint| prepared.model().surface(&hit, ray.direction, footprint).base_color[0];
    assert!(value(0.0) == 0.0 || value(0.0) == 1.0);
    // A footprint of two texels is level 1, where the chequers are uniformly grey.
    assert!((value(2.0 / 64.0) - 128.0 / 255.0).abs() < 1e-4, "{}", value(2.0 / 64.0));
    assert!((value(10.0) - 128.0 / 255.0).abs() < 1e-4);
}

#[test]
fn normal_textures_bend_the_normal_as_drawn() {
    let bend = |code: [u8; 4], scale: f32, from: f32| {
        let mut model = square(Material { normal_scale: scale, ..Material::default() });
        model.textures.push(Texture::from_image(Image::new(1, 1, vec![code]), false));
        model.materials[0].normal_texture = Some(TextureRef::new(0));
        crate::tangents::complete(&mut model);
        let prepared = PreparedModel::new(model);
        let ray = Ray { origin: Vec3::new(0.4, 0.3, from), direction: Vec3::new(0.0, 0.0, -from.signum()) };
        let hit = prepared.intersect(&ray, 9.0).unwrap();
        prepared.model().surface(&hit, ray.direction, 0.0).shading_normal
    };
    // Codes 255, 128, 128: (1, 0.0039, 0.0039) before scaling.
    let e = 128.0_f32 / 255.0 * 2.0 - 1.0;
    let right = bend([255, 128, 255, 255], 1.0, 2.0);
    assert!(right.distance(Vec3::new(1.0, e, 1.0).normalize()) < 1e-5, "{right}");
    let up = bend([128, 255, 255, 255], 0.5, 2.0);
    assert!(up.distance(Vec3::new(0.5 * e, 0.5, 1.0).normalize()) < 1e-5, "{up}");
    // From behind, the whole frame is flipped towards the viewer.
    let behind = bend([255, 128, 255, 255], 1.0, -2.0);
    assert!(behind.distance(-Vec3::new(1.0, e, 1.0).normalize()) < 1e-5, "{behind}");
}

#[test]
fn shading_normals_stay_on_the_viewers_side() {
    let mut model = square(Material::default());
    model.normals = vec![Vec3::new(1.0, 0.0, 0.1).normalize(); 4];
    let prepared = PreparedModel::new(model);
    for direction in [Vec3::new(0.99, 0.0, -0.1), Vec3::new(-0.99, 0.0, -0.1), Vec3::new(0.99, 0.1, 0.05)] {
        let direction = direction.normalize();
        let ray = Ray { origin: Vec3::new(0.5, 0.5, 0.0) - direction, direction };
        let hit = prepared.intersect(&ray, 9.0).unwrap();
        let point = prepared.model().surface(&hit, direction, 0.0);
        assert!(point.geometric_normal.dot(direction) < 0.0);
        assert!(point.shading_normal.dot(direction) < 0.0 && point.shading_normal.dot(point.geometric_normal) > 0.0);
        assert!((point.shading_normal.length() - 1.0).abs() < 1e-5);
    }
}

#[test]
fn alpha_lets_light_through() {
    let with = |alpha_mode, alpha| {
        PreparedModel::new(square(Material { base_color: [1.0, 1.0, 1.0, alpha], alpha_mode, ..Material::default() }))
    };
    let ray = down(0.3, 0.6);
    let glass = with(AlphaMode::Blend, 0.25);
    assert_eq!(glass.transmittance(&ray, 9.0), 0.75);
    assert_eq!(glass.transmittance(&ray, 1.0), 1.0);
    assert!(!glass.occluded(&ray, 9.0));
    let hit = glass.intersect(&ray, 9.0).unwrap();
    assert_eq!(glass.model().surface(&hit, ray.direction, 0.0).alpha, 0.25);
    assert!(with(AlphaMode::Mask { cutoff: 0.5 }, 0.25).intersect(&ray, 9.0).is_none());
    assert!(with(AlphaMode::Mask { cutoff: 0.5 }, 0.5).occluded(&ray, 9.0));
    assert_eq!(with(AlphaMode::Opaque, 0.1).transmittance(&ray, 9.0), 0.0);
}

#[test]
fn single_sided_backs_are_not_seen_but_cast_shadows() {
    let prepared = PreparedModel::new(square(Material { double_sided: false, ..Material::default() }));
    let up = Ray { origin: Vec3::new(0.3, 0.6, -2.0), direction: Vec3::Z };
    assert!(prepared.intersect(&down(0.3, 0.6), 9.0).is_some());
    assert!(prepared.intersect(&up, 9.0).is_none());
    assert!(prepared.intersect_both_sides(&up, 9.0).is_some());
    assert!(prepared.occluded(&up, 9.0));
}
