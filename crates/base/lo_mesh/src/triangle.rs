use lo_geometry::Vec3;

/// A ray prepared for watertight triangle tests (Woop, Benthin & Wald 2013, JCGT 2(1)).
///
/// No ray passes between two triangles that share an edge.
pub(crate) struct ShearedRay {
    origin: Vec3,
    /// Permutation of the axes: the direction is longest along the third.
    axes: [usize; 3],
    shear: Vec3,
}

/// An intersection of a ray with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crossing {
    /// Distance along the ray, in lengths of its direction.
    pub distance: f32,
    /// Barycentric weights of the second and third vertex.
    pub barycentric: [f32; 2],
    /// Whether the ray hits the front face, from which the triangle is counter-clockwise.
    pub front: bool,
}

impl ShearedRay {
    pub(crate) fn new(origin: Vec3, direction: Vec3) -> Self {
        let size = direction.abs();
        let z = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if direction[z] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        let shear = Vec3::new(direction[x], direction[y], 1.0) / direction[z];
        Self { origin, axes: [x, y, z], shear }
    }

    /// Returns the crossing at a distance in [`min_distance`, `max_distance`], if any.
    #[inline(always)]
    pub(crate) fn intersect(&self, [a, b, c]: [Vec3; 3], min_distance: f32, max_distance: f32) -> Option<Crossing> {
        let [x, y, z] = self.axes;
        let (a, b, c) = (a - self.origin, b - self.origin, c - self.origin);
        let sheared = |p: Vec3| (p[x] - self.shear.x * p[z], p[y] - self.shear.y * p[z]);
        let ((ax, ay), (bx, by), (cx, cy)) = (sheared(a), sheared(b), sheared(c));
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            // On an edge in f32: f64 decides, consistently for both triangles of the edge.
            let edge = |px: f32, qy: f32, py: f32, qx: f32| {
                (f64::from(px) * f64::from(qy) - f64::from(py) * f64::from(qx)) as f32
            };
            u = edge(cx, by, cy, bx);
            v = edge(ax, cy, ay, cx);
            w = edge(bx, ay, by, ax);
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let scale = 1.0 / determinant;
        let depth = u * (self.shear.z * a[z]) + v * (self.shear.z * b[z]) + w * (self.shear.z * c[z]);
        let distance = depth * scale;
        // Also rejects NaN.
        if !(distance >= min_distance && distance <= max_distance) {
            return None;
        }
        Some(Crossing { distance, barycentric: [v * scale, w * scale], front: determinant > 0.0 })
    }
}
