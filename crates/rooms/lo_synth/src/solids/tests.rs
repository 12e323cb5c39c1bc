#![allow(clippy::unwrap_used)]
use super::*;

const PAINT: Paint = Paint { material: 0, tint: [1.0; 3] };

/// Volume by the divergence theorem: positive where the triangles face outwards.
fn volume(shape: &Shape, part: &ShapePart) -> f32 {
    shape.triangles[part.triangles.clone()]
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| shape.positions[v as usize]);
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}

/// Asserts that every vertex normal is on the front side of its triangles.
fn assert_normals_agree(shape: &Shape) {
    for t in &shape.triangles {
        let [a, b, c] = t.map(|v| shape.positions[v as usize]);
        let face = (b - a).cross(c - a).normalize();
        for v in t {
            let normal = shape.normals[*v as usize];
            assert!((normal.length() - 1.0).abs() < 1e-4);
            assert!(normal.dot(face) > 0.0, "{normal} on {face}");
        }
    }
}

#[test]
fn volumes_are_those_of_the_formulas() {
    let mut shape = Shape::default();
    shape.cuboid(Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 4.0, 6.0), PAINT);
    shape.rounded(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0), 0.2, 12, PAINT);
    shape.lathe(Vec3::X, &[[0.5, 0.0], [0.5, 2.0]], 96, PAINT);
    shape.ball(Vec3::Y, [1.0, 0.5], 96, PAINT);
    shape.ring(Vec3::ZERO, &[[1.0, 0.0], [2.0, 0.0], [2.0, 0.5], [1.0, 0.5]], 96, PAINT);
    shape.bar(Vec3::ZERO, Vec3::new(3.0, 4.0, 0.0), [1.0, 0.0], 96, PAINT);
    let pi = std::f32::consts::PI;
    // A rounded box is its core, six slabs, twelve quarter cylinders and one ball.
    let (x, y, z, r) = (0.6f32, 1.6, 2.6, 0.2f32);
    let rounded = x * y * z + 2.0 * r * (x * y + y * z + z * x) + pi * r * r * (x + y + z) + 4.0 / 3.0 * pi * r.powi(3);
    let expected = [6.0, rounded, pi * 0.5, 4.0 / 3.0 * pi * 0.5, pi * 1.5, pi * 5.0 / 3.0];
    for (part, expected) in shape.parts.iter().zip(expected) {
        let found = volume(&shape, part);
        // Inscribed 96-gons lose 0.07 % of the volume, 24 steps per quarter 0.3 % of the rounded share.
        assert!((found / expected - 1.0).abs() < 0.004, "{found} for {expected}");
    }
    assert_eq!(shape.parts.len(), expected.len());
    assert_normals_agree(&shape);
}

#[test]
fn soft_solids_are_closed_and_face_outwards() {
    let mut shape = Shape::default();
    shape.pillow(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.5, 0.15, 0.4), 10, PAINT);
    shape.bulging(Vec3::ZERO, Vec3::new(0.8, 0.2, 0.7), 0.05, 2, 0.04, PAINT);
    for part in &shape.parts {
        assert!(volume(&shape, part) > 0.0);
        // The vector areas of a closed surface sum to zero.
        let sum: Vec3 = shape.triangles[part.triangles.clone()]
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| shape.positions[v as usize]);
                (b - a).cross(c - a)
            })
            .sum();
        assert!(sum.length() < 1e-4, "{sum}");
    }
    assert_normals_agree(&shape);
}

#[test]
fn turned_shapes_keep_normals_and_parts() {
    let mut one = Shape::default();
    one.lathe(Vec3::ZERO, &[[0.2, 0.0], [0.1, 0.5], [0.3, 1.0]], 12, PAINT);
    let mut two = Shape::default();
    two.cuboid(Vec3::ZERO, Vec3::ONE, PAINT);
    two.add(&one, Quat::from_rotation_z(0.7), Vec3::new(3.0, 1.0, -2.0));
    assert_normals_agree(&two);
    let total: f32 = two.parts.iter().map(|part| volume(&two, part)).sum();
    let apart = volume(&one, &one.parts[0]) + 1.0;
    assert!((total - apart).abs() < 1e-4);
    assert!((two.area(12..two.triangles.len()) - one.area(0..one.triangles.len())).abs() < 1e-4);
}
