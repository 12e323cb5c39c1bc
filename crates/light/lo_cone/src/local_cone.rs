use lo_geometry::Cube;

use crate::Cone;

/// A cone clipped to the cube, in leaf edges from the cube's lowest corner.
#[derive(Clone, Copy, Default)]
pub(crate) struct LocalCone {
    /// Point at which the axis enters the cube, or the apex if that is inside.
    pub entry: [f32; 3],
    pub direction: [f32; 3],
    /// Distance of the entry from the apex.
    pub near: f32,
    /// Distance of the exit from the apex.
    pub far: f32,
}

impl LocalCone {
    /// Returns `None` where the axis misses the cube or is not finite.
    #[inline(always)]
    pub fn new(cone: &Cone, cube: &Cube, side: i32) -> Option<Self> {
        let side = f64::from(side);
        let scale = side / f64::from(cube.edge_m);
        let origin: [f64; 3] = ((cone.origin.as_dvec3() - cube.origin_m.as_dvec3()) * scale).into();
        let direction: [f64; 3] = cone.direction.as_dvec3().into();
        let (mut near, mut far) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            if !(o.is_finite() && d.is_finite()) {
                return None;
            }
            if d == 0.0 {
                if !(0.0..side).contains(&o) {
                    return None;
                }
                continue;
            }
            let inverse = 1.0 / d;
            let (low, high) = (-o * inverse, (side - o) * inverse);
            near = near.max(low.min(high));
            far = far.min(low.max(high));
        }
        if !(near < far && far.is_finite()) {
            return None;
        }
        Some(Self {
            entry: std::array::from_fn(|axis| (origin[axis] + direction[axis] * near) as f32),
            direction: direction.map(|d| d as f32),
            near: near as f32,
            far: far as f32,
        })
    }

    /// Returns the position at `distance` from the apex.
    #[inline(always)]
    pub fn at(&self, distance: f32) -> [f32; 3] {
        let distance = distance - self.near;
        let ([x, y, z], [u, v, w]) = (self.entry, self.direction);
        [x + u * distance, y + v * distance, z + w * distance]
    }
}
