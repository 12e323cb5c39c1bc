//! Edited lights in a room of known radiance: a lamp and a window that are clipped in the photo, and a ceiling panel
//! outside it.

use std::sync::OnceLock;

use lo_geometry::{Camera, Cube, Vec3};
use lo_imaging::{Image, Photo, RadianceImage, luminance};
use lo_lights::{LightKind, LightOrigin, apply_edits, emitters, list, remove_emitters};
use lo_lookup::SceneRenderer;
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{
    AddedLight, AnalyticLight, EmitterEdit, Frame, LightChange, LightColor, LightEdits, LightShape, LitScene,
};

/// Leaves of 6.25 cm.
const CUBE: Cube = Cube { origin_m: Vec3::new(-4.0, -4.0, -4.0), edge_m: 8.0 };
const LOW: Vec3 = Vec3::new(-2.02, -1.52, -3.41);
const HIGH: Vec3 = Vec3::new(2.03, 1.24, 1.03);
const WALL: [f32; 3] = [0.3, 0.28, 0.25];
const LAMP: [f32; 3] = [16.0, 11.0, 6.0];
const WINDOW: [f32; 3] = [5.0, 6.0, 7.5];
const PANEL: [f32; 3] = [9.0, 9.0, 8.5];

/// Returns the radiance of a point of the room.
fn radiance(point: Vec3) -> [f32; 3] {
    let near = |value: f32, middle: f32, half: f32| (value - middle).abs() < half;
    if point.z < LOW.z + 0.05 && near(point.x, 0.6, 0.16) && near(point.y, 0.3, 0.16) {
        LAMP
    } else if point.x < LOW.x + 0.05 && near(point.z, -2.2, 0.5) && near(point.y, 0.2, 0.4) {
        WINDOW
    } else if point.y > HIGH.y - 0.05 && near(point.z, 0.3, 0.3) && near(point.x, 0.0, 0.5) {
        PANEL
    } else {
        WALL
    }
}

fn truth(origin: Vec3, direction: Vec3) -> Vec3 {
    let (a, b) = ((LOW - origin) / direction, (HIGH - origin) / direction);
    origin + direction * a.max(b).min_element()
}

fn scene() -> LitScene {
    static SCENE: OnceLock<LitScene> = OnceLock::new();
    let make = || {
        let camera = Camera::from_hfov_deg(90.0, 480, 360).unwrap();
        let ray = |x: usize, y: usize| truth(Vec3::ZERO, camera.direction(x as f64 + 0.5, y as f64 + 0.5));
        let photo = Image::from_fn(480, 360, |x, y| radiance(ray(x, y)).map(lo_imaging::srgb8_from_linear));
        let depth_m = Image::from_fn(480, 360, |x, y| -ray(x, y).z);
        let frame = Frame::new(Photo::Srgb8(photo), depth_m, camera, 1.0).unwrap();
        let eyes = [Vec3::ZERO, Vec3::new(-1.7, 0.5, -3.0), Vec3::new(1.7, -0.5, -3.0), Vec3::new(0.0, 0.0, -3.0)];
        let point = |eye: Vec3, i: usize| {
            let direction = lo_geometry::pixel_direction(i % 600, i / 600, 600, 300);
            let position_m = truth(eye, direction);
            let seen = camera.project(position_m).is_some_and(|(u, v, _)| camera.contains(u, v));
            RadiancePoint {
                position_m: position_m + direction * 1e-3,
                radiance: radiance(position_m),
                provenance: if seen { Provenance::Observed } else { Provenance::Inferred },
            }
        };
        let points: Vec<RadiancePoint> =
            eyes.into_iter().flat_map(|eye| (0..600 * 300).map(move |i| point(eye, i))).collect();
        let light = LightOctree::from_points(&points, CUBE, 7, 4).unwrap().0;
        LitScene::observed_only(light, frame)
    };
    SCENE.get_or_init(make).clone()
}

/// Returns the scene with one emitter changed.
fn edited(id: &str, change: LightChange) -> LitScene {
    let mut scene = scene();
    let found = emitters(&scene);
    let found_at_m =
        list(&scene, &LightEdits::default()).iter().find(|light| light.id == id).unwrap().position_m.unwrap();
    let emitters = vec![EmitterEdit { id: id.to_owned(), found_at_m, change }];
    apply_edits(&mut scene, &LightEdits { emitters, ..LightEdits::default() }, &found).unwrap();
    scene
}

