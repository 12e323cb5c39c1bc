//! Rays per second on the tea set of the data beside the checkout; skipped if that is missing.
#![allow(missing_docs)]

use std::hint::black_box;
use std::path::PathBuf;
use std::sync::LazyLock;

use divan::Bencher;
use divan::counter::ItemsCount;
use lo_geometry::{Ray, Vec3, fibonacci_sphere};
use lo_mesh::{Hit, LoadOptions, Model, PreparedModel, offset_origin};
use lo_testdata::shared_data;

static FILE: LazyLock<Option<PathBuf>> =
    LazyLock::new(|| shared_data("meshes/tea_set_01/tea_set_01_1k.gltf", "rays on the tea set"));

static PREPARED: LazyLock<Option<PreparedModel>> =
    LazyLock::new(|| Model::load(FILE.as_ref()?, &LoadOptions::default()).ok().map(PreparedModel::new));

fn main() {
    divan::main();
}

/// Rays of a 480 × 320 image filled by the tea set.
fn camera_rays() -> Vec<Ray> {
    let (origin, target) = (Vec3::new(0.0, 0.7, 0.9), Vec3::new(0.0, 0.05, 0.0));
    let forward = (target - origin).normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let pixel = |i: usize| {
        let (x, y) = ((i % 480) as f32 - 239.5, (i / 480) as f32 - 159.5);
        Ray { origin, direction: (forward + right * (x / 500.0) - up * (y / 500.0)).normalize() }
    };
    (0..480 * 320).map(pixel).collect()
}

fn hits(prepared: &PreparedModel, rays: &[Ray]) -> Vec<(Ray, Hit)> {
    rays.iter().filter_map(|ray| Some((*ray, prepared.intersect(ray, 10.0)?))).collect()
}

#[divan::bench]
fn camera(bencher: Bencher) {
    let Some(prepared) = &*PREPARED else { return };
    let rays = camera_rays();
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench(|| rays.iter().filter(|ray| prepared.intersect(black_box(ray), 10.0).is_some()).count());
}

#[divan::bench]
fn shadow(bencher: Bencher) {
    let Some(prepared) = &*PREPARED else { return };
    let directions = fibonacci_sphere(997);
    let rays: Vec<Ray> = hits(prepared, &camera_rays())
        .iter()
        .enumerate()
        .map(|(i, (ray, hit))| {
            let point = prepared.model().surface(hit, ray.direction, 0.0);
            let direction = directions[i * 331 % 997];
            let direction = direction * direction.dot(point.geometric_normal).signum();
            Ray { origin: offset_origin(point.position, point.geometric_normal), direction }
        })
        .collect();
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench(|| rays.iter().filter(|ray| prepared.occluded(black_box(ray), 10.0)).count());
}

#[divan::bench]
fn surface(bencher: Bencher) {
    let Some(prepared) = &*PREPARED else { return };
    let hits = hits(prepared, &camera_rays());
    bencher.counter(ItemsCount::new(hits.len())).bench(|| {
        hits.iter().map(|(ray, hit)| prepared.model().surface(hit, ray.direction, 0.002).roughness).sum::<f32>()
    });
}

#[divan::bench]
fn load(bencher: Bencher) {
    let Some(file) = &*FILE else { return };
    bencher.bench(|| Model::load(file, &LoadOptions::default()));
}

#[divan::bench]
fn build(bencher: Bencher) {
    let Some(prepared) = &*PREPARED else { return };
    bencher.with_inputs(|| prepared.model().clone()).bench_values(PreparedModel::new);
}
