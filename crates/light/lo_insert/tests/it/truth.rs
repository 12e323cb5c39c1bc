//! Insertion compared with a path-traced reference: the shaded object and the ratio on real surfaces, in a closed box
//! room.

use crate::reference::{Body, Finish, Random, Room, Solution, Surface, Tracer, V, add, scale, sub, unit};
use lo_geometry::{Camera, Cube, Plane, Vec3};
use lo_imaging::{Image, Photo, RadianceImage};
use lo_insert::{Composite, Inserter, Instance, Lighting, Placement, Quality};
use lo_mesh::{LoadOptions, Material, Model, PreparedModel};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{Frame, LitScene};
use rayon::prelude::*;

fn room() -> Room {
    Room {
        low: [-2.0, -1.2, -4.4],
        high: [2.1, 1.5, 0.7],
        albedo: [[0.65, 0.2, 0.15], [0.2, 0.5, 0.25], [0.55, 0.5, 0.45], [0.8; 3], [0.7; 3], [0.6; 3]],
        lamp: [-0.6, 0.4, -2.9, -1.9],
        emission: [9.0, 8.0, 7.0],
    }
}

fn to_f64(v: Vec3) -> V {
    v.to_array().map(f64::from)
}

/// Builds the octree of `depth` of the empty room, with photo and depth of the camera.
fn scene_of(solution: &Solution, depth: u32, width: u32, height: u32) -> LitScene {
    let room = solution.room;
    let cube = Cube::centred(Vec3::new(0.03, 0.11, -1.87), 5.6);
    // Three points per leaf edge
    let pitch = f64::from(cube.node_edge_m(depth)) / 3.0;
    let mut points = Vec::new();
    for wall in 0..6usize {
        let axis = wall / 2;
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let count = |k: usize| ((room.high[k] - room.low[k]) / pitch).ceil() as usize;
        let (na, nb) = (count(a), count(b));
        let made: Vec<RadiancePoint> = (0..na * nb)
            .into_par_iter()
            .map(|i| {
                let mut target = if wall.is_multiple_of(2) { room.low } else { room.high };
                target[a] = room.low[a] + (room.high[a] - room.low[a]) * ((i % na) as f64 + 0.5) / na as f64;
                target[b] = room.low[b] + (room.high[b] - room.low[b]) * ((i / na) as f64 + 0.5) / nb as f64;
                let hit = room.wall([0.0; 3], unit(target));
                RadiancePoint {
                    position_m: Vec3::from(hit.position.map(|x| x as f32)),
                    radiance: solution.radiance(&hit).map(|x| x as f32),
                    provenance: Provenance::Observed,
                }
            })
            .collect();
        points.extend(made);
    }
    let light = LightOctree::from_points(&points, cube, depth, 4).unwrap().0;
    let camera = Camera::from_hfov_deg(62.0, width, height).unwrap();
    let hits: Vec<_> = (0..(width * height) as usize)
        .map(|i| room.wall([0.0; 3], pixel_direction(&camera, i % width as usize, i / width as usize)))
        .collect();
    let (w, h) = (width as usize, height as usize);
    let photo: Vec<[f32; 3]> = hits.par_iter().map(|hit| solution.radiance(hit).map(|x| x as f32)).collect();
    let depth_m = hits.iter().map(|hit| -hit.position[2] as f32).collect();
    let frame =
        Frame::new(Photo::Linear(RadianceImage::new(w, h, photo)), Image::new(w, h, depth_m), camera, 1.0).unwrap();
    LitScene::observed_only(light, frame)
}

fn pixel_direction(camera: &Camera, x: usize, y: usize) -> V {
    unit(to_f64(camera.direction(x as f64 + 0.5, y as f64 + 0.5)))
}

fn cuboid(half: Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let positions =
        (0..8).map(|i| half * Vec3::new([-1.0, 1.0][i & 1], [-1.0, 1.0][i >> 1 & 1], [-1.0, 1.0][i >> 2 & 1]));
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    (positions.collect(), triangles)
}

