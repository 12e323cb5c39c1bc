use crate::{
    grid::{Entry, Grid},
    local_cone::LocalCone,
    reconstruction::{MediumSample, Reconstruction},
    steps::{Step, StepTable},
};

/// Number of cones traced in lockstep: enough to amortise the loops, few enough for the first-level cache.
pub(crate) const LANES: usize = 256;

/// A sample that is not empty.
pub(crate) struct Hit {
    pub step: u32,
    /// Value of the octree at the sample.
    pub medium: MediumSample,
    /// NodeWeight of the cone that reaches the sample.
    pub transmittance: f32,
    /// NodeWeight of that which the sample stops.
    pub opacity: f32,
}

/// Cones of a packet, marched in lockstep.
///
/// Each pass over the lanes is a branch-free loop, which the compiler vectorises for the instruction set of the caller.
/// A cone that ends gives its lane to the last active one, so that all lanes stay busy. The result of each cone is the
/// same as when it is traced alone.
pub(crate) struct Marcher<const LANES: usize> {
    cone: [u32; LANES],
    entry: [[f32; LANES]; 3],
    direction: [[f32; LANES]; 3],
    inverse: [[f32; LANES]; 3],
    near: [f32; LANES],
    step: [i32; LANES],
    end: [i32; LANES],
    transmittance: [f32; LANES],
    leaf: [[i32; LANES]; 3],
    found: [Entry; LANES],
    level: [i32; LANES],
    found_level: [i32; LANES],
}

impl<const LANES: usize> Marcher<LANES> {
    pub fn new() -> Self {
        Self {
            cone: [0; LANES],
            entry: [[0.0; LANES]; 3],
            direction: [[0.0; LANES]; 3],
            inverse: [[0.0; LANES]; 3],
            near: [0.0; LANES],
            step: [0; LANES],
            end: [0; LANES],
            transmittance: [0.0; LANES],
            leaf: [[0; LANES]; 3],
            found: [Entry::default(); LANES],
            level: [0; LANES],
            found_level: [0; LANES],
        }
    }

    /// Marches up to `LANES` cones front to back. Calls `hit` for each non-empty sample with the cone's index, and
    /// writes each cone's transmittance at the exit.
    ///
    /// Samples in empty space are skipped, which does not change the result.
    #[inline(always)]
    pub fn march<R: Reconstruction>(
        &mut self,
        grid: &Grid,
        table: &StepTable,
        cones: &[LocalCone],
        min_transmittance: f32,
        transmittances: &mut [f32; LANES],
        mut hit: impl FnMut(usize, &Step, Hit),
    ) {
        let mut active = self.start(table, cones);
        active = self.retire(active, transmittances);
        while active > 0 {
            self.find(grid, table, active);
            for lane in 0..active {
                if R::empty_radius(self.found[lane]) > 0 {
                    continue;
                }
                let cone = self.cone[lane] as usize;
                let step = &table.steps()[self.step[lane] as usize];
                if let Some(medium) = R::read(grid, self.found[lane], &cones[cone], step) {
                    let transmittance = self.transmittance[lane];
                    let opacity = opacity(medium.extinction * step.length);
                    hit(cone, step, Hit { step: self.step[lane] as u32, medium, transmittance, opacity });
                    self.transmittance[lane] -= transmittance * opacity;
                    if self.transmittance[lane] < min_transmittance {
                        self.end[lane] = 0;
                    }
                }
            }
            self.advance::<R>(grid, table, active);
            active = self.retire(active, transmittances);
        }
    }

    fn start(&mut self, table: &StepTable, cones: &[LocalCone]) -> usize {
        for (lane, cone) in cones.iter().enumerate() {
            self.cone[lane] = lane as u32;
            for axis in 0..3 {
                self.entry[axis][lane] = cone.entry[axis];
                self.direction[axis][lane] = cone.direction[axis];
                self.inverse[axis][lane] = 1.0 / cone.direction[axis];
            }
            self.near[lane] = cone.near;
            self.step[lane] = table.first_at(cone.near);
            self.end[lane] = table.first_at(cone.far);
            self.transmittance[lane] = 1.0;
        }
        cones.len()
    }

