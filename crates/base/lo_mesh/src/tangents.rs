use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};

use crate::{MeshWarning, Model};

impl Model {
    /// Computes missing tangents for normal textures by Mikkelsen's tangent space. Splits vertices where two tangents
    /// meet.
    ///
    /// Does nothing without normal textures.
    pub fn complete_tangents(&mut self) {
        complete(self);
    }
}

/// Computes tangents that normal textures need and the file lacks, by Mikkelsen's tangent space as specified by glTF.
///
/// Splits vertices where two tangents meet. Drops all tangents if no material has a normal texture.
pub(crate) fn complete(model: &mut Model) {
    let needs: Vec<bool> = model.materials.iter().map(|m| m.normal_texture.is_some()).collect();
    if !model.triangle_materials.iter().any(|&m| needs[m as usize]) {
        model.tangents = Vec::new();
        return;
    }
    for tangent in &mut model.tangents {
        let [x, y, z, w] = *tangent;
        let unit = lo_geometry::Vec3::new(x, y, z).as_dvec3().normalize_or_zero().as_vec3();
        *tangent = [unit.x, unit.y, unit.z, if w < 0.0 { -1.0 } else { 1.0 }];
    }
    model.tangents.resize(model.positions.len(), [0.0; 4]);
    let missing = |&vertex: &u32| model.tangents[vertex as usize][..3] == [0.0; 3];
    let faces: Vec<u32> = (0..model.triangles.len())
        .filter(|&t| needs[model.triangle_materials[t] as usize] && model.triangles[t].iter().any(missing))
        .map(|t| t as u32)
        .collect();
    if faces.is_empty() {
        return;
    }
    let mut corners = TangentGeometry { model, tangents: vec![[0.0; 4]; faces.len() * 3], faces };
    let outcome = generate_tangents(&mut corners);
    let TangentGeometry { faces, tangents, .. } = corners;
    if let Err(error) = outcome {
        // The crate has no error yet. Zero tangents disable the normal texture.
        model.warnings.push(MeshWarning::NormalTextures { reason: error.to_string() });
        return;
    }

    let mut split: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    let mut taken = vec![false; model.positions.len()];
    for (face, tangents) in faces.iter().zip(tangents.chunks_exact(3)) {
        for (side, tangent) in tangents.iter().enumerate() {
            let old = model.triangles[*face as usize][side];
            let new = *split.entry((old, tangent.map(f32::to_bits))).or_insert_with(|| {
                if !std::mem::replace(&mut taken[old as usize], true) {
                    return old;
                }
                copy_vertex(model, old)
            });
            model.tangents[new as usize] = *tangent;
            model.triangles[*face as usize][side] = new;
        }
    }
}

/// Appends a copy of a vertex and returns its index.
fn copy_vertex(model: &mut Model, old: u32) -> u32 {
    let old = old as usize;
    model.positions.push(model.positions[old]);
    model.normals.push(model.normals[old]);
    model.tangents.push(model.tangents[old]);
    for uvs in &mut model.uvs {
        if !uvs.is_empty() {
            uvs.push(uvs[old]);
        }
    }
    if !model.colors.is_empty() {
        model.colors.push(model.colors[old]);
    }
    (model.positions.len() - 1) as u32
}

/// The triangles that need tangents, as input of the tangent space crate.
struct TangentGeometry<'a> {
    model: &'a Model,
    faces: Vec<u32>,
    tangents: Vec<[f32; 4]>,
}

impl TangentGeometry<'_> {
    fn vertex(&self, face: usize, side: usize) -> usize {
        self.model.triangles[self.faces[face] as usize][side] as usize
    }
}

impl Geometry for TangentGeometry<'_> {
    fn num_faces(&self) -> usize {
        self.faces.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, side: usize) -> [f32; 3] {
        self.model.positions[self.vertex(face, side)].to_array()
    }

    fn normal(&self, face: usize, side: usize) -> [f32; 3] {
        self.model.normals[self.vertex(face, side)].to_array()
    }

    fn tex_coord(&self, face: usize, side: usize) -> [f32; 2] {
        let material = self.model.triangle_materials[self.faces[face] as usize] as usize;
        let Some(texture) = &self.model.materials[material].normal_texture else {
            return [0.0; 2];
        };
        let uv = self.model.uvs[texture.uv_set].get(self.vertex(face, side)).copied().unwrap_or_default();
        texture.transform(uv)
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, side: usize) {
        let [x, y, z, sign] = space.unwrap_or_default().tangent_encoded();
        // Our v points down, normal textures have +Y up: the bitangent is opposite to v.
        self.tangents[face * 3 + side] = [x, y, z, -sign];
    }
}
