//! Poses of a model: transforms of its nodes, skins and morph targets, at rest or at a time of an animation.

use lo_geometry::{Mat4, Quat, Vec3};

use super::buffers::Buffers;
use super::json::{Animation, AnimationSampler, Node, Root, get};
use crate::MeshError;

/// Largest number of joints that a vertex has, and their attributes, of four each.
const JOINT_SETS: usize = 2;

/// Where nodes, joints and morph targets are.
pub(super) struct Pose {
    /// Transform of each node in its parent.
    pub locals: Vec<Mat4>,
    /// Weights of the morph targets of each node's mesh, if the node has its own.
    weights: Vec<Option<Vec<f32>>>,
    /// Transform of each node in the world.
    world_from_nodes: Vec<Mat4>,
}

/// Translation, rotation and scale of a node.
#[derive(Clone, Copy)]
struct Transform {
    translation: Vec3,
    rotation: Quat,
    scale: Vec3,
}

impl Pose {
    /// Returns the pose without animation.
    pub fn rest(root: &Root) -> Self {
        let locals = root.nodes.iter().map(local).collect();
        Self::new(root, locals, root.nodes.iter().map(|node| node.weights.clone()).collect())
    }

    /// Returns the pose at a time of animations, in seconds. Before the first and after the last key, it is as there.
    pub fn at(
        root: &Root,
        buffers: &Buffers,
        animations: &[&Animation],
        time_s: f32,
        limit: u64,
    ) -> Result<Self, MeshError> {
        let Self { mut locals, mut weights, .. } = Self::rest(root);
        let mut moved: Vec<Option<Transform>> = vec![None; root.nodes.len()];
        let channels = animations.iter().flat_map(|animation| {
            animation.channels.iter().enumerate().map(move |(index, channel)| (animation, index, channel))
        });
        for (animation, index, channel) in channels {
            let Some(target) = channel.target.node else { continue };
            let node = get(&root.nodes, target, "node")?;
            let place = format!("animation '{}', channel {index}", animation.name);
            let sampler = get(&animation.samplers, channel.sampler, "animation sampler")?;
            let keys = Keys::at(sampler, buffers, time_s, limit, &place)?;
            let transform = moved[target].get_or_insert_with(|| Transform::of(node));
            match channel.target.path.as_str() {
                "translation" => transform.translation = Vec3::from_array(keys.vector(buffers, sampler, &place)?),
                "scale" => transform.scale = Vec3::from_array(keys.vector(buffers, sampler, &place)?),
                "rotation" => transform.rotation = keys.rotation(buffers, sampler, &place)?,
                "weights" => {
                    let count = node.mesh.map_or(Ok(0), |mesh| Ok(get(&root.meshes, mesh, "mesh")?.morph_targets()))?;
                    weights[target] = Some(keys.weights(buffers, sampler, count, &place)?);
                }
                // Other paths come from extensions.
                _ => {}
            }
        }
        for (local, moved) in locals.iter_mut().zip(moved) {
            if let Some(moved) = moved {
                *local = moved.matrix();
            }
        }
        Ok(Self::new(root, locals, weights))
    }

    fn new(root: &Root, locals: Vec<Mat4>, weights: Vec<Option<Vec<f32>>>) -> Self {
        let world_from_nodes = world_from_nodes(root, &locals);
        Self { locals, weights, world_from_nodes }
    }

    /// Returns the weights of the morph targets of a node's mesh.
    pub fn morph_weights<'a>(&'a self, root: &'a Root, node: usize) -> &'a [f32] {
        let own = self.weights.get(node).and_then(Option::as_deref);
        let of_mesh = || root.nodes[node].mesh.and_then(|mesh| root.meshes.get(mesh)).map(|mesh| &mesh.weights[..]);
        own.or_else(of_mesh).unwrap_or(&[])
    }

    /// Returns the transforms of a skin's joints from the mesh to the world.
    pub fn joints(&self, root: &Root, buffers: &Buffers, skin: usize, limit: u64) -> Result<Vec<Mat4>, MeshError> {
        let of = get(&root.skins, skin, "skin")?;
        let inverse: Vec<Mat4> = match of.inverse_bind_matrices {
            Some(accessor) => {
                let matrices = buffers.floats::<16>(accessor, limit)?;
                matrices.iter().map(Mat4::from_cols_array).collect()
            }
            None => vec![Mat4::IDENTITY; of.joints.len()],
        };
        if inverse.len() < of.joints.len() {
            let what = format!("{} inverse bind matrices for {} joints", inverse.len(), of.joints.len());
            return Err(MeshError::syntax("glTF", format!("skin {skin}"), what));
        }
        let joint = |(&node, inverse): (&usize, &Mat4)| {
            get(&root.nodes, node, "node").map(|_| self.world_from_nodes[node] * *inverse)
        };
        of.joints.iter().zip(&inverse).map(joint).collect()
    }
}

