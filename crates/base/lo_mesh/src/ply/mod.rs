//! PLY, ASCII or binary of either byte order: vertices with normals, colours and texture coordinates, polygons and
//! triangle strips.

mod header;

use lo_geometry::Vec3;

use self::header::{Element, Header, Reader};
use crate::{LoadOptions, MeshError, MeshWarning, Model, normals, polygon, repair};

/// Reads the model, without checking or completing its vertices.
pub(crate) fn read(bytes: &[u8], options: &LoadOptions) -> Result<Model, MeshError> {
    let (header, body) = Header::parse(bytes)?;
    header.check_counts(body.len())?;
    let mut reader = Reader::new(header.format, body, bytes.len() - body.len());
    let mut file = PlyFile::default();
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" => file.read_vertices(element, &mut reader)?,
            "face" | "tristrips" => file.read_faces(element, &mut reader)?,
            _ => skip(element, &mut reader)?,
        }
    }
    let mut model = file.into_model(options)?;
    if let Some(texture) = header.texture_file {
        model.warnings.push(MeshWarning::TextureInComment { file: texture.to_string() });
    }
    Ok(model)
}

#[derive(Default)]
struct PlyFile {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    colors: Vec<[f32; 4]>,
    uvs: Vec<[f32; 2]>,
    triangles: Vec<[u32; 3]>,
    has_faces: bool,
    warnings: Vec<MeshWarning>,
}

/// Property names of each vertex attribute.
const ROLES: [&[&str]; 12] = [
    &["x"],
    &["y"],
    &["z"],
    &["nx", "normal_x"],
    &["ny", "normal_y"],
    &["nz", "normal_z"],
    &["red", "diffuse_red", "r"],
    &["green", "diffuse_green", "g"],
    &["blue", "diffuse_blue", "b"],
    &["alpha", "a"],
    &["s", "u", "texture_u", "texture_s"],
    &["t", "v", "texture_v", "texture_t"],
];

impl PlyFile {
    fn read_vertices(&mut self, element: &Element, reader: &mut Reader) -> Result<(), MeshError> {
        let role = |name: &str| ROLES.iter().position(|names| names.contains(&name));
        let roles: Vec<Option<usize>> = element.properties.iter().map(|p| role(&p.name)).collect();
        let has = |wanted: &[usize]| wanted.iter().all(|&role| roles.contains(&Some(role)));
        if !has(&[0, 1, 2]) {
            return Err(MeshError::syntax("PLY", "header", "the vertices have no x, y and z"));
        }
        let (has_normals, has_colors, has_uvs) = (has(&[3, 4, 5]), has(&[6, 7, 8]), has(&[10, 11]));
        // Integer colours are 8- or 16-bit codes, floats are from 0 to 1; both are sRGB.
        let mut scales = [1.0; 12];
        for (property, role) in element.properties.iter().zip(&roles) {
            if let Some(role @ 6..=9) = *role {
                scales[role] = property.kind.largest_code().map_or(1.0, f64::recip);
            }
        }
        self.positions.reserve(element.count);
        for _ in 0..element.count {
            let mut values = [0.0_f64; 12];
            values[9] = 1.0 / scales[9];
            for (property, role) in element.properties.iter().zip(&roles) {
                if let Some(length) = property.length {
                    reader.skip_list(length, property.kind)?;
                    continue;
                }
                let value = reader.value(property.kind)?;
                if let Some(role) = *role {
                    values[role] = value;
                }
            }
            let vector =
                |first: usize| Vec3::new(values[first] as f32, values[first + 1] as f32, values[first + 2] as f32);
            self.positions.push(vector(0));
            if has_normals {
                self.normals.push(vector(3));
            }
            if has_colors {
                let [r, g, b] =
                    [6, 7, 8].map(|c| lo_imaging::linear_from_srgb((values[c] * scales[c]).clamp(0.0, 1.0) as f32));
                self.colors.push([r, g, b, (values[9] * scales[9]).clamp(0.0, 1.0) as f32]);
            }
            if has_uvs {
                // PLY's v points up.
                self.uvs.push([values[10] as f32, 1.0 - values[11] as f32]);
            }
        }
        Ok(())
    }

