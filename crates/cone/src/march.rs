use geometry::Cube;

use crate::{
    Cone,
    grid::{EmptyBox, Grid},
    reconstruction::{Read, Reconstruction},
    steps::StepTable,
};

/// A cone in leaf edges from the lowest corner of the cube, with the part of it that lies in the cube.
pub(crate) struct LocalCone {
    /// Where the axis enters the cube, or the apex inside of it.
    entry: [f32; 3],
    direction: [f32; 3],
    inverse_direction: [f32; 3],
    /// Distance of the entry from the apex.
    pub near: f32,
    /// Distance of the exit from the apex.
    pub far: f32,
}

/// A sample that met something.
pub(crate) struct Hit {
    pub step: u32,
    /// Linear RGB radiance and extinction per leaf edge at the sample.
    pub value: [f32; 4],
    /// Share of the cone that arrives at the sample.
    pub transmittance: f32,
    /// Share of that which it stops.
    pub opacity: f32,
}

impl LocalCone {
    /// `None` where the axis misses the cube or is not a number.
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
            let (low, high) = (-o / d, (side - o) / d);
            near = near.max(low.min(high));
            far = far.min(low.max(high));
        }
        if !(near < far && far.is_finite()) {
            return None;
        }
        Some(Self {
            entry: std::array::from_fn(|axis| (origin[axis] + direction[axis] * near) as f32),
            direction: direction.map(|d| d as f32),
            inverse_direction: direction.map(|d| 1.0 / d as f32),
            near: near as f32,
            far: far as f32,
        })
    }

    /// Position at `distance` from the apex.
    #[inline(always)]
    pub fn at(&self, distance: f32) -> [f32; 3] {
        let distance = distance - self.near;
        std::array::from_fn(|axis| self.entry[axis] + self.direction[axis] * distance)
    }

    /// A distance before which no position of [`LocalCone::at`] lies beyond `empty`.
    #[inline(always)]
    fn exit(&self, empty: &EmptyBox, margin: f32) -> f32 {
        let mut exit = f32::INFINITY;
        for axis in 0..3 {
            let inverse = self.inverse_direction[axis];
            let bound = if inverse < 0.0 { empty.low[axis] as f32 + margin } else { empty.high[axis] as f32 - margin };
            exit = exit.min((bound - self.entry[axis]) * inverse);
        }
        exit * (1.0 - 4.0 * f32::EPSILON) + self.near
    }
}

/// Follows a cone front to back and shows each sample that meets something; returns the transmittance to the exit.
///
/// `SKIP` leaves out samples in empty space, which changes nothing; without it, it is the plain loop over all samples.
#[inline(always)]
pub(crate) fn march<R: Reconstruction>(
    grid: &Grid,
    table: &StepTable,
    cone: &LocalCone,
    min_transmittance: f32,
    mut hit: impl FnMut(Hit),
) -> f32 {
    // Positions carry rounding errors of a few units in the last place of the side; so far inside is safely inside.
    let margin = grid.side() as f32 * (4.0 * f32::EPSILON);
    let end = table.first_at(cone.far);
    let mut n = table.first_at(cone.near);
    let mut transmittance = 1.0;
    while n < end {
        let step = &table.steps()[n as usize];
        match R::read(grid, cone.at(step.distance), step.level) {
            Read::Value(value) => {
                let opacity = opacity(value[3] * step.length);
                hit(Hit { step: n, value, transmittance, opacity });
                transmittance -= transmittance * opacity;
                if transmittance < min_transmittance {
                    break;
                }
                n += 1;
            }
            Read::Empty(empty) => {
                let exit = table.first_at(cone.exit(&empty, margin)).min(table.level_end(empty.level));
                n = exit.max(n + 1);
            }
        }
    }
    transmittance
}

/// 1 − e^(−x) for x ≥ 0, to 2 units in the last place, without a call or a branch.
#[inline(always)]
pub(crate) fn opacity(x: f32) -> f32 {
    // e^(−x) = 2^k · e^f with |f| ≤ ln 2 / 2; the series gives e^f − 1, which keeps small x exact.
    let x = x.min(80.0);
    let k = (x * -std::f32::consts::LOG2_E - 0.5) as i32;
    let f = -x - k as f32 * 0.693_359_4 - k as f32 * -2.121_944_4e-4;
    let p = 1.0
        + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f * (1.0 / 720.0 + f * (1.0 / 5040.0))))));
    let scale = f32::from_bits(((k + 127) as u32) << 23);
    (1.0 - scale) - scale * (f * p)
}
