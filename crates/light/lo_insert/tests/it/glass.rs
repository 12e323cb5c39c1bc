//! Solid glass: refraction against a plain solution in f64, energy, colour, and its shadow.

use crate::box_room::*;
use crate::reference::{V, add, dot, scale, sub, unit};
use lo_geometry::{Camera, Vec3};
use lo_imaging::Photo;
use lo_insert::{Composite, Inserter, Instance, Lighting, Quality};
use lo_mesh::{Material, Model, PreparedModel, Volume};

const IOR: f64 = 1.5;

fn glass() -> Material {
    Material {
        base_color: [1.0; 4],
        roughness: 0.0,
        transmission: 1.0,
        volume: Some(Volume::CLEAR),
        double_sided: false,
        ..Material::default()
    }
}

/// A sphere of radius 1 about (0, 1, 0), as the placements in the air expect it.
fn ball(material: Material) -> PreparedModel {
    PreparedModel::new(Model::sphere(1.0, 5, material).unwrap())
}

fn smooth_radiance(p: Vec3) -> [f32; 3] {
    [0.5 + 0.25 * (1.5 * p.x).sin(), 0.5 + 0.25 * (1.2 * p.y + 0.5).cos(), 0.4 + 0.2 * (0.9 * p.z + p.x).sin()]
}

/// Radiance that arrives at the camera through a glass ball, by Snell's and Fresnel's laws; every part of a ray above
/// a share of 10⁻⁴ is followed.
fn through_ball(centre: V, radius: f64, direction: V) -> Option<V> {
    let meet = |origin: V, direction: V, far: bool| {
        let to = sub(origin, centre);
        let (b, c) = (dot(to, direction), dot(to, to) - radius * radius);
        let root = b * b - c;
        (root > 0.0).then(|| if far { -b + root.sqrt() } else { -b - root.sqrt() })
    };
    let mut sum = [0.0; 3];
    // Origin, direction, share, inside.
    let first = meet([0.0; 3], direction, false)?;
    let mut parts = vec![(scale(direction, first), direction, 1.0, false)];
    while let Some((at, d, share, inside)) = parts.pop() {
        let outwards = scale(sub(at, centre), 1.0 / radius);
        let (n, eta) = if inside { (scale(outwards, -1.0), 1.0 / IOR) } else { (outwards, IOR) };
        let cosine = -dot(n, d);
        let sin2 = (1.0 - cosine * cosine) / (eta * eta);
        let mirrored = add(d, scale(n, 2.0 * cosine));
        let (reflected, passed) = if sin2 >= 1.0 {
            (1.0, None)
        } else {
            let beyond = (1.0 - sin2).sqrt();
            let s = (cosine - eta * beyond) / (cosine + eta * beyond);
            let p = (eta * cosine - beyond) / (eta * cosine + beyond);
            (0.5 * (s * s + p * p), Some(unit(add(scale(d, 1.0 / eta), scale(n, cosine / eta - beyond)))))
        };
        // A direction that stays inside meets the ball again; one outside meets a wall.
        for (direction, share, stays) in
            [(Some(mirrored), share * reflected, inside), (passed, share * (1.0 - reflected), !inside)]
        {
            let Some(direction) = direction.filter(|_| share > 1e-4) else { continue };
            if stays {
                let far = meet(at, direction, true).unwrap();
                parts.push((add(at, scale(direction, far)), direction, share, true));
            } else {
                let (origin, direction) = (Vec3::from(at.map(|x| x as f32)), Vec3::from(direction.map(|x| x as f32)));
                let wall = origin + direction * wall_distance(origin, direction);
                sum = add(sum, scale(smooth_radiance(wall).map(f64::from), share));
            }
        }
    }
    Some(sum)
}

fn linear(composite: &Composite) -> &lo_imaging::RadianceImage {
    let Photo::Linear(image) = &composite.image else { panic!("the photo is linear") };
    image
}