/// Returns the transform of each vertex of a skinned primitive, or `None` without joints.
pub(super) fn skinning(
    attribute: &dyn Fn(&str) -> Option<usize>,
    buffers: &Buffers,
    joints: &[Mat4],
    count: usize,
    limit: u64,
    place: &str,
) -> Result<Option<Vec<Mat4>>, MeshError> {
    let mut transforms: Option<Vec<(Mat4, f32)>> = None;
    for set in 0..JOINT_SETS {
        let names = [format!("JOINTS_{set}"), format!("WEIGHTS_{set}")];
        let [Some(indices), Some(weights)] = [0, 1].map(|i: usize| attribute(&names[i])) else { continue };
        let (indices, weights) = (buffers.floats::<4>(indices, limit)?, buffers.floats::<4>(weights, limit)?);
        for (name, length) in names.iter().zip([indices.len(), weights.len()]) {
            if length != count {
                let what = format!("{length} values of {name} for {count} positions");
                return Err(MeshError::syntax("glTF", place, what));
            }
        }
        let sums = transforms.get_or_insert_with(|| vec![(Mat4::ZERO, 0.0); count]);
        for (sum, (indices, weights)) in sums.iter_mut().zip(indices.iter().zip(&weights)) {
            for (&index, &weight) in indices.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
                let joint = joints.get(index as usize).ok_or_else(|| MeshError::IndexOutOfRange {
                    place: format!("{place}, {}", names[0]),
                    index: index as i64,
                    count: joints.len(),
                })?;
                *sum = (sum.0 + *joint * weight, sum.1 + weight);
            }
        }
    }
    // Weights need not add up to 1 in every file; a vertex without any stays.
    let normalised = |(sum, weight): (Mat4, f32)| if weight > 0.0 { sum * (1.0 / weight) } else { Mat4::IDENTITY };
    Ok(transforms.map(|sums| sums.into_iter().map(normalised).collect()))
}

/// The keys of a sampler around a time.
struct Keys {
    before: usize,
    after: usize,
    /// Share of the way from one to the other.
    share: f32,
    /// Time between them, seconds.
    span_s: f32,
    count: usize,
}

impl Keys {
    fn at(
        sampler: &AnimationSampler,
        buffers: &Buffers,
        time_s: f32,
        limit: u64,
        place: &str,
    ) -> Result<Self, MeshError> {
        let times: Vec<f32> = buffers.floats::<1>(sampler.input, limit)?.into_iter().map(|[time]| time).collect();
        let is_ordered = times.windows(2).all(|pair| pair[0] < pair[1]) && times.iter().all(|time| time.is_finite());
        if times.is_empty() || !is_ordered {
            return Err(MeshError::syntax("glTF", place, "its times do not increase, or there are none"));
        }
        let after = times.partition_point(|&time| time <= time_s);
        let (before, after) = (after.saturating_sub(1), after.min(times.len() - 1));
        let span_s = times[after] - times[before];
        let share = if span_s > 0.0 { ((time_s - times[before]) / span_s).clamp(0.0, 1.0) } else { 0.0 };
        Ok(Self { before, after, share, span_s, count: times.len() })
    }

    /// Interpolates between values, `values` per key: three for cubic splines (in-tangent, value, out-tangent).
    fn interpolated<const N: usize>(
        &self,
        outputs: &[[f32; N]],
        width: usize,
        sampler: &AnimationSampler,
        place: &str,
    ) -> Result<Vec<[f32; N]>, MeshError> {
        let is_cubic = sampler.interpolation == "CUBICSPLINE";
        let parts = if is_cubic { 3 } else { 1 };
        if outputs.len() != self.count * width * parts {
            let what = format!("{} values for {} keys", outputs.len(), self.count);
            return Err(MeshError::syntax("glTF", place, what));
        }
        let value = |key: usize, part: usize, i: usize| outputs[(key * parts + part) * width + i];
        let t = self.share;
        let mix = |terms: &[([f32; N], f32)]| {
            std::array::from_fn(|c| terms.iter().map(|(value, weight)| value[c] * weight).sum())
        };
        let at = |i: usize| match sampler.interpolation.as_str() {
            "STEP" => value(self.before, 0, i),
            "CUBICSPLINE" => {
                // glTF 2.0, appendix C: Hermite basis, tangents per second.
                let (t2, t3) = (t * t, t * t * t);
                mix(&[
                    (value(self.before, 1, i), 2.0 * t3 - 3.0 * t2 + 1.0),
                    (value(self.before, 2, i), (t3 - 2.0 * t2 + t) * self.span_s),
                    (value(self.after, 1, i), -2.0 * t3 + 3.0 * t2),
                    (value(self.after, 0, i), (t3 - t2) * self.span_s),
                ])
            }
            _ => mix(&[(value(self.before, 0, i), 1.0 - t), (value(self.after, 0, i), t)]),
        };
        Ok((0..width).map(at).collect())
    }

