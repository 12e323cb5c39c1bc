//! Passes for compositing.

use crate::box_room::*;
use lo_geometry::Vec3;
use lo_imaging::RadianceImage;
use lo_insert::{Composite, Inserter, Instance, Lighting, Passes, Quality};
use lo_mesh::{Material, Model, PreparedModel, Volume};

fn sum(images: &[&RadianceImage], i: usize) -> Vec3 {
    images.iter().map(|image| Vec3::from(image.pixels()[i])).sum()
}

fn named(name: &str) -> Material {
    Material { name: name.to_owned(), ..matte() }
}

/// A red ball before a shining one and one of glass.
fn composite(inserter: &Inserter) -> Composite {
    let ball = |material| PreparedModel::new(Model::sphere(1.0, 4, material).unwrap());
    let red = ball(Material { base_color: [0.8, 0.1, 0.1, 1.0], clearcoat: 0.5, ..named("lacquer") });
    let lamp = ball(Material { emissive: [0.5, 0.4, 0.3], ..named("lamp") });
    let glass = ball(Material { transmission: 1.0, volume: Some(Volume::CLEAR), roughness: 0.0, ..named("glass") });
    let instances = [
        Instance::new(&red, in_air(Vec3::new(-0.2, 0.0, -1.8), 0.3)).named("red ball"),
        Instance::new(&lamp, in_air(Vec3::new(0.2, 0.1, -2.4), 0.3)),
        Instance::new(&glass, on_floor(0.5, -2.2, 0.3)).named("glass ball"),
    ];
    together(inserter, &instances)
}

fn passes(composite: &Composite) -> &Passes {
    composite.passes.as_deref().unwrap()
}

#[test]
fn light_by_kind_adds_up_to_the_objects() {
    let scene = linear_scene();
    for look in [false, true] {
        let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap().with_passes();
        let inserter = if look { inserter.with_photo_look() } else { inserter };
        let composite = composite(&inserter);
        let passes = passes(&composite);
        let parts = [&passes.diffuse, &passes.specular, &passes.transmission, &passes.emission, &passes.edge];
        let mut largest = [0.0f32; 5];
        for (i, object) in composite.object.pixels().iter().enumerate() {
            let off = (sum(&parts, i) - Vec3::from(*object)).abs().max_element();
            assert!(off <= 1e-5 * (1.0 + Vec3::from(*object).max_element()), "{i}: {off}");
            let alpha = composite.alpha.pixels()[i];
            let shares: f32 = passes.objects.coverage.iter().map(|(_, image)| image.pixels()[i]).sum();
            assert!((shares.min(1.0) - alpha).abs() < 1e-5, "{i}: {shares} for {alpha}");
            for (largest, part) in largest.iter_mut().zip(parts) {
                *largest = largest.max(Vec3::from(part.pixels()[i]).max_element());
            }
        }
        assert!(largest[..4].iter().all(|&part| part > 0.05), "{largest:?}");
        let names: Vec<&str> = passes.objects.coverage.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["glass ball", "object 2", "red ball"]);
        let names: Vec<&str> = passes.materials.coverage.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["glass", "lacquer", "lamp"]);
    }
}

#[test]
fn geometry_is_that_of_the_objects() {
    let inserter = Inserter::new(&linear_scene(), Lighting::Octree, Quality::Normal).unwrap().with_passes();
    let composite = composite(&inserter);
    let passes = passes(&composite);
    let (name, shares) = &passes.objects.coverage[2];
    assert_eq!(name, "red ball");
    let (centre, mut count) = (Vec3::new(-0.2, 0.0, -1.8), 0);
    for (i, _) in shares.pixels().iter().enumerate().filter(|(_, share)| **share == 1.0) {
        let (position, normal) = (Vec3::from(passes.position_m.pixels()[i]), Vec3::from(passes.normal.pixels()[i]));
        assert!(((position - centre).length() - 0.3).abs() < 0.003, "{position}");
        assert!((normal - (position - centre) / 0.3).length() < 0.03, "{normal}");
        assert_eq!(passes.depth_m.pixels()[i], -position.z);
        let albedo = Vec3::from(passes.albedo.pixels()[i]);
        assert!((albedo - Vec3::new(0.8, 0.1, 0.1)).abs().max_element() < 1e-4, "{albedo}");
        count += 1;
    }
    assert!(count > 300, "{count}");
    let empty = composite.alpha.pixels().iter().position(|&alpha| alpha == 0.0).unwrap();
    assert_eq!((passes.depth_m.pixels()[empty], passes.normal.pixels()[empty]), (0.0, [0.0; 3]));
}