    /// Looks up the entry at the next sample of each lane.
    #[inline(always)]
    fn find(&mut self, grid: &Grid, table: &StepTable, active: usize) {
        let last = grid.side() - 1;
        let dense_level = grid.dense_level();
        for lane in 0..active.min(LANES) {
            let waypoint = table.waypoint(self.step[lane]);
            let distance = waypoint.distance - self.near[lane];
            // Rounding may put a position on the far side of a face of the cube.
            let x = ((self.entry[0][lane] + self.direction[0][lane] * distance) as i32).max(0).min(last);
            let y = ((self.entry[1][lane] + self.direction[1][lane] * distance) as i32).max(0).min(last);
            let z = ((self.entry[2][lane] + self.direction[2][lane] * distance) as i32).max(0).min(last);
            self.leaf[0][lane] = x;
            self.leaf[1][lane] = y;
            self.leaf[2][lane] = z;
            self.level[lane] = waypoint.level;
            self.found_level[lane] = waypoint.level.max(dense_level);
            self.found[lane] = grid.dense_cell([x, y, z], waypoint.level.max(dense_level));
        }
        for level in (0..dense_level).rev() {
            for lane in 0..active.min(LANES) {
                let leaf = [self.leaf[0][lane], self.leaf[1][lane], self.leaf[2][lane]];
                let descend = self.level[lane] <= level && self.found[lane].slot().is_some();
                self.found[lane] = grid.child_if(descend, self.found[lane], leaf, level);
                self.found_level[lane] = if descend { level } else { self.found_level[lane] };
            }
        }
    }

    /// Advances each lane to the next sample, or past all samples in empty space.
    #[inline(always)]
    fn advance<R: Reconstruction>(&mut self, grid: &Grid, table: &StepTable, active: usize) {
        // Positions have rounding errors of a few units in the last place of the side; this margin is safely inside.
        let margin = grid.side() as f32 * (4.0 * f32::EPSILON);
        let (mut radius, mut exit) = ([0i32; LANES], [0.0f32; LANES]);
        for lane in 0..active.min(LANES) {
            let level = self.found_level[lane];
            let reach = R::empty_radius(self.found[lane]);
            let mut nearest = f32::INFINITY;
            for axis in 0..3 {
                let cell = self.leaf[axis][lane] >> level;
                let low = ((cell - reach + 1) << level) as f32 + margin;
                let high = ((cell + reach) << level) as f32 - margin;
                let inverse = self.inverse[axis][lane];
                let bound = if inverse < 0.0 { low } else { high };
                nearest = nearest.min((bound - self.entry[axis][lane]) * inverse);
            }
            exit[lane] = nearest * (1.0 - 4.0 * f32::EPSILON) + self.near[lane];
            radius[lane] = reach;
        }
        for lane in 0..active.min(LANES) {
            let next = self.step[lane] + 1;
            let first = table.about_first_at(exit[lane]).min(table.level_end(self.found_level[lane])).max(next);
            self.step[lane] = if radius[lane] > 0 { first } else { next };
        }
    }

    /// Fills the lanes of finished cones with unfinished ones; returns the number of active lanes.
    #[inline(always)]
    fn retire(&mut self, mut active: usize, transmittances: &mut [f32; LANES]) -> usize {
        let mut lane = 0;
        while lane < active {
            if self.step[lane] < self.end[lane] {
                lane += 1;
                continue;
            }
            transmittances[self.cone[lane] as usize] = self.transmittance[lane];
            active -= 1;
            self.cone[lane] = self.cone[active];
            for axis in 0..3 {
                self.entry[axis][lane] = self.entry[axis][active];
                self.direction[axis][lane] = self.direction[axis][active];
                self.inverse[axis][lane] = self.inverse[axis][active];
            }
            self.near[lane] = self.near[active];
            self.step[lane] = self.step[active];
            self.end[lane] = self.end[active];
            self.transmittance[lane] = self.transmittance[active];
        }
        active
    }
}

