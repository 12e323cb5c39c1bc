//! Accuracy of sun patches and of the sun's strength in photos of sunny generated rooms, for a known sun direction.

use std::sync::Arc;

use lo_dataset::{Generator, GeneratorConfig};
use lo_estimate::{EstimateOptions, Estimator, Input, sun_from_photo, supported_sun};
use lo_geometry::{Ray, Vec3};
use lo_imaging::{DepthMap, Image, Photo, luminance};
use lo_lights::{Sunlit, sun_from_shadow};
use lo_mesh::PreparedModel;
use lo_random::RngExt;
use lo_scene::{Estimate, Frame};
use lo_synth::{CameraPose, Interior, Weather};

use crate::median;

const FAR_M: f32 = 100.0;

/// Every n-th pixel in each direction is tested.
const STRIDE: usize = 4;

/// Smallest share of sunlit pixels; other rooms are skipped.
const MIN_LIT: f64 = 0.005;

/// Returns the first hit of a ray, except for glass.
fn first_hit(model: &PreparedModel, mut ray: Ray) -> Option<Vec3> {
    let is_glass = |triangle: u32| {
        let model = model.model();
        model.materials[model.triangle_materials[triangle as usize] as usize].transmission > 0.0
    };
    for _ in 0..8 {
        let hit = model.intersect_both_sides(&ray, FAR_M)?;
        if !is_glass(hit.triangle) {
            return Some(ray.origin + ray.direction * hit.distance_m);
        }
        ray.origin += ray.direction * (hit.distance_m + 1e-3);
    }
    None
}

/// Returns the point at a pixel, and the point that occludes the sun from it; `None` without a hit.
fn shown(model: &PreparedModel, view: &CameraPose, sun: Vec3, (u, v): (f64, f64)) -> Option<(Vec3, Option<Vec3>)> {
    let direction = (view.pose.rotation * view.camera.direction(u, v)).normalize();
    let place = first_hit(model, Ray { origin: view.pose.position, direction })?;
    Some((place, first_hit(model, Ray { origin: place - direction * 2e-3, direction: sun })))
}

/// Returns whether a pixel is sunlit; `None` without a hit.
fn is_lit(model: &PreparedModel, view: &CameraPose, sun: Vec3, (x, y): (usize, usize)) -> Option<bool> {
    shown(model, view, sun, (x as f64 + 0.5, y as f64 + 0.5)).map(|(_, hidden_by)| hidden_by.is_none())
}

/// Returns the intersection over union of true and detected sun patches; 0 if none is detected.
fn overlap(truth: &Image<Option<bool>>, scene: &Estimate, sun: Vec3) -> f64 {
    let Some(found) = Sunlit::new(scene.surface(), scene.surface_normals(), sun) else { return 0.0 };
    let lit = found.lit();
    let (mut both, mut one) = (0.0, 0.0);
    for y in 0..truth.height() {
        for x in 0..truth.width() {
            let Some(truth_here) = truth[(x, y)] else { continue };
            let own = lit[(x * lit.width() / truth.width(), y * lit.height() / truth.height())] > 0.5;
            both += f64::from(u8::from(truth_here && own));
            one += f64::from(u8::from(truth_here || own));
        }
    }
    both / one
}

