//! Octrees of a room whose radiance is known in closed form, compared with ray-traced ground truth.

use lo_cone::{Cone, ConeSample, ConeTracer, Sampling, Settings, StepRule};
use lo_geometry::{Cube, Mat3, Ray, Vec3};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use rayon::prelude::*;

const CUBE: Cube = Cube { origin_m: Vec3::splat(-2.0), edge_m: 4.0 };
/// Half edges of the room in metres.
const HALF: Vec3 = Vec3::new(1.8, 1.3, 1.7);
const WIDTH: usize = 256;
const HEIGHT: usize = 128;

/// Sphere lights: centre and radius in metres, radiance.
const LIGHTS: [(Vec3, f32, [f32; 3]); 3] = [
    (Vec3::new(-0.7, 0.95, 0.3), 0.2, [14.0, 12.0, 9.0]),
    (Vec3::new(1.0, 0.4, -1.0), 0.3, [2.0, 5.0, 8.0]),
    (Vec3::new(0.2, -1.0, 1.0), 0.15, [25.0, 6.0, 3.0]),
];

/// Returns the radiance of the wall at `point`: a colour per wall, waves half a metre to two metres long, tiles on the
/// floor.
fn wall_radiance(point: Vec3, axis: usize) -> [f32; 3] {
    let side = usize::from(point[axis] > 0.0);
    let base = [
        [[0.7, 0.15, 0.1], [0.1, 0.5, 0.15]],
        [[0.45, 0.4, 0.35], [0.85, 0.85, 0.8]],
        [[0.2, 0.25, 0.7], [0.6, 0.55, 0.2]],
    ][axis][side];
    let (u, v) = (point[(axis + 1) % 3], point[(axis + 2) % 3]);
    let mut shade = 0.7 + 0.15 * (3.1 * u).sin() + 0.15 * (6.3 * v + 1.0).cos() * (2.0 * u).sin();
    if axis == 1 && side == 0 && ((2.0 * u).floor() + (2.0 * v).floor()).rem_euclid(2.0) < 1.0 {
        shade *= 0.5;
    }
    base.map(|c: f32| c * shade)
}

/// Returns radiance and distance of the first hit of a ray that starts inside the room.
fn truth(ray: &Ray) -> ([f32; 3], f32) {
    let (mut nearest, mut axis) = (f32::INFINITY, 0);
    for i in 0..3 {
        let t = (HALF[i].copysign(ray.direction[i]) - ray.origin[i]) / ray.direction[i];
        if t < nearest {
            (nearest, axis) = (t, i);
        }
    }
    let mut radiance = wall_radiance(ray.at(nearest), axis);
    for (centre, radius, light) in LIGHTS {
        let to = centre - ray.origin;
        let along = to.dot(ray.direction);
        let half_chord = radius * radius - (to.length_squared() - along * along);
        if half_chord > 0.0 && along > 0.0 && along - half_chord.sqrt() < nearest {
            nearest = along - half_chord.sqrt();
            radiance = light;
        }
    }
    (radiance, nearest)
}

fn surface_points(spacing_m: f32) -> Vec<RadiancePoint> {
    let point = |position_m, radiance| RadiancePoint { position_m, radiance, provenance: Provenance::Observed };
    let mut points = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let count = |axis: usize| (2.0 * HALF[axis] / spacing_m).ceil() as usize;
        for i in 0..=count(u) {
            for j in 0..=count(v) {
                for side in [-1.0, 1.0] {
                    let mut p = Vec3::ZERO;
                    p[axis] = side * HALF[axis];
                    p[u] = HALF[u] * (2.0 * i as f32 / count(u) as f32 - 1.0);
                    p[v] = HALF[v] * (2.0 * j as f32 / count(v) as f32 - 1.0);
                    points.push(point(p, wall_radiance(p, axis)));
                }
            }
        }
    }
    for (centre, radius, radiance) in LIGHTS {
        let count = (4.0 * std::f32::consts::PI * (radius / spacing_m).powi(2)) as usize;
        points.extend(lo_geometry::fibonacci_sphere(count).into_iter().map(|d| point(centre + d * radius, radiance)));
    }
    points
}

fn room(depth: u32) -> LightOctree {
    // At least four points along each edge of a leaf.
    let points = surface_points(CUBE.node_edge_m(depth) / 4.0);
    LightOctree::from_points(&points, CUBE, depth, 4).unwrap().0
}

