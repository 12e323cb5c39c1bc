//! Visible faces of the leaves as a mesh of quads with shared corners.

use std::collections::HashMap;

use lo_geometry::{Cube, Vec3};
use lo_imaging::RadianceImage;
use lo_scene::Frame;

use crate::atlas::Atlas;
use crate::free_space::{FACES, Leaf};
use crate::lamps::FaceEmission;

/// Quads with radiance.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct RoomMesh {
    /// Positions in metres.
    pub positions_m: Vec<Vec3>,
    /// Edge of the largest leaf at each position, in metres.
    pub edges_m: Vec<f32>,
    /// Corners of each quad, counter-clockwise seen from free space.
    pub quads: Vec<[u32; 4]>,
    /// Linear RGB radiance at the corners of each quad.
    pub radiance: Vec<[[f32; 3]; 4]>,
}

impl RoomMesh {
    /// Returns the radiance as a texture in the layout of [`Atlas`].
    pub fn texture(&self) -> RadianceImage {
        let quads = self.quads.len();
        Atlas::new(quads).image(quads, [0.0; 3], |quad, corner| self.radiance[quad][corner])
    }
}

/// Creates all exposed faces of the leaves of an octree of `depth`; `kept` is the part of each leaf's radiance that
/// they emit.
///
/// Faces share corners, and a corner has the mean radiance of its faces: smooth shading that keeps the power of a
/// flat wall.
pub(crate) fn from_leaves(leaves: &[Leaf], kept: &[FaceEmission], cube: &Cube, depth: u32) -> RoomMesh {
    let finest_edge_m = cube.node_edge_m(depth);
    let mut mesh = RoomMesh::default();
    let mut sums: Vec<(Vec3, f32)> = Vec::new();
    let mut vertices: HashMap<[u32; 3], u32> = HashMap::new();
    for (leaf, kept) in leaves.iter().zip(kept).filter(|(_, kept)| **kept != FaceEmission::Nothing) {
        let radiance = Vec3::from(kept.of(leaf.radiance()));
        for face in leaf.exposed_faces() {
            let quad = corners(leaf.xyz, face).map(|corner| {
                let finest = corner.map(|c| c << (depth - leaf.depth));
                let vertex = *vertices.entry(finest).or_insert_with(|| {
                    let offset_m = Vec3::from(finest.map(|c| c as f32)) * finest_edge_m;
                    mesh.positions_m.push(cube.origin_m + offset_m);
                    mesh.edges_m.push(0.0);
                    sums.push((Vec3::ZERO, 0.0));
                    mesh.positions_m.len() as u32 - 1
                });
                let edge_m = &mut mesh.edges_m[vertex as usize];
                *edge_m = edge_m.max(leaf.edge_m);
                let (sum, faces) = &mut sums[vertex as usize];
                *sum += radiance;
                *faces += 1.0;
                vertex
            });
            mesh.quads.push(quad);
        }
    }
    let mean = |&vertex: &u32| {
        let (sum, faces) = sums[vertex as usize];
        (sum / faces).to_array()
    };
    mesh.radiance = mesh.quads.iter().map(|quad| quad.each_ref().map(mean)).collect();
    mesh
}

impl RoomMesh {
    /// Moves observed parts along the photo's rays to half a leaf behind the photo's depth. The staircase of leaves
    /// becomes a sheet that closes the gaps of a finer mesh in front of it.
    ///
    /// A vertex moves if it is up to four leaves in front of that position, because the photo observed free space
    /// there. Steps of a floor seen from a low viewpoint are that far in front.
    pub fn move_behind_photo(&mut self, frame: &Frame) {
        let camera = frame.depth_camera();
        let depth_m = &frame.depth_m;
        for (position_m, &edge_m) in self.positions_m.iter_mut().zip(&self.edges_m) {
            let Some((u, v, z)) = camera.project(*position_m).filter(|&(u, v, _)| camera.contains(u, v)) else {
                continue;
            };
            let (x, y) = ((u as usize).min(depth_m.width() - 1), (v as usize).min(depth_m.height() - 1));
            let (seen, z) = (depth_m[(x, y)], z as f32);
            if seen <= 0.0 || seen - z > 4.0 * edge_m {
                continue;
            }
            let columns = x.saturating_sub(1)..(x + 2).min(depth_m.width());
            let near = columns.flat_map(|x| (y.saturating_sub(1)..(y + 2).min(depth_m.height())).map(move |y| (x, y)));
            // The farthest nearby reading of the same surface.
            let farthest = near.map(|at| depth_m[at]).filter(|near| (near - seen).abs() < edge_m).fold(seen, f32::max);
            let behind = farthest + 0.5 * edge_m;
            if z < behind {
                *position_m *= behind / z;
            }
        }
    }
}

