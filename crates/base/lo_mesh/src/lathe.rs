use std::f32::consts::TAU;

use lo_geometry::Vec3;

use crate::{LoadOptions, Material, MeshError, Model};

impl Model {
    /// Creates a body of revolution about +Y from a closed `profile` of (radius, height), in metres.
    ///
    /// The profile runs counter-clockwise with the radius to the right and the height up, so that faces look outwards.
    /// It is closed between its last and first point; points of radius 0 are on the axis.
    ///
    /// # Errors
    /// Fewer than three profile points or segments; coordinates that are not finite.
    pub fn lathe(profile: &[[f32; 2]], segments: u32, material: Material) -> Result<Self, MeshError> {
        let mut positions = Vec::new();
        // First vertex of each profile point, and whether it is on the axis.
        let rings: Vec<(u32, bool)> = profile
            .iter()
            .map(|&[radius, height]| {
                let first = positions.len() as u32;
                let is_pole = radius == 0.0;
                let count = if is_pole { 1 } else { segments };
                positions.extend((0..count).map(|i| {
                    let (sin, cos) = (TAU * i as f32 / segments as f32).sin_cos();
                    Vec3::new(radius * cos, height, radius * sin)
                }));
                (first, is_pole)
            })
            .collect();
        let mut triangles = Vec::new();
        let following = rings.iter().cycle().skip(1);
        for (&(a, a_pole), &(b, b_pole)) in rings.iter().zip(following) {
            let at = |first: u32, is_pole: bool, i: u32| if is_pole { first } else { first + i % segments };
            for i in 0..segments {
                let (a0, a1) = (at(a, a_pole, i), at(a, a_pole, i + 1));
                let (b0, b1) = (at(b, b_pole, i), at(b, b_pole, i + 1));
                if !a_pole {
                    triangles.push([a0, b0, a1]);
                }
                if !b_pole {
                    triangles.push([a1, b0, b1]);
                }
            }
        }
        Self::from_triangles(positions, triangles, material, &LoadOptions::default())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn bodies_are_closed_and_face_outwards() {
        // A cylinder, and a tube of its wall.
        let cylinder = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]];
        let tube = [[0.5, 0.0], [1.0, 0.0], [1.0, 2.0], [0.5, 2.0]];
        for (profile, expected) in [(cylinder, std::f32::consts::TAU), (tube, 1.5 * std::f32::consts::PI)] {
            let model = Model::lathe(&profile, 96, Material::default()).unwrap();
            let found = model.volume();
            assert!((found / expected - 1.0).abs() < 2e-3, "{found} for {expected}");
            // Each edge belongs to two triangles that run along it in opposite directions.
            let at = |v: u32| model.positions[v as usize].to_array().map(f32::to_bits);
            let mut edges = std::collections::HashMap::new();
            for t in &model.triangles {
                for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                    *edges.entry((at(t[a]), at(t[b]))).or_insert(0) += 1;
                }
            }
            assert!(edges.iter().all(|(&(a, b), &count)| count == 1 && edges.get(&(b, a)) == Some(&1)));
        }
    }

    #[test]
    fn impossible_profiles_are_refused() {
        assert!(Model::lathe(&[], 8, Material::default()).is_err());
        assert!(Model::lathe(&[[1.0, 0.0], [f32::NAN, 1.0], [0.0, 1.0]], 0, Material::default()).is_err());
    }
}
