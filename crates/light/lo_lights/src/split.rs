use lo_geometry::Vec3;
use lo_octree::LightOctree;

use crate::cap::{cap_of, excess};
use crate::{LightPatch, PatchShape};

/// Splits a lighting octree at the cap into patches of light and the octree without their excess. The two add up to the
/// whole.
///
/// The patches are the faces of bright leaves that border on empty space. For flat and slanted lamps alike, their
/// projections to any direction add up to the lamp's own. `faces_room(position, normal)` distinguishes faces towards
/// the room from those at the back of the shell.
pub fn split_octree(light: &LightOctree, faces_room: impl Fn(Vec3, Vec3) -> bool) -> (Vec<LightPatch>, LightOctree) {
    let cap = cap_of(light);
    let mut emitters = Vec::new();
    let excess = light.merged(|leaf| {
        let excess = excess(light.radiance(leaf), cap);
        if excess != Vec3::ZERO {
            emitters.extend(exposed_faces(light, leaf.depth, light.octree.key(leaf), excess));
        }
        excess
    });
    let rgba = light.rows_with(|depth, row, radiance| radiance - excess[depth][row]);
    let dimmed = LightOctree { rgba, ..light.clone() };
    let inside: Vec<LightPatch> = emitters
        .iter()
        .filter(|e| matches!(e.shape, PatchShape::Square { centre, normal, edge_m } if faces_room(centre + normal * 1.5 * edge_m, normal)))
        .copied()
        .collect();
    // An octree that is not closed has no inside; then all faces count.
    (if inside.is_empty() { emitters } else { inside }, dimmed)
}

/// Returns the faces of a leaf that border on empty nodes, as patches at the centre of the leaf, since the position of
/// the surface in a leaf is unknown.
fn exposed_faces(light: &LightOctree, depth: u32, key: u32, radiance: Vec3) -> impl Iterator<Item = LightPatch> {
    let edge_m = light.cube.node_edge_m(depth);
    let [x, y, z] = lo_octree::xyz_from_key(key).map(|c| c as f32 + 0.5);
    let centre = light.cube.origin_m + Vec3::new(x, y, z) * edge_m;
    exposed_normals(light, depth, centre).map(move |normal| LightPatch {
        shape: PatchShape::Square { centre, normal, edge_m },
        radiance,
        extent: edge_m * edge_m,
    })
}

/// Returns the normals of the faces that border on empty nodes, for the node of this depth and centre.
pub(crate) fn exposed_normals(light: &LightOctree, depth: u32, centre: Vec3) -> impl Iterator<Item = Vec3> {
    let edge_m = light.cube.node_edge_m(depth);
    let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    axes.into_iter().filter(move |normal| {
        light.locate(centre + *normal * edge_m, depth).is_none_or(|(d, node)| light.node_rgba(d, node).is_none())
    })
}
