//! Test objects: spheres of radius 1, and a pole of height 5, on the origin.

use std::f32::consts::TAU;

use lo_geometry::Vec3;
use lo_insert::Base;
use lo_mesh::{LoadOptions, Material, MeshError, Model, PreparedModel};

/// Number of sides of the pole.
const SIDES: u32 = 32;

/// Radius and height of the pole, in sphere radii.
const POLE: (f32, f32) = (0.15, 5.0);

/// Subdivisions of a sphere: 20,480 triangles.
const SUBDIVISIONS: u32 = 5;

/// An object whose shading and shadow are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TestObject {
    /// A sphere of white plaster.
    Diffuse,
    /// A sphere of brushed metal.
    Rough,
    /// A mirror.
    Mirror,
    /// A thin pole of white plaster.
    Pole,
}

impl TestObject {
    pub const ALL: [Self; 4] = [Self::Diffuse, Self::Rough, Self::Mirror, Self::Pole];

    /// Returns the name used in figures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Diffuse => "diffuse",
            Self::Rough => "rough",
            Self::Mirror => "mirror",
            Self::Pole => "pole",
        }
    }

    /// Returns whether its shadow is compared. Shadows of the spheres differ only by reflected light.
    pub fn casts(self) -> bool {
        matches!(self, Self::Diffuse | Self::Pole)
    }

    /// Returns the height, in sphere radii.
    pub fn height(self) -> f32 {
        if self == Self::Pole { POLE.1 } else { 2.0 }
    }

    /// Builds the mesh, +Y up, standing on the origin.
    ///
    /// # Errors
    /// Oversized meshes; does not occur.
    pub fn model(self) -> Result<Model, MeshError> {
        let plaster =
            Material { base_color: [0.8, 0.8, 0.8, 1.0], metallic: 0.0, roughness: 1.0, ..Material::default() };
        let metal = |roughness| Material { metallic: 1.0, roughness, ..plaster.clone() };
        let mut model = match self {
            Self::Diffuse => Model::sphere(1.0, SUBDIVISIONS, plaster),
            Self::Rough => Model::sphere(1.0, SUBDIVISIONS, metal(0.4)),
            Self::Mirror => Model::sphere(1.0, SUBDIVISIONS, metal(0.0)),
            Self::Pole => pole(plaster),
        }?;
        if self != Self::Pole {
            model.positions.iter_mut().for_each(|position| position.y += 1.0);
        }
        Ok(model)
    }
}

/// A test object, ready for insertion.
pub(crate) struct PreparedObject {
    pub kind: TestObject,
    pub model: PreparedModel,
    pub base: Base,
}

impl PreparedObject {
    /// Builds objects.
    ///
    /// # Errors
    /// As for [`TestObject::model`].
    pub fn all(kinds: &[TestObject]) -> Result<Vec<Self>, MeshError> {
        let prepared = |&kind: &TestObject| {
            let model = PreparedModel::new(kind.model()?);
            Ok(Self { kind, base: Base::new(&model), model })
        };
        kinds.iter().map(prepared).collect()
    }
}

fn pole(material: Material) -> Result<Model, MeshError> {
    let (radius, height) = POLE;
    let ring = |y: f32| {
        (0..SIDES).map(move |i| {
            let (sin, cos) = (TAU * i as f32 / SIDES as f32).sin_cos();
            Vec3::new(radius * cos, y, radius * sin)
        })
    };
    let mut positions: Vec<Vec3> = ring(0.0).chain(ring(height)).collect();
    positions.extend([Vec3::ZERO, Vec3::new(0.0, height, 0.0)]);
    let (bottom, top) = (2 * SIDES, 2 * SIDES + 1);
    let side = |i: u32| {
        let (a, b) = (i, (i + 1) % SIDES);
        let (c, d) = (a + SIDES, b + SIDES);
        [[a, c, b], [b, c, d], [bottom, a, b], [top, d, c]]
    };
    Model::from_triangles(positions, (0..SIDES).flat_map(side).collect(), material, &LoadOptions::default())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn objects_stand_on_the_origin_and_face_outwards() {
        for kind in TestObject::ALL {
            let model = kind.model().unwrap();
            let low = model.positions.iter().copied().reduce(Vec3::min).unwrap();
            let high = model.positions.iter().copied().reduce(Vec3::max).unwrap();
            assert!(low.y.abs() < 1e-3 && (high.y - kind.height()).abs() < 1e-3, "{kind:?}: {low} {high}");
            let half_width = if kind == TestObject::Pole { POLE.0 } else { 1.0 };
            assert!((high.x - half_width).abs() < 0.01, "{kind:?}: {high}");
            // Divergence theorem: the volume is positive if triangles face outwards.
            let signed_volume = |[a, b, c]: [u32; 3]| {
                let [a, b, c] = [a, b, c].map(|i| model.positions[i as usize]);
                a.dot(b.cross(c)) / 6.0
            };
            let volume: f32 = model.triangles.iter().map(|&triangle| signed_volume(triangle)).sum();
            let exact = match kind {
                TestObject::Pole => std::f32::consts::PI * POLE.0 * POLE.0 * POLE.1,
                _ => 4.0 / 3.0 * std::f32::consts::PI,
            };
            assert!((volume / exact - 1.0).abs() < 0.01, "{kind:?}: {volume} {exact}");
        }
    }
}