#[test]
fn a_glass_ball_shows_the_room_as_snell_and_fresnel_do() {
    let scene = room(Photo::Linear, smooth_radiance, smooth_radiance);
    let (centre, radius) = (Vec3::new(0.15, 0.1, -1.6), 0.45);
    for (quality, worst_mean, worst_pixel) in [(Quality::Normal, 0.03, 0.05), (Quality::High, 0.03, 0.04)] {
        let inserter = Inserter::new(&scene, Lighting::Octree, quality).unwrap();
        let composite = alone(&inserter, &ball(glass()), in_air(centre, radius));
        let camera = Camera::from_hfov_deg(65.0, WIDTH as u32, HEIGHT as u32).unwrap();
        let (mut found, mut expected, mut error, mut count) = ([0.0; 3], [0.0; 3], 0.0, 0);
        for (i, pixel) in linear(&composite).pixels().iter().enumerate() {
            let (x, y) = (i % WIDTH, i / WIDTH);
            // Pixels that are wholly of glass, without the last few at the rim.
            let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let off = (centre - direction * centre.dot(direction)).length();
            if composite.alpha.pixels()[i] < 1.0 || off > 0.93 * radius {
                continue;
            }
            let direction = unit(direction.to_array().map(f64::from));
            let truth = through_ball(centre.to_array().map(f64::from), f64::from(radius), direction).unwrap();
            let pixel = pixel.map(f64::from);
            (found, expected) = (add(found, pixel), add(expected, truth));
            error += sub(pixel, truth).map(f64::abs).iter().sum::<f64>() / truth.iter().sum::<f64>();
            count += 1;
        }
        assert!(count > 700, "{count}");
        for c in 0..3 {
            let ratio = found[c] / expected[c];
            assert!((ratio - 1.0).abs() < worst_mean, "{quality:?}, channel {c}: {ratio}");
        }
        let mean = error / f64::from(count);
        assert!(mean < worst_pixel, "{quality:?}: {mean}");
        println!("{quality:?}: {count} pixels, mean {found:?} for {expected:?}, error of a pixel {mean:.4}");
    }
}

#[test]
fn clear_glass_in_uniform_light_is_invisible_and_casts_no_shadow() {
    let grey = |_: Vec3| [0.5; 3];
    let scene = room(Photo::Linear, grey, grey);
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap();
    let rough = Material { roughness: 0.4, ..glass() };
    let wine_glass = Model::wine_glass().unwrap();
    for (name, model, placement) in [
        ("ball", ball(glass()), on_floor(0.0, -2.2, 0.4)),
        ("rough ball", ball(rough), on_floor(0.0, -2.2, 0.4)),
        ("wine glass", PreparedModel::new(wine_glass), on_floor(0.0, -2.2, 4.0)),
    ] {
        let composite = alone(&inserter, &model, placement);
        let off = linear(&composite).pixels().iter().map(|pixel| (pixel[0] - 0.5).abs());
        // Single rays pass between the points of the test's octree.
        assert!(off.clone().fold(0.0, f32::max) < 0.06, "{name}");
        assert!(off.filter(|&off| off > 0.02).count() < 5, "{name}");
        assert!(composite.alpha.pixels().iter().filter(|&&alpha| alpha == 1.0).count() > 150, "{name}");
        let ratio = composite.shadow_ratio.pixels().iter().flatten();
        let (low, high) = ratio.fold((1.0f32, 1.0f32), |(low, high), &r| (low.min(r), high.max(r)));
        assert!(low > 0.98 && high < 1.02, "{name}: {low} to {high}");
    }
}

#[test]
fn interiors_absorb_by_beers_law() {
    let grey = |_: Vec3| [0.5; 3];
    let scene = room(Photo::Linear, grey, grey);
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap();
    // An index of 1 neither bends nor reflects: the middle of the ball is as long as its diameter.
    let volume = Volume { attenuation_color: [0.5, 0.9, 0.25], attenuation_distance_m: 0.4 };
    let tinted = Material { volume: Some(volume), ior: 1.0, ..glass() };
    let composite = alone(&inserter, &ball(tinted), in_air(Vec3::new(0.0, 0.0, -2.0), 0.4));
    let middle = linear(&composite)[(WIDTH / 2, HEIGHT / 2)];
    for (found, color) in middle.into_iter().zip(volume.attenuation_color) {
        // The wall behind it is in its own tinted shadow.
        let share = found / (0.5 * color * color);
        assert!((0.96..1.005).contains(&share), "{share} of {color}²");
    }
}

