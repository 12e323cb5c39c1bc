//! Tests of several objects in one image: they hide, shadow, light and mirror one another like parts of one object.

use std::ops::ControlFlow;

use crate::box_room::*;
use lo_events::Event;
use lo_geometry::{Plane, Vec3};
use lo_imaging::{Image, Photo};
use lo_insert::{Composite, InsertError, InsertWarning, Inserter, Instance, Layout, Lighting, Placement, Quality};
use lo_mesh::{AlphaMode, Material, PreparedModel};
use lo_scene::LitScene;
use proptest::prelude::*;

fn shining(base_color: [f32; 3]) -> PreparedModel {
    let [r, g, b] = base_color;
    sphere(Material { base_color: [r, g, b, 1.0], unlit: true, ..Material::default() })
}

fn black() -> PreparedModel {
    sphere(Material { base_color: [0.0, 0.0, 0.0, 1.0], ..Material::default() })
}

/// A sphere that touches the floor, with the floor as its support.
fn resting(x: f32, z: f32, radius: f32) -> Placement {
    let support = Some(Plane { normal: Vec3::Y, offset_m: LOW.y });
    Placement { support, ..in_air(Vec3::new(x, LOW.y + radius, z), radius) }
}

fn warnings(inserter: &Inserter, instances: &[Instance]) -> Vec<InsertWarning> {
    let mut warnings = Vec::new();
    let hear = &mut |event: Event| {
        warnings.extend(event.warning().cloned());
        ControlFlow::Continue(())
    };
    inserter.render(instances, hear).unwrap();
    warnings
}

fn direction(scene: &LitScene, i: usize) -> Vec3 {
    scene.frame.camera.direction((i % WIDTH) as f64 + 0.5, (i / WIDTH) as f64 + 0.5)
}

/// Returns the largest difference of radiances and factors of two images.
fn difference(a: &Composite, b: &Composite) -> f32 {
    let pairs = [(&a.object, &b.object), (&a.shadow_ratio, &b.shadow_ratio)];
    let largest = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0f32, f32::max)
    };
    pairs.iter().map(|(a, b)| largest(a.pixels(), b.pixels())).fold(0.0, f32::max)
}

#[test]
fn nothing_gives_the_photo() {
    let scene = linear_scene();
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Draft).unwrap().with_floor_gloss(0.5);
    let composite = together(&inserter, &[]);
    assert_eq!(composite.image, scene.frame.photo);
    assert!(composite.reflection.is_none() && composite.alpha.pixels().iter().all(|&alpha| alpha == 0.0));
}

#[test]
fn far_from_each_other_each_is_as_if_it_were_alone() {
    let scene = linear_scene();
    let (small, other) = (sphere(matte()), shining([0.2, 0.5, 0.9]));
    let (left, right) = (resting(-1.2, -3.0, 0.12), resting(1.2, -3.0, 0.12));
    for quality in [Quality::Draft, Quality::Normal] {
        let inserter = Inserter::new(&scene, Lighting::Octree, quality).unwrap();
        let (a, b) = (alone(&inserter, &small, left), alone(&inserter, &other, right));
        let both = together(&inserter, &[Instance::new(&small, left), Instance::new(&other, right)]);
        let (mut covered, mut shadowed) = (0, 0);
        for i in 0..WIDTH * HEIGHT {
            assert_eq!(both.alpha.pixels()[i], a.alpha.pixels()[i] + b.alpha.pixels()[i]);
            let sum = Vec3::from(a.object.pixels()[i]) + Vec3::from(b.object.pixels()[i]);
            let found = Vec3::from(both.object.pixels()[i]);
            // Neighbours 20 radii apart exchange some thousandths of their light.
            assert!(
                (found - sum).abs().max_element() <= 0.01 * sum.max_element(),
                "{quality:?} {i}: {found} for {sum}"
            );
            let [ratio_a, ratio_b] = [&a, &b].map(|one| Vec3::from(one.shadow_ratio.pixels()[i]));
            let ratio = Vec3::from(both.shadow_ratio.pixels()[i]);
            assert!((ratio - (ratio_a + ratio_b - 1.0)).abs().max_element() < 0.005, "{quality:?} {i}: {ratio}");
            covered += usize::from(sum != Vec3::ZERO);
            shadowed += usize::from(ratio.min_element() < 0.95);
        }
        assert!(covered > 40 && shadowed > 20, "{covered} {shadowed}");
    }
}

