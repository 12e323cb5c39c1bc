//! Scenes with known solutions: furnaces, lamps over a point, sky and sun through a window.

use std::f64::consts::PI;

use crate::support::{Builder, furnace, mean, panorama, photo};
use lo_geometry::Vec3;
use lo_transport::{BakeSettings, BakedWorld, PathTracer, Portal, Sun};

/// Returns the share of uniform light that a rough plastic of the given base colour reflects: GGX of roughness 0.9 and
/// f0 0.04 over Lambert. Midpoint rule in f64 over view and light directions.
fn reflected(base: f64) -> f64 {
    let (alpha2, count) = (0.9_f64.powi(4), 60);
    let mut mean = 0.0;
    for i in 0..count {
        let v = ((f64::from(i) + 0.5) / f64::from(count)).sqrt();
        let mut gloss = 0.0;
        for j in 0..count * count {
            let l = (f64::from(j / count) + 0.5) / f64::from(count);
            let phi = (f64::from(j % count) + 0.5) / f64::from(count) * PI;
            let (sv, sl) = ((1.0 - v * v).sqrt(), (1.0 - l * l).sqrt());
            let half = [sv + sl * phi.cos(), sl * phi.sin(), v + l];
            let length = half.iter().map(|x| x * x).sum::<f64>().sqrt();
            let (nh, vh) = (half[2] / length, (half[0] * sv + half[2] * v) / length);
            let d = alpha2 / (PI * (nh * nh * (alpha2 - 1.0) + 1.0).powi(2));
            let g = |x: f64| 2.0 * x / (x + (alpha2 + (1.0 - alpha2) * x * x).sqrt());
            let f = 0.04 + 0.96 * (1.0 - vh).powi(5);
            gloss += f * d * g(v) * g(l) / (4.0 * v) * 2.0 * PI / f64::from(count * count);
        }
        mean += (gloss + (1.0 - gloss) * base) / f64::from(count);
    }
    mean
}

#[test]
fn furnaces_glow_by_the_geometric_series() {
    for base in [0.5_f32, 0.8] {
        let share = reflected(f64::from(base));
        let emission = (1.0 - share) as f32;
        // L = E / (1 − ρ) = 1 everywhere.
        let baked = BakedWorld::bake(furnace(base, emission), &BakeSettings::default()).unwrap();
        // Gloss is stronger at grazing angles, so views are compared with the path tracer's.
        let tracer = PathTracer::new(furnace(base, emission), 1).unwrap();
        let view = panorama(Vec3::new(0.2, 1.1, 0.3), 24);
        let (found, truth) = (mean(&baked.render(&view).radiance), mean(&tracer.render(&view, 64)));
        assert!((found / truth - 1.0).abs() < 0.01, "{found} for {truth} at base {base}");
        let points = baked.radiance_points(0.1).points;
        let sum: f64 = points.iter().map(|p| f64::from(p.radiance[1])).sum();
        assert!((sum / points.len() as f64 - 1.0).abs() < 0.01, "{}", sum / points.len() as f64);
    }
}

/// Returns the irradiance at the origin, facing +Y, by a parallel rectangle `x` × `z` at height `h` of radiance 1: four
/// times the corner formula (Howell, Siegel & Mengüç, configuration B-3), times π.
fn under_rectangle(x: f64, z: f64, h: f64) -> f64 {
    let (a, b) = (0.5 * x / h, 0.5 * z / h);
    let (ra, rb) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    4.0 * PI / (2.0 * PI) * (a / ra * (b / ra).atan() + b / rb * (a / rb).atan())
}

#[test]
fn reference_meets_closed_forms() {
    let mut b = Builder::new();
    let lamp = b.lamp([2.0, 1.0, 0.5]);
    b.sheet(Vec3::new(-0.6, 1.5, -0.4), Vec3::X * 1.2, Vec3::Z * 0.8, [3, 2], lamp);
    let tracer = PathTracer::new(b.world([0.0; 3], None, Vec::new()), 1).unwrap();
    let [r, g, _] = tracer.irradiance(Vec3::ZERO, Vec3::Y, 40_000, 0);
    let expected = under_rectangle(1.2, 0.8, 1.5);
    assert!((f64::from(g) / expected - 1.0).abs() < 0.005 && (r / g - 2.0).abs() < 1e-3, "{g} for {expected}");

    // A ball entirely above the horizon: E = π L (r / d)² cos θ.
    let mut b = Builder::new();
    let lamp = b.lamp([1.0; 3]);
    b.ball(Vec3::new(0.0, 2.0, 1.0), 0.5, 64, lamp);
    let tracer = PathTracer::new(b.world([0.0; 3], None, Vec::new()), 1).unwrap();
    let [e, ..] = tracer.irradiance(Vec3::ZERO, Vec3::Y, 40_000, 0);
    let expected = PI * 0.25 / 5.0 * (2.0 / 5.0_f64.sqrt());
    // 64 × 128 faces are inside the ball by 0.1 %.
    assert!((f64::from(e) / expected - 1.0).abs() < 0.01, "{e} for {expected}");
}

