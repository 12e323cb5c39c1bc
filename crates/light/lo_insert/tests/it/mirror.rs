//! Reflections of a chrome sphere compared with the truth: a striped room that the photo shows.

use lo_geometry::{Camera, Cube, Plane, Vec3};
use lo_imaging::{Image, Photo, RadianceImage};
use lo_insert::{Inserter, Instance, Lighting, Placement, Quality};
use lo_mesh::{Material, Model, PreparedModel};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{Frame, LitScene};

const LOW: Vec3 = Vec3::new(-1.5, -1.0, -3.5);
const HIGH: Vec3 = Vec3::new(1.5, 1.4, 0.6);
const RADIUS: f32 = 0.5;
const CENTRE: Vec3 = Vec3::new(0.1, LOW.y + RADIUS, -2.2);

/// Returns the point where a ray from inside meets the room, and its radiance: stripes of 7 cm.
fn room(origin: Vec3, direction: Vec3) -> (Vec3, [f32; 3]) {
    let (a, b) = ((LOW - origin) / direction, (HIGH - origin) / direction);
    let point = origin + direction * a.max(b).min_element();
    let wave = ((point.x + point.y + point.z) * std::f32::consts::TAU / 0.25).sin();
    (point, [0.5 + 0.35 * wave, 0.5, 0.5 - 0.35 * wave])
}

fn scene() -> LitScene {
    let camera = Camera::from_hfov_deg(75.0, 640, 480).unwrap();
    let ray = |x: usize, y: usize| room(Vec3::ZERO, camera.direction(x as f64 + 0.5, y as f64 + 0.5));
    let photo = RadianceImage::from_fn(640, 480, |x, y| ray(x, y).1);
    let depth_m = Image::from_fn(640, 480, |x, y| -ray(x, y).0.z);
    let points = lo_geometry::fibonacci_sphere(400_000).into_iter().map(|direction| {
        let (position_m, radiance) = room(Vec3::ZERO, direction);
        RadiancePoint { position_m, radiance, provenance: Provenance::Observed }
    });
    // Leaves of 8 cm
    let cube = Cube::centred(Vec3::new(0.0, 0.0, -1.5), 5.1);
    let light = LightOctree::from_points(&points.collect::<Vec<_>>(), cube, 6, 4).unwrap().0;
    LitScene::observed_only(light, Frame::new(Photo::Linear(photo), depth_m, camera, 1.0).unwrap())
}

/// Sub-pixel positions along a pixel's sides for the truth.
const PLACES: usize = 4;

/// Returns what the sphere reflects at a sub-pixel position, where the photo shows it away from the sphere's shadow.
fn mirrored(camera: &Camera, x: usize, y: usize, place: usize) -> Option<Vec3> {
    let at = |pixel: usize, step: usize| pixel as f64 + (step as f64 + 0.5) / PLACES as f64;
    let view = camera.direction(at(x, place % PLACES), at(y, place / PLACES));
    let along = view.dot(CENTRE);
    let discriminant = along * along - CENTRE.length_squared() + RADIUS * RADIUS;
    let point = view * (along - discriminant.max(0.0).sqrt());
    let normal = (point - CENTRE) / RADIUS;
    let (met, truth) = room(point, view - 2.0 * view.dot(normal) * normal);
    let inside = |u: f64, v: f64| (10.0..630.0).contains(&u) && (10.0..470.0).contains(&v);
    let shown = camera.project(met).is_some_and(|(u, v, _)| inside(u, v)) && met.y > LOW.y + 0.1;
    (discriminant > 0.0 && shown).then_some(Vec3::from(truth))
}

/// Returns the mean error of the pixels that reflect a point shown by the photo, away from the sphere's shadow, and
/// their number.
fn error(scene: &LitScene, quality: Quality) -> (f32, usize) {
    let camera = scene.frame.camera;
    let chrome = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.0, ..Material::default() };
    let model = PreparedModel::new(Model::sphere(RADIUS, 6, chrome).unwrap());
    let placement = Placement {
        position_m: CENTRE - Vec3::Y * RADIUS,
        scale: 1.0,
        yaw_rad: 0.0,
        up: Vec3::Y,
        support: Some(Plane::through(Vec3::new(0.0, LOW.y, 0.0), Vec3::Y)),
    };
    let inserter = Inserter::new(scene, Lighting::Octree, quality).unwrap();
    let composite = inserter.render(&[Instance::new(&model, placement)], &mut lo_events::ignore).unwrap();
    let (mut sum, mut count) = (0.0, 0);
    for y in 0..480 {
        for x in 0..640 {
            if composite.alpha[(x, y)] < 1.0 {
                continue;
            }
            let mirrored: Option<Vec<Vec3>> = (0..PLACES * PLACES).map(|i| mirrored(&camera, x, y, i)).collect();
            if let Some(mirrored) = mirrored {
                let truth = mirrored.iter().sum::<Vec3>() / mirrored.len() as f32;
                sum += (Vec3::from(composite.object[(x, y)]) - truth).abs().element_sum() / 2.0;
                count += 1;
            }
        }
    }
    (sum / count as f32, count)
}

