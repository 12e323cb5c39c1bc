use lo_geometry::{DVec3, Mat3, Mat4, Vec3};

use super::buffers::Buffers;
use super::json::{Primitive, Root, get};
use super::pose::{Pose, skinning};
use super::transform::{PlacedMesh, placed_meshes};
use crate::{MeshError, MeshWarning, Model};

/// Appends all triangle primitives of the scene to the model, in a pose and in world coordinates.
pub(super) fn read(
    root: &Root,
    buffers: &Buffers,
    pose: &Pose,
    limit: u64,
    model: &mut Model,
) -> Result<(), MeshError> {
    let default_material = model.materials.len() as u32 - 1;
    let mut skipped = 0;
    for PlacedMesh { mesh: mesh_index, node, world_from_mesh } in placed_meshes(root, pose)? {
        let deformation = Deformation {
            weights: pose.morph_weights(root, node),
            joints: match root.nodes[node].skin {
                Some(skin) => Some(pose.joints(root, buffers, skin, limit)?),
                None => None,
            },
        };
        let mesh = get(&root.meshes, mesh_index, "mesh")?;
        for (primitive_index, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("mesh {mesh_index} '{}', primitive {primitive_index}", mesh.name);
            if primitive.extensions.draco.is_some() && !primitive.attributes.contains_key("POSITION") {
                return Err(MeshError::UnsupportedExtension {
                    name: "KHR_draco_mesh_compression".to_owned(),
                    remedy: "export without Draco compression",
                });
            }
            if !(4..=6).contains(&primitive.mode) {
                skipped += 1;
                continue;
            }
            let left = limit.saturating_sub(model.positions.len().max(model.triangles.len()) as u64);
            let material = match primitive.material {
                Some(material) => {
                    get(&root.materials, material, "material")?;
                    material as u32
                }
                None => default_material,
            };
            let mut mesh = read_primitive(primitive, buffers, &deformation, left, &place)?;
            mesh.transform(&world_from_mesh);
            append(model, mesh, material);
        }
    }
    if skipped > 0 {
        model.warnings.push(MeshWarning::PointsOrLines { primitives: skipped });
    }
    Ok(())
}

/// Movement of the vertices of a mesh within it.
struct Deformation<'a> {
    /// Weights of the morph targets.
    weights: &'a [f32],
    /// Transforms of the skin's joints.
    joints: Option<Vec<Mat4>>,
}

/// One primitive with its own vertices.
struct PrimitiveMesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    tangents: Vec<[f32; 4]>,
    uvs: [Vec<[f32; 2]>; 2],
    colors: Vec<[f32; 4]>,
    triangles: Vec<[u32; 3]>,
}

fn read_primitive(
    primitive: &Primitive,
    buffers: &Buffers,
    deformation: &Deformation<'_>,
    limit: u64,
    place: &str,
) -> Result<PrimitiveMesh, MeshError> {
    let attribute = |name: &str| primitive.attributes.get(name).copied();
    let Some(position) = attribute("POSITION") else {
        return Err(MeshError::syntax("glTF", place, "it has no POSITION attribute"));
    };
    let positions: Vec<Vec3> = buffers.floats::<3>(position, limit)?.into_iter().map(Vec3::from_array).collect();
    let count = positions.len();
    let same_length = |name: &str, length: usize| {
        let what = format!("{length} values of {name} for {count} positions");
        if length == count { Ok(()) } else { Err(MeshError::syntax("glTF", place, what)) }
    };
    let mut part = PrimitiveMesh {
        positions,
        normals: Vec::new(),
        tangents: Vec::new(),
        uvs: [Vec::new(), Vec::new()],
        colors: Vec::new(),
        triangles: Vec::new(),
    };
    if let Some(accessor) = attribute("NORMAL") {
        part.normals = buffers.floats::<3>(accessor, limit)?.into_iter().map(Vec3::from_array).collect();
        same_length("NORMAL", part.normals.len())?;
        // By the specification, tangents are ignored without normals.
        if let Some(accessor) = attribute("TANGENT") {
            part.tangents = buffers.floats::<4>(accessor, limit)?;
            same_length("TANGENT", part.tangents.len())?;
        }
    }
    for (set, name) in ["TEXCOORD_0", "TEXCOORD_1"].into_iter().enumerate() {
        if let Some(accessor) = attribute(name) {
            part.uvs[set] = buffers.floats::<2>(accessor, limit)?;
            same_length(name, part.uvs[set].len())?;
        }
    }
    if let Some(accessor) = attribute("COLOR_0") {
        part.colors = if buffers.components(accessor)? == 3 {
            buffers.floats::<3>(accessor, limit)?.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
        } else {
            buffers.floats::<4>(accessor, limit)?
        };
        same_length("COLOR_0", part.colors.len())?;
    }
    part.deform(primitive, buffers, deformation, limit, place)?;
    let indices = match primitive.indices {
        Some(accessor) => buffers.indices(accessor, limit.saturating_mul(3))?,
        None => (0..count as u32).collect(),
    };
    if let Some(&index) = indices.iter().find(|&&index| index as usize >= count) {
        return Err(MeshError::IndexOutOfRange { place: place.to_owned(), index: i64::from(index), count });
    }
    part.triangles = assemble(primitive.mode, &indices);
    if part.triangles.len() as u64 > limit {
        return Err(MeshError::TooLarge { what: "triangles", count: part.triangles.len() as u64, limit });
    }
    if part.normals.is_empty() {
        part.flatten();
    }
    Ok(part)
}