fn model(body: &Body, finish: Finish) -> Model {
    let [r, g, b] = finish.base.map(|x| x as f32);
    let material = Material { base_color: [r, g, b, 1.0], roughness: finish.roughness as f32, ..Material::default() };
    match *body {
        Body::Sphere { radius, .. } => Model::sphere(radius as f32, 4, material).unwrap(),
        Body::Cuboid { low, high } => {
            let (positions, triangles) = cuboid(Vec3::from(sub(high, low).map(|x| 0.5 * x as f32)));
            Model::from_triangles(positions, triangles, material, &LoadOptions::default()).unwrap()
        }
    }
}

fn placement(body: &Body, floor: f64) -> Placement {
    let base = match *body {
        Body::Sphere { centre, radius } => [centre[0], centre[1] - radius, centre[2]],
        Body::Cuboid { low, high } => [0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])],
    };
    let position_m = Vec3::from(base.map(|x| x as f32));
    Placement {
        position_m,
        scale: 1.0,
        yaw_rad: 0.0,
        up: Vec3::Y,
        support: Some(Plane::through(Vec3::new(0.0, floor as f32, 0.0), Vec3::Y)),
    }
}

/// Mean relative errors of the object's pixels and of the ratio where it deviates from 1, with their pixel counts.
struct Errors {
    object: f64,
    object_pixels: usize,
    ratio: f64,
    ratio_pixels: usize,
    /// Signed error of the ratio on the floor right beside the body.
    contact: f64,
    contact_pixels: usize,
}

/// Largest distance of contact floor from the body, in metres.
const CONTACT_M: f64 = 0.06;

/// Compares every `stride`-th pixel of every `stride`-th row, with `paths` paths per pixel.
fn compare(
    scene: &LitScene,
    solution: &Solution,
    bodies: &[(Body, Finish)],
    composite: &Composite,
    stride: usize,
    paths: usize,
) -> Errors {
    let tracer = Tracer { room: solution.room, bodies };
    let camera = scene.frame.camera;
    let (width, height) = (camera.width as usize, camera.height as usize);
    let pixels: Vec<(usize, usize)> = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).collect();
    let at_contact = |x: usize, y: usize| {
        let hit = solution.room.wall([0.0; 3], pixel_direction(&camera, x, y));
        hit.surface == Surface::Wall(2) && bodies.iter().any(|(body, _)| body.distance_m(hit.position) < CONTACT_M)
    };
    let results: Vec<(Option<f64>, Option<f64>, Option<f64>)> = pixels
        .par_iter()
        .map(|&(x, y)| {
            let chosen = x % stride == 0 && y % stride == 0;
            let contact = at_contact(x, y);
            if !chosen && !contact {
                return (None, None, None);
            }
            let direction = pixel_direction(&camera, x, y);
            let hit = tracer.hit([0.0; 3], direction);
            let mut random = Random::new((y * width + x) as u64);
            let alpha = composite.alpha[(x, y)];
            let view = scale(direction, -1.0);
            let on_wall = matches!(hit.surface, Surface::Wall(_));
            if chosen && !on_wall && alpha > 0.999 {
                let truth = tracer.reflected(&hit, view, paths, &mut random);
                let found = composite.object[(x, y)].map(f64::from);
                let sum = |v: V| v[0] + v[1] + v[2];
                let difference = (0..3).map(|c| (found[c] - truth[c]).abs()).sum::<f64>();
                return (Some(difference / sum(truth)), None, None);
            }
            if on_wall && alpha == 0.0 && !solution.room.on_lamp(&hit) {
                // A cheap estimate first, and an accurate one only where needed
                let empty = solution.radiance(&hit);
                let rough = tracer.reflected(&hit, view, 64, &mut random);
                let found = composite.shadow_ratio[(x, y)].map(f64::from);
                let suspect = (0..3).any(|c| (rough[c] / empty[c] - 1.0).abs() > 0.02)
                    || found.iter().any(|r| (r - 1.0).abs() > 0.01);
                if suspect {
                    let truth = tracer.reflected(&hit, view, paths, &mut random);
                    let ratio: V = std::array::from_fn(|c| truth[c] / empty[c]);
                    if ratio.iter().any(|r| (r - 1.0).abs() > 0.03) {
                        let error = (0..3).map(|c| (found[c] - ratio[c]).abs() / ratio[c]).sum::<f64>() / 3.0;
                        let signed = (0..3).map(|c| found[c] / ratio[c] - 1.0).sum::<f64>() / 3.0;
                        return (None, chosen.then_some(error), contact.then_some(signed));
                    }
                }
            }
            (None, None, None)
        })
        .collect();
    let mean = |values: Vec<f64>| (values.iter().sum::<f64>() / values.len().max(1) as f64, values.len());
    let (object, object_pixels) = mean(results.iter().filter_map(|r| r.0).collect());
    let (ratio, ratio_pixels) = mean(results.iter().filter_map(|r| r.1).collect());
    let (contact, contact_pixels) = mean(results.iter().filter_map(|r| r.2).collect());
    Errors { object, object_pixels, ratio, ratio_pixels, contact, contact_pixels }
}