    fn vector(&self, buffers: &Buffers, sampler: &AnimationSampler, place: &str) -> Result<[f32; 3], MeshError> {
        let outputs = buffers.floats::<3>(sampler.output, 3 * self.count as u64)?;
        Ok(self.interpolated(&outputs, 1, sampler, place)?[0])
    }

    fn rotation(&self, buffers: &Buffers, sampler: &AnimationSampler, place: &str) -> Result<Quat, MeshError> {
        let outputs = buffers.floats::<4>(sampler.output, 3 * self.count as u64)?;
        let blended = self.interpolated(&outputs, 1, sampler, place)?[0];
        if sampler.interpolation == "LINEAR" {
            let [a, b] = [self.before, self.after].map(|key| unit(outputs[key]));
            // By the shorter way.
            return Ok(a.slerp(if a.dot(b) < 0.0 { -b } else { b }, self.share).normalize());
        }
        Ok(unit(blended))
    }

    fn weights(
        &self,
        buffers: &Buffers,
        sampler: &AnimationSampler,
        targets: usize,
        place: &str,
    ) -> Result<Vec<f32>, MeshError> {
        let outputs = buffers.floats::<1>(sampler.output, 3 * (self.count * targets.max(1)) as u64)?;
        Ok(self.interpolated(&outputs, targets, sampler, place)?.into_iter().map(|[weight]| weight).collect())
    }
}

impl Animation {
    /// Returns the time of its last key, seconds.
    pub fn duration_s(&self, buffers: &Buffers, limit: u64) -> Result<f32, MeshError> {
        let mut last_s = 0.0f32;
        for sampler in &self.samplers {
            let times = buffers.floats::<1>(sampler.input, limit)?;
            last_s = times.into_iter().map(|[time]| time).filter(|time| time.is_finite()).fold(last_s, f32::max);
        }
        Ok(last_s)
    }
}

impl Transform {
    fn of(node: &Node) -> Self {
        if let Some(matrix) = &node.matrix {
            let (scale, rotation, translation) = Mat4::from_cols_array(matrix).to_scale_rotation_translation();
            return Self { translation, rotation, scale };
        }
        Self {
            translation: node.translation.map_or(Vec3::ZERO, Vec3::from_array),
            rotation: node.rotation.map_or(Quat::IDENTITY, unit),
            scale: node.scale.map_or(Vec3::ONE, Vec3::from_array),
        }
    }

    fn matrix(&self) -> Mat4 {
        Mat4::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

fn local(node: &Node) -> Mat4 {
    node.matrix.as_ref().map_or_else(|| Transform::of(node).matrix(), Mat4::from_cols_array)
}

fn unit(quaternion: [f32; 4]) -> Quat {
    let q = Quat::from_array(quaternion);
    if q.length_squared() > 0.0 && q.is_finite() { q.normalize() } else { Quat::IDENTITY }
}

/// Returns the world transform of each node. A node within a cycle has that of its own.
fn world_from_nodes(root: &Root, locals: &[Mat4]) -> Vec<Mat4> {
    let mut world = locals.to_vec();
    let mut seen = vec![false; locals.len()];
    let mut stack: Vec<(usize, Mat4)> = parentless(root).into_iter().map(|node| (node, Mat4::IDENTITY)).collect();
    while let Some((node, parent)) = stack.pop() {
        if seen.get(node).is_none_or(|&seen| seen) {
            continue;
        }
        seen[node] = true;
        world[node] = parent * locals[node];
        stack.extend(root.nodes[node].children.iter().map(|&child| (child, world[node])));
    }
    world
}

/// Returns the nodes without a parent, as roots of files without a scene.
pub(super) fn parentless(root: &Root) -> Vec<usize> {
    let mut has_parent = vec![false; root.nodes.len()];
    for &child in root.nodes.iter().flat_map(|node| &node.children) {
        if let Some(flag) = has_parent.get_mut(child) {
            *flag = true;
        }
    }
    (0..root.nodes.len()).filter(|&node| !has_parent[node]).collect()
}