fn added(shape: LightShape, radiance: [f32; 3], change: LightChange) -> LitScene {
    let mut scene = scene();
    let found = emitters(&scene);
    let light = AnalyticLight { shape, radiance };
    let added = vec![AddedLight { id: "A1".to_owned(), light, change }];
    apply_edits(&mut scene, &LightEdits { added, ..LightEdits::default() }, &found).unwrap();
    scene
}

const WIDTH: usize = 256;
const HEIGHT: usize = 128;

fn panorama(scene: &LitScene, eye: Vec3) -> RadianceImage {
    SceneRenderer::new(scene).panorama(eye, WIDTH, HEIGHT).radiance
}

/// Renders panoramas at each of [`EYES`].
fn panoramas(scene: &LitScene) -> Vec<RadianceImage> {
    let renderer = SceneRenderer::new(scene);
    EYES.iter().map(|&eye| renderer.panorama(eye, WIDTH, HEIGHT).radiance).collect()
}

const EYES: [Vec3; 3] = [Vec3::ZERO, Vec3::new(0.5, -0.4, -2.3), Vec3::new(-1.2, 0.3, -0.5)];

fn scaled(scale: f32) -> LightChange {
    LightChange { scale, ..LightChange::NONE }
}

const OFF: LightChange = LightChange { on: false, ..LightChange::NONE };

/// Returns the irradiance on a surface with this normal.
fn irradiance(map: &RadianceImage, normal: Vec3) -> Vec3 {
    let (width, height) = (map.width(), map.height());
    let pixel = |i: usize| {
        let (x, y) = (i % width, i / width);
        let cosine = lo_geometry::pixel_direction(x, y, width, height).dot(normal).max(0.0);
        Vec3::from(map[(x, y)]) * (cosine * lo_geometry::pixel_solid_angle_sr(y, width, height))
    };
    (0..width * height).map(pixel).sum()
}

#[test]
fn emitters_are_listed_with_position_size_and_kind() {
    let scene = scene();
    let lights = list(&scene, &LightEdits::default());
    assert_eq!(lights.iter().map(|light| &light.id[..]).collect::<Vec<_>>(), ["L1", "L2", "L3"]);
    let found = |place: Vec3| lights.iter().find(|light| (light.position_m.unwrap() - place).length() < 0.1).unwrap();
    let window = found(Vec3::new(LOW.x, 0.2, -2.2));
    assert_eq!((window.kind, window.origin), (LightKind::Window, LightOrigin::Observed));
    assert!(window.direction.unwrap().dot(Vec3::X) > 0.99);
    // Whole leaves: up to one more in each direction.
    let [width, height] = window.size_m.unwrap();
    assert!((0.95..1.15).contains(&width) && (0.75..0.95).contains(&height), "{width} {height}");
    let lamp = found(Vec3::new(0.6, 0.3, LOW.z));
    assert_eq!((lamp.kind, lamp.origin), (LightKind::Lamp, LightOrigin::Observed));
    // (16, 11, 6) has x = 0.3791 and y = 0.3819, which is 4,079 K by McCamy.
    assert!((lamp.color_temperature_k.unwrap() / 4079.0 - 1.0).abs() < 0.02, "{:?}", lamp.color_temperature_k);
    let panel = found(Vec3::new(0.0, HIGH.y, 0.3));
    assert_eq!((panel.kind, panel.origin), (LightKind::Lamp, LightOrigin::Inferred));
    assert!(panel.direction.unwrap().dot(Vec3::NEG_Y) > 0.99);
    // Their irradiance at the walls in closed form, as shares of all light.
    let size = HIGH - LOW;
    let walls = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x) * luminance(WALL);
    let own = |area: f32, radiance: [f32; 3]| area * (luminance(radiance) - luminance(WALL));
    let given = [own(0.8, WINDOW), own(0.32 * 0.32, LAMP), own(0.6, PANEL)];
    let all = walls + given.iter().sum::<f32>();
    for (light, given) in [window, lamp, panel].into_iter().zip(given) {
        let share = light.flux_share.unwrap();
        assert!((share / (given / all) - 1.0).abs() < 0.08, "{}: {share} for {}", light.id, given / all);
    }
}