/// Assembles the triangles of a list (mode 4), a strip (5) or a fan (6).
fn assemble(mode: u32, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        4 => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        5 => indices
            .windows(3)
            .enumerate()
            .map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] })
            .collect(),
        _ => indices.windows(2).skip(1).map(|t| [indices[0], t[0], t[1]]).collect(),
    }
}

impl PrimitiveMesh {
    /// Applies morph targets, then the skin.
    fn deform(
        &mut self,
        primitive: &Primitive,
        buffers: &Buffers,
        deformation: &Deformation<'_>,
        limit: u64,
        place: &str,
    ) -> Result<(), MeshError> {
        for (target, &weight) in primitive.targets.iter().zip(deformation.weights).filter(|(_, weight)| **weight != 0.0)
        {
            for (name, values) in [("POSITION", &mut self.positions), ("NORMAL", &mut self.normals)] {
                let Some(&accessor) = target.get(name).filter(|_| !values.is_empty()) else { continue };
                let offsets = buffers.floats::<3>(accessor, limit)?;
                if offsets.len() != values.len() {
                    let what = format!("{} values of a morph target's {name} for {}", offsets.len(), values.len());
                    return Err(MeshError::syntax("glTF", place, what));
                }
                values.iter_mut().zip(offsets).for_each(|(value, offset)| *value += weight * Vec3::from(offset));
            }
        }
        let Some(joints) = &deformation.joints else { return Ok(()) };
        let attribute = |name: &str| primitive.attributes.get(name).copied();
        let count = self.positions.len();
        let Some(transforms) = skinning(&attribute, buffers, joints, count, limit, place)? else { return Ok(()) };
        for (i, transform) in transforms.iter().enumerate() {
            self.positions[i] = transform.transform_point3(self.positions[i]);
            let turn = Turn::of(transform);
            self.normals.get_mut(i).into_iter().for_each(|normal| *normal = turn.normal(*normal));
            self.tangents.get_mut(i).into_iter().for_each(|tangent| *tangent = turn.tangent(*tangent));
        }
        Ok(())
    }

    /// Splits vertices so that every triangle has its own: flat shading, as specified for missing normals.
    fn flatten(&mut self) {
        fn gather<T: Copy>(list: &mut Vec<T>, triangles: &[[u32; 3]]) {
            if !list.is_empty() {
                *list = triangles.iter().flatten().map(|&vertex| list[vertex as usize]).collect();
            }
        }
        gather(&mut self.positions, &self.triangles);
        for uvs in &mut self.uvs {
            gather(uvs, &self.triangles);
        }
        gather(&mut self.colors, &self.triangles);
        self.triangles = (0..self.triangles.len() as u32).map(|t| [t * 3, t * 3 + 1, t * 3 + 2]).collect();
        // Zero normals are replaced by face normals when the model is completed.
        self.normals = vec![Vec3::ZERO; self.positions.len()];
    }

    /// Transforms the primitive to world coordinates; a mirroring transform flips the winding.
    fn transform(&mut self, world_from_mesh: &Mat4) {
        let turn = Turn::of(world_from_mesh);
        self.positions.iter_mut().for_each(|position| *position = world_from_mesh.transform_point3(*position));
        self.normals.iter_mut().for_each(|normal| *normal = turn.normal(*normal));
        self.tangents.iter_mut().for_each(|tangent| *tangent = turn.tangent(*tangent));
        if turn.sign < 0.0 {
            for triangle in &mut self.triangles {
                triangle.swap(1, 2);
            }
        }
    }
}

/// The linear part of a transform, for normals and tangents.
struct Turn {
    linear: Mat3,
    /// Cofactors of `linear`: they transform normals correctly, even for singular transforms.
    cofactors: [DVec3; 3],
    /// −1 for mirroring transforms.
    sign: f64,
}

impl Turn {
    fn of(transform: &Mat4) -> Self {
        let linear = Mat3::from_mat4(*transform);
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis].map(Vec3::as_dvec3);
        let sign = if linear.as_dmat3().determinant() < 0.0 { -1.0 } else { 1.0 };
        Self { linear, cofactors: [y.cross(z) * sign, z.cross(x) * sign, x.cross(y) * sign], sign }
    }

    fn normal(&self, normal: Vec3) -> Vec3 {
        let n = normal.as_dvec3();
        let [x, y, z] = self.cofactors;
        (x * n.x + y * n.y + z * n.z).normalize_or_zero().as_vec3()
    }

    fn tangent(&self, tangent: [f32; 4]) -> [f32; 4] {
        let turned = (self.linear * Vec3::new(tangent[0], tangent[1], tangent[2])).normalize_or_zero();
        [turned.x, turned.y, turned.z, tangent[3] * self.sign as f32]
    }
}

/// Appends the primitive to the model. An attribute that only one of them has is padded for the other.
fn append(model: &mut Model, part: PrimitiveMesh, material: u32) {
    fn join<T: Copy>(all: &mut Vec<T>, before: usize, new: Vec<T>, added: usize, missing: T) {
        if all.is_empty() && new.is_empty() {
            return;
        }
        all.resize(before, missing);
        all.extend(new);
        all.resize(before + added, missing);
    }
    let (before, added) = (model.positions.len(), part.positions.len());
    model.positions.extend(part.positions);
    model.normals.extend(part.normals);
    join(&mut model.tangents, before, part.tangents, added, [0.0; 4]);
    for (all, new) in model.uvs.iter_mut().zip(part.uvs) {
        join(all, before, new, added, [0.0; 2]);
    }
    join(&mut model.colors, before, part.colors, added, [1.0; 4]);
    model.triangle_materials.resize(model.triangles.len() + part.triangles.len(), material);
    model.triangles.extend(part.triangles.iter().map(|t| t.map(|vertex| vertex + before as u32)));
}
