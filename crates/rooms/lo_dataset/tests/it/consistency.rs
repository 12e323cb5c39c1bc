//! The octree of a generated room, rendered by cone tracing, against panoramas rendered from the room itself.
//!
//! PSNR is computed on images under the tone curve x / (m + x), where m is the panorama's mean luminance.

use lo_cone::{ConeTracer, Settings};
use lo_dataset::{Generator, GeneratorConfig, NovelView, Record};
use lo_geometry::{Cube, Vec3};
use lo_octree::LightOctree;
use lo_synth::SynthConfig;

struct Agreement {
    psnr_db: f64,
    /// Share of the squared error where the octree's surface is more than two leaves in front of or behind the room's.
    geometry_share: f64,
    /// Mean after the tone curve: the octree's over the room's.
    brightness: f64,
}

fn octree(record: &Record, depth: u32) -> LightOctree {
    let positions = record.points.iter().map(|p| p.position_m);
    let (low, high) = positions.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let edge_m = (high - low).max_element() * 1.001;
    let cube = Cube { origin_m: 0.5 * (low + high - Vec3::splat(edge_m)), edge_m };
    LightOctree::from_uniform_points(&record.points, record.point_area_m2.unwrap(), cube, depth, 2).unwrap().0
}

fn compare(octree: &LightOctree, view: &NovelView, depth: u32) -> Agreement {
    let (width, height) = (view.radiance.width(), view.radiance.height());
    let tracer = ConeTracer::new(octree, Settings::default()).unwrap();
    let found = tracer.panorama(view.position_m, width, height);
    let leaf_m = octree.cube.edge_m / (1u32 << depth) as f32;
    let luminance: f64 = view.radiance.pixels().iter().map(|&p| f64::from(lo_imaging::luminance(p))).sum();
    let mean = luminance / (width * height) as f64;
    let curve = |x: f32| f64::from(x) / (mean + f64::from(x));
    let (mut error, mut by_geometry, mut sums) = (0.0, 0.0, [0.0; 2]);
    for i in 0..width * height {
        let (x, y) = (found.radiance.pixels()[i], view.radiance.pixels()[i]);
        let squared: f64 = (0..3).map(|c| (curve(x[c]) - curve(y[c])).powi(2)).sum();
        error += squared / (3 * width * height) as f64;
        let depth_m = view.depth_m.as_ref().unwrap().pixels()[i];
        // Windows have no depth: there the octree has the pane.
        if depth_m > 0.0 && (found.distance_m.pixels()[i] - depth_m).abs() > 2.0 * leaf_m {
            by_geometry += squared / (3 * width * height) as f64;
        }
        sums = [sums[0] + curve(x[1]), sums[1] + curve(y[1])];
    }
    Agreement { psnr_db: -10.0 * error.log10(), geometry_share: by_geometry / error, brightness: sums[0] / sums[1] }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Returns the median over the panoramas of a room, for an octree of `depth`.
fn room(index: u64, depth: u32) -> Agreement {
    let room = SynthConfig { crop_size: [48, 32], ..SynthConfig::default() };
    let config = GeneratorConfig { room, octree_depth: depth, ..GeneratorConfig::default() };
    let record = Generator::new(7, config).unwrap().record(index).unwrap();
    let octree = octree(&record, depth);
    let all: Vec<Agreement> = record.views.iter().map(|view| compare(&octree, view, depth)).collect();
    let of = |value: fn(&Agreement) -> f64| median(all.iter().map(value).collect());
    Agreement { psnr_db: of(|a| a.psnr_db), geometry_share: of(|a| a.geometry_share), brightness: of(|a| a.brightness) }
}

#[test]
fn the_octree_of_a_room_shows_its_panoramas() {
    let agreement = room(2, 7);
    assert!(agreement.psnr_db > 23.0, "{} dB", agreement.psnr_db);
    assert!((agreement.brightness - 1.0).abs() < 0.1, "× {}", agreement.brightness);
}

#[test]
#[ignore = "minutes: cargo test --release -p lo_dataset --test it consistency:: -- --ignored --nocapture"]
fn octrees_of_fifty_rooms_show_their_panoramas() {
    let at = |depth: u32| {
        let rooms: Vec<Agreement> = (0..50).map(|index| room(index, depth)).collect();
        let of = |value: fn(&Agreement) -> f64| median(rooms.iter().map(value).collect());
        let [psnr_db, geometry, brightness] = [of(|a| a.psnr_db), of(|a| a.geometry_share), of(|a| a.brightness)];
        let short = rooms.iter().filter(|a| a.psnr_db < 25.0).count();
        let share = 100.0 * geometry;
        eprintln!(
            "d = {depth}: median {psnr_db:.2} dB, {short} rooms of 50 below 25, brightness × {brightness:.3}, {share:.0} % of the error by geometry"
        );
        psnr_db
    };
    let [_, seven, _] = [6, 7, 8].map(at);
    assert!(seven >= 25.0, "{seven} dB");
}