#[test]
fn the_nearer_one_hides_the_farther_and_their_order_does_not_matter() {
    let scene = linear_scene();
    let (near, far) = (shining([1.0, 0.0, 0.0]), shining([0.0, 1.0, 0.0]));
    let (centres, radius) = ([Vec3::new(0.1, 0.0, -1.8), Vec3::new(0.6, 0.05, -3.0)], 0.3);
    let meets = |centre: Vec3, direction: Vec3| (centre - direction * centre.dot(direction)).length();
    for quality in [Quality::Draft, Quality::Normal, Quality::High] {
        let inserter = Inserter::new(&scene, Lighting::Octree, quality).unwrap();
        let instances = [(&near, centres[0]), (&far, centres[1])];
        let instances = instances.map(|(model, centre)| Instance::new(model, in_air(centre, radius)));
        let composite = together(&inserter, &instances);
        let mut counts = [0; 2];
        for i in 0..WIDTH * HEIGHT {
            let [first, second] = centres.map(|centre| meets(centre, direction(&scene, i)));
            let expected = match (first, second) {
                (first, _) if first < 0.93 * radius => [1.0, 0.0, 0.0],
                (first, second) if first > 1.07 * radius && second < 0.88 * radius => [0.0, 1.0, 0.0],
                _ => continue,
            };
            assert_eq!((composite.object.pixels()[i], composite.alpha.pixels()[i]), (expected, 1.0), "{quality:?} {i}");
            counts[expected[1] as usize] += 1;
        }
        assert!(counts[0] > 200 && counts[1] > 20, "{counts:?}");
        let [first, second] = instances;
        assert!(difference(&composite, &together(&inserter, &[second, first])) < 1e-5);
    }
}

#[test]
fn a_mirror_shows_the_other_object() {
    let scene = linear_scene();
    let mirror = sphere(Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.0, ..Material::default() });
    let lamp = shining([6.0, 5.0, 0.0]);
    let (centre, other, radius) = (Vec3::new(-0.3, 0.0, -2.2), Vec3::new(0.45, 0.1, -1.9), 0.3);
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap();
    let instances = [Instance::new(&mirror, in_air(centre, radius)), Instance::new(&lamp, in_air(other, radius))];
    let composite = together(&inserter, &instances);
    let (mut shown, mut beside) = (0, 0);
    for i in 0..WIDTH * HEIGHT {
        let view = direction(&scene, i);
        let along = centre.dot(view);
        let root = along * along - centre.length_squared() + radius * radius;
        if root < 0.01 || composite.alpha.pixels()[i] < 1.0 {
            continue;
        }
        let point = view * (along - root.sqrt());
        let normal = (point - centre) / radius;
        let mirrored = view - 2.0 * normal.dot(view) * normal;
        let offset = other - point;
        let off = (offset - mirrored * offset.dot(mirrored)).length();
        let found = composite.object.pixels()[i];
        if offset.dot(mirrored) > 0.0 && off < 0.7 * radius {
            assert!((found[0] - 6.0).abs() < 0.05 && found[2] < 0.05, "{found:?}");
            shown += 1;
        } else if off > 1.3 * radius {
            assert!(found[2] > 0.1, "the room: {found:?}");
            beside += 1;
        }
    }
    assert!(shown > 8 && beside > 200, "{shown} {beside}");
}

