use std::collections::HashMap;
use std::collections::hash_map::Entry;

use lo_geometry::Vec3;

use crate::repair::face_normal;

/// Number of faces around a vertex beyond which all count as joined: comparing all pairs would take too long.
const MAX_COMPARED_FACES: usize = 64;

/// A mesh with smooth vertex normals, its vertices split at creases.
pub(crate) struct SmoothedMesh {
    /// For each new vertex, the index of its position.
    pub vertex_positions: Vec<u32>,
    /// For each new vertex, its unit normal (zero if all its faces are degenerate).
    pub vertex_normals: Vec<Vec3>,
    /// Triangles over the new vertices, in the given order.
    pub triangles: Vec<[u32; 3]>,
}

/// Computes smooth vertex normals and splits vertices at creases.
///
/// Around each position, joined faces share one vertex. Its normal is the mean of theirs weighted by the corner angle
/// (Thürmer & Wüthrich 1998). Faces are joined if they meet at less than the crease angle. If `smoothing_group` returns
/// groups, these decide: faces of equal groups are joined, except for group 0.
///
/// Equal positions count as one, whatever their indices, but a new vertex corresponds to exactly one given vertex.
/// Indices must be in range.
pub(crate) fn smooth(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    crease_angle_rad: f32,
    smoothing_group: impl Fn(usize) -> Option<u32>,
) -> SmoothedMesh {
    let (points, point_of) = weld(positions.iter().copied());
    if points.len() == positions.len() {
        return smooth_welded(positions, triangles, crease_angle_rad, smoothing_group);
    }
    let welded: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|vertex| point_of[vertex as usize])).collect();
    let smooth = smooth_welded(&points, &welded, crease_angle_rad, smoothing_group);
    let corners = triangles.iter().flatten().zip(smooth.triangles.iter().flatten());
    let (keys, vertices) = unique(corners.map(|(&given, &cluster)| (given, cluster)));
    SmoothedMesh {
        vertex_positions: keys.iter().map(|&(given, _)| given).collect(),
        vertex_normals: keys.iter().map(|&(_, cluster)| smooth.vertex_normals[cluster as usize]).collect(),
        triangles: vertices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}

/// Returns the distinct points in order of first appearance, and the index there of each given point.
pub(crate) fn weld(points: impl Iterator<Item = Vec3>) -> (Vec<Vec3>, Vec<u32>) {
    // Adding zero turns -0 into 0.
    let (bits, indices) = unique(points.map(|p| (p + Vec3::ZERO).to_array().map(f32::to_bits)));
    (bits.into_iter().map(|p| Vec3::from_array(p.map(f32::from_bits))).collect(), indices)
}

/// Returns the distinct keys in order of first appearance, and the index there of each given key.
pub(crate) fn unique<K: Copy + Eq + std::hash::Hash>(keys: impl Iterator<Item = K>) -> (Vec<K>, Vec<u32>) {
    let mut known: HashMap<K, u32> = HashMap::new();
    let mut distinct = Vec::new();
    let indices = keys
        .map(|key| match known.entry(key) {
            Entry::Occupied(entry) => *entry.get(),
            Entry::Vacant(entry) => {
                distinct.push(key);
                *entry.insert(distinct.len() as u32 - 1)
            }
        })
        .collect();
    (distinct, indices)
}

