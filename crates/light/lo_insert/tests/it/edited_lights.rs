//! Tests of added and edited lights on an object and in its shadow, in a room of known radiance.

use std::f32::consts::PI;
use std::sync::OnceLock;

use lo_cone::OctreeRenderer;
use lo_geometry::{Camera, Cube, Plane, Vec3};
use lo_imaging::{Image, Photo, luminance};
use lo_insert::{Composite, Inserter, Instance, Lighting, Placement, Quality};
use lo_lights::{apply_edits, emitters, list};
use lo_mesh::{Material, Model, PreparedModel};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{AddedLight, AnalyticLight, EmitterEdit, Frame, LightChange, LightEdits, LightShape, LitScene};

const LOW: Vec3 = Vec3::new(-2.0, -1.0, -4.0);
const HIGH: Vec3 = Vec3::new(2.0, 1.5, 1.0);
const WIDTH: usize = 120;
const HEIGHT: usize = 80;
const CENTRE: Vec3 = Vec3::new(0.2, -0.45, -2.4);
const RADIUS: f32 = 0.25;
const ALBEDO: f32 = 0.7;

fn wall(origin: Vec3, direction: Vec3) -> Vec3 {
    let (a, b) = ((LOW - origin) / direction, (HIGH - origin) / direction);
    origin + direction * a.max(b).min_element()
}

/// A lamp in the ceiling; walls of 0.4.
fn radiance(p: Vec3) -> [f32; 3] {
    let lamp = p.y > HIGH.y - 0.01 && (p.x + 0.5).abs() < 0.4 && (p.z + 2.0).abs() < 0.4;
    if lamp { [12.0; 3] } else { [0.4; 3] }
}

/// A room whose photo shows the floor and the back wall.
fn scene() -> LitScene {
    static SCENE: OnceLock<LitScene> = OnceLock::new();
    SCENE.get_or_init(new_scene).clone()
}

fn new_scene() -> LitScene {
    let camera = Camera::from_hfov_deg(65.0, WIDTH as u32, HEIGHT as u32).unwrap();
    let point = |direction: Vec3| {
        let position_m = wall(0.5 * (LOW + HIGH), direction);
        let seen = camera.project(position_m).is_some_and(|(u, v, _)| camera.contains(u, v));
        let provenance = if seen { Provenance::Observed } else { Provenance::Inferred };
        RadiancePoint { position_m, radiance: radiance(position_m), provenance }
    };
    let points: Vec<RadiancePoint> = lo_geometry::fibonacci_sphere(400_000).into_iter().map(point).collect();
    let light = LightOctree::from_points(&points, Cube::centred(0.5 * (LOW + HIGH), 5.5), 6, 4).unwrap().0;
    let seen = |x: usize, y: usize| wall(Vec3::ZERO, camera.direction(x as f64 + 0.5, y as f64 + 0.5));
    let photo = Photo::Linear(Image::from_fn(WIDTH, HEIGHT, |x, y| radiance(seen(x, y))));
    let depth_m = Image::from_fn(WIDTH, HEIGHT, |x, y| -seen(x, y).z);
    LitScene::observed_only(light, Frame::new(photo, depth_m, camera, 1.0).unwrap())
}

fn with(shape: LightShape, radiance: f32) -> LitScene {
    added(scene(), shape, radiance)
}

/// Adds a light to the scene.
fn added(mut scene: LitScene, shape: LightShape, radiance: f32) -> LitScene {
    let found = emitters(&scene);
    let light = AnalyticLight { shape, radiance: [radiance; 3] };
    let added = vec![AddedLight { id: "A1".to_owned(), light, change: LightChange::NONE }];
    apply_edits(&mut scene, &LightEdits { added, ..LightEdits::default() }, &found).unwrap();
    scene
}

/// The room with a square sun patch centred on the back wall at `middle`.
fn with_patch(middle: Vec3) -> LitScene {
    let mut scene = scene();
    let camera = scene.frame.camera;
    let photo = Image::from_fn(WIDTH, HEIGHT, |x, y| {
        let seen = wall(Vec3::ZERO, camera.direction(x as f64 + 0.5, y as f64 + 0.5));
        let lit = seen.z < LOW.z + 0.01 && (seen - middle).abs().max_element() < 0.35;
        radiance(seen).map(|value| if lit { 5.0 * value } else { value })
    });
    scene.estimate_mut().frame.photo = Photo::Linear(photo);
    scene
}