/// Returns the corners of a face of the node at `xyz`, counter-clockwise seen from outside.
fn corners(xyz: [u32; 3], face: usize) -> [[u32; 3]; 4] {
    let axis = face / 2;
    let positive = FACES[face][axis] > 0;
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    // Counter-clockwise about +axis, because u × v = +axis; reversed for the opposite face.
    let turn = if positive { [(0, 0), (1, 0), (1, 1), (0, 1)] } else { [(0, 0), (0, 1), (1, 1), (1, 0)] };
    turn.map(|(du, dv)| {
        let mut corner = xyz;
        corner[axis] += u32::from(positive);
        corner[u] += du;
        corner[v] += dv;
        corner
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::box_room;
    use crate::{free_space, lamps};

    fn mesh() -> RoomMesh {
        let scene = box_room();
        let leaves = free_space::leaves(&scene.light, None);
        let kept = lamps::face_emission(&leaves, &[]);
        from_leaves(&leaves, &kept, &scene.light.cube, 3)
    }

    #[test]
    fn the_mesh_is_the_inside_of_the_room() {
        let mesh = mesh();
        // The lattice points on the surface of a box of 6³ cells.
        assert_eq!(mesh.positions_m.len(), 7usize.pow(3) - 5usize.pow(3));
        assert_eq!(mesh.quads.len(), 216);
        assert!(mesh.positions_m.iter().all(|p| p.abs().max_element() == 1.5));
        for quad in &mesh.quads {
            let [a, b, c, d] = quad.map(|i| mesh.positions_m[i as usize]);
            for (a, b, c) in [(a, b, c), (a, c, d)] {
                assert!((b - a).cross(c - a).dot(-(a + b + c)) > 0.0, "{quad:?} is seen from inside");
            }
        }
        // With shared corners, the middle of the lamp has the lamp's radiance, a corner of the room the wall's.
        let at = |p: Vec3| {
            let of_quad = |(quad, radiance): (&[u32; 4], &[[f32; 3]; 4])| {
                quad.iter().position(|&i| mesh.positions_m[i as usize] == p).map(|corner| radiance[corner])
            };
            mesh.quads.iter().zip(&mesh.radiance).find_map(of_quad)
        };
        assert_eq!(at(Vec3::new(0.0, 1.5, 0.0)), Some([10.0, 8.0, 6.0]));
        assert_eq!(at(Vec3::splat(-1.5)), Some([0.5; 3]));
        // One of the four faces at a corner of the lamp is the lamp's.
        let corner = [(10.0 + 1.5) / 4.0, (8.0 + 1.5) / 4.0, (6.0 + 1.5) / 4.0];
        assert_eq!(at(Vec3::new(0.5, 1.5, 0.5)), Some(corner));
    }

    #[test]
    fn what_the_photo_sees_is_drawn_behind_it() {
        let frame = box_room().frame.clone();
        let before = mesh();
        let mut mesh = before.clone();
        mesh.move_behind_photo(&frame);
        // The photo shows a wall at 1.5 m, 8 × 6 pixels with f = 5: every vertex up to four cells in front moves to
        // 1.75 m.
        let mut moved = 0;
        for (old, new) in before.positions_m.iter().zip(&mesh.positions_m) {
            let seen = frame.camera.project(*old).filter(|&(u, v, _)| frame.camera.contains(u, v));
            let (x, y, _) = seen.unwrap_or_default();
            if seen.is_some() {
                assert!((new.z + 1.75).abs() < 1e-5, "{old} {new}");
                let (u, v, _) = frame.camera.project(*new).expect("in front of the camera");
                assert!((u - x).abs() < 1e-4 && (v - y).abs() < 1e-4);
                moved += 1;
            } else {
                assert_eq!(old, new);
            }
        }
        // The rows and columns of the grid within the photo.
        assert!(moved >= 15, "{moved}");
    }
}
