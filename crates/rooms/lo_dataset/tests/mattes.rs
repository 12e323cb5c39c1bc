//! Edges of mattes: where real surfaces hide an object, by a sensor's depth and by the true one, in generated rooms.
#![allow(clippy::unwrap_used)]

use lo_dataset::{Generator, GeneratorConfig, Sample};
use lo_geometry::{Cube, Vec3};
use lo_imaging::{DepthMap, Image, Photo};
use lo_insert::{Inserter, Lighting, Placement, Quality};
use lo_mesh::{LoadOptions, Material, Model, PreparedModel};
use lo_octree::{Coverage, LightOctree, RadiancePoint};
use lo_scene::{Frame, Scene};
use rayon::prelude::*;

/// Share of its depth that the card keeps from surfaces whose edges are measured: what is nearer to it may be hidden or not.
const CLEAR: f32 = 0.06;

/// A black card that faces the camera and fills the picture but for a border.
fn card(sample: &Sample, z_m: f32) -> (PreparedModel, Placement) {
    let camera = &sample.camera;
    let corner = |u: f64, v: f64| camera.unproject(u * f64::from(camera.width), v * f64::from(camera.height), f64::from(z_m));
    let positions = vec![corner(0.02, 0.02), corner(0.02, 0.98), corner(0.98, 0.98), corner(0.98, 0.02)];
    let base_m = Vec3::new(
        0.5 * (positions[0].x + positions[2].x),
        positions.iter().fold(f32::INFINITY, |low, p| low.min(p.y)),
        -z_m,
    );
    let material = Material { unlit: true, ..Material::default() };
    let model = Model::from_triangles(positions, vec![[0, 1, 2], [0, 2, 3]], material, &LoadOptions::default()).unwrap();
    let placement = Placement { position_m: base_m, scale: 1.0, yaw_rad: 0.0, up: Vec3::Y, support: None };
    (PreparedModel::new(model), placement)
}

/// Depth of the card: in the widest gap of the true depths between the 15th and the 60th percentile.
fn card_depth_m(truth: &DepthMap) -> f32 {
    let mut depths: Vec<f32> = truth.pixels().iter().copied().filter(|&z| z > 0.0).collect();
    depths.sort_by(f32::total_cmp);
    let at = |share: f32| depths[(share * (depths.len() - 1) as f32) as usize];
    let candidates = (0..60).map(|i| at(0.15) * (at(0.6) / at(0.15)).powf(i as f32 / 59.0));
    let near = |z: f32| depths.iter().filter(|&&d| (d / z - 1.0).abs() < CLEAR).count();
    candidates.min_by_key(|&z| near(z)).unwrap()
}

/// Share of each pixel where the card is hidden, by a depth map.
fn occlusion(sample: &Sample, depth_m: DepthMap, z_m: f32) -> Image<f32> {
    let frame = Frame::new(Photo::Srgb8(sample.photo.clone()), depth_m, sample.camera, 1.0).unwrap();
    let points: Vec<RadiancePoint> = lo_geometry::fibonacci_sphere(2000)
        .into_iter()
        .map(|d| RadiancePoint { position_m: 9.0 * d, radiance: [0.5; 3], coverage: Coverage::Inferred })
        .collect();
    let light = LightOctree::from_points(&points, Cube::centred(Vec3::ZERO, 20.0), 3, 2).unwrap().0;
    let inserter = Inserter::new(&Scene::as_seen(light, frame), Lighting::Octree, Quality::Draft).unwrap();
    let (model, placement) = card(sample, z_m);
    inserter.render(&model, &placement, &mut lo_events::ignore).unwrap().occlusion
}

/// Where two images of hidden shares differ in their edges.
#[derive(Default)]
struct Edges {
    /// For each point of the true edge the distance to the nearest one of the estimate, pixels.
    missed_px: Vec<f32>,
    /// For each point of the estimate's edge that is clear of the card the distance to the nearest true one.
    false_px: Vec<f32>,
}

/// Farthest distance that is told apart.
const FARTHEST_PX: f32 = 20.0;