#[test]
fn twice_the_scale_is_twice_the_light_at_every_probe() {
    let plain = panoramas(&scene());
    for light in list(&scene(), &LightEdits::default()) {
        let [off, one, two] = [OFF, LightChange::NONE, scaled(2.0)].map(|change| panoramas(&edited(&light.id, change)));
        assert!(one == plain, "no change is none");
        for ((off, one), two) in off.iter().zip(&one).zip(&two) {
            let brightest = one.pixels().as_flattened().iter().copied().fold(0.0, f32::max);
            let pairs = off.pixels().iter().zip(one.pixels()).zip(two.pixels());
            let mut light = 0.0;
            for ((off, one), two) in pairs {
                for c in 0..3 {
                    let own = one[c] - off[c];
                    light += own;
                    assert!((two[c] - off[c] - 2.0 * own).abs() < 1e-3 * brightest, "{off:?} {one:?} {two:?}");
                }
            }
            assert!(light > 10.0, "the light is seen from everywhere");
            for normal in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
                let [off, one, two] = [off, one, two].map(|map| irradiance(map, normal));
                let (own, twice) = (one - off, two - off);
                assert!((twice - 2.0 * own).abs().max_element() < 0.01 * own.max_element().max(1e-2), "{own} {twice}");
            }
        }
    }
}

#[test]
fn a_lamp_that_is_off_leaves_no_rim() {
    for light in list(&scene(), &LightEdits::default()) {
        let scene = edited(&light.id, OFF);
        for (eye, map) in EYES.into_iter().zip(panoramas(&scene)) {
            let off = |i: usize| {
                let direction = lo_geometry::pixel_direction(i % WIDTH, i / WIDTH, WIDTH, HEIGHT);
                let towards = light.position_m.unwrap() - eye;
                towards.angle_between(direction) < 1.2 * light.area_m2.unwrap().sqrt() / towards.length()
            };
            // In and around it there is only wall, with the error of partly filled leaves.
            for i in (0..WIDTH * HEIGHT).filter(|&i| off(i)) {
                let bright = luminance(map.pixels()[i]) / luminance(WALL);
                assert!((0.8..1.25).contains(&bright), "{} from {eye}: {bright}", light.id);
            }
        }
    }
}

#[test]
fn without_emitters_there_are_walls_alone() {
    let mut scene = scene();
    let found = emitters(&scene);
    remove_emitters(&mut scene, &found);
    for map in panoramas(&scene) {
        for pixel in map.pixels() {
            assert!((0.75..1.3).contains(&(luminance(*pixel) / luminance(WALL))), "{pixel:?}");
        }
    }
}

#[test]
fn another_colour_keeps_the_luminance() {
    let lamp = list(&scene(), &LightEdits::default())
        .into_iter()
        .find(|light| light.kind == LightKind::Lamp && light.origin == LightOrigin::Observed);
    let lamp = lamp.unwrap();
    let change = LightChange { color: Some(LightColor::Kelvin(6500.0)), ..LightChange::NONE };
    let eye = EYES[1];
    let [off, one, blue] = [OFF, LightChange::NONE, change].map(|change| edited(&lamp.id, change));
    let [off, one, blue] = [&off, &one, &blue].map(|scene| irradiance(&panorama(scene, eye), Vec3::NEG_Z));
    let (own, blue) = (one - off, blue - off);
    let luminances = [own, blue].map(|light| luminance(light.to_array()));
    assert!((luminances[1] / luminances[0] - 1.0).abs() < 0.01, "{luminances:?}");
    let kelvin = lo_lights::color_temperature_k(blue.to_array()).unwrap();
    assert!((kelvin / 6500.0 - 1.0).abs() < 0.03, "{kelvin}");
}

#[test]
fn a_lamp_that_is_moved_gives_its_light_elsewhere() {
    let lamp = list(&scene(), &LightEdits::default())
        .into_iter()
        .find(|light| light.kind == LightKind::Lamp && light.origin == LightOrigin::Observed);
    let lamp = lamp.unwrap();
    let at_m = Vec3::new(-0.4, 0.1, -2.0);
    let moved = edited(&lamp.id, LightChange { at_m: Some(at_m), ..LightChange::NONE });
    let off = edited(&lamp.id, OFF);
    // 1 m in front of it: L A / d² straight ahead, within the size of the lamp.
    let eye = at_m + Vec3::Z * 1.0;
    let given = irradiance(&panorama(&moved, eye), Vec3::NEG_Z) - irradiance(&panorama(&off, eye), Vec3::NEG_Z);
    let expected = (Vec3::from(LAMP) - Vec3::from(WALL)) * 0.32 * 0.32;
    assert!((given / expected - 1.0).abs().max_element() < 0.12, "{given} {expected}");
}

