//! Triangle meshes of solids: closed, with outward normals and texture coordinates in metres.

mod boxes;
mod round;
mod soft;
mod thin;

use std::ops::Range;

use lo_geometry::{Quat, Vec2, Vec3};

/// A material of the room, by index, with a colour that multiplies it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Paint {
    pub material: u32,
    pub tint: [f32; 3],
}

impl Paint {
    pub(crate) fn tinted(self, tint: [f32; 3]) -> Self {
        Self { tint, ..self }
    }
}

/// A solid or an open sheet of a shape, with the orientation of its bounding box.
#[derive(Clone, Debug)]
pub(crate) struct ShapePart {
    pub triangles: Range<usize>,
    pub rotation: Quat,
}

/// A mesh of several parts in a common frame: x to the right, y up, z to the front.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    /// Texture coordinates, metres along the surface.
    pub uvs: Vec<[f32; 2]>,
    pub tints: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub materials: Vec<u32>,
    pub parts: Vec<ShapePart>,
}

impl Shape {
    /// Adds another shape, rotated and then translated.
    pub(crate) fn add(&mut self, other: &Self, rotation: Quat, offset: Vec3) {
        let (vertices, triangles) = (self.positions.len() as u32, self.triangles.len());
        self.positions.extend(other.positions.iter().map(|&p| rotation * p + offset));
        self.normals.extend(other.normals.iter().map(|&n| rotation * n));
        self.uvs.extend_from_slice(&other.uvs);
        self.tints.extend_from_slice(&other.tints);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + vertices)));
        self.materials.extend_from_slice(&other.materials);
        self.parts.extend(other.parts.iter().map(|part| ShapePart {
            triangles: part.triangles.start + triangles..part.triangles.end + triangles,
            rotation: rotation * part.rotation,
        }));
    }

    /// Adds another shape, translated.
    pub(crate) fn add_at(&mut self, other: &Self, offset: Vec3) {
        self.add(other, Quat::IDENTITY, offset);
    }

    /// Minimum and maximum corner of all parts; zero for an empty shape.
    pub(crate) fn bounds(&self) -> (Vec3, Vec3) {
        if self.positions.is_empty() {
            return (Vec3::ZERO, Vec3::ZERO);
        }
        self.positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), &p| (min.min(p), max.max(p)))
    }

    /// Area of a range of triangles, square metres.
    pub(crate) fn area(&self, triangles: Range<usize>) -> f32 {
        self.triangles[triangles]
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| self.positions[v as usize]);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum()
    }

    /// Adds a grid of `columns × rows` cells over `point(u, v)` with u and v in [0, 1].
    ///
    /// The front faces `∂u × ∂v`. Normals are smooth: the mean over adjacent triangles. Texture coordinates cover
    /// `size_m`.
    pub(crate) fn grid(
        &mut self,
        [columns, rows]: [usize; 2],
        size_m: Vec2,
        paint: Paint,
        point: impl Fn(f32, f32) -> Vec3,
    ) {
        let (first, first_triangle) = (self.positions.len(), self.triangles.len());
        for row in 0..=rows {
            for column in 0..=columns {
                let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
                self.vertex(point(u, v), Vec3::ZERO, [u * size_m.x, v * size_m.y], paint);
            }
        }
        let stride = columns as u32 + 1;
        for row in 0..rows as u32 {
            for column in 0..columns as u32 {
                let a = first as u32 + row * stride + column;
                self.quad([a, a + 1, a + 1 + stride, a + stride], paint);
            }
        }
        for t in first_triangle..self.triangles.len() {
            let corners = self.triangles[t].map(|v| v as usize);
            let [a, b, c] = corners.map(|v| self.positions[v]);
            let face = (b - a).cross(c - a);
            for v in corners {
                self.normals[v] += face;
            }
        }
        for normal in &mut self.normals[first..] {
            // Vertices without a triangle (at the poles of a grid) get any normal.
            *normal = normal.normalize_or(Vec3::Y);
        }
    }

    fn vertex(&mut self, position: Vec3, normal: Vec3, uv: [f32; 2], paint: Paint) -> u32 {
        self.positions.push(position);
        self.normals.push(normal);
        self.uvs.push(uv);
        self.tints.push(paint.tint);
        self.positions.len() as u32 - 1
    }

    fn triangle(&mut self, corners: [u32; 3], paint: Paint) {
        let [a, b, c] = corners.map(|v| self.positions[v as usize]);
        // Quads degenerate to one triangle at the poles of lathes and the corners of pillows.
        if (b - a).cross(c - a).length() > 1e-12 {
            self.triangles.push(corners);
            self.materials.push(paint.material);
        }
    }

    /// Adds two triangles, counter-clockwise seen from the front.
    fn quad(&mut self, [a, b, c, d]: [u32; 4], paint: Paint) {
        self.triangle([a, b, c], paint);
        self.triangle([a, c, d], paint);
    }

    /// Adds a flat convex polygon, counter-clockwise seen from the front, with u along its first edge.
    pub(crate) fn polygon(&mut self, corners: &[Vec3], paint: Paint) {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(Vec3::Y);
        let along = (corners[1] - corners[0]).normalize_or(Vec3::X);
        let up = normal.cross(along);
        let first = self.positions.len() as u32;
        for &corner in corners {
            let offset = corner - corners[0];
            self.vertex(corner, normal, [offset.dot(along), -offset.dot(up)], paint);
        }
        for k in 1..corners.len() as u32 - 1 {
            self.triangle([first, first + k, first + k + 1], paint);
        }
    }

    /// Groups the triangles from `first` on into one part.
    pub(crate) fn close_part(&mut self, first: usize) {
        if self.triangles.len() > first {
            self.parts.push(ShapePart { triangles: first..self.triangles.len(), rotation: Quat::IDENTITY });
        }
    }
}

#[cfg(test)]
mod tests;