/// Points where a share crosses a half between neighbouring pixels that `keep` lets through.
fn contour(share: &Image<f32>, keep: impl Fn((usize, usize), (usize, usize)) -> bool) -> Vec<[f32; 2]> {
    let mut points = Vec::new();
    let (width, height) = (share.width(), share.height());
    // Inside of the card's border alone.
    let (border_x, border_y) = (width / 40 + 2, height / 40 + 2);
    for y in border_y..height - border_y {
        for x in border_x..width - border_x {
            for (dx, dy) in [(1, 0), (0, 1)] {
                let other = (x + dx, y + dy);
                let (a, b) = (share[(x, y)] - 0.5, share[other] - 0.5);
                if (a > 0.0) != (b > 0.0) && keep((x, y), other) {
                    let t = a / (a - b);
                    points.push([x as f32 + t * dx as f32, y as f32 + t * dy as f32]);
                }
            }
        }
    }
    points
}

fn distances(from: &[[f32; 2]], to: &[[f32; 2]]) -> Vec<f32> {
    let nearest = |p: &[f32; 2]| {
        to.iter().map(|q| (p[0] - q[0]).hypot(p[1] - q[1])).fold(FARTHEST_PX, f32::min)
    };
    from.par_iter().map(nearest).collect()
}

fn edges(truth_m: &DepthMap, estimate: &Image<f32>, z_m: f32) -> Edges {
    let hidden = truth_m.map(|&z| if z > 0.0 && z < z_m { 1.0 } else { 0.0 });
    let clear = |p: (usize, usize)| truth_m[p] > 0.0 && (truth_m[p] / z_m - 1.0).abs() > CLEAR;
    let real = contour(&hidden, |a, b| clear(a) && clear(b));
    let all = contour(&hidden, |_, _| true);
    let around = |(x, y): (usize, usize)| (y - 2..=y + 2).all(|y| (x - 2..=x + 2).all(|x| clear((x, y))));
    let found = contour(estimate, |_, _| true);
    let found_clear = contour(estimate, |a, _| around(a));
    Edges { missed_px: distances(&real, &found), false_px: distances(&found_clear, &all) }
}

fn figures(mut px: Vec<f32>) -> String {
    px.sort_by(f32::total_cmp);
    let at = |share: f32| px[(share * (px.len() - 1) as f32) as usize];
    let mean = px.iter().sum::<f32>() / px.len() as f32;
    let within = px.iter().filter(|&&d| d <= 1.0).count() as f32 / px.len() as f32;
    format!("{:6} points, mean {mean:.2} median {:.2} p90 {:.2} px, {:.0} % within 1 px", px.len(), at(0.5), at(0.9), 100.0 * within)
}

#[test]
#[ignore = "dev"]
fn dev() {
    use lo_dataset::{Dataset, Shards};
    let shards = Shards::open(std::path::Path::new(&std::env::var("MATTE_ROOMS").unwrap())).unwrap();
    let mut by_kind: std::collections::BTreeMap<String, Edges> = Default::default();
    for i in (0..shards.len()).filter(|i| std::env::var("ONLY").is_err() || i % 2 == 0) {
        let sample = shards.get(i).unwrap();
        let truth = sample.depth_m.clone().unwrap();
        let z_m = card_depth_m(&truth);
        let sensor = sample.sensor_depth_m.clone().unwrap();
        let kind = sample.metadata.get("depth_sensor").map_or("?".into(), |v| v["kind"].to_string());
        for (name, depth) in [(kind, sensor), ("true".to_owned(), truth.clone())] {
            let share = occlusion(&sample, depth, z_m);
            let e = edges(&truth, &share, z_m);
            if let Ok(folder) = std::env::var("MATTE_OUT") {
                let shown = Image::from_fn(share.width(), share.height(), |x, y| {
                    let p = sample.photo[(x, y)];
                    let a = share[(x, y)];
                    let t = if truth[(x, y)] < z_m { 1.0 } else { 0.0 };
                    [(p[0] as f32 * a) as u8, (p[1] as f32 * a + 200.0 * (1.0 - a)) as u8, (255.0 * (a - t).abs()) as u8]
                });
                lo_imaging::write_photo(format!("{folder}/{i:02}_{}.png", name.trim_matches('"')), &Photo::Srgb8(shown), "dev").unwrap();
            }
            let m = |v: &Vec<f32>| v.iter().sum::<f32>() / v.len().max(1) as f32;
            println!("{i} {name} z {z_m:.2}: missed {} {:.2} false {} {:.2}", e.missed_px.len(), m(&e.missed_px), e.false_px.len(), m(&e.false_px));
            let all = by_kind.entry(name).or_default();
            all.missed_px.extend(e.missed_px);
            all.false_px.extend(e.false_px);
        }
    }
    for (kind, e) in by_kind {
        println!("{kind:>18}: to truth {}\n{:>18}  from truth {}", figures(e.missed_px), "", figures(e.false_px));
    }
}