/// Returns twenty positions at least 0.35 m from all surfaces.
fn probes() -> Vec<Vec3> {
    let mut probes = Vec::new();
    for i in 1.. {
        // the R3 sequence (Roberts 2018)
        let unit = Vec3::new(0.819_172_5, 0.671_043_6, 0.549_700_5) * i as f32;
        let p = (unit.fract() * 2.0 - 1.0) * (HALF - Vec3::splat(0.35));
        if LIGHTS.iter().all(|(centre, radius, _)| p.distance(*centre) > radius + 0.35) {
            probes.push(p);
        }
        if probes.len() == 20 {
            break;
        }
    }
    probes
}

/// Returns the true panorama at `origin` (4 × 4 rays per pixel) with its distances.
fn true_panorama(origin: Vec3) -> Vec<([f32; 3], f32)> {
    const RAYS: usize = 4;
    (0..WIDTH * HEIGHT)
        .map(|pixel| {
            let (x, y) = (pixel % WIDTH, pixel / WIDTH);
            let (mut sum, mut distance) = ([0.0; 3], 0.0);
            for ray in 0..RAYS * RAYS {
                let (sx, sy) = (x * RAYS + ray % RAYS, y * RAYS + ray / RAYS);
                let direction = lo_geometry::pixel_direction(sx, sy, WIDTH * RAYS, HEIGHT * RAYS);
                let (radiance, d) = truth(&Ray { origin, direction });
                sum = std::array::from_fn(|c| sum[c] + radiance[c] / (RAYS * RAYS) as f32);
                distance += d / (RAYS * RAYS) as f32;
            }
            (sum, distance)
        })
        .collect()
}

struct Score {
    /// PSNR of sRGB-encoded radiance clipped to [0, 1], in dB.
    psnr_db: f64,
    /// Root mean square difference of ln(1 + radiance).
    log_rmse: f64,
    /// Median relative error of the expected distance.
    distance_error: f32,
}

fn score(light: &LightOctree, settings: Settings) -> Score {
    let tracer = ConeTracer::new(light, settings).unwrap();
    let encode = |c: f32| {
        let c = f64::from(c.clamp(0.0, 1.0));
        if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
    };
    let sums: Vec<(f64, f64, Vec<f32>)> = probes()
        .into_par_iter()
        .map(|probe| {
            let got = tracer.panorama(probe, WIDTH, HEIGHT);
            let (mut squares, mut log_squares, mut distances) = (0.0, 0.0, Vec::new());
            for (pixel, (radiance, distance)) in true_panorama(probe).into_iter().enumerate() {
                for (a, b) in got.radiance.pixels()[pixel].into_iter().zip(radiance) {
                    squares += (encode(a) - encode(b)).powi(2);
                    log_squares += f64::from(a.ln_1p() - b.ln_1p()).powi(2);
                }
                distances.push((got.distance_m.pixels()[pixel] / distance - 1.0).abs());
            }
            (squares, log_squares, distances)
        })
        .collect();
    let count = (sums.len() * WIDTH * HEIGHT * 3) as f64;
    let mut distances: Vec<f32> = sums.iter().flat_map(|s| s.2.iter().copied()).collect();
    distances.sort_by(f32::total_cmp);
    Score {
        psnr_db: -10.0 * (sums.iter().map(|s| s.0).sum::<f64>() / count).log10(),
        log_rmse: (sums.iter().map(|s| s.1).sum::<f64>() / count).sqrt(),
        distance_error: distances[distances.len() / 2],
    }
}

#[test]
fn panoramas_match_the_truth_and_better_with_depth() {
    let mut last = 0.0;
    for depth in [6, 7, 8] {
        let light = room(depth);
        for sampling in [Sampling::Interpolated, Sampling::Nearest, Sampling::Blended] {
            let score = score(&light, Settings { sampling, ..Settings::default() });
            eprintln!(
                "depth {depth}, {sampling:?}: {:.2} dB, log-RMSE {:.4}, distance off by {:.2} %",
                score.psnr_db,
                score.log_rmse,
                100.0 * score.distance_error
            );
            if sampling == Settings::default().sampling {
                assert!(score.psnr_db > last && (depth < 7 || score.psnr_db >= 30.0));
                assert!(score.distance_error < 1.5 * CUBE.node_edge_m(depth));
                last = score.psnr_db;
            }
        }
    }
}

