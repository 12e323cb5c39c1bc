use std::f32::consts::TAU;

use lo_geometry::{Vec2, Vec3};

use super::{Paint, Shape};

impl Shape {
    /// Adds a pillow lying at `center`, of width (x), thickness (y) and depth (z) `size`.
    ///
    /// It is thin at the seam and pointed at the corners.
    pub(crate) fn pillow(&mut self, center: Vec3, size: Vec3, cells: usize, paint: Paint) {
        let first = self.triangles.len();
        for side in [1.0f32, -1.0] {
            self.grid([cells, cells], Vec2::new(size.x, size.z), paint, |u, v| {
                // Finer towards the seam, where the curvature is highest.
                let ease = |t: f32| -(t * std::f32::consts::PI).cos();
                let (x, z) = (ease(u), ease(if side > 0.0 { 1.0 - v } else { v }));
                let puff = ((1.0 - x * x) * (1.0 - z * z)).max(0.0).powf(0.4);
                // The filling pulls the edges in between the corners.
                let pull = |across: f32| 1.0 - 0.06 * (1.0 - across * across);
                let p = Vec3::new(0.5 * x * pull(z) * size.x, 0.5 * puff * side * size.y, 0.5 * z * pull(x) * size.z);
                center + p
            });
        }
        self.close_part(first);
    }

    /// Adds cloth hanging in folds about the plane z = 0, from `(0, height)` down to `(width, 0)`.
    ///
    /// Folds are `depth` deep on either side. The cloth is an open sheet, not a solid.
    pub(crate) fn drape(&mut self, width: f32, height: f32, folds: f32, depth: f32, phase: f32, paint: Paint) {
        let first = self.triangles.len();
        // Below the limit at which the cloth would overlap itself.
        let sway = (0.12 * depth).min(0.03 * width / folds);
        let columns = (folds * 10.0).ceil().max(4.0) as usize;
        // The flat cloth is about 1.5 times as wide as the folded curtain.
        self.grid([columns, 4], Vec2::new(1.5 * width, height), paint, |u, v| {
            let angle = phase + folds * TAU * u + 0.35 * (3.0 * folds * u + 2.0 * v + phase).sin();
            // Gathered at the top.
            let amplitude = depth * (0.65 + 0.35 * (1.0 - v));
            Vec3::new(u * width + sway * (2.0 * angle).sin(), v * height, amplitude * angle.sin())
        });
        self.close_part(first);
    }

    /// Adds a leaf from `base` to `base + reach`, `width` wide and bent down: an open sheet.
    ///
    /// The caller closes the part.
    pub(crate) fn leaf(&mut self, base: Vec3, reach: Vec3, width: f32, bend: f32, paint: Paint) {
        let side = reach.cross(Vec3::Y).normalize_or(Vec3::X);
        let length = reach.length();
        self.grid([2, 4], Vec2::new(width, length), paint, |u, v| {
            let across = (u - 0.5) * width * (v * std::f32::consts::PI * 0.97 + 0.05).sin();
            let fold = 0.25 * across.abs();
            base + reach * v + side * across + Vec3::Y * (fold - bend * length * v * v)
        });
    }
}