#[test]
fn light_goes_from_one_object_to_the_other() {
    // A white ball beside a red emissive one: its additional light is the red one's view factor.
    let scene = linear_scene();
    let white = sphere(Material { base_color: [0.8, 0.8, 0.8, 1.0], roughness: 1.0, ..Material::default() });
    let lamp = shining([4.0, 0.0, 0.0]);
    let (centre, other, radius) = (Vec3::new(-0.3, 0.0, -2.4), Vec3::new(0.5, 0.2, -2.0), 0.3);
    for quality in [Quality::Draft, Quality::Normal] {
        let inserter = Inserter::new(&scene, Lighting::Octree, quality).unwrap();
        let placed = [(&white, centre), (&lamp, other)];
        let instances = placed.map(|(model, centre)| Instance::new(model, in_air(centre, radius)));
        let (without, with) = (together(&inserter, &instances[..1]), together(&inserter, &instances));
        let (mut sum, mut expected) = (0.0, 0.0);
        for i in (0..WIDTH * HEIGHT).filter(|&i| without.alpha.pixels()[i] == 1.0 && with.alpha.pixels()[i] == 1.0) {
            let view = direction(&scene, i);
            let along = centre.dot(view);
            let root = along * along - centre.length_squared() + radius * radius;
            if root < 0.0 {
                continue;
            }
            let point = view * (along - root.sqrt());
            let normal = (point - centre) / radius;
            let distance = (other - point).length();
            let cosine = normal.dot(other - point) / distance;
            // Sphere completely above the horizon (closed form); the diffuse part of the dielectric is a little
            // darker.
            if cosine > radius / distance {
                expected += 0.8 * 4.0 * cosine * (radius / distance).powi(2);
                sum += with.object.pixels()[i][0] - without.object.pixels()[i][0];
            }
        }
        println!("{quality:?}: {sum} for {expected}");
        assert!(sum / expected > 0.8 && sum / expected < 1.1, "{quality:?}: {sum} for {expected}");
    }
}

#[test]
fn what_is_inside_of_another_object_changes_no_light() {
    let scene = linear_scene();
    for quality in [Quality::Draft, Quality::Normal, Quality::High] {
        let inserter = Inserter::new(&scene, Lighting::Octree, quality).unwrap();
        // Off the floor: at a contact, rays begin inside.
        let (model, centre) = (sphere(matte()), Vec3::new(0.3, LOW.y + 0.4, -3.0));
        let [place, inner] = [in_air(centre, 0.35), in_air(centre, 0.2)];
        let both = together(&inserter, &[Instance::new(&model, place), Instance::new(&model, inner)]);
        let one = alone(&inserter, &model, place);
        let apart = difference(&one, &both);
        println!("{quality:?}: {apart}");
        assert!(apart < 1e-3, "{quality:?}: {apart}");
    }
}

/// With two black spheres, one on the floor and one in the air, real surfaces are no brighter than with either of
/// them, and no darker than with both shadows multiplied.
fn check_that_shadows_add_up(x: [f32; 2], z: [f32; 2], radius: [f32; 2], height: f32) {
    let scene = linear_scene();
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Draft).unwrap();
    let model = black();
    let in_air = in_air(Vec3::new(x[1], LOW.y + radius[1] + height, z[1]), radius[1]);
    let instances = [resting(x[0], z[0], radius[0]), in_air].map(|place| Instance::new(&model, place));
    let [a, b] = instances.map(|instance| together(&inserter, &[instance]));
    let both = together(&inserter, &instances);
    for i in 0..WIDTH * HEIGHT {
        for c in 0..3 {
            let [a, b, both] = [&a, &b, &both].map(|picture| picture.shadow_ratio.pixels()[i][c]);
            // Black objects mirror a twentieth of each other, and of the floor in the other's shadow.
            assert!(both < a.min(b) + 0.02, "{both} with both, {a} and {b} with one");
            assert!(both > a + b - 1.0 - 0.06, "{both} with both, {a} and {b} with one");
        }
    }
}

