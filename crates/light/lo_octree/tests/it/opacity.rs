//! The opacity pyramid: closed rooms stay closed and thin objects keep their size, at every level.
//!
//! Rays are integrated exactly through the nodes of one level, in f64: optical depth `Σ σ ℓ` over the nodes crossed.

use lo_geometry::{Cube, Quat, Vec3, fibonacci_sphere};
use lo_octree::{LightOctree, MAX_ALPHA, Provenance, RadiancePoint, key_from_xyz};

const CUBE: Cube = Cube { origin_m: Vec3::splat(-4.0), edge_m: 8.0 };

/// Returns the transmittance through the nodes of `depth` along a ray until it leaves the cube.
fn transmittance(light: &LightOctree, depth: u32, origin: Vec3, direction: Vec3) -> f64 {
    let nodes = 1i64 << depth;
    let edge = f64::from(light.cube.edge_m) / nodes as f64;
    let start = (origin - light.cube.origin_m).to_array().map(f64::from);
    let direction = direction.to_array().map(f64::from);
    let mut cell = start.map(|c| (c / edge).floor() as i64);
    let (mut at, mut optical_depth) = (0.0, 0.0);
    while cell.iter().all(|c| (0..nodes).contains(c)) {
        // distance at which each axis leaves the cell
        let exits: Vec<f64> = (0..3)
            .map(|axis| {
                let face = cell[axis] + i64::from(direction[axis] > 0.0);
                if direction[axis] == 0.0 {
                    f64::INFINITY
                } else {
                    (face as f64 * edge - start[axis]) / direction[axis]
                }
            })
            .collect();
        let axis = (0..3).min_by(|&a, &b| exits[a].total_cmp(&exits[b])).unwrap();
        if let Some(node) = light.octree.find(depth, key_from_xyz(cell.map(|c| c as u32)))
            && let Some(rgba) = light.node_rgba(depth, node)
        {
            optical_depth -= (1.0 - f64::from(rgba[3])).ln() / edge * (exits[axis] - at);
        }
        at = exits[axis];
        cell[axis] += direction[axis].signum() as i64;
    }
    (-optical_depth).exp()
}

fn octree_of(positions: impl IntoIterator<Item = Vec3>) -> LightOctree {
    let points: Vec<RadiancePoint> = positions
        .into_iter()
        .map(|position_m| RadiancePoint { position_m, radiance: [1.0; 3], provenance: Provenance::Observed })
        .collect();
    LightOctree::from_points(&points, CUBE, 7, 4).unwrap().0
}

/// The walls of a rotated box with these half extents, sampled every `spacing` metres.
fn room(half: Vec3, turn: Quat, centre: Vec3, spacing: f32) -> LightOctree {
    let mut positions = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let steps = |extent: f32| (2.0 * extent / spacing).ceil() as i32;
        for i in 0..=steps(half[u]) {
            for j in 0..=steps(half[v]) {
                for side in [-1.0, 1.0] {
                    let mut p = Vec3::ZERO;
                    p[axis] = side * half[axis];
                    p[u] = half[u] * (2.0 * i as f32 / steps(half[u]) as f32 - 1.0);
                    p[v] = half[v] * (2.0 * j as f32 / steps(half[v]) as f32 - 1.0);
                    positions.push(centre + turn * p);
                }
            }
        }
    }
    octree_of(positions)
}

/// Rotations at which rooms are tested: aligned with the cube's axes, and by odd angles about one axis and three.
fn turns() -> [Quat; 4] {
    let (x, y, z) = (Quat::from_rotation_x, Quat::from_rotation_y, Quat::from_rotation_z);
    [Quat::IDENTITY, y(0.40), y(0.3) * x(0.41) * z(0.17), y(1.1) * x(0.61) * z(0.77)]
}

/// Returns the mean transmittance from inside the room, and the share of rays that transmit more than 1 %.
fn leak(light: &LightOctree, depth: u32, turn: Quat) -> (f64, f64) {
    let origins = [Vec3::ZERO, Vec3::new(0.7, 0.3, -0.5), Vec3::new(-0.9, -0.4, 0.6)];
    let directions = fibonacci_sphere(1000);
    let rays = origins.iter().flat_map(|&origin| directions.iter().map(move |&direction| (turn * origin, direction)));
    let leaks: Vec<f64> = rays.map(|(origin, direction)| transmittance(light, depth, origin, direction)).collect();
    let count = leaks.len() as f64;
    (leaks.iter().sum::<f64>() / count, leaks.iter().filter(|&&leak| leak > 0.01).count() as f64 / count)
}

#[test]
fn closed_rooms_stay_closed_at_every_level() {
    // Down to the full depth, the coarsest level that cone tracing uses. An axis-aligned room is closed on every ray at
    // the leaves. The remaining leaks are at corners of nodes, where even the leaves of a slanted wall share only an
    // edge. Without the extended columns of `pyramid.rs` the turned rooms leak up to 16 %, with the mean of the axes 40
    // %.
    for (name, turn) in ["aligned", "yaw", "tilted", "oblique"].into_iter().zip(turns()) {
        let light = room(Vec3::new(2.1, 1.3, 1.7), turn, Vec3::new(0.031, -0.017, 0.0123), 0.012);
        for depth in 4..=7 {
            let (mean, leaky) = leak(&light, depth, turn);
            println!("{name:8} depth {depth}: mean {:.3} %, {:.2} % of rays above 1 %", 100.0 * mean, 100.0 * leaky);
            if name == "aligned" && depth == 7 {
                assert_eq!(leaky, 0.0);
            }
            assert!(mean < 0.005, "{name}, depth {depth}: {mean}");
            assert!(leaky < 0.035, "{name}, depth {depth}: {leaky}");
        }
    }
}