/// Adds a black box with a matte floor, and a window from y = 1 to 2 m and 1.6 m wide in the wall x = 2 m. Returns the
/// window.
fn cell(b: &mut Builder, floor: f32) -> Portal {
    // An unlit black material reflects nothing at all.
    let black = lo_mesh::Material { unlit: true, base_color: [0.0, 0.0, 0.0, 1.0], ..lo_mesh::Material::default() };
    let (black, floor) = (b.material(black), b.matte([floor; 3]));
    let at = |y: f32, z: f32| Vec3::new(2.0, y, z);
    b.sheet(Vec3::new(-2.0, 0.0, -2.0), Vec3::Z * 4.0, Vec3::X * 4.0, [8, 8], floor);
    b.sheet(Vec3::new(-2.0, 3.0, -2.0), Vec3::X * 4.0, Vec3::Z * 4.0, [1, 1], black);
    b.sheet(Vec3::new(-2.0, 0.0, -2.0), Vec3::Y * 3.0, Vec3::Z * 4.0, [1, 1], black);
    b.sheet(Vec3::new(-2.0, 0.0, -2.0), Vec3::X * 4.0, Vec3::Y * 3.0, [1, 1], black);
    b.sheet(Vec3::new(-2.0, 0.0, 2.0), Vec3::Y * 3.0, Vec3::X * 4.0, [1, 1], black);
    b.sheet(at(0.0, -2.0), Vec3::Z * 4.0, Vec3::Y, [1, 1], black);
    b.sheet(at(2.0, -2.0), Vec3::Z * 4.0, Vec3::Y, [1, 1], black);
    b.sheet(at(1.0, -2.0), Vec3::Z * 1.2, Vec3::Y, [1, 1], black);
    b.sheet(at(1.0, 0.8), Vec3::Z * 1.2, Vec3::Y, [1, 1], black);
    // Its normal, edge × edge, points to −X.
    Portal { corner: at(1.0, -0.8), edges: [Vec3::Z * 1.6, Vec3::Y] }
}

/// Returns the irradiance on the floor at (x, 0, 0) by the window of radiance 1 in all directions. Midpoint rule in
/// f64.
fn by_window(x: f64) -> f64 {
    let count = 400;
    let mut sum = 0.0;
    for i in 0..count * count {
        let z = -0.8 + 1.6 * (f64::from(i % count) + 0.5) / f64::from(count);
        let y = 1.0 + (f64::from(i / count) + 0.5) / f64::from(count);
        let (dx, d2) = (2.0 - x, (2.0 - x).powi(2) + y * y + z * z);
        sum += y * dx / (d2 * d2) * 1.6 / f64::from(count * count);
    }
    sum
}

/// Returns the irradiance of the floor around (x, 0, 0): the radiance of a floor of albedo 0.5 minus that of a black
/// one with the same gloss, seen from above.
fn floor_irradiance([grey, black]: &[BakedWorld; 2], x: f32) -> f64 {
    // Pixels of 1.6 cm: the filter mixes light over a dozen of them.
    let view = photo(Vec3::new(x, 2.0, 0.0), 0.0, -std::f32::consts::FRAC_PI_2, [192, 192]);
    let radiance = |baked: &BakedWorld| {
        let image = baked.render(&view).radiance;
        (0..16).map(|i| f64::from(image[(94 + i % 4, 94 + i / 4)][1])).sum::<f64>() / 16.0
    };
    // 4 % of the light along the normal does not pass the gloss (GGX of this roughness masks some of it).
    (radiance(grey) - radiance(black)) / (0.5 * 0.965 / PI)
}

#[test]
fn sky_through_a_window_falls_on_the_floor() {
    let world = |floor: f32| {
        let mut b = Builder::new();
        let portal = cell(&mut b, floor);
        b.world([1.0; 3], None, vec![portal])
    };
    let tracer = PathTracer::new(world(0.5), 3).unwrap();
    let baked = [0.5, 0.0].map(|floor| BakedWorld::bake(world(floor), &BakeSettings::default()).unwrap());
    for x in [-1.0, 0.0, 1.0] {
        let expected = by_window(f64::from(x));
        let reference = f64::from(tracer.irradiance(Vec3::new(x, 1e-4, 0.0), Vec3::Y, 20_000, 1)[1]);
        assert!((reference / expected - 1.0).abs() < 0.01, "{reference} for {expected} at {x}");
        let found = floor_irradiance(&baked, x);
        assert!((found / expected - 1.0).abs() < 0.04, "{found} for {expected} at {x}");
    }
}

