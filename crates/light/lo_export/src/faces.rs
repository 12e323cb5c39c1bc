use lo_geometry::Vec3;
use lo_octree::{LeafNode, LightOctree};

use crate::free_space;
use crate::lamps::FaceEmission;
use crate::room_mesh;

/// Faces of an octree's leaves towards the room's free space, as exported by [`write`](crate::write).
///
/// Walls have only their inner side: with back-face culling, a viewer outside looks into the room.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoomFaces {
    /// Positions in metres, shared by faces.
    pub positions_m: Vec<Vec3>,
    /// Corners of each face, counter-clockwise seen from free space.
    pub quads: Vec<[u32; 4]>,
    /// The leaf of each face.
    pub leaves: Vec<LeafNode>,
}

impl RoomFaces {
    /// Extracts the faces of an octree with the camera at the origin.
    pub fn of(light: &LightOctree) -> Self {
        let leaves = free_space::leaves(light, None);
        let kept = vec![FaceEmission::All; leaves.len()];
        let mesh = room_mesh::from_leaves(&leaves, &kept, &light.cube, light.octree.depth());
        // The mesh has the faces leaf by leaf.
        let of_faces = leaves.iter().flat_map(|leaf| leaf.exposed_faces().map(|_| leaf.leaf_node()));
        Self { positions_m: mesh.positions_m, quads: mesh.quads, leaves: of_faces.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::box_room;

    #[test]
    fn each_face_is_one_of_its_leaf() {
        let light = box_room().light;
        let faces = RoomFaces::of(&light);
        assert_eq!((faces.quads.len(), faces.leaves.len()), (6 * 36, 6 * 36));
        for (quad, leaf) in faces.quads.iter().zip(&faces.leaves) {
            let key = light.octree.levels()[leaf.depth as usize].keys[leaf.node];
            assert_eq!(light.row(leaf.depth, key), Some(leaf.row));
            let middle_m = quad.iter().map(|&corner| faces.positions_m[corner as usize]).sum::<Vec3>() / 4.0;
            let edge_m = light.cube.node_edge_m(leaf.depth);
            let offset_m = middle_m - light.node_middle_m(leaf.depth, key);
            // The centre of a face is half an edge from the leaf's, on the room's side.
            assert!((offset_m.length() - 0.5 * edge_m).abs() < 1e-6, "{offset_m}");
            assert!(offset_m.dot(-middle_m) > 0.0, "{middle_m}");
        }
    }
}