/// Computes 1 − e^(−x) for x ≥ 0, to 2 units in the last place, without a call or a branch.
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

    use lo_geometry::{Cube, Vec3};
    use lo_octree::{LightOctree, key_from_xyz};
    use proptest::prelude::*;

    use super::*;
    use crate::{
        Cone, Settings,
        reconstruction::{Blended, Interpolated, Nearest},
    };

    const CUBE: Cube = Cube { origin_m: Vec3::new(-1.0, 0.5, 2.0), edge_m: 1.7 };

    /// Reads every sample between entry and exit in order: the reference for skipping.
    fn march_without_skipping<R: Reconstruction>(
        grid: &Grid,
        table: &StepTable,
        cone: &LocalCone,
    ) -> Vec<(u32, MediumSample)> {
        let mut seen = Vec::new();
        for n in 0..table.steps().len() as u32 {
            let step = &table.steps()[n as usize];
            if step.distance < cone.near || step.distance >= cone.far {
                continue;
            }
            let position = cone.at(step.distance);
            let leaf = position.map(|p| (p as i32).clamp(0, grid.side() - 1));
            let entry = grid.find(leaf, step.level.ceil() as i32);
            if let Some(medium) = R::read(grid, entry, cone, step) {
                seen.push((n, medium));
            }
        }
        seen
    }

    fn check<R: Reconstruction>(grid: &Grid, table: &StepTable, cones: &[LocalCone]) -> usize {
        let mut hits: Vec<Vec<(u32, MediumSample)>> = vec![Vec::new(); LANES];
        Marcher::<LANES>::new().march::<R>(grid, table, cones, 0.0, &mut [0.0; LANES], |lane, _, hit| {
            hits[lane].push((hit.step, hit.medium));
        });
        for (cone, hits) in cones.iter().zip(&hits) {
            assert_eq!(*hits, march_without_skipping::<R>(grid, table, cone));
            let mut alone = Vec::new();
            Marcher::<1>::new().march::<R>(grid, table, std::slice::from_ref(cone), 0.0, &mut [0.0], |_, _, hit| {
                alone.push((hit.step, hit.medium));
            });
            assert_eq!(*hits, alone);
        }
        hits.iter().map(Vec::len).sum()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn skipping_and_packets_change_no_sample(
            depth in 1u32..=8,
            full in 0u32..=4,
            clump in 1u32..=8,
            leaves in proptest::collection::btree_set(any::<[u32; 3]>(), 1..60),
            seeds in proptest::collection::vec((any::<[u16; 3]>(), any::<[i16; 3]>(), 0.0..1.5f32), 40),
            literal in any::<bool>(),
            tan_half_angle in prop_oneof![Just(0.0f32), Just(0.0245), 0.0..1.0f32],
        ) {
            let side = (1u32 << depth) - 1;
            let mut keys: Vec<u32> = leaves.iter().map(|leaf| key_from_xyz(leaf.map(|c| (side / 2) ^ (c & side & ((1 << clump) - 1))))).collect();
            keys.sort_unstable();
            keys.dedup();
            let count = keys.len();
            let light = LightOctree::from_leaves(
                keys, vec![[1.0, 2.0, 3.0, 0.3]; count], vec![0; count], CUBE, depth, full.min(depth),
            ).unwrap();
            let grid = Grid::new(&light);
            let cones: Vec<LocalCone> = seeds.iter().filter_map(|(at, towards, back)| {
                // Corners, faces and axis-parallel directions are frequent.
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
            check::<Blended>(&grid, &table, &cones);
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