#[test]
fn added_lights_give_what_they_should() {
    let eye = Vec3::new(0.3, -0.9, -1.9);
    let base = panorama(&scene(), eye);
    let given = |shape, radiance, normal| {
        let one = panorama(&added(shape, radiance, LightChange::NONE), eye);
        let two = panorama(&added(shape, radiance, scaled(2.0)), eye);
        let (one, two) = (
            irradiance(&one, normal) - irradiance(&base, normal),
            irradiance(&two, normal) - irradiance(&base, normal),
        );
        assert!((two - 2.0 * one).abs().max_element() < 1e-3 * two.max_element(), "{one} {two}");
        one
    };
    let close = |found: Vec3, expected: f32, name: &str| {
        assert!((found / expected - 1.0).abs().max_element() < 0.01, "{name}: {found} for {expected}");
    };
    // At the distance d in front of its centre, a square of edge 2 a gives E = 4 L a/√(a² + d²) atan(a/√(a² + d²)).
    let (a, d) = (0.4f32, 1.3f32);
    let square = |size: f32, two_sided| LightShape::Rectangle {
        centre_m: eye + Vec3::Y * d,
        direction: Vec3::NEG_Y,
        across: Vec3::X,
        size_m: [size; 2],
        two_sided,
    };
    let form = |a: f32| 4.0 * (a / a.hypot(d)) * (a / a.hypot(d)).atan();
    close(given(square(2.0 * a, false), [3.0; 3], Vec3::Y), 3.0 * form(a), "square");
    close(given(square(2.0 * a, true), [3.0; 3], Vec3::Y), 3.0 * form(a), "two-sided square");
    // Smaller than a pixel.
    close(given(square(0.01, false), [1e5; 3], Vec3::Y), 1e5 * form(0.005), "small square");
    let back = LightShape::Rectangle {
        centre_m: eye + Vec3::Y * d,
        direction: Vec3::Y,
        across: Vec3::X,
        size_m: [1.0; 2],
        two_sided: false,
    };
    assert!(panorama(&added(back, [3.0; 3], LightChange::NONE), eye) == base, "it shines to the other side");
    // A sphere of radius r at the distance d: π L (r/d)².
    for (r, radiance) in [(0.3f32, 2.0f32), (0.004, 1e5)] {
        let sphere = LightShape::Sphere { centre_m: eye + Vec3::Y * d, radius_m: r };
        close(given(sphere, [radiance; 3], Vec3::Y), std::f32::consts::PI * radiance * (r / d).powi(2), "sphere");
    }
    // A sun of irradiance 4, through an unobserved wall.
    let direction = Vec3::new(0.2, 0.8, 0.6).normalize();
    let sun = LightShape::Sun { direction, angular_radius_deg: 0.27, of_photo: false };
    let light = AnalyticLight { shape: sun, radiance: [1.0; 3] };
    close(given(sun, [4.0 / light.extent(); 3], direction), 4.0, "sun");
    // Not through a wall that the photo shows, but through the window in the left wall.
    let front =
        LightShape::Sun { direction: Vec3::new(0.0, 0.2, -1.0).normalize(), angular_radius_deg: 0.27, of_photo: false };
    assert!(panorama(&added(front, [1e5; 3], LightChange::NONE), eye) == base, "a seen wall hides it");
    let through = (Vec3::new(LOW.x, 0.2, -2.2) - eye).normalize();
    let window = LightShape::Sun { direction: through, angular_radius_deg: 0.27, of_photo: false };
    close(given(window, [4.0 / light.extent(); 3], through), 4.0, "sun through the window");
}

#[test]
fn nothing_is_seen_through_walls() {
    let eye = Vec3::new(0.0, 0.0, -2.0);
    let behind = LightShape::Sphere { centre_m: Vec3::new(0.0, 0.0, LOW.z - 0.6), radius_m: 0.1 };
    assert!(panorama(&added(behind, [100.0; 3], LightChange::NONE), eye) == panorama(&scene(), eye));
}

#[test]
fn edits_of_unknown_lights_are_refused() {
    let mut scene = scene();
    let (before, found) = (scene.light.clone(), emitters(&scene));
    let edit = |id: &str, found_at_m| LightEdits {
        emitters: vec![EmitterEdit { id: id.to_owned(), found_at_m, change: OFF }],
        ..LightEdits::default()
    };
    let message = apply_edits(&mut scene, &edit("L7", Vec3::ZERO), &found).unwrap_err().to_string();
    assert_eq!(message, "the scene has no light L7; it has L1, L2, L3");
    let message = apply_edits(&mut scene, &edit("L1", Vec3::new(1.9, -1.4, 0.9)), &found).unwrap_err().to_string();
    assert!(message.starts_with("light L1 is ") && message.ends_with("reset it"), "{message}");
    assert!(scene.light.rgba == before.rgba && scene.edited.is_none());
}
