use lo_geometry::Vec3;

use crate::{MeshError, MeshWarning, Model};

/// Largest usable coordinate, in metres: its square is finite in `f32`.
const LARGEST_COORDINATE: f32 = 1e15;

/// Checks that every index is in range.
pub(crate) fn check_indices(triangles: &[[u32; 3]], count: usize) -> Result<(), MeshError> {
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&index) = corners.iter().find(|&&index| index as usize >= count) {
            let place = format!("triangle {triangle}");
            return Err(MeshError::IndexOutOfRange { place, index: i64::from(index), count });
        }
    }
    Ok(())
}

/// Drops triangles without a finite, positive area (with a warning) and replaces invalid normals, texture coordinates
/// and colours.
///
/// # Errors
/// Indices out of range, or no triangle left.
pub(crate) fn repair(model: &mut Model) -> Result<(), MeshError> {
    check_indices(&model.triangles, model.positions.len())?;
    let read = model.triangles.len();
    let usable = |p: Vec3| p.is_finite() && p.abs().max_element() <= LARGEST_COORDINATE;
    let first_bad_vertex = model.positions.iter().position(|&p| !usable(p));

    let (mut not_finite, mut flat) = (0_usize, 0_usize);
    let positions = &model.positions;
    let keep: Vec<bool> = model
        .triangles
        .iter()
        .map(|corners| {
            let points = corners.map(|vertex| positions[vertex as usize]);
            let finite = points.iter().all(|&p| usable(p));
            not_finite += usize::from(!finite);
            // In f64 the product of two f32 edges cannot underflow to 0.
            let [a, b, c] = points.map(Vec3::as_dvec3);
            let area = (b - a).cross(c - a).length_squared();
            flat += usize::from(finite && area == 0.0);
            finite && area > 0.0
        })
        .collect();
    if not_finite + flat > 0 {
        let mut at = keep.iter();
        model.triangles.retain(|_| *at.next().expect("one flag per triangle"));
        let mut at = keep.iter();
        model.triangle_materials.retain(|_| *at.next().expect("one flag per triangle"));
    }
    if let (true, Some(vertex)) = (not_finite > 0, first_bad_vertex) {
        let p = model.positions[vertex];
        let (dropped, triangles) = (not_finite, read);
        model.warnings.push(MeshWarning::UnusableCoordinate { dropped, triangles, vertex, at: p.to_array() });
    }
    if flat > 0 {
        model.warnings.push(MeshWarning::NoArea { dropped: flat, triangles: read });
    }
    if model.triangles.is_empty() {
        let reason = match (read, model.warnings.is_empty()) {
            (0, true) => String::new(),
            _ => {
                let warnings: Vec<String> = model.warnings.iter().map(ToString::to_string).collect();
                format!(": {}", warnings.join("; "))
            }
        };
        return Err(MeshError::NoTriangles { reason });
    }

    for uv in model.uvs.iter_mut().flatten() {
        if !uv.iter().all(|x| x.is_finite() && x.abs() <= 1e9) {
            *uv = [0.0; 2];
        }
    }
    for color in &mut model.colors {
        *color = color.map(|x| if x.is_finite() { x.clamp(0.0, 1e4) } else { 1.0 });
    }
    repair_normals(model);
    Ok(())
}

/// Normalises all normals. Replaces unusable ones by the normalised sum of the face normals.
fn repair_normals(model: &mut Model) {
    for normal in &mut model.normals {
        *normal = normal.as_dvec3().normalize_or_zero().as_vec3();
    }
    let bad: Vec<bool> = model.normals.iter().map(|n| n.length_squared() == 0.0 || !n.is_finite()).collect();
    if !bad.contains(&true) {
        return;
    }
    for (normal, _) in model.normals.iter_mut().zip(&bad).filter(|(_, bad)| **bad) {
        *normal = Vec3::ZERO;
    }
    for corners in &model.triangles {
        if !corners.iter().any(|&vertex| bad[vertex as usize]) {
            continue;
        }
        let face = face_normal(corners.map(|vertex| model.positions[vertex as usize]));
        for &vertex in corners {
            if bad[vertex as usize] {
                model.normals[vertex as usize] += face;
            }
        }
    }
    for (normal, _) in model.normals.iter_mut().zip(&bad).filter(|(_, bad)| **bad) {
        *normal = normal.normalize_or(Vec3::Y);
    }
}

/// Unit normal of a counter-clockwise triangle; zero if it has no area.
pub(crate) fn face_normal(points: [Vec3; 3]) -> Vec3 {
    let [a, b, c] = points.map(Vec3::as_dvec3);
    (b - a).cross(c - a).normalize_or_zero().as_vec3()
}