/// A matte sphere of radius 1 about the origin.
fn sphere() -> PreparedModel {
    let material = Material { base_color: [ALBEDO, ALBEDO, ALBEDO, 1.0], roughness: 1.0, ..Material::default() };
    PreparedModel::new(Model::sphere(1.0, 5, material).unwrap())
}

fn render(scene: &LitScene) -> Composite {
    render_at(scene, Quality::High)
}

fn render_at(scene: &LitScene, quality: Quality) -> Composite {
    let support = Some(Plane { normal: Vec3::Y, offset_m: LOW.y });
    let position_m = CENTRE - Vec3::Y * RADIUS;
    let placement = Placement { position_m, scale: RADIUS, yaw_rad: 0.0, up: Vec3::Y, support };
    let inserter = Inserter::new(scene, Lighting::Octree, quality).unwrap();
    inserter.render(&[Instance::new(&sphere(), placement)], &mut lo_events::ignore).unwrap()
}

fn pixel(scene: &LitScene, point: Vec3) -> (usize, usize) {
    let (u, v, _) = scene.frame.camera.project(point).unwrap();
    (u as usize, v as usize)
}

#[test]
fn the_photos_own_sun_lights_what_stands_in_its_patches_alone() {
    let direction = Vec3::new(0.3, 0.05, 0.8).normalize();
    let sun = |of_photo| LightShape::Sun { direction, angular_radius_deg: 0.27, of_photo };
    let radiance = 6.0 / AnalyticLight { shape: sun(true), radiance: [1.0; 3] }.extent();
    let render = |scene: &LitScene| render_at(scene, Quality::Normal);
    // The centre of the sphere's shadow, and a point beside it.
    let shadow = CENTRE - direction * ((CENTRE.z - LOW.z) / direction.z);
    let free = render(&with(sun(false), radiance));
    let none = render(&scene());
    let on = render(&added(with_patch(shadow), sun(true), radiance));
    let off = render(&added(with_patch(shadow + Vec3::X * 1.2), sun(true), radiance));
    let normal = (direction + (-CENTRE).normalize()).normalize();
    let at = pixel(&scene(), CENTRE + normal * RADIUS);
    let [all, own, lit, dark] = [&free, &none, &on, &off].map(|composite| luminance(composite.object[at]));
    assert!((lit / all - 1.0).abs() < 0.03, "{lit} of {all}");
    assert!((dark / own - 1.0).abs() < 0.03, "{dark} of {own}, {lit} in the sun");
    // Its shadow is in the patch; there is none where the photo has no sunlight.
    let ratio = |composite: &Composite| luminance(composite.shadow_ratio[pixel(&scene(), shadow)]);
    let [all, own, lit, dark] = [&free, &none, &on, &off].map(ratio);
    assert!((lit / all - 1.0).abs() < 0.1 && (dark / own - 1.0).abs() < 0.1, "{lit} of {all}, {dark} of {own}");
}

#[test]
fn an_added_sun_lights_the_object_and_casts_its_shadow() {
    let direction = Vec3::new(0.5, 0.7, 0.4).normalize();
    let shape = LightShape::Sun { direction, angular_radius_deg: 0.27, of_photo: false };
    let extent = AnalyticLight { shape, radiance: [1.0; 3] }.extent();
    let strength = 6.0;
    let (plain, scene) = (scene(), with(shape, strength / extent));
    let [none, one, two] = [&plain, &scene, &with(shape, 2.0 * strength / extent)].map(render);

    // Where the sphere faces the sun, half way to the camera, the sun adds albedo / π · E · cos, minus a twentieth by
    // Fresnel's term.
    let normal = (direction + (-CENTRE).normalize()).normalize();
    let at = pixel(&scene, CENTRE + normal * RADIUS);
    let [dark, lit, bright] = [&none, &one, &two].map(|composite| luminance(composite.object[at]));
    let expected = ALBEDO / PI * strength * normal.dot(direction);
    assert!((lit - dark) / expected > 0.92 && (lit - dark) / expected < 1.02, "{lit} − {dark}, {expected}");
    // The samples of the other lamp differ, too.
    assert!(((bright - dark) / (lit - dark) - 2.0).abs() < 0.03, "{dark} {lit} {bright}");

    // In the centre of its shadow, only the other light remains: E₀ r / (E₀ + S).
    let shadow = CENTRE - direction * ((CENTRE.y - LOW.y) / direction.y);
    let sun = strength * direction.y;
    let map = OctreeRenderer::new(&plain.light).at(shadow).panorama(shadow + Vec3::Y * 0.13, 256, 128).radiance;
    let cosine = |i: usize| lo_geometry::pixel_direction(i % 256, i / 256, 256, 128).y.max(0.0);
    let arriving =
        |i: usize| luminance(map.pixels()[i]) * cosine(i) * lo_geometry::pixel_solid_angle_sr(i / 256, 256, 128);
    let other: f32 = (0..256 * 128).map(arriving).sum();
    let ratio = |composite: &Composite| luminance(composite.shadow_ratio[pixel(&scene, shadow)]);
    let expected = other * ratio(&none) / (other + sun);
    assert!((ratio(&one) / expected - 1.0).abs() < 0.12, "{} for {expected}", ratio(&one));
    // Beside it, the photo is not relit.
    let beside = pixel(&scene, Vec3::new(1.1, LOW.y, -3.2));
    assert!((luminance(one.shadow_ratio[beside]) - 1.0).abs() < 0.02, "{:?}", one.shadow_ratio[beside]);
}