/// The sphere in the air hides the brightest part of the ceiling. The light inferred from that must not be lost in
/// the mean over both.
#[test]
fn what_one_tells_of_the_light_counts_beside_the_other() {
    check_that_shadows_add_up([0.0, 0.0], [-1.6, -2.3165548], [0.36953294, 0.20802301], 0.75993675);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Black objects only remove light.
    #[test]
    fn shadows_add_up(
        x in prop::array::uniform2(-0.9f32..0.9), z in prop::array::uniform2(-3.4f32..-1.6), radius in prop::array::uniform2(0.1f32..0.45),
        height in 0.0f32..0.8,
    ) {
        // Intersecting objects are excluded: `insert` warns of them.
        let middles = [Vec3::new(x[0], radius[0], z[0]), Vec3::new(x[1], radius[1] + height, z[1])];
        prop_assume!(middles[0].distance(middles[1]) > radius[0] + radius[1]);
        check_that_shadows_add_up(x, z, radius, height);
    }

    /// Any order gives the same image, also with glass and metal.
    #[test]
    fn their_order_does_not_matter(
        x in prop::array::uniform3(-0.6f32..0.6), y in prop::array::uniform3(-0.5f32..0.5), z in prop::array::uniform3(-3.4f32..-1.6),
        radius in prop::array::uniform3(0.1f32..0.4),
    ) {
        let scene = linear_scene();
        let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Draft).unwrap();
        let glass = Material { base_color: [0.2, 0.5, 0.9, 0.25], alpha_mode: AlphaMode::Blend, double_sided: true, ..Material::default() };
        let gold = Material { base_color: [1.0, 0.8, 0.3, 1.0], metallic: 1.0, roughness: 0.15, ..Material::default() };
        let models = [glass, gold, matte()].map(sphere);
        let instances: [Instance; 3] = std::array::from_fn(|i| {
            Instance::new(&models[i], in_air(Vec3::new(x[i], y[i], z[i]), radius[i]))
        });
        let one = together(&inserter, &instances);
        let other = together(&inserter, &[instances[2], instances[0], instances[1]]);
        prop_assert!(difference(&one, &other) < 1e-3, "{}", difference(&one, &other));
        prop_assert!(one.object.pixels().iter().flatten().all(|c| c.is_finite()));
    }
}

#[test]
fn a_glossy_floor_mirrors_all_objects() {
    let scene = linear_scene();
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap().with_floor_gloss(1.0);
    let models = [shining([5.0, 0.0, 0.0]), shining([0.0, 5.0, 0.0])];
    // The support's position is known to some millimetres.
    let place = |x: f32, offset_m: f32| {
        let support = Some(Plane { normal: Vec3::Y, offset_m: LOW.y + offset_m });
        Placement { support, ..in_air(Vec3::new(x, LOW.y + 0.3, -3.4), 0.25) }
    };
    let places = [place(-0.45, 0.004), place(0.3, 0.0)];
    let instances: [Instance; 2] = std::array::from_fn(|i| Instance::new(&models[i], places[i]));
    let alone = instances.map(|instance| together(&inserter, &[instance]).reflection.unwrap());
    let both = together(&inserter, &instances).reflection.unwrap();
    let mut mirrored = [0; 2];
    for i in 0..WIDTH * HEIGHT {
        let [a, b, both] = [&alone[0], &alone[1], &both].map(|image| Vec3::from(image.pixels()[i]));
        if a == Vec3::ZERO || b == Vec3::ZERO {
            assert!((both - a - b).abs().max_element() < 1e-5, "{both} for {a} and {b}");
        }
        mirrored[0] += usize::from(both.x > 0.05);
        mirrored[1] += usize::from(both.y > 0.05);
    }
    assert!(mirrored.iter().all(|&count| count > 60), "{mirrored:?}");
}

#[test]
fn one_that_moves_leaves_the_other_alone() {
    let scene = linear_scene();
    let (model, gold) = (sphere(matte()), sphere(Material { metallic: 1.0, roughness: 0.2, ..matte() }));
    for quality in [Quality::Draft, Quality::Normal] {
        let inserter = Inserter::new(&scene, Lighting::Octree, quality).unwrap();
        // 5 mm per frame, past the front of the fixed one.
        let frames: Vec<Composite> = (0..13)
            .map(|frame| {
                let moving = resting(0.0 + 0.005 * frame as f32, -2.3, 0.15);
                together(&inserter, &[Instance::new(&model, moving), Instance::new(&gold, resting(0.35, -3.0, 0.3))])
            })
            .collect();
        let value = |f: usize, i: usize| f64::from(frames[f].shadow_ratio.pixels()[i][1]);
        let light = |f: usize, i: usize| f64::from(frames[f].object.pixels()[i][1]);
        let is_floor = |i: usize| frames.iter().all(|f| f.alpha.pixels()[i] == 0.0);
        let floor: Vec<usize> = (0..WIDTH * HEIGHT).filter(|&i| is_floor(i) && value(0, i) < 0.97).collect();
        // Pixels of the fixed one that the moving one never covers.
        let is_still = |i: usize| {
            let offset = Vec3::new(0.35, LOW.y + 0.3, -3.0);
            let view = direction(&scene, i);
            let beside = |centre: Vec3| (centre - view * centre.dot(view)).length();
            let moving = |x: f32| beside(Vec3::new(x, LOW.y + 0.15, -2.3)) > 0.17;
            beside(offset) < 0.27 && moving(0.0) && moving(0.03) && moving(0.06)
        };
        let still: Vec<usize> = (0..WIDTH * HEIGHT).filter(|&i| is_still(i)).collect();
        let mean = |pixels: &[usize], order: &dyn Fn(usize, usize) -> f64| {
            pixels.iter().map(|&i| (1..12).map(|f| order(f, i).abs()).sum::<f64>()).sum::<f64>()
                / (11 * pixels.len()) as f64
        };
        let bend = |of: &dyn Fn(usize, usize) -> f64, f: usize, i: usize| of(f + 1, i) - 2.0 * of(f, i) + of(f - 1, i);
        let floor_step = mean(&floor, &|f, i| value(f + 1, i) - value(f, i));
        let floor_bend = mean(&floor, &|f, i| bend(&value, f, i));
        let still_bend = mean(&still, &|f, i| bend(&light, f, i));
        println!(
            "{quality:?}: floor {floor_step:.5} {floor_bend:.5} of {}, other {still_bend:.5} of {}",
            floor.len(),
            still.len()
        );
        assert!(floor.len() > 100 && floor_bend < 0.003 && floor_bend < 0.5 * floor_step);
        assert!(still.len() > 100 && still_bend < 0.004, "{still_bend}");
    }
}

