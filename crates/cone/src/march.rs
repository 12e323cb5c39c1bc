use geometry::Cube;

use crate::{
    Cone,
    grid::{Cell, Grid},
    reconstruction::{Reconstruction, rounded_up},
    steps::{Step, StepTable},
};

/// A cone in leaf edges from the lowest corner of the cube, with the part of it that lies in the cube.
#[derive(Clone, Copy, Default)]
pub(crate) struct LocalCone {
    /// Where the axis enters the cube, or the apex inside of it.
    entry: [f32; 3],
    direction: [f32; 3],
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

    /// Position at `distance` from the apex.
    #[inline(always)]
    pub fn at(&self, distance: f32) -> [f32; 3] {
        let distance = distance - self.near;
        let ([x, y, z], [u, v, w]) = (self.entry, self.direction);
        [x + u * distance, y + v * distance, z + w * distance]
    }
}

/// Follows up to `LANES` cones side by side, each front to back, and shows each sample that meets something together with the
/// cone's index; returns the transmittances to the exit.
///
/// Samples in empty space are skipped, which changes nothing. The loops over lanes have no branches where it matters, so that
/// the compiler makes vector code of them for whatever instruction set the caller is compiled for; one lane is the plain
/// single cone. Each lane computes exactly what it would alone.
#[inline(always)]
pub(crate) fn march<R: Reconstruction, const LANES: usize>(
    grid: &Grid,
    table: &StepTable,
    cones: &[LocalCone],
    min_transmittance: f32,
    mut hit: impl FnMut(usize, &Step, Hit),
) -> [f32; LANES] {
    // Positions carry rounding errors of a few units in the last place of the side; so far inside is safely inside.
    let margin = grid.side() as f32 * (4.0 * f32::EPSILON);
    let mut transmittances = [1.0f32; LANES];
    let (mut entry, mut direction, mut inverse) = ([[0.0f32; LANES]; 3], [[0.0f32; LANES]; 3], [[0.0f32; LANES]; 3]);
    let (mut near, mut n, mut end) = ([0.0f32; LANES], [0u32; LANES], [0u32; LANES]);
    for (lane, cone) in cones.iter().enumerate() {
        for axis in 0..3 {
            entry[axis][lane] = cone.entry[axis];
            direction[axis][lane] = cone.direction[axis];
            inverse[axis][lane] = 1.0 / cone.direction[axis];
        }
        near[lane] = cone.near;
        n[lane] = table.first_at(cone.near);
        end[lane] = table.first_at(cone.far);
    }
    let Some(last) = table.steps().len().checked_sub(1) else { return transmittances };
    loop {
        let mut any = false;
        let (mut distance, mut level) = ([0.0f32; LANES], [0.0f32; LANES]);
        for lane in 0..LANES {
            any |= n[lane] < end[lane];
            let step = &table.steps()[(n[lane] as usize).min(last)];
            distance[lane] = step.distance - near[lane];
            level[lane] = step.level;
        }
        if !any {
            return transmittances;
        }
        let mut leaf = [[0i32; LANES]; 3];
        for axis in 0..3 {
            for lane in 0..LANES {
                let position = entry[axis][lane] + direction[axis][lane] * distance[lane];
                // Rounding may have put it on the far side of a face of the cube.
                leaf[axis][lane] = (position as i32).clamp(0, grid.side() - 1);
            }
        }
        let mut coarse = [0u32; LANES];
        for lane in 0..LANES {
            coarse[lane] = rounded_up(level[lane]);
        }
        let cells = grid.dense_cells_at(&leaf, &coarse);
        // For each lane the level and reach of the empty cells around it; none where there is something.
        let (mut shift, mut reach) = ([0u32; LANES], [0i32; LANES]);
        for lane in 0..LANES {
            let cell = grid.descend(cells[lane], [leaf[0][lane], leaf[1][lane], leaf[2][lane]], coarse[lane]);
            (shift[lane], reach[lane]) = match cell {
                Cell::Empty { level, radius } => (level, radius - R::RADIUS),
                Cell::Slot(_) => (0, 0),
            };
            if reach[lane] <= 0 && n[lane] < end[lane] {
                let step = &table.steps()[n[lane] as usize];
                let position = cones[lane].at(step.distance);
                let value = R::read(grid, cell, position, step.level);
                let opacity = opacity(value[3] * step.length);
                hit(lane, step, Hit { step: n[lane], value, transmittance: transmittances[lane], opacity });
                transmittances[lane] -= transmittances[lane] * opacity;
                if transmittances[lane] < min_transmittance {
                    end[lane] = 0;
                }
            }
        }
        let mut exit = [f32::INFINITY; LANES];
        for axis in 0..3 {
            for lane in 0..LANES {
                let cell = leaf[axis][lane] >> shift[lane];
                let low = ((cell - reach[lane] + 1) << shift[lane]) as f32 + margin;
                let high = ((cell + reach[lane]) << shift[lane]) as f32 - margin;
                let bound = if inverse[axis][lane] < 0.0 { low } else { high };
                exit[lane] = exit[lane].min((bound - entry[axis][lane]) * inverse[axis][lane]);
            }
        }
        for lane in 0..LANES {
            let exit = exit[lane] * (1.0 - 4.0 * f32::EPSILON) + near[lane];
            let first = table.first_at(exit).min(table.level_end(shift[lane]));
            n[lane] = if reach[lane] > 0 { first.max(n[lane] + 1) } else { n[lane] + 1 };
        }
    }
}