/// Returns the mean opacity over a cap of 0.5 rad towards the cube's centre.
fn coverage(light: &LightOctree, depth: u32, origin: Vec3) -> f64 {
    let (count, lowest) = (6000, 0.5f32.cos());
    let turn = Quat::from_rotation_arc(Vec3::Z, -origin.normalize());
    let directions = (0..count).map(|i| {
        let z = 1.0 - (1.0 - lowest) * (i as f32 + 0.5) / count as f32;
        let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        turn * Vec3::new(radius * cos, radius * sin, z)
    });
    directions.map(|direction| 1.0 - transmittance(light, depth, origin, direction)).sum::<f64>() / f64::from(count)
}

/// Returns the ratio of the solid angle at `depth` to that of the leaves, mean of three views.
fn solid_angle_ratio(light: &LightOctree, depth: u32) -> f64 {
    let views = [Vec3::new(0.4, 0.3, 3.5), Vec3::new(2.1, -1.0, 2.5), Vec3::new(-3.4, 0.7, 0.3)];
    views.map(|view| coverage(light, depth, view) / coverage(light, 7, view)).iter().sum::<f64>() / 3.0
}

#[test]
fn things_keep_their_solid_angle() {
    // Two levels up a node is a quarter of a metre. An object grows by a share of a node at its silhouette; a thin one
    // must not.
    let scattered = octree_of((0..60).map(|i| {
        let i = i as f32;
        Vec3::new((0.754_877 * i).fract(), (0.569_84 * i).fract(), (0.324_7 * i).fract()) - 0.5
    }));
    let ball = octree_of(fibonacci_sphere(60_000).into_iter().map(|d| Vec3::new(0.013, 0.021, 0.007) + 0.52 * d));
    let mut shapes = vec![("scattered", scattered, 0.65..1.1), ("ball", ball, 0.9..1.6)];
    for turn in [turns()[0], turns()[2]] {
        let pole = octree_of((0..3000).map(|i| turn * Vec3::new(0.021, i as f32 / 1000.0 - 1.5, 0.017)));
        let plate = octree_of(
            (0..200 * 200)
                .map(|i| turn * Vec3::new((i % 200) as f32 / 200.0 - 0.51, (i / 200) as f32 / 200.0 - 0.47, 0.017)),
        );
        let cube = room(Vec3::new(0.41, 0.37, 0.43), turn, Vec3::new(0.03, 0.02, 0.01), 0.01);
        shapes.extend([("pole", pole, 0.85..1.15), ("plate", plate, 0.9..1.65), ("cube", cube, 0.9..1.65)]);
    }
    for (name, light, allowed) in shapes {
        let [d6, d5] = [6, 5].map(|depth| solid_angle_ratio(&light, depth));
        println!("{name:10} depth 6: {d6:.2}, depth 5: {d5:.2} of the leaves' solid angle");
        assert!(allowed.contains(&d6) && allowed.contains(&d5), "{name}: {d6}, {d5}");
    }
}

#[test]
fn a_wall_is_as_opaque_as_its_leaves_at_every_level() {
    // y = 0.03 is in one layer of leaves. It crosses every node above, up to the one that holds half of the cube.
    let wall = octree_of(
        (0..256 * 256).map(|i| Vec3::new((i % 256) as f32 / 32.0 - 3.98, 0.03, (i / 256) as f32 / 32.0 - 3.98)),
    );
    for rows in &wall.rgba[1..] {
        assert!(rows.iter().all(|rgba| (rgba[3] - MAX_ALPHA).abs() < 1e-6));
    }
}

#[test]
fn parents_mix_premultiplied_colour() {
    // Two children side by side: x = 0 red with opacity 0.75, x = 1 green with opacity 0.25, observed and inferred.
    let light = LightOctree::from_leaves(
        vec![0, 4],
        vec![[4.0, 0.0, 0.0, 0.75], [0.0, 8.0, 0.0, 0.25]],
        vec![255, 0],
        CUBE,
        1,
        0,
    )
    .unwrap();
    // Along x one of four columns holds both: (1 − 0.25 · 0.75) / 4 = 0.203; along y and z each fills one: 1 / 4.
    assert_eq!(light.rgba[0], [[3.0, 2.0, 0.0, 0.25]]);
    assert_eq!(light.seen[0], [128]);

    let invisible =
        LightOctree::from_leaves(vec![0, 4], vec![[4.0, 0.0, 0.0, 0.0], [0.0, 8.0, 0.0, 0.0]], vec![0; 2], CUBE, 1, 0);
    assert_eq!(invisible.unwrap().rgba[0], [[2.0, 4.0, 0.0, 0.0]]);
}