#[test]
fn warnings_and_errors_say_which_object() {
    let scene = linear_scene();
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Draft).unwrap();
    let model = sphere(matte());
    let large = Instance::new(&model, in_air(Vec3::new(0.0, 0.0, -2.0), 0.5));
    let at = |x: f32, y: f32, z: f32, radius: f32| Instance::new(&model, in_air(Vec3::new(x, y, z), radius));
    // They float.
    let not_floating = |warning: &InsertWarning| !matches!(warning, InsertWarning::ObjectFloats { .. });
    let told = |instance| warnings(&inserter, &[large, instance]).into_iter().filter(not_floating).collect::<Vec<_>>();
    assert_eq!(told(at(0.0, 0.0, -3.2, 0.2)), [InsertWarning::ObjectHidden { object: 1 }]);
    assert_eq!(told(at(0.0, 0.0, 0.6, 0.2)), [InsertWarning::ObjectOutsidePicture { object: 1 }]);
    // Far enough apart, touching, a third inside, and completely inside.
    assert_eq!(told(at(1.0, 0.0, -2.0, 0.3)), []);
    assert_eq!(told(at(0.799, 0.0, -2.0, 0.3)), []);
    assert_eq!(told(at(0.6, 0.0, -2.0, 0.3)), [InsertWarning::ObjectsIntersect { objects: [0, 1] }]);
    let inside = [InsertWarning::ObjectHidden { object: 1 }, InsertWarning::ObjectsIntersect { objects: [0, 1] }];
    assert_eq!(told(at(0.1, 0.0, -2.0, 0.3)), inside);
    // On another object: its centre supports, positions over its edge do not, and thin objects on it do not intersect
    // it.
    let (board, plate) = (slab(0.6, 0.4), slab(0.2, 0.2));
    let table = Instance::new(&board, Placement { scale: 1.0, ..in_air(Vec3::new(0.0, -0.5, -2.0), 0.0) });
    let support = Some(Plane { normal: Vec3::Y, offset_m: LOW.y });
    let lying = |x: f32| {
        let place = Placement { position_m: Vec3::new(x, -0.4, -2.0), support, ..table.placement };
        let told = warnings(&inserter, &[table, Instance::new(&plate, place)]);
        told.into_iter().filter(not_floating).collect::<Vec<_>>()
    };
    assert_eq!(lying(0.0), []);
    let over = lying(0.36);
    let [InsertWarning::ObjectOverhangs { object: 1, supported }] = over[..] else { panic!("{over:?}") };
    assert!((supported - 0.2).abs() < 0.12, "{supported}");
    let bad = Instance::new(&model, Placement { scale: f32::NAN, ..large.placement });
    let error = inserter.render(&[large, bad], &mut lo_events::ignore).unwrap_err();
    assert!(matches!(error, InsertError::Object { object: 1, .. }), "{error}");
    assert!(error.to_string().contains("object 2") && error.to_string().contains("scale"), "{error}");
}

