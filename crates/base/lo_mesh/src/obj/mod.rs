//! Wavefront OBJ: polygons, texture coordinates, normals, smoothing groups, vertex colours; materials from MTL.

mod lines;
mod mtl;

use std::collections::HashMap;

use lo_geometry::Vec3;

use self::lines::{in_lower_case, logical_lines, without_comment};
use crate::model::Resolver;
use crate::{LoadOptions, Material, MeshError, MeshWarning, Model, normals, polygon};

/// Marks a corner without texture coordinates or normal.
const NONE: u32 = u32::MAX;

/// Reads the model, without checking or completing its vertices.
pub(crate) fn read(bytes: &[u8], resolve: &Resolver, options: &LoadOptions) -> Result<Model, MeshError> {
    let mut file = ObjFile { counts: count_elements(bytes), ..ObjFile::default() };
    let mut model = Model::default();
    for (number, line) in logical_lines(bytes) {
        file.line(number, &line)?;
    }
    let known = mtl::read_libraries(&file.libraries, resolve, bytes.len(), &mut model);
    let mut unknown: Vec<&str> = Vec::new();
    for name in &file.material_names {
        let other_case = || {
            let alike = known.values().filter(|material| material.name.eq_ignore_ascii_case(name));
            alike.min_by(|a, b| a.name.cmp(&b.name))
        };
        model.materials.push(known.get(name.as_str()).or_else(other_case).cloned().unwrap_or_else(|| {
            if !name.is_empty() {
                unknown.push(name);
            }
            Material { name: name.clone(), ..Material::default() }
        }));
    }
    if !unknown.is_empty() && !known.is_empty() {
        model.warnings.push(MeshWarning::UnknownMaterials { names: unknown.iter().map(ToString::to_string).collect() });
    }
    file.into_model(model, options)
}

/// Contents of the lines read so far.
#[derive(Default)]
struct ObjFile {
    /// Number of `v`, `vt` and `vn` lines in the whole file.
    counts: [usize; 3],
    positions: Vec<Vec3>,
    colors: Vec<[f32; 4]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<Vec3>,
    /// Indices of position, texture coordinates and normal of the three corners.
    triangles: Vec<[[u32; 3]; 3]>,
    triangle_materials: Vec<u32>,
    /// Smoothing group (`s`) of each triangle; `None` before the first such line.
    groups: Vec<Option<u32>>,
    group: Option<u32>,
    material: Option<u32>,
    material_names: Vec<String>,
    material_index: HashMap<String, u32>,
    libraries: Vec<String>,
}

impl ObjFile {
    fn line(&mut self, number: usize, line: &str) -> Result<(), MeshError> {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        match &*in_lower_case(keyword) {
            "v" => {
                let (values, count) = numbers::<8>(rest, number)?;
                if count < 3 {
                    return Err(invalid(number, "a vertex needs three coordinates"));
                }
                self.positions.push(Vec3::new(values[0], values[1], values[2]));
                if count == 6 || !self.colors.is_empty() {
                    let rgb = if count == 6 { [values[3], values[4], values[5]] } else { [1.0; 3] };
                    let [r, g, b] = rgb.map(|c| lo_imaging::linear_from_srgb(c.clamp(0.0, 1.0)));
                    self.colors.resize(self.positions.len() - 1, [1.0; 4]);
                    self.colors.push([r, g, b, 1.0]);
                }
            }
            "vt" => {
                let (values, _) = numbers::<3>(rest, number)?;
                self.uvs.push([values[0], 1.0 - values[1]]);
            }
            "vn" => {
                let (values, _) = numbers::<3>(rest, number)?;
                self.normals.push(Vec3::new(values[0], values[1], values[2]));
            }
            "f" | "fo" => self.face(number, rest)?,
            "s" => self.group = Some(if rest.eq_ignore_ascii_case("off") { 0 } else { rest.parse().unwrap_or(0) }),
            "usemtl" => self.material = Some(self.material_named(rest)),
            "mtllib" if !self.libraries.iter().any(|known| known == rest) => self.libraries.push(rest.to_owned()),
            _ => {} // Names, groups, curves, points and lines.
        }
        Ok(())
    }

    fn material_named(&mut self, name: &str) -> u32 {
        if let Some(&index) = self.material_index.get(name) {
            return index;
        }
        let index = self.material_names.len() as u32;
        self.material_names.push(name.to_owned());
        self.material_index.insert(name.to_owned(), index);
        index
    }

