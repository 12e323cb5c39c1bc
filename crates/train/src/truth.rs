//! What the light network ought to make of a room.

use geometry::{Cube, Vec3};
use octree::{LightOctree, OctreeError, RadiancePoint};

/// Of what lies beyond the cube in a leaf's direction, only that is kept which is at most this factor farther than the nearest.
const BEHIND: f32 = 1.1;

/// The true octree of a room in the cube that estimation placed: what lies outside is drawn in along its line of sight from the camera
/// to the cube's side, as estimation does with what is seen. The nearest hides what is behind it.
///
/// # Errors
/// Depths out of range, a cube without volume.
pub fn true_octree(
    points: &[RadiancePoint],
    cube: Cube,
    depth: u32,
    full_depth: u32,
) -> Result<LightOctree, OctreeError> {
    let mut inside: Vec<RadiancePoint> = Vec::with_capacity(points.len());
    // Leaf of the cube's side, distance, and the point that is drawn in.
    let mut outside: Vec<(u32, f32, RadiancePoint)> = Vec::new();
    for point in points {
        let position_m = cube.pulled_inside(point.position_m);
        if position_m == point.position_m {
            inside.push(*point);
        } else {
            let drawn = RadiancePoint { position_m, ..*point };
            outside.push((leaf(cube, depth, position_m), point.position_m.length(), drawn));
        }
    }
    outside.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let hidden = |nearest_m: f32, distance_m: f32| distance_m > BEHIND * nearest_m;
    for same in outside.chunk_by(|a, b| a.0 == b.0) {
        inside.extend(same.iter().take_while(|drawn| !hidden(same[0].1, drawn.1)).map(|drawn| drawn.2));
    }
    Ok(LightOctree::from_points(&inside, cube, depth, full_depth)?.0)
}

fn leaf(cube: Cube, depth: u32, position_m: Vec3) -> u32 {
    let unit = cube.unit_from_world(position_m) * (1u32 << depth) as f32;
    octree::key_from_xyz([unit.x as u32, unit.y as u32, unit.z as u32])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use octree::Coverage;

    use super::*;

    #[test]
    fn what_is_far_is_painted_on_the_side_and_hides_what_is_behind() {
        let cube = Cube::centred(Vec3::ZERO, 8.0);
        let point = |z: f32, radiance: f32| RadiancePoint {
            position_m: Vec3::new(0.01 * z, 0.01 * z, z),
            radiance: [radiance; 3],
            coverage: Coverage::Inferred,
        };
        let octree = true_octree(&[point(-2.0, 1.0), point(-9.0, 3.0), point(-6.0, 2.0)], cube, 5, 3).unwrap();
        let rows: Vec<f32> = octree.rgba[5].iter().map(|rgba| rgba[0]).collect();
        let mut sorted = rows.clone();
        sorted.sort_by(f32::total_cmp);
        assert_eq!(sorted, [1.0, 2.0]);
        let (depth, node) = octree.locate(Vec3::new(-0.04, -0.04, -3.99), 5).unwrap();
        assert_eq!((depth, octree.node_rgba(5, node).unwrap()[0]), (5, 2.0));
    }
}
