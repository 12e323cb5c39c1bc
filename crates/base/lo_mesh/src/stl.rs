//! STL, ASCII or binary. The file's normals are ignored: they follow from the winding, and exporters often write zeros.

use lo_geometry::Vec3;

use crate::{LoadOptions, MeshError, Model, normals};

const HEADER_BYTES: usize = 84;
const TRIANGLE_BYTES: usize = 50;

/// Reads the model, without checking or completing its vertices.
pub(crate) fn read(bytes: &[u8], options: &LoadOptions) -> Result<Model, MeshError> {
    let points = if is_ascii(bytes) { read_ascii(bytes)? } else { read_binary(bytes)? };
    if points.is_empty() {
        return Err(MeshError::NoTriangles { reason: String::new() });
    }
    let (positions, corners) = normals::weld(points.into_iter());
    let triangles: Vec<[u32; 3]> = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    drop(corners);
    let smooth = normals::smooth(&positions, &triangles, options.crease_angle_rad, |_| None);
    Ok(Model {
        positions: smooth.vertex_positions.iter().map(|&p| positions[p as usize]).collect(),
        normals: smooth.vertex_normals,
        triangle_materials: vec![0; smooth.triangles.len()],
        triangles: smooth.triangles,
        ..Model::default()
    })
}

/// Whether the file is ASCII. Binary files may also begin with "solid", but have exactly the declared length.
fn is_ascii(bytes: &[u8]) -> bool {
    let begins = bytes.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    begins && declared_bytes(bytes) != Some(bytes.len())
}

fn declared_bytes(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..HEADER_BYTES)?.try_into().ok().map(u32::from_le_bytes)?;
    (count as usize).checked_mul(TRIANGLE_BYTES)?.checked_add(HEADER_BYTES)
}

/// Reads a binary file to three points per triangle.
fn read_binary(bytes: &[u8]) -> Result<Vec<Vec3>, MeshError> {
    let declared = declared_bytes(bytes).ok_or_else(|| {
        MeshError::syntax("STL", format!("byte {}", bytes.len()), "unexpected end of file in the header")
    })?;
    if declared > bytes.len() {
        let (count, held) = ((declared - HEADER_BYTES) / TRIANGLE_BYTES, (bytes.len() - HEADER_BYTES) / TRIANGLE_BYTES);
        let what = format!("the header declares {count} triangles, the file has {held}");
        return Err(MeshError::syntax("STL", "byte 80", what));
    }
    let triangles = bytes[HEADER_BYTES..declared].chunks_exact(TRIANGLE_BYTES);
    Ok(triangles.flat_map(|triangle| [12, 24, 36].map(|at| point(&triangle[at..at + 12]))).collect())
}

fn point(bytes: &[u8]) -> Vec3 {
    let [x, y, z] = [0, 4, 8].map(|at| f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]));
    Vec3::new(x, y, z)
}

fn read_ascii(bytes: &[u8]) -> Result<Vec<Vec3>, MeshError> {
    let mut points = Vec::new();
    let mut facet = 0;
    let invalid = |line: usize, what: &str| MeshError::syntax("STL", format!("line {}", line + 1), what);
    let mut last = 0;
    for (number, line) in bytes.split(|&byte| byte == b'\n').enumerate() {
        last = number;
        let line = String::from_utf8_lossy(line.trim_ascii());
        let mut words = line.split_ascii_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("vertex") => {
                let mut next = || words.next().and_then(|word| word.parse().ok());
                let (Some(x), Some(y), Some(z)) = (next(), next(), next()) else {
                    return Err(invalid(number, "a vertex needs three numbers"));
                };
                points.push(Vec3::new(x, y, z));
                facet += 1;
            }
            Some("endfacet" | "endloop") if facet != 0 && facet != 3 => {
                return Err(invalid(number, "a facet needs three vertices"));
            }
            Some("endfacet") => facet = 0,
            _ => {}
        }
    }
    if facet != 0 {
        return Err(invalid(last, "unexpected end of file in a facet"));
    }
    Ok(points)
}

#[cfg(test)]
#[path = "stl_tests.rs"]
mod tests;
