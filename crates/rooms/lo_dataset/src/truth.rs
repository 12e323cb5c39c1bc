//! Ground-truth octree of a room.

use lo_geometry::{Cube, Vec3};
use lo_octree::{LightOctree, OctreeError, RadiancePoint};

/// Points outside the cube are kept up to this multiple of the nearest distance in the same leaf's direction.
const MAX_BEHIND: f32 = 1.1;

/// Selection of a true octree's leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrueLeaves {
    /// Every leaf that contains a surface point. The light network learns these, and its split labels are compared with
    /// them. Whether a surface just touches a leaf can be inferred from a photo; whether it fills less than half of the
    /// leaf's face cannot.
    All,
    /// Leaves that surfaces fill ([`LightOctree::from_uniform_points`]). Looks most like the room: an upper bound for
    /// octrees.
    Filled {
        /// Surface area per point, in m².
        point_area_m2: f32,
    },
}

/// Builds the true octree of a room in a cube. Points outside are projected along their line of sight from the camera
/// onto the cube's boundary, as estimation does. Nearer points hide those behind them.
///
/// # Errors
/// If the depths are out of range or the cube has no volume.
pub fn true_octree(
    points: &[RadiancePoint],
    leaves: TrueLeaves,
    cube: Cube,
    depth: u32,
    full_depth: u32,
) -> Result<LightOctree, OctreeError> {
    let mut inside: Vec<RadiancePoint> = Vec::with_capacity(points.len());
    // Leaf at the cube's boundary, distance, and the projected point.
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
    let hidden = |nearest_m: f32, distance_m: f32| distance_m > MAX_BEHIND * nearest_m;
    for same in outside.chunk_by(|a, b| a.0 == b.0) {
        inside.extend(same.iter().take_while(|drawn| !hidden(same[0].1, drawn.1)).map(|drawn| drawn.2));
    }
    let (octree, _) = match leaves {
        TrueLeaves::All => LightOctree::from_points(&inside, cube, depth, full_depth)?,
        TrueLeaves::Filled { point_area_m2 } => {
            LightOctree::from_uniform_points(&inside, point_area_m2, cube, depth, full_depth)?
        }
    };
    Ok(octree)
}

fn leaf(cube: Cube, depth: u32, position_m: Vec3) -> u32 {
    let unit = cube.unit_from_world(position_m) * (1u32 << depth) as f32;
    lo_octree::key_from_xyz([unit.x as u32, unit.y as u32, unit.z as u32])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_octree::Provenance;

    use super::*;

    #[test]
    fn distant_points_are_projected_onto_the_boundary_and_hide_those_behind() {
        let cube = Cube::centred(Vec3::ZERO, 8.0);
        let point = |z: f32, radiance: f32| RadiancePoint {
            position_m: Vec3::new(0.01 * z, 0.01 * z, z),
            radiance: [radiance; 3],
            provenance: Provenance::Inferred,
        };
        let points = [point(-2.0, 1.0), point(-9.0, 3.0), point(-6.0, 2.0)];
        let octree = true_octree(&points, TrueLeaves::All, cube, 5, 3).unwrap();
        let rows: Vec<f32> = octree.rgba[5].iter().map(|rgba| rgba[0]).collect();
        let mut sorted = rows.clone();
        sorted.sort_by(f32::total_cmp);
        assert_eq!(sorted, [1.0, 2.0]);
        let (depth, node) = octree.locate(Vec3::new(-0.04, -0.04, -3.99), 5).unwrap();
        assert_eq!((depth, octree.node_rgba(5, node).unwrap()[0]), (5, 2.0));
    }

    #[test]
    fn a_surface_that_just_touches_a_leaf_is_in_all_leaves_and_fills_its_neighbour() {
        // A wall with 8 × 8 points per leaf face. Its last column of leaves is one eighth wall.
        let cube = Cube::centred(Vec3::ZERO, 8.0);
        let step = 1.0 / 8.0;
        let place = |i: usize| -2.0 + (i as f32 + 0.5) * step;
        let points: Vec<RadiancePoint> = (0..17 * 16)
            .map(|i| RadiancePoint {
                position_m: Vec3::new(place(i % 17), place(i / 17), 0.5),
                radiance: [1.0; 3],
                provenance: Provenance::Inferred,
            })
            .collect();
        let leaves = |leaves| true_octree(&points, leaves, cube, 3, 1).unwrap().rgba[3].len();
        assert_eq!(leaves(TrueLeaves::All), 3 * 2);
        assert_eq!(leaves(TrueLeaves::Filled { point_area_m2: step * step }), 2 * 2);
    }
}