/// Returns the greatest transmittance of a ray out of the room, and the share of rays that transmit more than 1 %.
///
/// A ray with a single sample of half a leaf at the greatest opacity transmits (10⁻⁴)^½ = 1 %; that does not count as a
/// hole.
fn leaks<'a>(opacities: impl Iterator<Item = &'a f32>) -> (f32, f32) {
    let (mut most, mut holes, mut count) = (0.0f32, 0, 0);
    for opacity in opacities {
        most = most.max(1.0 - opacity);
        holes += usize::from(1.0 - opacity > 0.010_1);
        count += 1;
    }
    (most, holes as f32 / count as f32)
}

#[test]
fn a_closed_room_stays_closed() {
    let depth = 7;
    let turns = [
        Mat3::IDENTITY,
        Mat3::from_rotation_y(0.5),
        Mat3::from_rotation_y(0.785) * Mat3::from_rotation_x(0.3),
        Mat3::from_rotation_x(1.1) * Mat3::from_rotation_z(0.6),
    ];
    for (room, turn) in turns.into_iter().enumerate() {
        let mut points = surface_points(CUBE.node_edge_m(depth) / 4.0);
        // Smaller, so that its corners stay in the cube.
        points.iter_mut().for_each(|point| point.position_m = turn * (point.position_m * 0.7));
        let light = LightOctree::from_points(&points, CUBE, depth, 4).unwrap().0;
        let tracer = |settings| ConeTracer::new(&light, settings).unwrap();
        let places: Vec<Vec3> = probes().into_iter().map(|probe| turn * (probe * 0.7)).collect();
        for sampling in [Sampling::Nearest, Sampling::Interpolated] {
            let panoramas = tracer(Settings { sampling, ..Settings::default() }).panoramas(&places[..4], WIDTH, HEIGHT);
            let (most, holes) = leaks(panoramas.iter().flat_map(|p| p.opacity.pixels()));
            eprintln!(
                "room {room}, {sampling:?}, panoramas: {:.3} % of a ray, {:.4} % of rays",
                100.0 * most,
                100.0 * holes
            );
            match sampling {
                // The edges of the axis-aligned room are half open in the octree's upper levels.
                Sampling::Nearest | Sampling::Blended => assert!(holes < if room == 0 { 1e-3 } else { 1e-9 }),
                Sampling::Interpolated => assert!(most < 0.025),
            }
            // Equal steps keep a ray in one level, with the least and the greatest step of that level.
            for (level, steps) in [[0.5, 1.0], [1.01, 2.0], [2.01, 4.0], [4.01, 8.0]].into_iter().enumerate() {
                for step in steps {
                    let settings = Settings { sampling, step: StepRule::Floored(step), ..Settings::default() };
                    let directions = lo_geometry::fibonacci_sphere(3000);
                    let cones: Vec<Cone> = places
                        .iter()
                        .flat_map(|&origin| directions.iter().map(move |&direction| (origin, direction)))
                        .map(|(origin, direction)| Cone { origin, direction, tan_half_angle: 0.0 })
                        .collect();
                    let mut samples = vec![ConeSample::default(); cones.len()];
                    tracer(settings).trace_batch(&cones, &mut samples);
                    let (most, holes) = leaks(samples.iter().map(|sample| &sample.opacity));
                    eprintln!(
                        "room {room}, {sampling:?}, level {level}, steps of {step}: {:.3} % of a ray, {:.4} % of rays",
                        100.0 * most,
                        100.0 * holes
                    );
                    match sampling {
                        Sampling::Nearest if step == 0.5 => assert!(holes == 0.0),
                        Sampling::Nearest | Sampling::Blended => assert!(holes < 0.01),
                        Sampling::Interpolated => assert!(most < 0.025),
                    }
                }
            }
        }
    }
}

#[test]
fn wide_cones_do_not_pass_through_walls() {
    let (light, _) = LightOctree::from_points(&surface_points(0.01), CUBE, 6, 4).unwrap();
    for sampling in [Sampling::Blended, Sampling::Interpolated] {
        let tracer = ConeTracer::new(&light, Settings { sampling, ..Settings::default() }).unwrap();
        for tan_half_angle in [0.05, 0.2, 0.4, 0.6, 0.8, 1.0] {
            let cone = |direction| Cone { origin: Vec3::new(0.3, -0.2, 0.4), direction, tan_half_angle };
            let cones: Vec<Cone> = lo_geometry::fibonacci_sphere(1000).into_iter().map(cone).collect();
            let mut samples = vec![ConeSample::default(); cones.len()];
            tracer.trace_batch(&cones, &mut samples);
            let passed = samples.iter().map(|sample| 1.0 - sample.opacity).sum::<f32>() / samples.len() as f32;
            assert!(passed < 0.02, "{sampling:?}, {tan_half_angle}: {passed}");
        }
    }
}
