//! Ray casting, compared with Möller & Trumbore's test in f64 on every triangle.

use lo_geometry::{Quat, Ray, Vec3};
use lo_mesh::{LoadOptions, Material, Model, PlacedModel, Placement, PreparedModel, offset_origin};
use proptest::prelude::*;

/// Distance and least barycentric weight of every hit; the weight is negative outside the triangle.
fn brute_force(model: &Model, ray: &Ray) -> Vec<(f64, f64)> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut hits = Vec::new();
    for triangle in &model.triangles {
        let [a, b, c] = triangle.map(|v| model.positions[v as usize].as_dvec3());
        let (e1, e2) = (b - a, c - a);
        let p = d.cross(e2);
        let det = e1.dot(p);
        let s = o - a;
        let u = s.dot(p) / det;
        let q = s.cross(e1);
        let v = d.dot(q) / det;
        let t = e2.dot(q) / det;
        let inside = u.min(v).min(1.0 - u - v);
        if det != 0.0 && t > 0.0 && inside >= -1e-4 {
            hits.push((t, inside));
        }
    }
    hits.sort_by(|a, b| a.0.total_cmp(&b.0));
    hits
}

fn vector(size: f32) -> impl Strategy<Value = Vec3> {
    (-size..size, -size..size, -size..size).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn closest_and_any_hit_agree_with_brute_force(
        soup in prop::collection::vec((vector(1.0), vector(0.4), vector(0.4)), 1..200),
        rays in prop::collection::vec((vector(3.0), vector(1.0)), 20),
        exponent in -20..20_i32,
    ) {
        let unit = 2_f32.powi(exponent);
        let positions: Vec<Vec3> = soup.iter().flat_map(|&(a, b, c)| [a, a + b, a + c]).map(|p| p * unit).collect();
        let triangles = (0..soup.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let model = Model::from_triangles(positions, triangles, Material::default(), &LoadOptions::default());
        prop_assume!(model.is_ok());
        let prepared = PreparedModel::new(model.unwrap());
        for (origin, towards) in rays {
            let ray = Ray { origin: origin * unit, direction: (towards - origin).normalize() };
            let expected = brute_force(prepared.model(), &ray);
            let found = prepared.intersect(&ray, f32::INFINITY);
            // Hits within 1e-4 of an edge may go either way against f64.
            match expected.iter().find(|hit| hit.1 > 1e-4) {
                Some(&(t, _)) => {
                    let found = found.expect("a hit well inside a triangle");
                    let first = expected[0].0.min(t);
                    let distance = f64::from(found.distance_m);
                    prop_assert!(distance >= first * (1.0 - 1e-4) && distance <= t * (1.0 + 1e-4) , "{} {}", distance, t);
                    prop_assert!(prepared.occluded(&ray, (t * 1.001) as f32));
                    prop_assert!(!prepared.occluded(&ray, (first * 0.999) as f32));
                    prop_assert_eq!(prepared.transmittance(&ray, (t * 1.001) as f32), 0.0);
                    prop_assert!(prepared.intersect(&ray, (first * 0.999) as f32).is_none());
                }
                None => prop_assert!(found.is_none() || !expected.is_empty()),
            }
        }
    }
}

fn one_sided() -> Material {
    Material { double_sided: false, ..Material::default() }
}

#[test]
fn no_ray_slips_through_a_closed_mesh() {
    let prepared = PreparedModel::new(Model::sphere(1.0, 3, one_sided()).unwrap());
    let model = prepared.model().clone();
    // Towards vertices and edge midpoints, where a leak would show.
    for triangle in &model.triangles {
        let [a, b, c] = triangle.map(|v| model.positions[v as usize]);
        for target in [a, b, (a + b) * 0.5, (b + c) * 0.5] {
            let ray = Ray { origin: Vec3::new(0.01, -0.02, 0.03), direction: Vec3::ZERO };
            let ray = Ray { direction: (target - ray.origin).normalize(), ..ray };
            assert!(prepared.occluded(&ray, 10.0), "leak towards {target}");
            assert!(prepared.intersect(&ray, 10.0).is_none(), "the inside of a single-sided sphere is not seen");
            assert!(prepared.intersect_both_sides(&ray, 10.0).is_some());
        }
    }
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for direction in [axis, -axis] {
            assert!(prepared.occluded(&Ray { origin: Vec3::ZERO, direction }, 2.0), "leak along {direction}");
            assert!(prepared.occluded(
                &Ray { origin: Vec3::new(-0.0, 0.0, -0.0), direction: direction * 1.0 + Vec3::new(-0.0, -0.0, -0.0) },
                2.0
            ));
        }
    }
}

#[test]
fn offset_rays_do_not_meet_their_own_surface() {
    let prepared = PreparedModel::new(Model::sphere(1.0, 3, one_sided()).unwrap());
    for scale in [0.01, 1.0, 30.0] {
        let placement =
            Placement { scale, rotation: Quat::from_rotation_y(1.1), translation: Vec3::new(3.0, -1.5, -2.0) };
        let placed = PlacedModel { prepared: &prepared, placement };
        for k in 0..500 {
            let out = lo_geometry::fibonacci_sphere(500)[k];
            let ray = Ray { origin: placement.translation + out * scale * 2.0, direction: -out };
            let hit = placed.intersect(&ray, 10.0 * scale).expect("towards the middle of a sphere");
            let point = placed.surface(&hit, ray.direction, 0.0);
            let origin = offset_origin(point.position, point.geometric_normal);
            // A convex body: no occlusion outside its surface, occlusion inside.
            let away = (point.geometric_normal + 0.9 * out.any_orthonormal_vector()).normalize();
            assert!(!placed.occluded(&Ray { origin, direction: away }, f32::INFINITY), "scale {scale}, {out}");
            let inside = offset_origin(point.position, -point.geometric_normal);
            assert!(placed.occluded(&Ray { origin: inside, direction: -out }, f32::INFINITY), "scale {scale}, {out}");
        }
    }
}

#[test]
fn a_placed_model_behaves_like_a_moved_one() {
    let prepared = PreparedModel::new(Model::sphere(1.0, 2, one_sided()).unwrap());
    let placement = Placement {
        scale: 0.37,
        rotation: Quat::from_rotation_y(0.4) * Quat::from_rotation_x(-1.0) * Quat::from_rotation_z(2.2),
        translation: Vec3::new(0.3, 0.2, -1.9),
    };
    let placed = PlacedModel { prepared: &prepared, placement };
    let moved: Vec<Vec3> = prepared.model().positions.iter().map(|&p| placement.world_from_model(p)).collect();
    let moved =
        Model::from_triangles(moved, prepared.model().triangles.clone(), Material::default(), &LoadOptions::default());
    let moved = PreparedModel::new(moved.unwrap());
    let mut hits = 0;
    for (k, direction) in lo_geometry::fibonacci_sphere(2000).into_iter().enumerate() {
        let ray = Ray { origin: Vec3::new(0.0, 0.0, (k % 7) as f32 * 0.1), direction };
        let (a, b) = (placed.intersect(&ray, 9.0), moved.intersect(&ray, 9.0));
        assert_eq!(a.is_some(), b.is_some());
        let (Some(a), Some(b)) = (a, b) else { continue };
        hits += 1;
        assert!((a.distance_m - b.distance_m).abs() < 1e-5);
        let (a, b) = (placed.surface(&a, direction, 0.0), moved.model().surface(&b, direction, 0.0));
        assert!(a.position.distance(b.position) < 1e-5);
        assert!(a.shading_normal.distance(b.shading_normal) < 1e-3);
    }
    assert!(hits > 10, "{hits}");
}
