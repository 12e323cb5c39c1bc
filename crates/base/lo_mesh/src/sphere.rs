use std::collections::HashMap;

use lo_geometry::Vec3;

use crate::{LoadOptions, Material, MeshError, Model};

/// Largest number of subdivisions of a sphere: 20 · 4⁹ is five million triangles.
const MAX_SUBDIVISIONS: u32 = 9;

impl Model {
    /// Creates a closed sphere about the origin: an icosahedron whose triangles are split into four `subdivisions`
    /// times.
    ///
    /// # Errors
    /// A radius that is not positive and finite, or more than nine subdivisions.
    pub fn sphere(radius_m: f32, subdivisions: u32, material: Material) -> Result<Self, MeshError> {
        if subdivisions > MAX_SUBDIVISIONS {
            return Err(MeshError::TooLarge {
                what: "subdivisions of a sphere",
                count: subdivisions.into(),
                limit: MAX_SUBDIVISIONS.into(),
            });
        }
        let (directions, triangles) = icosphere(subdivisions);
        let positions = directions.into_iter().map(|direction| direction * radius_m).collect();
        Self::from_triangles(positions, triangles, material, &LoadOptions::default())
    }
}

/// Returns unit directions and the triangles between them, counter-clockwise from outside.
fn icosphere(subdivisions: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    // corners of three golden rectangles
    let g = 0.5 * (1.0 + 5f32.sqrt());
    let corner = |i: usize| {
        let mut p = [0.0, if i & 1 == 0 { 1.0 } else { -1.0 }, if i & 2 == 0 { g } else { -g }];
        p.rotate_right(i / 4);
        Vec3::from(p).normalize()
    };
    let mut directions: Vec<Vec3> = (0..12).map(corner).collect();
    let mut triangles = faces(&directions);
    for _ in 0..subdivisions {
        let mut middles = HashMap::new();
        let mut next = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let mut middle = |a: u32, b: u32| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    directions.push((directions[a as usize] + directions[b as usize]).normalize());
                    directions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            next.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = next;
    }
    (directions, triangles)
}

/// Returns the faces of an icosahedron: all triples of neighbouring corners, counter-clockwise from outside.
fn faces(corners: &[Vec3]) -> Vec<[u32; 3]> {
    // neighbours are 63.4° apart, others at least 116.6°
    let joined = |a: usize, b: usize| corners[a].dot(corners[b]) > 0.0;
    let mut faces = Vec::new();
    for a in 0..corners.len() {
        for b in (a + 1..corners.len()).filter(|&b| joined(a, b)) {
            for c in (b + 1..corners.len()).filter(|&c| joined(a, c) && joined(b, c)) {
                let outside = corners[a].cross(corners[b]).dot(corners[c]) > 0.0;
                faces.push(if outside { [a, b, c] } else { [a, c, b] }.map(|corner| corner as u32));
            }
        }
    }
    faces
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn spheres_are_closed_round_and_face_outwards() {
        for (subdivisions, tolerance) in [(0, 0.4), (2, 0.05), (4, 0.004)] {
            let model = Model::sphere(2.0, subdivisions, Material::default()).unwrap();
            let count = 20 * 4usize.pow(subdivisions);
            // Euler: V − E + F = 2 with E = 3/2 F
            assert_eq!((model.triangles.len(), icosphere(subdivisions).0.len()), (count, count / 2 + 2));
            let volume = model.volume();
            let exact = 4.0 / 3.0 * std::f32::consts::PI * 8.0;
            assert!(volume < exact && volume > exact * (1.0 - tolerance), "{subdivisions}: {volume} of {exact}");
        }
    }

    #[test]
    fn impossible_spheres_are_refused() {
        assert!(Model::sphere(f32::NAN, 1, Material::default()).is_err());
        assert!(Model::sphere(0.0, 1, Material::default()).is_err());
        assert!(matches!(Model::sphere(1.0, 10, Material::default()), Err(MeshError::TooLarge { .. })));
    }
}