#[test]
fn chrome_mirrors_what_the_photo_shows() {
    let scene = scene();
    let (draft, pixels) = error(&scene, Quality::Draft);
    let (normal, _) = error(&scene, Quality::Normal);
    println!("{pixels} pixels: {draft} without the photo, {normal} with it");
    assert!(pixels > 500, "{pixels}");
    assert!(normal < 0.6 * draft, "{normal} with the photo, {draft} without");
}

/// A room that is grey in the octree, and striped in the photo.
fn unseen_scene() -> LitScene {
    let scene = scene();
    let rgba = |rows: &Vec<[f32; 4]>| rows.iter().map(|&[.., opacity]| [0.5, 0.5, 0.5, opacity]).collect();
    let light = LightOctree { rgba: scene.light.rgba.iter().map(rgba).collect(), ..scene.light.clone() };
    LitScene { light, ..scene }
}

/// Inserts the sphere of a material, with and without detail.
fn with_and_without_detail(material: Material, quality: Quality) -> [lo_insert::Composite; 2] {
    let scene = unseen_scene();
    let model = PreparedModel::new(Model::sphere(RADIUS, 6, material).unwrap());
    let placement = Placement {
        position_m: CENTRE - Vec3::Y * RADIUS,
        scale: 1.0,
        yaw_rad: 0.0,
        up: Vec3::Y,
        support: Some(Plane::through(Vec3::new(0.0, LOW.y, 0.0), Vec3::Y)),
    };
    let with = Inserter::new(&scene, Lighting::Octree, quality).unwrap();
    let without = Inserter::new(&scene, Lighting::Octree, quality).unwrap().without_detail();
    [with, without]
        .map(|inserter| inserter.render(&[Instance::new(&model, placement)], &mut lo_events::ignore).unwrap())
}

/// Returns the deviation of red in the reflection at the sphere's centre, which shows the room behind the camera.
fn deviation(composite: &lo_insert::Composite) -> f32 {
    let camera = Camera::from_hfov_deg(75.0, 640, 480).unwrap();
    let (u, v, _) = camera.project(CENTRE).unwrap();
    let is_inside = |i: &usize| ((*i % 640) as f64 - u).hypot((*i / 640) as f64 - v) < 45.0;
    let reds: Vec<f32> = (0..640 * 480).filter(is_inside).map(|i| composite.object.pixels()[i][0]).collect();
    let mean = reds.iter().sum::<f32>() / reds.len() as f32;
    (reds.iter().map(|red| (red - mean).powi(2)).sum::<f32>() / reds.len() as f32).sqrt()
}

#[test]
fn chrome_mirrors_detail_where_nothing_was_seen() {
    let chrome = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.0, ..Material::default() };
    let [with, without] = with_and_without_detail(chrome.clone(), Quality::Normal);
    let (with, without) = (deviation(&with), deviation(&without));
    println!("{with} with detail, {without} without");
    assert!(with > 1.5 * without, "{with} with detail, {without} without");
    let [with, without] = with_and_without_detail(chrome, Quality::Draft);
    assert_eq!(with.image, without.image);
}

#[test]
fn diffuse_light_and_shadows_have_no_detail() {
    let plaster = Material { base_color: [0.7, 0.7, 0.7, 1.0], metallic: 0.0, roughness: 1.0, ..Material::default() };
    let [with, without] = with_and_without_detail(plaster, Quality::Normal);
    assert_eq!(with.shadow_ratio, without.shadow_ratio);
    // Its rough reflection, some hundredths of its light, is gathered by wide cones, which see the photo's means.
    let pairs = with.object.pixels().iter().zip(without.object.pixels());
    let off = pairs.map(|(a, b)| (Vec3::from(*a) - Vec3::from(*b)).abs().max_element()).fold(0.0, f32::max);
    println!("plaster is off by {off}");
    assert!(off < 0.01, "{off}");
    let chrome = Material { base_color: [1.0; 4], metallic: 1.0, roughness: 0.0, ..Material::default() };
    let [with, without] = with_and_without_detail(chrome, Quality::Normal);
    assert_eq!(with.shadow_ratio, without.shadow_ratio);
}
