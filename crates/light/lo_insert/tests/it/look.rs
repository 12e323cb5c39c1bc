//! The photo's sharpness and grain on objects, and the strength of shadows.

use crate::box_room::*;
use lo_geometry::Vec3;
use lo_imaging::{Photo, RadianceImage, linear_from_srgb, srgb_from_linear};
use lo_insert::{Composite, Inserter, Lighting, Quality};
use lo_scene::LitScene;

/// Deviation of the noise in sRGB's range.
const DEVIATION: f32 = 0.02;

/// Pixels of the photo per pixel of the scene's, along a side.
const FINER: usize = 4;

/// Returns the scene's photo at a higher resolution, with noise of zero mean that differs by pixel and channel.
fn noisy(scene: &LitScene) -> Photo {
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    // uniform values have a deviation of 1/√12
    let mut noise = || DEVIATION * 12.0f32.sqrt() * (next() - 0.5);
    let image = RadianceImage::from_fn(FINER * WIDTH, FINER * HEIGHT, |x, y| {
        scene
            .frame
            .photo
            .linear_at((x / FINER, y / FINER))
            .map(|v| linear_from_srgb(srgb_from_linear(v) + noise()).max(0.0))
    });
    Photo::Linear(image)
}

fn inserter(scene: &LitScene) -> Inserter {
    Inserter::new(scene, Lighting::Octree, Quality::Normal).unwrap()
}

fn render(inserter: &Inserter) -> Composite {
    alone(inserter, &sphere(matte()), on_floor(0.1, -2.0, 0.5))
}

fn radiance(photo: &Photo) -> &RadianceImage {
    let Photo::Linear(image) = photo else { panic!("not linear") };
    image
}

#[test]
fn objects_have_the_noise_of_the_photo() {
    let scene = linear_scene();
    let photo = noisy(&scene);
    let inserter = || inserter(&scene).with_photo(photo.clone());
    let clean = render(&inserter());
    assert!(clean.grain.is_none());
    let matched = render(&inserter().with_photo_look());
    let pixels = FINER * FINER * WIDTH * HEIGHT;
    let grain = matched.grain.as_ref().unwrap();
    let inside: Vec<usize> =
        (0..pixels).filter(|&i| clean.alpha.pixels()[i] == 1.0 && matched.alpha.pixels()[i] > 0.999).collect();
    assert!(inside.len() > 200, "{}", inside.len());
    let added = |i: usize| {
        let code = |image: &Photo| radiance(image).pixels()[i].map(srgb_from_linear);
        let (with, without) = (code(&matched.image), code(&clean.image));
        (0..3).map(|c| (with[c] - without[c]).powi(2)).sum::<f32>() / 3.0
    };
    let deviation = (inside.iter().map(|&i| added(i)).sum::<f32>() / inside.len() as f32).sqrt();
    assert!((deviation / DEVIATION - 1.0).abs() < 0.2, "{deviation}");
    // layers add up to the composite
    let exposure = scene.frame.exposure;
    for i in 0..pixels {
        let layer = |image: &RadianceImage| Vec3::from(image.pixels()[i]);
        let photo = layer(radiance(&photo)) * exposure * layer(&matched.shadow_ratio);
        let sum = photo * (1.0 - matched.alpha.pixels()[i]) + layer(&matched.object) + layer(grain);
        let found = layer(radiance(&matched.image)) * exposure;
        assert!((sum.max(Vec3::ZERO) - found).abs().max_element() < 1e-4 * (1.0 + exposure), "{i}: {sum} {found}");
        assert!(matched.alpha.pixels()[i] > 0.0 || layer(grain) == Vec3::ZERO);
    }
    // nothing is drawn by chance
    assert_eq!(render(&inserter().with_photo_look()).image, matched.image);
}

#[test]
fn clean_photos_add_no_grain() {
    let scene = linear_scene();
    assert!(render(&inserter(&scene).with_photo_look()).grain.is_none());
}

#[test]
fn strength_is_an_exponent_of_the_shadow() {
    let scene = linear_scene();
    let ratio = |strength: f32| render(&inserter(&scene).with_shadow_strength(strength)).shadow_ratio;
    let (none, plain, twice) = (ratio(0.0), ratio(1.0), ratio(2.0));
    assert!(none.pixels().iter().all(|&ratio| ratio == [1.0; 3]));
    assert!(plain.pixels().iter().any(|ratio| ratio[1] < 0.8));
    for (one, two) in plain.pixels().iter().flatten().zip(twice.pixels().iter().flatten()) {
        assert!((one * one - two).abs() < 1e-5, "{one} {two}");
    }
}
