use lo_geometry::Mat4;

use super::json::{Root, get};
use super::pose::{Pose, parentless};
use crate::MeshError;

/// Largest depth of the node hierarchy.
const MAX_DEPTH: usize = 10_000;

/// A mesh in the scene.
pub(super) struct PlacedMesh {
    pub mesh: usize,
    pub node: usize,
    pub world_from_mesh: Mat4,
}

/// Returns every mesh instance of the scene with its world transform, in f32 as in the file.
pub(super) fn placed_meshes(root: &Root, pose: &Pose) -> Result<Vec<PlacedMesh>, MeshError> {
    let roots: Vec<usize> = match (root.scene, root.scenes.is_empty()) {
        (Some(scene), _) => get(&root.scenes, scene, "scene")?.nodes.clone(),
        (None, false) => root.scenes.iter().flat_map(|scene| scene.nodes.iter().copied()).collect(),
        (None, true) => parentless(root),
    };
    let mut result = Vec::new();
    let mut seen = vec![false; root.nodes.len()];
    let mut stack: Vec<(usize, Mat4, usize)> = roots.into_iter().rev().map(|node| (node, Mat4::IDENTITY, 0)).collect();
    while let Some((index, parent, depth)) = stack.pop() {
        let node = get(&root.nodes, index, "node")?;
        if depth == 0 && seen[index] {
            continue; // Scenes may share a root.
        }
        if std::mem::replace(&mut seen[index], true) || depth > MAX_DEPTH {
            return Err(MeshError::syntax(
                "glTF",
                format!("node {index}"),
                "it has several parents, or the hierarchy is too deep",
            ));
        }
        let world_from_node = parent * pose.locals[index];
        if let Some(mesh) = node.mesh {
            // Skinned vertices follow only their joints.
            let world_from_mesh = if node.skin.is_some() { Mat4::IDENTITY } else { world_from_node };
            result.push(PlacedMesh { mesh, node: index, world_from_mesh });
        }
        stack.extend(node.children.iter().rev().map(|&child| (child, world_from_node, depth + 1)));
    }
    Ok(result)
}