#[test]
fn added_lamps_light_the_object_by_the_square_of_their_distance() {
    let plain = render(&scene());
    let given = |shape: LightShape, radiance: f32, normal: Vec3| {
        let scene = with(shape, radiance);
        let at = pixel(&scene, CENTRE + normal * RADIUS);
        luminance(render(&scene).object[at]) - luminance(plain.object[at])
    };
    let normal = (-CENTRE).normalize();
    for distance_m in [0.8, 1.6] {
        let centre_m = CENTRE + normal * (RADIUS + distance_m);
        let (radius_m, radiance) = (0.05, 400.0);
        // Minus Fresnel's term, a twentieth.
        let expected = 0.95 * ALBEDO * radiance * (radius_m / distance_m).powi(2);
        let ball = given(LightShape::Sphere { centre_m, radius_m }, radiance, normal);
        assert!((ball / expected - 1.0).abs() < 0.06, "{ball} for {expected} at {distance_m} m");
        let across = normal.any_orthonormal_vector();
        let rectangle =
            LightShape::Rectangle { centre_m, direction: -normal, across, size_m: [0.1, 0.08], two_sided: false };
        let expected = 0.95 * ALBEDO / PI * radiance * 0.008 / (distance_m * distance_m);
        let flat = given(rectangle, radiance, normal);
        assert!((flat / expected - 1.0).abs() < 0.06, "{flat} for {expected} at {distance_m} m");
        let away = LightShape::Rectangle { centre_m, direction: normal, across, size_m: [0.1, 0.08], two_sided: false };
        assert!(given(away, radiance, normal).abs() < 0.05 * expected, "it shines away");
    }
}

#[test]
fn a_lamp_that_is_off_lights_nothing_and_one_of_twice_the_scale_twice() {
    let changed = |change: LightChange| {
        let mut scene = scene();
        let found = emitters(&scene);
        let lamp = list(&scene, &LightEdits::default()).remove(0);
        let found_at_m = lamp.position_m.unwrap();
        let emitters = vec![EmitterEdit { id: lamp.id, found_at_m, change }];
        apply_edits(&mut scene, &LightEdits { emitters, ..LightEdits::default() }, &found).unwrap();
        scene
    };
    let off = changed(LightChange { on: false, ..LightChange::NONE });
    let two = changed(LightChange { scale: 2.0, ..LightChange::NONE });
    let top = pixel(&off, CENTRE + Vec3::new(-0.2, 0.9, 0.39).normalize() * RADIUS);
    let [dark, lit, bright] = [&off, &scene(), &two].map(|scene| luminance(render(scene).object[top]));
    // The walls alone give albedo · 0.4, minus the floor's loss to the object's own shadow.
    assert!(dark < 1.02 * ALBEDO * 0.4 && dark > 0.8 * ALBEDO * 0.4, "{dark}");
    assert!(lit > 1.5 * dark, "{lit} {dark}");
    assert!(((bright - dark) / (lit - dark) - 2.0).abs() < 0.05, "{dark} {lit} {bright}");
}