type Case = (&'static str, Vec<(Body, Finish)>);

fn ball() -> Body {
    Body::Sphere { centre: [0.35, room().low[1] + 0.45, -2.6], radius: 0.45 }
}

fn cases() -> [Case; 2] {
    let floor = room().low[1];
    let cuboid = Body::Cuboid { low: [-0.9, floor, -3.1], high: [-0.3, floor + 0.7, -2.5] };
    let finish = Finish { base: [0.7, 0.6, 0.5], roughness: 0.9 };
    [("sphere", vec![(ball(), finish)]), ("box", vec![(cuboid, finish)])]
}

/// A white ball, a red block 5 cm beside it towards the lamp, and a green one on the floor behind both.
fn several() -> Case {
    let floor = room().low[1];
    let finish = |base| Finish { base, roughness: 0.9 };
    let red = Body::Cuboid { low: [-0.6, floor, -2.9], high: [-0.15, floor + 0.8, -2.4] };
    let green = Body::Cuboid { low: [-0.3, floor, -3.7], high: [0.9, floor + 0.5, -3.2] };
    let bodies = [(ball(), [0.8, 0.8, 0.8]), (red, [0.8, 0.1, 0.1]), (green, [0.1, 0.6, 0.2])];
    ("several", bodies.map(|(body, base)| (body, finish(base))).to_vec())
}

/// A table leg, thinner than a leaf.
fn leg() -> Case {
    let floor = room().low[1];
    let body = Body::Cuboid { low: [0.1, floor, -3.35], high: [0.15, floor + 0.7, -3.3] };
    ("leg", vec![(body, Finish { base: [0.3, 0.3, 0.3], roughness: 0.9 })])
}

fn run(
    cases: impl IntoIterator<Item = Case>,
    depth: u32,
    (width, height): (u32, u32),
    quality: Quality,
    stride: usize,
    paths: usize,
) -> Vec<Errors> {
    let room = room();
    let solution = Solution::new(&room);
    let scene = scene_of(&solution, depth, width, height);
    let inserter = Inserter::new(&scene, Lighting::Octree, quality).unwrap();
    cases
        .into_iter()
        .map(|(name, bodies)| {
            let models: Vec<PreparedModel> =
                bodies.iter().map(|(body, finish)| PreparedModel::new(model(body, *finish))).collect();
            let instance =
                |(model, (body, _)): (_, &(Body, Finish))| Instance::new(model, placement(body, room.low[1]));
            let instances: Vec<Instance> = models.iter().zip(&bodies).map(instance).collect();
            let composite = inserter.render(&instances, &mut lo_events::ignore).unwrap();
            let errors = compare(&scene, &solution, &bodies, &composite, stride, paths);
            println!(
                "{name}, d = {depth}, {quality:?}: object {:.1} % ({} pixels), ratio {:.1} % ({} pixels), contact {:+.1} % ({} pixels)",
                100.0 * errors.object,
                errors.object_pixels,
                100.0 * errors.ratio,
                errors.ratio_pixels,
                100.0 * errors.contact,
                errors.contact_pixels
            );
            errors
        })
        .collect()
}

#[test]
fn reference_solutions_agree() {
    // Compares path tracing of the empty room with its solution by final gathering: two independent programs.
    let room = room();
    let solution = Solution::new(&room);
    let tracer = Tracer { room: &room, bodies: &[] };
    for (i, target) in
        [[0.3, -1.2, -2.0], [-2.0, 0.2, -1.5], [1.0, 0.5, -4.4], [2.1, -0.8, -3.0]].into_iter().enumerate()
    {
        let hit = room.wall([0.0; 3], unit(target));
        let traced = tracer.reflected(&hit, unit(scale(add(target, [0.0; 3]), -1.0)), 4096, &mut Random::new(i as u64));
        let solved = solution.radiance(&hit);
        for c in 0..3 {
            assert!((traced[c] / solved[c] - 1.0).abs() < 0.03, "{target:?}: {traced:?} {solved:?}");
        }
    }
}

/// Merges the meshes of instances into one, at the returned placement.
fn merged(instances: &[Instance], finish: Finish) -> (PreparedModel, Placement) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for Instance { model, placement, .. } in instances {
        let (bounds, first) = (model.bounds(), positions.len() as u32);
        let base = Vec3::new(bounds.center().x, bounds.min.y, bounds.center().z);
        positions.extend(model.model().positions.iter().map(|p| *p - base + placement.position_m));
        triangles.extend(model.model().triangles.iter().map(|triangle| triangle.map(|vertex| first + vertex)));
    }
    let [r, g, b] = finish.base.map(|x| x as f32);
    let material = Material { base_color: [r, g, b, 1.0], roughness: finish.roughness as f32, ..Material::default() };
    let model = Model::from_triangles(positions, triangles, material, &LoadOptions::default()).unwrap();
    let prepared = PreparedModel::new(model);
    let (middle, low) = (prepared.bounds().center(), prepared.bounds().min.y);
    let position_m = Vec3::new(middle.x, low, middle.z);
    (prepared, Placement { position_m, ..instances[0].placement })
}

