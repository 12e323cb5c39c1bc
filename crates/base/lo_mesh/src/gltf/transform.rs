use lo_geometry::{Mat4, Quat, Vec3};

use super::json::{Node, Root, get};
use crate::MeshError;

/// Deepest chain of nodes that is followed.
const DEEPEST: usize = 10_000;

/// Every node of the scene that shows a mesh, with its world transform (f64 would not help: the file has f32).
pub(super) fn placed_meshes(root: &Root) -> Result<Vec<(usize, Mat4)>, MeshError> {
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
            continue; // Several scenes may share a root.
        }
        if std::mem::replace(&mut seen[index], true) || depth > DEEPEST {
            return Err(MeshError::syntax("glTF", format!("node {index}"), "it hangs on the node tree twice"));
        }
        let world_from_node = parent * local(node);
        if let Some(mesh) = node.mesh {
            // Skinned vertices follow their joints alone; in the bind pose that leaves them where they are.
            result.push((mesh, if node.skin.is_some() { Mat4::IDENTITY } else { world_from_node }));
        }
        stack.extend(node.children.iter().rev().map(|&child| (child, world_from_node, depth + 1)));
    }
    Ok(result)
}

/// Roots of the node forest, for files without a scene.
fn parentless(root: &Root) -> Vec<usize> {
    let mut has_parent = vec![false; root.nodes.len()];
    for &child in root.nodes.iter().flat_map(|node| &node.children) {
        if let Some(flag) = has_parent.get_mut(child) {
            *flag = true;
        }
    }
    (0..root.nodes.len()).filter(|&node| !has_parent[node]).collect()
}

fn local(node: &Node) -> Mat4 {
    if let Some(matrix) = &node.matrix {
        return Mat4::from_cols_array(matrix);
    }
    let rotation = node.rotation.map_or(Quat::IDENTITY, |q| {
        let q = Quat::from_array(q);
        if q.length_squared() > 0.0 && q.is_finite() { q.normalize() } else { Quat::IDENTITY }
    });
    Mat4::from_scale_rotation_translation(
        node.scale.map_or(Vec3::ONE, Vec3::from_array),
        rotation,
        node.translation.map_or(Vec3::ZERO, Vec3::from_array),
    )
}
