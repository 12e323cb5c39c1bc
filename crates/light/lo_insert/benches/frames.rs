//! Benchmark of one frame with an object in a box room, 480 × 320, at each quality: `cargo bench -p lo_insert`.
//!
//! `first` gathers the light on the shadowed real surfaces, `later` has it cached.

use divan::{Bencher, black_box};
use lo_geometry::{Camera, Cube, Plane, Vec3};
use lo_imaging::{Image, Photo, RadianceImage};
use lo_insert::{Inserter, Instance, Lighting, Placement, Quality};
use lo_mesh::{LoadOptions, Material, Model, PreparedModel};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{Frame, LitScene};

const LOW: Vec3 = Vec3::new(-2.0, -1.0, -4.0);
const HIGH: Vec3 = Vec3::new(2.0, 1.5, 1.0);
const WIDTH: usize = 480;
const HEIGHT: usize = 320;
/// Radius for about 20,000 visible pixels.
const RADIUS_M: f32 = 0.5;
const CENTRE: Vec3 = Vec3::new(0.2, LOW.y + RADIUS_M, -2.4);

fn main() {
    divan::main();
}

fn wall_point(origin: Vec3, direction: Vec3) -> Vec3 {
    let (a, b) = ((LOW - origin) / direction, (HIGH - origin) / direction);
    origin + direction * a.max(b).min_element()
}

fn wall_radiance(p: Vec3) -> [f32; 3] {
    let lamp = p.y > HIGH.y - 0.01 && (p.x + 0.5).abs() < 0.4 && (p.z + 2.0).abs() < 0.4;
    if lamp { [12.0, 11.0, 10.0] } else { [0.3 + 0.1 * (3.0 * p.x).sin(), 0.4, 0.3 + 0.1 * (2.0 * p.z).cos()] }
}

fn scene() -> LitScene {
    let middle = 0.5 * (LOW + HIGH);
    let points: Vec<RadiancePoint> = lo_geometry::fibonacci_sphere(1_500_000)
        .into_iter()
        .map(|direction| {
            let position_m = wall_point(middle, direction);
            RadiancePoint { position_m, radiance: wall_radiance(position_m), provenance: Provenance::Observed }
        })
        .collect();
    let light = LightOctree::from_points(&points, Cube::centred(middle, 5.5), 7, 4).expect("the room fills its cube").0;
    let camera = Camera::from_hfov_deg(65.0, WIDTH as u32, HEIGHT as u32).expect("a plain camera");
    let seen = |x: usize, y: usize| wall_point(Vec3::ZERO, camera.direction(x as f64 + 0.5, y as f64 + 0.5));
    let photo: RadianceImage = Image::from_fn(WIDTH, HEIGHT, |x, y| wall_radiance(seen(x, y)));
    let depth_m = Image::from_fn(WIDTH, HEIGHT, |x, y| -seen(x, y).z);
    let frame = Frame::new(Photo::Linear(photo), depth_m, camera, 1.0).expect("photo and depth have one size");
    LitScene::observed_only(light, frame)
}

/// Creates a sphere of 32 × 64 quads, glossy gold or matte.
fn sphere(metallic: f32) -> PreparedModel {
    let (rows, columns) = (32u32, 64u32);
    let at = |row: u32, column: u32| {
        let (sin, cos) = (row as f32 / rows as f32 * std::f32::consts::PI).sin_cos();
        let (s, c) = (column as f32 / columns as f32 * std::f32::consts::TAU).sin_cos();
        RADIUS_M * Vec3::new(sin * c, cos, sin * s)
    };
    let positions = (0..=rows).flat_map(|row| (0..columns).map(move |column| at(row, column))).collect();
    let index = |row: u32, column: u32| row * columns + column % columns;
    let triangles = (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (row, column)))
        .flat_map(|(row, column)| {
            let [a, b] = [index(row, column), index(row, column + 1)];
            let [c, d] = [index(row + 1, column), index(row + 1, column + 1)];
            [[a, b, c], [b, d, c]]
        })
        .collect();
    let roughness = if metallic > 0.0 { 0.15 } else { 0.9 };
    let material = Material { base_color: [0.9, 0.75, 0.4, 1.0], metallic, roughness, ..Material::default() };
    let model = Model::from_triangles(positions, triangles, material, &LoadOptions::default());
    PreparedModel::new(model.expect("a sphere is a mesh"))
}

fn placement() -> Placement {
    let support = Some(Plane { normal: Vec3::Y, offset_m: LOW.y });
    Placement { position_m: CENTRE - RADIUS_M * Vec3::Y, scale: 1.0, yaw_rad: 0.0, up: Vec3::Y, support }
}

fn inserter(scene: &LitScene, quality: Quality) -> Inserter {
    Inserter::new(scene, Lighting::Octree, quality).expect("the room can be traced")
}

#[divan::bench(args = [Quality::Draft, Quality::Normal, Quality::High], sample_count = 3)]
fn first(bencher: Bencher, quality: Quality) {
    let (scene, model) = (scene(), sphere(0.0));
    bencher.with_inputs(|| inserter(&scene, quality)).bench_values(|inserter| {
        black_box(
            inserter
                .render(&[Instance::new(&model, placement())], &mut lo_events::ignore)
                .expect("the sphere can be inserted"),
        );
        inserter
    });
}

#[divan::bench(args = [(Quality::Draft, 0.0), (Quality::Draft, 1.0), (Quality::Normal, 0.0), (Quality::Normal, 1.0), (Quality::High, 0.0)], sample_count = 5)]
fn later(bencher: Bencher, (quality, metallic): (Quality, f32)) {
    let model = sphere(metallic);
    let inserter = inserter(&scene(), quality);
    let render = || {
        inserter
            .render(&[Instance::new(&model, placement())], &mut lo_events::ignore)
            .expect("the sphere can be inserted")
    };
    render();
    bencher.bench_local(render);
}