/// Like [`smooth`], for distinct positions.
fn smooth_welded(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    crease_angle_rad: f32,
    smoothing_group: impl Fn(usize) -> Option<u32>,
) -> SmoothedMesh {
    let faces: Vec<Vec3> =
        triangles.iter().map(|corners| face_normal(corners.map(|vertex| positions[vertex as usize]))).collect();
    let (first, corners) = corners_by_vertex(positions.len(), triangles);
    let least_cos = crease_angle_rad.cos();
    let joined = |a: usize, b: usize| match (smoothing_group(a), smoothing_group(b)) {
        (None, None) => faces[a].dot(faces[b]) >= least_cos,
        (Some(a), Some(b)) => a == b && a != 0,
        _ => false,
    };

    let mut result = SmoothedMesh {
        vertex_positions: Vec::with_capacity(positions.len()),
        vertex_normals: Vec::with_capacity(positions.len()),
        triangles: vec![[0; 3]; triangles.len()],
    };
    let mut cluster: Vec<usize> = Vec::new();
    for position in 0..positions.len() {
        let corners = &corners[first[position] as usize..first[position + 1] as usize];
        cluster.clear();
        cluster.extend(0..corners.len());
        if corners.len() > MAX_COMPARED_FACES {
            cluster.fill(0);
        } else {
            for i in 1..corners.len() {
                for j in 0..i {
                    if cluster[i] != cluster[j] && joined(corners[i] as usize / 3, corners[j] as usize / 3) {
                        let (from, to) = (cluster[i].max(cluster[j]), cluster[i].min(cluster[j]));
                        cluster[..=i].iter_mut().filter(|c| **c == from).for_each(|c| *c = to);
                    }
                }
            }
        }
        for (i, &corner) in corners.iter().enumerate() {
            let (triangle, side) = (corner as usize / 3, corner as usize % 3);
            // The first member of a cluster has the cluster's number.
            let vertex = if cluster[i] == i {
                result.vertex_positions.push(position as u32);
                result.vertex_normals.push(Vec3::ZERO);
                result.vertex_positions.len() as u32 - 1
            } else {
                let leader = corners[cluster[i]] as usize;
                result.triangles[leader / 3][leader % 3]
            };
            result.triangles[triangle][side] = vertex;
            let points = [0, 1, 2].map(|k| positions[triangles[triangle][(side + k) % 3] as usize]);
            result.vertex_normals[vertex as usize] += faces[triangle] * corner_angle_rad(points);
        }
    }
    for normal in &mut result.vertex_normals {
        *normal = normal.normalize_or_zero();
    }
    result
}

/// Angle at the first point, in radians.
fn corner_angle_rad(points: [Vec3; 3]) -> f32 {
    let [a, b, c] = points.map(Vec3::as_dvec3);
    let (u, v) = (b - a, c - a);
    u.cross(v).length().atan2(u.dot(v)) as f32
}

/// Returns the corners (triangle · 3 + side) of each vertex: offsets and list.
fn corners_by_vertex(vertices: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut first = vec![0_u32; vertices + 1];
    for &vertex in triangles.iter().flatten() {
        first[vertex as usize + 1] += 1;
    }
    for vertex in 0..vertices {
        first[vertex + 1] += first[vertex];
    }
    let mut next = first.clone();
    let mut corners = vec![0_u32; triangles.len() * 3];
    for (corner, &vertex) in triangles.iter().flatten().enumerate() {
        corners[next[vertex as usize] as usize] = corner as u32;
        next[vertex as usize] += 1;
    }
    (first, corners)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let positions = (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        (positions, triangles)
    }

    #[test]
    fn a_cube_keeps_its_edges_below_90_degrees() {
        let (positions, triangles) = cube();
        let smooth = smooth(&positions, &triangles, 40_f32.to_radians(), |_| None);
        assert_eq!(smooth.vertex_positions.len(), 24);
        for (corners, old) in smooth.triangles.iter().zip(&triangles) {
            let face = face_normal(old.map(|v| positions[v as usize]));
            for (&new, &old) in corners.iter().zip(old) {
                assert_eq!(smooth.vertex_positions[new as usize], old);
                assert!(smooth.vertex_normals[new as usize].distance(face) < 1e-6);
            }
        }
    }

    #[test]
    fn a_cube_is_round_above_90_degrees_and_in_one_smoothing_group() {
        let (positions, triangles) = cube();
        for (crease_deg, group) in [(91_f32, None), (0.0, Some(3))] {
            let smooth = smooth(&positions, &triangles, crease_deg.to_radians(), |_| group);
            assert_eq!(smooth.vertex_positions.len(), 8);
            for (&position, normal) in smooth.vertex_positions.iter().zip(&smooth.vertex_normals) {
                // By symmetry along the diagonal; the angle weights make the triangulation irrelevant.
                let diagonal = (positions[position as usize] - Vec3::splat(0.5)).normalize();
                assert!(normal.distance(diagonal) < 1e-6, "{normal} against {diagonal}");
            }
        }
    }

    #[test]
    fn group_zero_is_flat() {
        let (positions, triangles) = cube();
        let smooth = smooth(&positions, &triangles, 3.0, |_| Some(0));
        assert_eq!(smooth.vertex_positions.len(), 36);
    }
}