#[test]
#[ignore = "two minutes: cargo test --release -p lo_eval --test it sun::sun_patches -- --ignored --nocapture; SUN_SEED chooses other rooms"]
fn sun_patches_of_generated_rooms() {
    let mut config = GeneratorConfig { shots: 1, ..GeneratorConfig::default() };
    config.room.crop_size = [480, 320];
    config.room.weather_weights = [(Weather::Clear, 0.8), (Weather::Sunset, 0.2)].into();
    let seed = std::env::var("SUN_SEED").map_or(7003, |seed| seed.parse().unwrap());
    let generator = Generator::new(seed, config).unwrap();
    let estimator = Estimator::shipped().unwrap();
    let names = ["true depth", "sensor depth", "photo alone"];
    let [mut overlaps, mut strengths] = [const { [const { Vec::new() }; 3] }; 2];
    for index in 0..60 {
        let interior = generator.interior(index).unwrap();
        let view = interior.camera_poses(1)[0];
        let model = PreparedModel::new(interior.world.model.clone());
        let Some(sun) = interior.world.outdoors.sun else { continue };
        let (columns, rows) = (view.camera.width as usize / STRIDE, view.camera.height as usize / STRIDE);
        let pixel = |x: usize, y: usize| is_lit(&model, &view, sun.direction, (x * STRIDE, y * STRIDE));
        let truth = Image::from_fn(columns, rows, pixel);
        let lit = truth.pixels().iter().filter(|lit| **lit == Some(true)).count();
        let share = lit as f64 / (columns * rows) as f64;
        if share < MIN_LIT {
            continue;
        }
        let record = generator.record(index).unwrap();
        let (sample, gains) = (record.sample(0), record.shots[0].gains);
        let radiance: [f32; 3] = std::array::from_fn(|c| sun.radiance[c] * gains[c]);
        let strength = luminance(radiance) * std::f32::consts::PI * sun.angular_radius_rad.powi(2);
        let direction = view.pose.rotation.inverse() * sun.direction;
        let photo = Photo::Srgb8(sample.photo.clone());
        let measured = |depth: &Option<DepthMap>| {
            Input::MeasuredDepth(Frame::new(photo.clone(), depth.clone().unwrap(), sample.camera, 1.0).unwrap())
        };
        let alone = Input::Photo { photo: photo.clone(), camera: sample.camera };
        let inputs = [measured(&sample.depth_m), measured(&sample.sensor_depth_m), alone];
        print!("room {index}: {:.1} % in the sun, strength {strength:.1}", 100.0 * share);
        for (way, input) in inputs.into_iter().enumerate() {
            let options = EstimateOptions::default();
            let scene = Arc::new(estimator.estimate(input, &options, &mut lo_events::ignore).unwrap());
            overlaps[way].push(overlap(&truth, &scene, direction));
            print!("; {}: overlap {:.2}", names[way], overlaps[way].last().unwrap());
            if let Some(found) = sun_from_photo(&scene, direction, 0.27) {
                let ratio = luminance(found.light.radiance) * found.light.extent() / strength;
                print!(", strength × {ratio:.2}{}", if found.clipped { " at the least" } else { "" });
                strengths[way].push(f64::from(ratio));
            }
        }
        println!();
    }
    for (name, (overlaps, strengths)) in names.into_iter().zip(overlaps.iter().zip(&strengths)) {
        let (found, photos) = (strengths.len(), overlaps.len());
        let (overlap, strength) = (median(overlaps.clone()), median(strengths.clone()));
        println!("{name}: sun patches in {found} of {photos} photos, overlap {overlap:.2}, strength × {strength:.2}");
        assert!(overlap > 0.2 && (0.2..2.0).contains(&strength), "{name}");
    }
}

/// Pixels of an occluder and of its shadow.
type Shadow = [[f64; 2]; 2];

/// Largest number of shadows of each kind per photo.
const SHADOWS: usize = 5;

/// Returns visible occluders with their shadows beside sun patches.
fn true_shadows(interior: &Interior, view: &CameraPose) -> Vec<Shadow> {
    let Some(sun) = interior.world.outdoors.sun else { return Vec::new() };
    let model = PreparedModel::new(interior.world.model.clone());
    let camera = &view.camera;
    let (columns, rows) = (camera.width as usize / STRIDE, camera.height as usize / STRIDE);
    let at = |x: usize, y: usize| ((x * STRIDE) as f64 + 0.5, (y * STRIDE) as f64 + 0.5);
    let places = Image::from_fn(columns, rows, |x, y| shown(&model, view, sun.direction, at(x, y)));
    let is_lit = |x: usize, y: usize| places[(x, y)].is_some_and(|(_, hidden_by)| hidden_by.is_none());
    let lit = places.pixels().iter().flatten().filter(|(_, hidden_by)| hidden_by.is_none()).count();
    if (lit as f64) < MIN_LIT * (columns * rows) as f64 {
        return Vec::new();
    }
    let pixels = (0..rows).flat_map(|y| (1..columns - 1).map(move |x| (x, y)));
    let beside_patch = pixels.filter(|&(x, y)| is_lit(x - 1, y) || is_lit(x + 1, y));
    let shadow = |(x, y): (usize, usize)| {
        let thing = places[(x, y)]?.1?;
        let (u, v, _) = camera.project(view.pose.rotation.inverse() * (thing - view.pose.position))?;
        let seen = shown(&model, view, sun.direction, (u, v)).filter(|_| camera.contains(u, v))?.0;
        ((seen - thing).length() < 0.1).then(|| [[u, v], at(x, y).into()])
    };
    let all: Vec<Shadow> = beside_patch.filter_map(shadow).filter(|shadow| is_far(camera.width, shadow)).collect();
    all.iter().step_by(all.len().div_ceil(SHADOWS).max(1)).copied().collect()
}

