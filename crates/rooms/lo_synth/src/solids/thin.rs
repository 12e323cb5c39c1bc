use std::f32::consts::TAU;

use lo_geometry::{Vec2, Vec3};

use super::{Paint, Shape};

impl Shape {
    /// Adds a cable or hose of constant thickness along a smooth, nowhere steep line.
    pub(crate) fn tube(&mut self, line: &[Vec3], radius: f32, sides: usize, paint: Paint) {
        let first = self.triangles.len();
        let last = line.len() - 1;
        // Rings of radius 0 close the ends.
        let rows = line.len() + 1;
        self.grid([sides, rows], Vec2::new(TAU * radius, 1.0), paint, |u, v| {
            let row = (v * rows as f32).round() as usize;
            let k = row.saturating_sub(1).min(last);
            let along = (line[(k + 1).min(last)] - line[k.saturating_sub(1)]).normalize_or(Vec3::X);
            let side = Vec3::Y.cross(along).normalize_or(Vec3::X);
            let up = along.cross(side);
            let (sin, cos) = if u == 1.0 { (0.0, 1.0) } else { (u * TAU).sin_cos() };
            let r = if row == 0 || row == rows { 0.0 } else { radius };
            line[k] + (side * cos + up * sin) * r
        });
        self.close_part(first);
    }

    /// Adds a flat picture by its corners, counter-clockwise from the lower left.
    pub(crate) fn picture(&mut self, corners: [Vec3; 4], paint: Paint) {
        let first = (self.triangles.len(), self.uvs.len());
        self.polygon(&corners, paint);
        self.uvs[first.1..].copy_from_slice(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
        self.close_part(first.0);
    }

    /// Adds a picture lying over `[min, max]` (x, z) at height `y`, its upper edge towards −z.
    pub(crate) fn picture_on(&mut self, min: Vec2, max: Vec2, y: f32, paint: Paint) {
        let p = |x: f32, z: f32| Vec3::new(x, y, z);
        self.picture([p(min.x, max.y), p(max.x, max.y), p(max.x, min.y), p(min.x, min.y)], paint);
    }

    /// Adds a picture wrapped once around the vertical through `base`, `high` metres high.
    pub(crate) fn label(&mut self, base: Vec3, radius: f32, high: f32, segments: usize, paint: Paint) {
        let first = self.uvs.len();
        self.lathe(base, &[[radius, 0.0], [radius, high]], segments, paint);
        for [u, v] in &mut self.uvs[first..] {
            (*u, *v) = (*u / (TAU * radius), 1.0 + *v / high);
        }
    }

    /// Scales the shape along the axes.
    pub(crate) fn scaled_by(mut self, by: Vec3) -> Self {
        self.positions.iter_mut().for_each(|p| *p *= by);
        self.normals.iter_mut().for_each(|n| *n = (*n / by).normalize_or(Vec3::Y));
        self
    }
}
