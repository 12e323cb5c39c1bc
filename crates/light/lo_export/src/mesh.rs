//! The visible faces of the leaves as one mesh whose quads share their corners.

use std::collections::HashMap;

use lo_geometry::{Cube, Vec3};

use crate::free_space::{FACES, Leaf};
use crate::points::Point;

/// Vertices with radiance: quads of two triangles each, or loose points where there are no indices.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Mesh {
    /// Positions in metres.
    pub positions_m: Vec<[f32; 3]>,
    /// Linear RGB radiance of each vertex.
    pub radiance: Vec<[f32; 3]>,
    /// Three vertices a triangle, counter-clockwise seen from the room's air; two triangles a face.
    pub indices: Vec<u32>,
}

/// All exposed faces of the leaves of an octree of `depth`.
///
/// Faces share corners, and a corner has the mean radiance of its faces: a quarter of the bytes of separate quads, and
/// smooth shading between the leaves.
pub(crate) fn from_leaves(leaves: &[Leaf], cube: &Cube, depth: u32) -> Mesh {
    let finest_edge_m = cube.node_edge_m(depth);
    let mut mesh = Mesh::default();
    let mut faces_at: Vec<f32> = Vec::new();
    let mut vertices: HashMap<[u32; 3], u32> = HashMap::new();
    for leaf in leaves {
        for face in leaf.exposed_faces() {
            let corners = corners(leaf.xyz, face).map(|corner| {
                let finest = corner.map(|c| c << (depth - leaf.depth));
                let vertex = *vertices.entry(finest).or_insert_with(|| {
                    let offset_m = Vec3::from(finest.map(|c| c as f32)) * finest_edge_m;
                    mesh.positions_m.push((cube.origin_m + offset_m).to_array());
                    mesh.radiance.push([0.0; 3]);
                    faces_at.push(0.0);
                    mesh.positions_m.len() as u32 - 1
                });
                faces_at[vertex as usize] += 1.0;
                for (sum, c) in mesh.radiance[vertex as usize].iter_mut().zip(leaf.radiance()) {
                    *sum += c;
                }
                vertex
            });
            let [a, b, c, d] = corners;
            mesh.indices.extend([a, b, c, a, c, d]);
        }
    }
    for (radiance, faces) in mesh.radiance.iter_mut().zip(faces_at) {
        *radiance = radiance.map(|sum| sum / faces);
    }
    mesh
}

/// Loose points.
pub(crate) fn from_points(points: &[Point]) -> Mesh {
    Mesh {
        positions_m: points.iter().map(|point| point.position_m.to_array()).collect(),
        radiance: points.iter().map(|point| point.radiance).collect(),
        indices: Vec::new(),
    }
}

/// Corners of a face of the node at `xyz`, counter-clockwise seen from outside.
fn corners(xyz: [u32; 3], face: usize) -> [[u32; 3]; 4] {
    let axis = face / 2;
    let positive = FACES[face][axis] > 0;
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    // Counter-clockwise about +axis, because u × v = +axis; the other way round for the opposite face.
    let turn = if positive { [(0, 0), (1, 0), (1, 1), (0, 1)] } else { [(0, 0), (0, 1), (1, 1), (1, 0)] };
    turn.map(|(du, dv)| {
        let mut corner = xyz;
        corner[axis] += u32::from(positive);
        corner[u] += du;
        corner[v] += dv;
        corner
    })
}