#[test]
fn each_edge_hides_its_own_object() {
    // A board at 2 m covers the left half; one object in front of it, one behind it.
    let mut scene = linear_scene();
    let room = scene.frame.depth_m.clone();
    scene.estimate_mut().frame.depth_m = Image::from_fn(WIDTH, HEIGHT, |x, y| if x < 60 { 2.0 } else { room[(x, y)] });
    if let Photo::Linear(photo) = &mut scene.estimate_mut().frame.photo {
        *photo = Image::from_fn(WIDTH, HEIGHT, |x, y| if x < 60 { [0.9, 0.1, 0.1] } else { photo[(x, y)] });
    }
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap();
    let (near, far) = (shining([0.0, 1.0, 0.0]), shining([0.0, 0.0, 1.0]));
    let instances = [
        Instance::new(&near, in_air(Vec3::new(0.0, 0.0, -1.2), 0.15)),
        Instance::new(&far, in_air(Vec3::new(0.0, 0.0, -3.0), 0.9)),
    ];
    let composite = together(&inserter, &instances);
    for i in 0..WIDTH * HEIGHT {
        let view = direction(&scene, i);
        let beside = |depth: f32| (Vec3::new(0.0, 0.0, -depth) - view * -view.z * depth).length();
        let (x, found) = (i % WIDTH, composite.object.pixels()[i]);
        if beside(1.2) < 0.14 {
            assert_eq!((found, composite.occlusion.pixels()[i]), ([0.0, 1.0, 0.0], 0.0), "{x}");
        } else if beside(1.2) > 0.16 && beside(3.0) < 0.85 && x.abs_diff(60) > 3 {
            let expected = if x < 60 { ([0.0; 3], 1.0) } else { ([0.0, 0.0, 1.0], 0.0) };
            assert_eq!((found, composite.occlusion.pixels()[i]), expected, "{x}");
        }
    }
}

fn layout(text: &str) -> Layout {
    Layout::from_json(text).unwrap()
}

#[test]
fn a_layout_says_what_stands_where() {
    let scene = linear_scene();
    let (u, v, _) = scene.frame.camera.project(Vec3::new(0.2, LOW.y, -2.5)).unwrap();
    let text = format!(
        r#"[{{"mesh": "a/table.glb", "pixel": [{u}, {v}], "scale": 0.5, "yaw_deg": 90, "material": "gold"}},
            {{"mesh": "vase.obj", "on": "table", "height_m": 0.2}},
            {{"mesh": "vase.obj", "on": "table", "position_m": [0.25, 0, -2.6], "height_m": 0.1, "material": {{"roughness": 0.4}}}},
            {{"mesh": "vase.obj", "name": "last", "position_m": [0.5, 0.1, -2], "align": "none"}}]"#
    );
    let layout = layout(&text);
    let names: Vec<&str> = layout.objects().iter().map(|object| object.name()).collect();
    assert_eq!(names, ["table", "vase", "vase 2", "last"]);
    let (table, vase) = (slab(0.8, 0.4), sphere(matte()));
    let placed = layout.placements(&scene, &[&table, &vase, &vase, &vase], 1).unwrap();
    let at = |i: usize| placed[i][0];
    assert!((at(0).position_m - Vec3::new(0.2, LOW.y, -2.5)).length() < 0.02, "{}", at(0).position_m);
    assert_eq!((at(0).scale, at(1).scale, at(2).scale, at(3).scale), (0.5, 0.1, 0.05, 1.0));
    // The table's top is 5 cm up, and its centre is the table's.
    let top = at(0).position_m + Vec3::Y * 0.05;
    assert!((at(1).position_m - top).length() < 2e-3, "{} {top}", at(1).position_m);
    assert!((at(2).position_m - Vec3::new(0.25, top.y, -2.6)).length() < 2e-3, "{}", at(2).position_m);
    assert_eq!((at(1).support, at(3).position_m), (at(0).support, Vec3::new(0.5, 0.1, -2.0)));
    // The table is not below.
    let beside = text.replace("[0.25, 0, -2.6]", "[1.35, 0, -2.5]");
    let error = Layout::from_json(&beside).unwrap().placements(&scene, &[&table, &vase, &vase, &vase], 1).unwrap_err();
    assert!(matches!(error, InsertError::Object { object: 2, .. }), "{error}");
}