#[test]
fn sun_through_a_window_lights_its_patch_alone() {
    let direction = Vec3::new(2.0, 1.5, 0.0).normalize();
    let sun = Sun { direction, angular_radius_rad: 0.005, radiance: [10_000.0; 3] };
    let world = |floor: f32| {
        let mut b = Builder::new();
        let portal = cell(&mut b, floor);
        b.world([0.0; 3], Some(sun), vec![portal])
    };
    let tracer = PathTracer::new(world(0.5), 3).unwrap();
    let baked = [0.5, 0.0].map(|floor| BakedWorld::bake(world(floor), &BakeSettings::default()).unwrap());
    // The patch extends from x = 2 − 2 · 2 / 1.5 to 2 − 1 · 2 / 1.5.
    let lit = 10_000.0 * PI * 0.005_f64.powi(2) * 0.6;
    for (x, expected) in [(0.0, lit), (-0.4, lit), (1.2, 0.0), (-1.2, 0.0)] {
        let reference = f64::from(tracer.irradiance(Vec3::new(x, 1e-4, 0.0), Vec3::Y, 4000, 1)[1]);
        assert!((reference - expected).abs() < 0.01 * lit, "{reference} for {expected} at {x}");
        let found = floor_irradiance(&baked, x);
        assert!((found - expected).abs() < 0.03 * lit, "{found} for {expected} at {x}");
    }
}

/// The edge of a shadow on the ground, with the sun as a point. Pixels across it show the lit share of their area.
#[test]
fn edges_of_sunny_patches_cover_pixels_as_lines_do() {
    let mut builder = Builder::new();
    let white = builder.matte([0.6; 3]);
    builder.sheet(Vec3::new(-4.0, 0.0, -4.0), Vec3::X * 8.0, Vec3::Z * 8.0, [8, 8], white);
    // A roof with a slanted edge, outside the view, just above the camera's height.
    let (along, aside) = (Vec3::new(1.0, 0.0, 0.21).normalize(), Vec3::new(-0.21, 0.0, 1.0).normalize());
    builder.sheet(Vec3::Y * 3.0 - along * 4.0, aside * -4.0, along * 8.0, [4, 4], white);
    let sun = Sun { direction: Vec3::Y, angular_radius_rad: 1e-4, radiance: [3e7; 3] };
    let world = || lo_transport::World {
        model: builder.model.clone(),
        outdoors: lo_transport::Outdoors {
            radiance: lo_imaging::RadianceImage::new(2, 1, vec![[0.0; 3]; 2]),
            sun: Some(sun),
        },
        portals: Vec::new(),
    };
    // Straight down, +x to the right in the image and −z up.
    let camera = lo_geometry::Camera::from_hfov_deg(40.0, 240, 160).unwrap();
    let pose = lo_transport::Pose {
        position: Vec3::Y * 2.5,
        rotation: lo_geometry::Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2),
    };
    let error = |sun_at_edges: bool| {
        let baked = BakedWorld::bake(world(), &BakeSettings { sun_at_edges, ..BakeSettings::default() }).unwrap();
        let seen = baked.render(&lo_transport::View::Pinhole { pose, camera });
        let lit = f64::from(seen.radiance[(120, 150)][1]);
        let (mut sum, mut pixels) = (0.0, 0);
        for (x, y) in (20..220).flat_map(|x| (20..140).map(move |y| (x, y))) {
            // Share of the pixel on the lit side of the line, by 16 × 16 points.
            let inside = (0..256).filter(|k| {
                let (u, v) = (x as f64 + (f64::from(k % 16) + 0.5) / 16.0, y as f64 + (f64::from(k / 16) + 0.5) / 16.0);
                let direction = pose.rotation * camera.direction(u, v);
                let place = pose.position - direction * (pose.position.y / direction.y);
                place.dot(aside) > 0.0
            });
            let share = inside.count() as f64 / 256.0;
            if share > 0.0 && share < 1.0 {
                let found = f64::from(seen.radiance[(x, y)][1]) / lit;
                sum += (found - share).powi(2);
                pixels += 1;
            }
        }
        assert!(pixels > 200, "{pixels}");
        (sum / f64::from(pixels)).sqrt()
    };
    let (usual, asked) = (error(false), error(true));
    // 52 samples of a pixel leave an error of at most 0.5 / √52 = 0.07.
    assert!(asked < 0.07 && usual > 1.5 * asked, "{asked}, {usual} without");
}