#[test]
fn layers_have_the_names_that_programs_expect() {
    let inserter = Inserter::new(&linear_scene(), Lighting::Octree, Quality::Draft).unwrap();
    let without = composite(&inserter);
    assert!(without.passes.is_none() && without.metadata().is_empty());
    let composite = composite(&inserter.with_passes());
    let groups = composite.channels();
    let names: Vec<String> = (groups.iter())
        .flat_map(|group| group.channels.iter().map(move |(channel, _)| format!("{}.{channel}", group.name)))
        .collect();
    for name in ["diffuse.R", "normal.X", "position.Z", "depth.Z", "CryptoObject00.R", "CryptoMaterial02.A"] {
        assert!(names.iter().any(|other| other == name), "{name} in {names:?}");
    }
    let metadata = composite.metadata();
    assert_eq!(metadata.len(), 8);
    assert!(metadata.iter().any(|(key, value)| key.starts_with("cryptomatte/") && value == "CryptoMaterial"));
}

#[test]
fn motion_is_that_of_the_surface() {
    let inserter = Inserter::new(&linear_scene(), Lighting::Octree, Quality::Draft).unwrap().with_passes();
    let ball = PreparedModel::new(Model::sphere(1.0, 4, named("ball")).unwrap());
    let at = |x: f32, y: f32, z: f32| in_air(Vec3::new(x, y, z), 0.2);
    let still = Instance::new(&ball, at(-0.5, 0.0, -2.0));
    // To the left before, up afterwards.
    let moving =
        Instance::new(&ball, at(0.3, 0.0, -2.0)).moving(at(0.4, 0.0, -2.0), at(0.3, 0.1, -2.0)).named("moving");
    let composite = together(&inserter, &[still, moving]);
    let passes = passes(&composite);
    let motion = passes.motion_px.as_ref().unwrap();
    let fx = focal_px();
    let (mut seen, moving) = (0, &passes.objects.coverage.iter().find(|(name, _)| name == "moving").unwrap().1);
    for (i, (&[u, v, back_u, back_v], &depth_m)) in motion.pixels().iter().zip(passes.depth_m.pixels()).enumerate() {
        if moving.pixels()[i] < 1.0 {
            assert!(moving.pixels()[i] > 0.0 || [u, v, back_u, back_v] == [0.0; 4]);
            continue;
        }
        seen += 1;
        let pixels = 0.1 * fx / depth_m;
        assert!(u.abs() < 1e-3 && (v - pixels).abs() < 1e-2, "{u} {v} for {pixels}");
        assert!(back_v.abs() < 1e-3 && (back_u + pixels).abs() < 1e-2, "{back_u} {back_v} for {pixels}");
    }
    assert!(seen > 50, "{seen}");
    assert!(composite.channels().iter().any(|group| group.name == "forward" && group.channels[1].0 == "v"));
    let unmoved = together(&inserter, &[still]);
    assert!(unmoved.passes.unwrap().motion_px.is_none());
}

/// Focal length of the box room's camera, in pixels.
fn focal_px() -> f32 {
    lo_geometry::Camera::from_hfov_deg(65.0, WIDTH as u32, HEIGHT as u32).unwrap().fx as f32
}