#[test]
fn several_objects_are_as_the_parts_of_one() {
    let finish = Finish { base: [0.5, 0.5, 0.5], roughness: 0.9 };
    let (_, bodies) = several();
    let (room, floor) = (room(), room().low[1]);
    let solution = Solution::new(&room);
    let scene = scene_of(&solution, 7, 120, 80);
    let models: Vec<PreparedModel> = bodies.iter().map(|(body, _)| PreparedModel::new(model(body, finish))).collect();
    let instance = |(model, (body, _)): (_, &(Body, Finish))| Instance::new(model, placement(body, floor));
    let instances: Vec<Instance> = models.iter().zip(&bodies).map(instance).collect();
    let (one, place) = merged(&instances, finish);
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap();
    let render = |instances: &[Instance]| inserter.render(instances, &mut lo_events::ignore).unwrap();
    let (parts, whole) = (render(&instances), render(&[Instance::new(&one, place)]));
    let mean = |a: &RadianceImage, b: &RadianceImage| {
        let pairs = || a.pixels().iter().flatten().zip(b.pixels().iter().flatten());
        let changed = pairs().filter(|(a, b)| **a != 1.0 && **a > 0.0 || **b != 1.0 && **b > 0.0).count();
        pairs().map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / changed as f64
    };
    let (object, ratio) = (mean(&parts.object, &whole.object), mean(&parts.shadow_ratio, &whole.shadow_ratio));
    println!("mean difference: object {object:.4}, ratio {ratio:.4}");
    assert_eq!(parts.alpha, whole.alpha);
    assert!(object < 0.01 && ratio < 0.01, "{object} {ratio}");
}

#[test]
fn insertion_agrees_with_path_tracing() {
    for errors in run(cases().into_iter().chain([several()]), 7, (120, 80), Quality::Normal, 4, 256) {
        assert!(errors.object_pixels > 20 && errors.ratio_pixels > 20);
        assert!(errors.object < 0.12 && errors.ratio < 0.12);
    }
}

/// The acceptance criterion of issue 3, at full size; takes minutes.
#[test]
#[ignore = "minutes; run with --release -- --ignored --nocapture"]
fn insertion_agrees_with_path_tracing_at_high_quality() {
    for (quality, contact) in [(Quality::Normal, 0.06), (Quality::High, 0.04)] {
        let cases = cases().into_iter().chain([leg()]);
        for errors in run(cases, 7, (480, 320), quality, 6, 1024) {
            assert!(errors.object < 0.10 && errors.ratio < 0.10);
            assert!(errors.contact_pixels == 0 || errors.contact.abs() < contact, "{}", errors.contact);
        }
        // Floor in the gap between two bodies is too dark, relative to the little light that remains there; one
        // merged model has the same error.
        for errors in run([several()], 7, (480, 320), quality, 6, 1024) {
            assert!(errors.object < 0.12 && errors.ratio < 0.10 && errors.contact.abs() < 0.2);
        }
    }
}