#[test]
fn what_is_carried_moves_and_turns_along() {
    let scene = linear_scene();
    let text = r#"{"objects": [
        {"mesh": "car.glb", "path": {"keyframes": [{"time_s": 1, "position_m": [0, -1, -3]}, {"time_s": 2, "position_m": [1, -1, -3], "yaw_deg": 90}]}},
        {"mesh": "box.glb", "on": "car", "position_m": [0.3, 0, -3], "yaw_deg": 10},
        {"mesh": "still.glb", "position_m": [-1, -1, -3]},
        {"mesh": "late.glb", "path": {"keyframes": [{"time_s": 1, "position_m": [0, 1, -3]}, {"time_s": 3, "position_m": [2, 1, -3]}]}}
    ]}"#;
    let layout = layout(text);
    assert!(layout.moves());
    let (car, small) = (slab(1.0, 0.5), slab(0.1, 0.1));
    let placed = layout.placements(&scene, &[&car, &small, &small, &small], 5).unwrap();
    let at = |object: usize, frame: usize| placed[object][frame];
    assert!((at(1, 0).position_m - Vec3::new(0.3, -0.9, -3.0)).length() < 1e-4, "{}", at(1, 0).position_m);
    // One clock for all: from 1 s to 3 s. The car arrives after half of the frames, and rests.
    for frame in 2..5 {
        assert!((at(0, frame).position_m - Vec3::new(1.0, -1.0, -3.0)).length() < 1e-4);
        // An object on its right is now behind (counter-clockwise from above: +X goes to −Z).
        assert!((at(1, frame).position_m - Vec3::new(1.0, -0.9, -3.3)).length() < 1e-4, "{}", at(1, frame).position_m);
        assert!((at(1, frame).yaw_rad.to_degrees() - 100.0).abs() < 1e-3);
    }
    assert_eq!(at(2, 0), at(2, 4));
    assert!((at(3, 1).position_m.x - 0.5).abs() < 1e-5 && (at(3, 4).position_m.x - 2.0).abs() < 1e-5);
}