    fn read_faces(&mut self, element: &Element, reader: &mut Reader) -> Result<(), MeshError> {
        self.has_faces |= element.count > 0;
        let strips = element.name == "tristrips";
        let is_indices = |name: &str| name == "vertex_indices" || name == "vertex_index";
        let wedges = element.properties.iter().any(|p| p.name == "texcoord");
        if wedges && element.count > 0 {
            self.warnings.push(MeshWarning::FaceTextureCoordinates);
        }
        let mut corners: Vec<i64> = Vec::new();
        for face in 0..element.count {
            for property in &element.properties {
                match property.length {
                    Some(length) if is_indices(&property.name) => {
                        reader.list(length, property.kind, &mut corners)?;
                        if strips { self.strip(&corners, face)? } else { self.polygon(&corners, face)? }
                    }
                    Some(length) => reader.skip_list(length, property.kind)?,
                    None => {
                        reader.value(property.kind)?;
                    }
                }
            }
        }
        Ok(())
    }

    fn check(&self, index: i64, face: usize) -> Result<u32, MeshError> {
        let count = self.positions.len();
        if index < 0 || index >= count as i64 {
            return Err(MeshError::IndexOutOfRange { place: format!("face {face}"), index, count });
        }
        Ok(index as u32)
    }

    fn polygon(&mut self, corners: &[i64], face: usize) -> Result<(), MeshError> {
        if let [a, b, c] = *corners {
            self.triangles.push([self.check(a, face)?, self.check(b, face)?, self.check(c, face)?]);
            return Ok(());
        }
        let corners = corners.iter().map(|&index| self.check(index, face)).collect::<Result<Vec<_>, _>>()?;
        let points: Vec<Vec3> = corners.iter().map(|&index| self.positions[index as usize]).collect();
        polygon::triangulate(&points, |t| self.triangles.push(t.map(|i| corners[i])));
        Ok(())
    }

    /// Adds triangle strips, separated by −1.
    fn strip(&mut self, corners: &[i64], face: usize) -> Result<(), MeshError> {
        for strip in corners.split(|&index| index == -1) {
            let strip = strip.iter().map(|&index| self.check(index, face)).collect::<Result<Vec<_>, _>>()?;
            let turned = strip.windows(3).enumerate();
            self.triangles
                .extend(turned.map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] }));
        }
        Ok(())
    }

    fn into_model(self, options: &LoadOptions) -> Result<Model, MeshError> {
        if self.triangles.is_empty() {
            let reason = match (self.positions.len(), self.has_faces) {
                (0, _) => String::new(),
                (count, false) => format!(": it is a point cloud of {count} points without faces"),
                (_, true) => ": its faces have fewer than three corners".to_owned(),
            };
            return Err(MeshError::NoTriangles { reason });
        }
        let triangle_materials = vec![0; self.triangles.len()];
        let mut model = Model { triangle_materials, warnings: self.warnings, ..Model::default() };
        if self.normals.len() == self.positions.len() {
            model.positions = self.positions;
            model.normals = self.normals;
            model.colors = self.colors;
            model.uvs[0] = self.uvs;
            model.triangles = self.triangles;
            return Ok(model);
        }
        repair::check_indices(&self.triangles, self.positions.len())?;
        let smooth = normals::smooth(&self.positions, &self.triangles, options.crease_angle_rad, |_| None);
        let given = &smooth.vertex_positions;
        fn gather<T: Copy>(list: &[T], given: &[u32]) -> Vec<T> {
            if list.is_empty() { Vec::new() } else { given.iter().map(|&vertex| list[vertex as usize]).collect() }
        }
        model.positions = gather(&self.positions, given);
        model.colors = gather(&self.colors, given);
        model.uvs[0] = gather(&self.uvs, given);
        model.normals = smooth.vertex_normals;
        model.triangles = smooth.triangles;
        Ok(model)
    }
}

fn skip(element: &Element, reader: &mut Reader) -> Result<(), MeshError> {
    for _ in 0..element.count {
        for property in &element.properties {
            match property.length {
                Some(length) => reader.skip_list(length, property.kind)?,
                None => {
                    reader.value(property.kind)?;
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