/// 1 − e^(−x) for x ≥ 0, to 2 units in the last place, without a call or a branch.
#[inline(always)]
fn opacity(x: f32) -> f32 {
    // e^(−x) = 2^k · e^f with |f| ≤ ln 2 / 2; the series gives e^f − 1, which keeps small x exact.
    let x = x.min(80.0);
    let k = (x * -std::f32::consts::LOG2_E - 0.5) as i32;
    let f = -x - k as f32 * 0.693_359_4 - k as f32 * -2.121_944_4e-4;
    let p = 1.0
        + f * (0.5 + f * (1.0 / 6.0 + f * (1.0 / 24.0 + f * (1.0 / 120.0 + f * (1.0 / 720.0 + f * (1.0 / 5040.0))))));
    let scale = f32::from_bits(((k + 127) as u32) << 23);
    (1.0 - scale) - scale * (f * p)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use geometry::Vec3;
    use octree::{LightOctree, key_from_xyz};
    use proptest::prelude::*;

    use super::*;
    use crate::{
        Settings,
        reconstruction::{Interpolated, Nearest},
        tracer::LANES,
    };

    const CUBE: Cube = Cube { origin_m: Vec3::new(-1.0, 0.5, 2.0), edge_m: 1.7 };

    /// Every sample between entry and exit, one after the other: what skipping must not change.
    fn march_without_skipping<R: Reconstruction>(
        grid: &Grid,
        table: &StepTable,
        cone: &LocalCone,
    ) -> Vec<(u32, [f32; 4])> {
        let mut seen = Vec::new();
        for n in 0..table.steps().len() as u32 {
            let step = &table.steps()[n as usize];
            if step.distance < cone.near || step.distance >= cone.far {
                continue;
            }
            let position = cone.at(step.distance);
            let leaf = position.map(|p| (p as i32).clamp(0, grid.side() - 1));
            let value = R::read(grid, grid.find(leaf, step.level.ceil() as u32), position, step.level);
            if value[3] > 0.0 {
                seen.push((n, value));
            }
        }
        seen
    }

    fn check<R: Reconstruction>(grid: &Grid, table: &StepTable, cones: &[LocalCone]) -> usize {
        let mut met: Vec<Vec<(u32, [f32; 4])>> = vec![Vec::new(); LANES];
        march::<R, LANES>(grid, table, cones, 0.0, |lane, _, hit| {
            if hit.value[3] > 0.0 {
                met[lane].push((hit.step, hit.value));
            }
        });
        for (cone, met) in cones.iter().zip(&met) {
            assert_eq!(*met, march_without_skipping::<R>(grid, table, cone));
            let mut alone = Vec::new();
            march::<R, 1>(grid, table, std::slice::from_ref(cone), 0.0, |_, _, hit| {
                if hit.value[3] > 0.0 {
                    alone.push((hit.step, hit.value));
                }
            });
            assert_eq!(*met, alone);
        }
        met.iter().map(Vec::len).sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn skipping_and_packets_change_no_sample(
            depth in 1u32..=8,
            full in 0u32..=4,
            leaves in proptest::collection::btree_set(any::<[u32; 3]>(), 1..60),
            seeds in proptest::collection::vec((any::<[u16; 3]>(), any::<[i16; 3]>(), 0.0..1.5f32), LANES),
            literal in any::<bool>(),
            tan_half_angle in prop_oneof![Just(0.0f32), Just(0.0245), 0.0..1.0f32],
        ) {
            let side = (1u32 << depth) - 1;
            let mut keys: Vec<u32> = leaves.iter().map(|leaf| key_from_xyz(leaf.map(|c| c & side))).collect();
            keys.sort_unstable();
            keys.dedup();
            let count = keys.len();
            let light = LightOctree::from_leaves(
                keys, vec![[1.0, 2.0, 3.0, 0.3]; count], vec![0; count], CUBE, depth, full.min(depth),
            ).unwrap();
            let grid = Grid::new(&light);
            let cones: Vec<LocalCone> = seeds.iter().filter_map(|(at, towards, back)| {
                // Corners, faces and axis-parallel directions come up often.
                let unit = Vec3::from(at.map(|c| f32::from(c >> 12) / 16.0 + if c & 1 == 0 { 0.0 } else { f32::from(c) / 1e7 }));
                let direction = Vec3::from(towards.map(|c| if c & 3 == 0 { 0.0 } else { f32::from(c) })).try_normalize()?;
                let origin = CUBE.world_from_unit(unit) - direction * *back;
                LocalCone::new(&Cone { origin, direction, tan_half_angle }, &CUBE, grid.side())
            }).collect();
            let step = if literal { crate::StepRule::Literal } else { crate::StepRule::Floored(0.5) };
            let tan_half_angle = if literal { tan_half_angle.max(0.01) } else { tan_half_angle };
            let settings = Settings { step, ..Settings::default() };
            let table = StepTable::new(&settings, tan_half_angle, grid.max_level(), 0.0, 3.0 * grid.side() as f32);
            check::<Nearest>(&grid, &table, &cones);
            check::<Interpolated>(&grid, &table, &cones);
        }
    }

    #[test]
    fn opacity_is_one_minus_exp() {
        for i in 0..200_000 {
            let x = 1e-7 * 1.000_11f32.powi(i);
            let exact = -(-f64::from(x)).exp_m1();
            assert!((f64::from(opacity(x)) - exact).abs() <= 3e-7 * exact, "{x}");
        }
        assert_eq!(opacity(0.0), 0.0);
        assert_eq!(opacity(f32::INFINITY), 1.0);
    }
}