#[test]
fn shadows_of_glass_are_bright_and_tinted() {
    let scene = linear_scene();
    let volume = Volume { attenuation_color: [0.1, 0.8, 0.2], attenuation_distance_m: 0.6 };
    let green = Material { volume: Some(volume), ..glass() };
    for quality in [Quality::Draft, Quality::Normal, Quality::High] {
        let inserter = Inserter::new(&scene, Lighting::Octree, quality).unwrap();
        let darkest = |material: Material| {
            let composite = alone(&inserter, &ball(material), on_floor(0.2, -2.4, 0.3));
            let darker = |a: [f32; 3], b: [f32; 3]| if b[0] < a[0] { b } else { a };
            composite.shadow_ratio.pixels().iter().copied().fold([1.0; 3], darker)
        };
        let (clear, green, matte) = (darkest(glass()), darkest(green.clone()), darkest(matte()));
        assert!(matte[0] < 0.6, "{quality:?}: {matte:?}");
        assert!(clear[0] > matte[0] + 0.5 * (1.0 - matte[0]), "{quality:?}: {clear:?} against {matte:?}");
        assert!(clear[0] < 0.99 && (clear[0] - clear[1]).abs() < 0.05, "{quality:?}: {clear:?}");
        assert!(green[1] > green[0] + 0.1, "{quality:?}: {green:?}");
    }
}

#[test]
fn what_is_inside_or_behind_glass_is_seen_through_it() {
    let scene = linear_scene();
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap();
    let red = Material { base_color: [0.8, 0.02, 0.02, 1.0], ..matte() };
    let (shell, core) = (ball(glass()), ball(red));
    let centre = Vec3::new(0.0, 0.0, -2.0);
    let core = Instance::new(&core, in_air(centre, 0.12));
    let without = together(&inserter, &[core]);
    let with = together(&inserter, &[core, Instance::new(&shell, in_air(centre, 0.3))]);
    let reds = |composite: &Composite| {
        let is_red = |p: &&[f32; 3]| p[0] > 3.0 * p[1] && p[0] > 3.0 * p[2];
        linear(composite).pixels().iter().filter(is_red).count() as f32
    };
    // A core in a ball looks larger by the index of refraction, 1.5² in area.
    let enlarged = reds(&with) / reds(&without);
    assert!((enlarged / 2.25 - 1.0).abs() < 0.15, "{enlarged}");
}

#[test]
fn coats_and_sheen_neither_make_nor_lose_much_light() {
    let grey = |_: Vec3| [0.5; 3];
    let scene = room(Photo::Linear, grey, grey);
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap();
    let white = Material { base_color: [1.0; 4], roughness: 1.0, ..Material::default() };
    let range = |material: Material| {
        let composite = alone(&inserter, &ball(material), in_air(Vec3::new(0.0, 0.0, -2.0), 0.4));
        let pixels = linear(&composite).pixels().iter().zip(composite.alpha.pixels());
        let inside = pixels.filter(|(_, alpha)| **alpha == 1.0).map(|(pixel, _)| pixel[0]);
        inside.fold((f32::INFINITY, 0.0f32), |(low, high), value| (low.min(value), high.max(value)))
    };
    let (_, bare) = range(white.clone());
    let coated = range(Material { clearcoat: 1.0, ..white.clone() });
    let cloth = range(Material { sheen: [1.0; 3], sheen_roughness: 0.5, ..white });
    for (name, (low, high)) in [("coat", coated), ("sheen", cloth)] {
        assert!(high < bare.max(0.5) + 0.01, "{name}: {high} over {bare}");
        assert!(low > 0.4, "{name}: {low}");
    }
}