#[test]
fn layouts_that_make_no_sense_are_refused_by_name() {
    let cases = [
        ("{", "EOF"),
        ("[]", "1 to 100"),
        ("3", "not a list"),
        (r#"{"objects": [], "floor": 1}"#, "`floor`"),
        (r#"{"items": []}"#, "`items`"),
        (r#"[{"mesh": "a.glb"}]"#, "object 1 (a): needs exactly one of"),
        (r#"[{"pixel": [1, 2]}]"#, "object 1"),
        (r#"[{"mesh": "a.glb", "pixel": [1, 2], "position_m": [0, 0, -1]}]"#, "needs exactly one of"),
        (
            r#"[{"mesh": "a.glb", "pixel": [1, 2]}, {"mesh": "b.glb", "pixle": [1, 2]}]"#,
            "object 2 (b.glb): unknown field `pixle`",
        ),
        (r#"[{"mesh": "a.glb", "pixel": [1]}]"#, "object 1 (a.glb)"),
        (
            r#"[{"mesh": "a.glb", "pixel": [1, 2], "scale": 0}]"#,
            "\"scale\" must be from 0.000001 to 1000000 m per unit",
        ),
        (r#"[{"mesh": "a.glb", "pixel": [1, 2], "scale": 1e300}]"#, "\"scale\" must be from"),
        (r#"[{"mesh": "a.glb", "pixel": [1, 2], "height_m": -1}]"#, "\"height_m\" must be from"),
        (r#"[{"mesh": "a.glb", "pixel": [1, 2], "height_m": 1e30}]"#, "\"height_m\" must be from 0.000001 to 10000 m"),
        (r#"[{"mesh": "a.glb", "name": "vase", "pixel": [1, 1e30]}]"#, "object 1 (vase): \"pixel\" must be from"),
        (
            r#"[{"mesh": "a.glb", "position_m": [1, 1e30, 0]}]"#,
            "\"position_m\" must be from -10000 to 10000 m, got 1e30",
        ),
        (r#"[{"mesh": "a.glb", "pixel": [1, 2], "yaw_deg": -1e30}]"#, "\"yaw_deg\" must be from"),
        (
            r#"[{"mesh": "a.glb", "path": {"keyframes": [{"time_s": 1e30, "pixel": [1, 2]}]}}]"#,
            "keyframe 0: \"time_s\" must",
        ),
        (
            r#"[{"mesh": "a.glb", "path": {"keyframes": [{"time_s": 0, "pixel": [1e9, 2]}]}}]"#,
            "keyframe 0: \"pixel\" must",
        ),
        (
            r#"[{"mesh": "a.glb", "path": {"keyframes": [{"time_s": 0, "position_m": [0, 0, -1e9]}]}}]"#,
            "\"position_m\" must",
        ),
        (
            r#"[{"mesh": "a.glb", "path": {"keyframes": [{"time_s": 0, "pixel": [1, 2], "yaw_deg": 1e9}]}}]"#,
            "\"yaw_deg\" must",
        ),
        (r#"[{"mesh": "a.glb", "pixel": [1, 2], "scale": 1, "height_m": 1}]"#, "cannot both"),
        (r#"[{"mesh": "a.glb", "pixel": [1, 2], "material": "golf"}]"#, "golf"),
        (r#"[{"mesh": "a.glb", "pixel": [1, 2], "material": {"colour": 1}}]"#, "colour"),
        (
            r#"[{"mesh": "a.glb", "name": "x", "pixel": [1, 2]}, {"mesh": "b.glb", "name": "x", "pixel": [1, 2]}]"#,
            "named `x`",
        ),
        (r#"[{"mesh": "a.glb", "on": "b"}, {"mesh": "b.glb", "pixel": [1, 2]}]"#, "is named `b`"),
        (r#"[{"mesh": "a.glb", "pixel": [1, 2]}, {"mesh": "b.glb", "on": "a", "align": "none"}]"#, "align"),
        (r#"[{"mesh": "a.glb", "path": {"keyframes": []}}]"#, "keyframes"),
        (r#"[{"mesh": "a.glb", "path": "a.json", "yaw_deg": 3}]"#, "yaw_deg"),
    ];
    for (text, word) in cases {
        let error = Layout::from_json(text).unwrap_err().to_string();
        assert!(error.contains(word), "{text}: {error}");
    }
    let many = format!("[{}]", vec![r#"{"mesh": "a.glb", "pixel": [1, 2]}"#; 101].join(","));
    assert!(Layout::from_json(&many).unwrap_err().to_string().contains("101"));
    // The caller reads path files.
    let layout = layout(r#"[{"mesh": "a.glb", "path": "way.json"}]"#);
    let model = sphere(matte());
    assert!(layout.placements(&linear_scene(), &[&model], 2).unwrap_err().to_string().contains("way.json"));
    let missing = layout.clone().with_paths(|_| Err(std::io::ErrorKind::NotFound.into())).unwrap_err().to_string();
    assert!(missing.contains("path of a, way.json"), "{missing}");
    let way = r#"{"keyframes": [{"time_s": 0, "position_m": [0, 0, -1]}, {"time_s": 1, "position_m": [0, 0, -2]}]}"#;
    let read =
        layout.with_paths(|file| Ok(if file.ends_with("way.json") { way.into() } else { String::new() })).unwrap();
    assert_eq!(read.placements(&linear_scene(), &[&model], 3).unwrap()[0][1].position_m.z, -1.5);
}

#[test]
fn hidden_objects_and_what_they_carry_are_left_out() {
    let layout = layout(
        r#"[{"mesh": "table.glb", "position_m": [1, -1, -2], "hidden": true, "locked": true},
            {"mesh": "vase.glb", "on": "table"}, {"mesh": "flower.glb", "on": "vase"},
            {"mesh": "ball.glb", "position_m": [0, -1, -3]}]"#,
    );
    assert_eq!(Layout::from_json(&layout.to_json().unwrap()).unwrap(), layout);
    let scaled = layout.in_scaled_room(2.0).unwrap();
    assert_eq!(scaled.objects()[0].position_m, Some([2.0, -2.0, -4.0]));
    let shown = layout.without_hidden().unwrap();
    assert_eq!(shown.objects().iter().map(|object| object.name()).collect::<Vec<_>>(), ["ball"]);
    let alone = self::layout(r#"[{"mesh": "a.glb", "position_m": [0, 0, -2], "hidden": true}]"#);
    assert_eq!(alone.without_hidden(), None);
}
