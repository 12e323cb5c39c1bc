//! Selection of the faces of bright leaves that light the observed part of the room, not the space behind its
//! ceiling.

use lo_geometry::Vec3;
use lo_octree::LightOctree;
use lo_scene::Frame;

use crate::free_space::{FACES, Leaf};

/// Number of rays across and down the photo along which test positions are placed, since objects are inserted where
/// the photo shows.
const RAYS: usize = 4;

/// Position along a ray, as a share of the distance to the observed surface.
const ALONG: f32 = 0.7;

/// Smallest transmittance between a test position and a face.
const MIN_TRANSMITTANCE: f32 = 0.5;

/// Returns the camera and positions in front of the observed surfaces.
pub(crate) fn places(frame: &Frame) -> Vec<Vec3> {
    let (width, height) = (frame.depth_m.width(), frame.depth_m.height());
    let at = |i: usize, size: usize| (2 * i + 1) * size / (2 * RAYS);
    let rays = (0..RAYS * RAYS).map(|i| (at(i % RAYS, width), at(i / RAYS, height)));
    let seen = rays.filter_map(|(x, y)| frame.point(x, y)).map(|point| point * ALONG);
    std::iter::once(Vec3::ZERO).chain(seen).collect()
}

/// Restricts the exposed faces of leaves of at least this luminance to those visible from some position; other leaves
/// stay unchanged.
pub(crate) fn lit_sides(light: &LightOctree, leaves: &[Leaf], luminance: f32, places: &[Vec3]) -> Vec<Leaf> {
    let lit = |leaf: &Leaf| {
        let mut leaf = *leaf;
        if leaf.luminance() > luminance {
            let seen = |face: &usize| {
                let normal = Vec3::from(FACES[*face].map(|c| c as f32));
                // Just in front of the face, so that the leaf does not occlude itself.
                let before_m = leaf.centre_m + normal * (0.6 * leaf.edge_m);
                places.iter().any(|&place| (place - before_m).dot(normal) > 0.0 && is_free(light, place, before_m))
            };
            leaf.exposed = leaf.exposed_faces().filter(seen).fold(0, |bits, face| bits | 1 << face);
        }
        leaf
    };
    leaves.iter().map(lit).collect()
}

/// Returns whether at least half of the light passes between two points.
fn is_free(light: &LightOctree, from: Vec3, to: Vec3) -> bool {
    let depth = light.octree.depth();
    let step_m = 0.5 * light.cube.node_edge_m(depth);
    let way = to - from;
    let steps = (way.length() / step_m).ceil().max(1.0) as usize;
    let mut transmittance = 1.0;
    let mut last = None;
    for step in 0..=steps {
        let node = light.locate(from + way * (step as f32 / steps as f32), depth);
        if let Some((depth, node)) = node.filter(|_| node != last) {
            let row = light.octree.levels()[depth as usize].rows[node];
            if row >= 0 {
                transmittance *= 1.0 - light.rgba[depth as usize][row as usize][3];
            }
        }
        last = node;
    }
    transmittance >= MIN_TRANSMITTANCE
}

#[cfg(test)]
mod tests {
    use lo_geometry::Cube;

    use super::*;
    use crate::free_space;
    use crate::test_scene::{box_room, light_of};

    #[test]
    fn a_lamp_shines_into_the_room_alone() {
        // A bright sheet of 8 × 8 cells below the middle of the cube, seen from below, open above; a dim one beside
        // it.
        let sheet = (0..64).map(|i| ([i / 8, 5, i % 8], [9.0, 9.0, 9.0, 0.99]));
        let cells: Vec<_> = sheet.chain([([3, 0, 3], [0.5, 0.5, 0.5, 0.99])]).collect();
        let light = light_of(&cells, Cube::centred(Vec3::ZERO, 4.0), 3);
        let mut leaves = free_space::leaves(&light, None);
        leaves.iter_mut().for_each(|leaf| leaf.exposed = 0b1111);
        for leaf in lit_sides(&light, &leaves, 1.0, &[Vec3::ZERO]) {
            let expected = if leaf.luminance() > 1.0 { 0b0100 } else { 0b1111 };
            assert_eq!(leaf.exposed, expected, "{leaf:?}");
        }
    }

    #[test]
    fn what_is_behind_a_wall_is_not_seen() {
        // Two bright sheets, one behind the other.
        let cells: Vec<_> = (0..128).map(|i| ([i / 8 % 8, 4 + 2 * (i / 64), i % 8], [9.0, 9.0, 9.0, 0.99])).collect();
        let light = light_of(&cells, Cube::centred(Vec3::new(0.0, 0.3, 0.0), 4.0), 3);
        let mut leaves = free_space::leaves(&light, None);
        leaves.iter_mut().for_each(|leaf| leaf.exposed = 0b1100);
        let lit = lit_sides(&light, &leaves, 1.0, &[Vec3::ZERO]);
        for leaf in lit {
            assert_eq!(leaf.exposed != 0, leaf.xyz[1] == 4, "{leaf:?}");
        }
    }

    #[test]
    fn places_lie_before_what_is_seen() {
        let places = places(&box_room().frame);
        assert_eq!(places[0], Vec3::ZERO);
        assert!(places.len() > 12 && places[1..].iter().all(|p| (p.z + 0.7 * 1.5).abs() < 1e-5));
    }
}