    fn face(&mut self, number: usize, rest: &str) -> Result<(), MeshError> {
        let mut corners = Vec::with_capacity(4);
        for word in rest.split_ascii_whitespace() {
            let mut corner = [NONE; 3];
            let so_far = [self.positions.len(), self.uvs.len(), self.normals.len()];
            for (kind, text) in word.split('/').enumerate().filter(|(_, text)| !text.is_empty()) {
                let Some(slot) = corner.get_mut(kind) else {
                    return Err(invalid(number, format!("'{word}' is not a valid face corner")));
                };
                *slot = self.index(number, text, kind, so_far[kind])?;
            }
            if corner[0] == NONE {
                return Err(invalid(number, format!("'{word}' has no vertex index")));
            }
            corners.push(corner);
        }
        let material = match self.material {
            Some(material) => material,
            None => self.material_named(""),
        };
        // A face may refer to vertices that follow later; such polygons are triangulated as fans.
        let points: Option<Vec<Vec3>> = corners.iter().map(|c| self.positions.get(c[0] as usize).copied()).collect();
        let points = points.unwrap_or_else(|| vec![Vec3::ZERO; corners.len()]);
        polygon::triangulate(&points, |corner| {
            self.triangles.push(corner.map(|i| corners[i]));
            self.triangle_materials.push(material);
            self.groups.push(self.group);
        });
        Ok(())
    }

    /// Converts an index of the file (from 1, or backwards from −1) to one counted from 0.
    fn index(&self, number: usize, text: &str, kind: usize, so_far: usize) -> Result<u32, MeshError> {
        let given: i64 = text.parse().map_err(|_| invalid(number, format!("'{text}' is not an index")))?;
        let index = if given < 0 { so_far as i64 + given } else { given - 1 };
        let count = self.counts[kind];
        if index < 0 || index >= count as i64 {
            let kind = ["", " (texture coordinates)", " (normals)"][kind];
            return Err(MeshError::IndexOutOfRange { place: format!("line {number}{kind}"), index, count });
        }
        Ok(index as u32)
    }

    /// Creates a vertex for every combination of position, texture coordinates and normal.
    fn into_model(self, mut model: Model, options: &LoadOptions) -> Result<Model, MeshError> {
        if self.positions.len() >= NONE as usize {
            let limit = u64::from(NONE);
            return Err(MeshError::TooLarge { what: "vertices", count: self.positions.len() as u64, limit });
        }
        if self.triangles.is_empty() {
            let reason = format!(" (it has {} vertices, but no faces)", self.positions.len());
            return Err(MeshError::NoTriangles { reason });
        }
        let by_position: Vec<[u32; 3]> = self.triangles.iter().map(|t| t.map(|corner| corner[0])).collect();
        let needs_normals = self.triangles.iter().flatten().any(|corner| corner[2] == NONE);
        let smooth = needs_normals
            .then(|| normals::smooth(&self.positions, &by_position, options.crease_angle_rad, |t| self.groups[t]));
        let corners = self.triangles.iter().enumerate().flat_map(|(t, corners)| {
            let smooth = smooth.as_ref();
            corners.iter().enumerate().map(move |(side, &[position, uv, normal])| {
                let generated = smooth.filter(|_| normal == NONE).map(|s| s.triangles[t][side]);
                (position, uv, generated.unwrap_or(normal), generated.is_some())
            })
        });
        let (keys, vertices) = normals::unique(corners);
        model.positions = keys.iter().map(|key| self.positions[key.0 as usize]).collect();
        if !self.uvs.is_empty() {
            let uv = |uv: u32| if uv == NONE { [0.0; 2] } else { self.uvs[uv as usize] };
            model.uvs[0] = keys.iter().map(|key| uv(key.1)).collect();
        }
        let normal = |&(_, _, normal, generated): &(u32, u32, u32, bool)| match (&smooth, generated) {
            (Some(smooth), true) => smooth.vertex_normals[normal as usize],
            _ => self.normals[normal as usize],
        };
        model.normals = keys.iter().map(normal).collect();
        if !self.colors.is_empty() {
            model.colors = keys.iter().map(|key| self.colors[key.0 as usize]).collect();
        }
        model.triangles = vertices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        model.triangle_materials = self.triangle_materials;
        Ok(model)
    }
}

fn invalid(line: usize, what: impl Into<String>) -> MeshError {
    MeshError::syntax("OBJ", format!("line {line}"), what)
}

/// Counts `v`, `vt` and `vn` lines; a continuation of the previous line does not count.
fn count_elements(bytes: &[u8]) -> [usize; 3] {
    let mut counts = [0; 3];
    let mut joined = false;
    for line in bytes.split(|&byte| byte == b'\n') {
        let line = without_comment(line);
        if std::mem::replace(&mut joined, line.ends_with(b"\\")) {
            continue;
        }
        match line {
            [b'v' | b'V', b't' | b'T', space, ..] if space.is_ascii_whitespace() => counts[1] += 1,
            [b'v' | b'V', b'n' | b'N', space, ..] if space.is_ascii_whitespace() => counts[2] += 1,
            [b'v' | b'V', space, ..] if space.is_ascii_whitespace() => counts[0] += 1,
            _ => {}
        }
    }
    counts
}

/// Parses up to `N` numbers of a line and returns them with their count; missing ones are 0.
fn numbers<const N: usize>(rest: &str, line: usize) -> Result<([f32; N], usize), MeshError> {
    let mut values = [0.0; N];
    let mut count = 0;
    for (slot, word) in values.iter_mut().zip(rest.split_ascii_whitespace()) {
        *slot = word.parse().map_err(|_| invalid(line, format!("'{word}' is not a number")))?;
        count += 1;
    }
    Ok((values, count))
}

#[cfg(test)]
mod tests;