/// Returns whether occluder and shadow are far enough apart to determine a direction.
fn is_far(width: u32, [thing, shadow]: &Shadow) -> bool {
    (thing[0] - shadow[0]).hypot(thing[1] - shadow[1]) > 0.06 * f64::from(width)
}

/// Draws random pairs of pixels that give a direction; with `at_edges`, the second is at an edge of brightness.
fn any_shadows(scene: &Estimate, at_edges: bool, stream: &mut impl RngExt) -> Vec<Shadow> {
    let (camera, radiance) = (scene.frame.camera, scene.frame.radiance());
    let size = [f64::from(camera.width), f64::from(camera.height)];
    let log = |u: f64, v: f64| {
        let pixel = (u.clamp(0.0, size[0] - 1.0) as usize, v.clamp(0.0, size[1] - 1.0) as usize);
        luminance(radiance[pixel]).max(2e-3).ln()
    };
    let mut any = || size.map(|size| stream.random_range(0.0..size));
    let pairs = std::iter::repeat_with(|| [any(), any()]).take(3000);
    let is_edge = |[u, v]: [f64; 2]| {
        let across = [log(u - 4.0, v) - log(u + 4.0, v), log(u, v - 4.0) - log(u, v + 4.0)];
        across.into_iter().any(|difference| difference.abs() > 0.7)
    };
    let usable = pairs.filter(|pair| is_far(camera.width, pair) && (!at_edges || is_edge(pair[1])));
    usable.filter(|pair| sun_from_shadow(scene, pair[0], pair[1]).is_some()).take(SHADOWS).collect()
}

#[test]
#[ignore = "five minutes: cargo test --release -p lo_eval --test it sun::shadows -- --ignored --nocapture"]
fn shadows_of_generated_rooms() {
    let mut config = GeneratorConfig { shots: 1, panoramas: 1, panorama_height: 16, ..GeneratorConfig::default() };
    config.octree_depth = 4;
    config.light.gather_rays = 24;
    config.room.crop_size = [480, 320];
    let weather = [(Weather::Clear, 0.5), (Weather::Sunset, 0.1), (Weather::Overcast, 0.2), (Weather::Night, 0.2)];
    config.room.weather_weights = weather.into();
    let seed = std::env::var("SUN_SEED").map_or(7103, |seed| seed.parse().unwrap());
    let generator = Generator::new(seed, config).unwrap();
    let estimator = Estimator::shipped().unwrap();
    let kinds = ["true shadows", "no sun: any pixels", "no sun: edges", "sun: any pixels", "sun: edges"];
    let depths = ["true depth", "photo alone"];
    // By depth and kind: number tested, number accepted.
    let mut counts = [[[0u32; 2]; 5]; 2];
    for index in 0..60 {
        let interior = generator.interior(index).unwrap();
        let view = interior.camera_poses(1)[0];
        let sample = generator.record(index).unwrap().sample(0);
        let photo = Photo::Srgb8(sample.photo.clone());
        let frame = Frame::new(photo.clone(), sample.depth_m.clone().unwrap(), sample.camera, 1.0).unwrap();
        let inputs = [Input::MeasuredDepth(frame), Input::Photo { photo, camera: sample.camera }];
        let shadows = true_shadows(&interior, &view);
        for (counts, input) in counts.iter_mut().zip(inputs) {
            let options = EstimateOptions::default();
            let scene = Arc::new(estimator.estimate(input, &options, &mut lo_events::ignore).unwrap());
            let mut stream = lo_random::stream(seed, "shadows", index);
            let [any, edges] = [false, true].map(|at_edges| any_shadows(&scene, at_edges, &mut stream));
            let other = if interior.world.outdoors.sun.is_some() { 3 } else { 1 };
            for (kind, shadows) in [(0, &shadows), (other, &any), (other + 1, &edges)] {
                for [thing, shadow] in shadows {
                    let accepted = supported_sun(&scene, *thing, *shadow)
                        .is_ok_and(|sun| sun_from_photo(&scene, sun, 0.27).is_some());
                    counts[kind][0] += 1;
                    counts[kind][1] += u32::from(accepted);
                }
            }
        }
    }
    for (depth, counts) in depths.into_iter().zip(counts) {
        for (kind, [asked, accepted]) in kinds.into_iter().zip(counts) {
            println!("{depth}, {kind}: {accepted} of {asked} accepted");
        }
        let share = |kind: usize| f64::from(counts[kind][1]) / f64::from(counts[kind][0]);
        assert!(share(0) > 0.4 && share(1) < 0.1 && share(2) < 0.15, "{depth}");
    }
}
