use lo_geometry::Vec3;

use super::{Paint, Shape};

/// Edge radius of boards and doors, metres, as of sanded wood and folded metal.
const EDGE: f32 = 0.003;

impl Shape {
    /// Adds a box with sharp edges.
    pub(crate) fn cuboid(&mut self, min: Vec3, max: Vec3, paint: Paint) {
        let first = self.triangles.len();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let (u, v) = face_axes(axis, side);
                let mut corner = min;
                corner[axis] = if side > 0.0 { max[axis] } else { min[axis] };
                let start = self.positions.len() as u32;
                let mut normal = Vec3::ZERO;
                normal[axis] = side;
                for (a, b) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                    let mut p = corner;
                    p[u] = min[u] + a * (max[u] - min[u]);
                    p[v] = min[v] + b * (max[v] - min[v]);
                    self.vertex(p, normal, box_uv(p, axis), paint);
                }
                self.quad([start, start + 1, start + 2, start + 3], paint);
            }
        }
        self.close_part(first);
    }

    /// Adds a box with edges and corners rounded to `radius` (less if the box is thin) in `segments` steps.
    pub(crate) fn rounded(&mut self, min: Vec3, max: Vec3, radius: f32, segments: usize, paint: Paint) {
        self.bulging(min, max, radius, segments, 0.0, paint);
    }

    /// Adds a rounded box whose top rises by `bulge` in the middle, as of a seat cushion or a mattress.
    pub(crate) fn bulging(&mut self, min: Vec3, max: Vec3, radius: f32, segments: usize, bulge: f32, paint: Paint) {
        let first = self.triangles.len();
        let size = max - min;
        let radius = radius.min(0.49 * size.min_element());
        let (core_min, core_max) = (min + Vec3::splat(radius), max - Vec3::splat(radius));
        let middle = (min + max) * 0.5;
        let crown = |mut p: Vec3| {
            let x = ((p.x - middle.x) / (0.5 * size.x)).clamp(-1.0, 1.0);
            let z = ((p.z - middle.z) / (0.5 * size.z)).clamp(-1.0, 1.0);
            p.y += bulge * ((p.y - min.y) / size.y).max(0.0) * (1.0 - x * x) * (1.0 - z * z);
            p
        };
        // The bulge needs vertices between the edges.
        let inner = if bulge > 0.0 { 4 } else { 1 };
        let lines = |axis: usize| -> Vec<f32> {
            let arc = |k: usize| radius * (1.0 - (k as f32 / segments as f32 * std::f32::consts::FRAC_PI_4).tan());
            let (a, b) = (core_min[axis], core_max[axis]);
            // Equal angles: `arc(0)` is the start of the arc, `arc(segments)` the bisecting plane of the edge.
            let mut lines: Vec<f32> = (0..=segments).flat_map(|k| [min[axis] + arc(k), max[axis] - arc(k)]).collect();
            lines.extend((1..inner).map(|k| a + (b - a) * k as f32 / inner as f32));
            lines.sort_by(f32::total_cmp);
            lines
        };
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let (u, v) = face_axes(axis, side);
                let (lines_u, lines_v) = (lines(u), lines(v));
                let start = self.positions.len() as u32;
                for &b in &lines_v {
                    for &a in &lines_u {
                        let mut p = Vec3::ZERO;
                        p[axis] = if side > 0.0 { max[axis] } else { min[axis] };
                        p[u] = a;
                        p[v] = b;
                        let core = p.clamp(core_min, core_max);
                        let normal = (p - core).normalize();
                        let p = core + normal * radius;
                        let bent = crown(p);
                        let normal = if bulge > 0.0 { crown_normal(&crown, p, normal) } else { normal };
                        self.vertex(bent, normal, box_uv(p, axis), paint);
                    }
                }
                let stride = lines_u.len() as u32;
                for row in 0..lines_v.len() as u32 - 1 {
                    for column in 0..stride - 1 {
                        let a = start + row * stride + column;
                        self.quad([a, a + 1, a + 1 + stride, a + stride], paint);
                    }
                }
            }
        }
        self.close_part(first);
    }

    /// Adds a box with slightly rounded edges: a board, a door, a carcass.
    pub(crate) fn board(&mut self, min: Vec3, max: Vec3, paint: Paint) {
        self.rounded(min, max, EDGE, 1, paint);
    }
}

/// The axes of a box's face, such that first × second points outwards.
fn face_axes(axis: usize, side: f32) -> (usize, usize) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    if side > 0.0 { (u, v) } else { (v, u) }
}

/// Texture coordinates of a box face. The grain of wood (v) is vertical, and along z on level faces.
fn box_uv(p: Vec3, axis: usize) -> [f32; 2] {
    match axis {
        0 => [p.z, -p.y],
        1 => [p.x, p.z],
        _ => [p.x, -p.y],
    }
}

/// Normal at `p` after the deformation `crown` of a surface with normal `n`.
fn crown_normal(crown: &impl Fn(Vec3) -> Vec3, p: Vec3, n: Vec3) -> Vec3 {
    let basis = lo_geometry::orthonormal_basis(n);
    let step = 1e-3;
    let along = |t: Vec3| crown(p + t * step) - crown(p - t * step);
    let normal = along(basis.x_axis).cross(along(basis.y_axis)).normalize_or(n);
    if normal.dot(n) < 0.0 { -normal } else { normal }
}
