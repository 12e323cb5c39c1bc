//! Occupied space: footprints on the floor and passages that must stay free.

use lo_geometry::{Vec2, Vec3};

use crate::plan::Plan;

/// A rectangle in the floor plane (x, z).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Footprint {
    pub center: Vec2,
    /// Unit direction of the first half extent; the second is perpendicular.
    pub along: Vec2,
    pub half: Vec2,
}

impl Footprint {
    /// Footprint of the box `min … max`, rotated about +Y and then translated.
    pub(crate) fn of_box(min: Vec3, max: Vec3, yaw_rad: f32, offset: Vec2) -> Self {
        let middle = (min + max) * 0.5;
        let half = (max - min) * 0.5;
        Self {
            center: offset + rotated_yaw(Vec2::new(middle.x, middle.z), yaw_rad),
            along: rotated_yaw(Vec2::X, yaw_rad),
            half: Vec2::new(half.x, half.z),
        }
    }

    fn across(&self) -> Vec2 {
        Vec2::new(-self.along.y, self.along.x)
    }

    pub(crate) fn corners(&self) -> [Vec2; 4] {
        let (a, b) = (self.along * self.half.x, self.across() * self.half.y);
        [self.center - a - b, self.center + a - b, self.center + a + b, self.center - a + b]
    }

    /// Footprint expanded by `margin` on every side.
    pub(crate) fn expanded(&self, margin: f32) -> Self {
        Self { half: self.half + Vec2::splat(margin), ..*self }
    }

    pub(crate) fn contains(&self, p: Vec2) -> bool {
        let d = p - self.center;
        d.dot(self.along).abs() <= self.half.x && d.dot(self.across()).abs() <= self.half.y
    }

    /// Whether two rectangles overlap by more than an edge (separating axes).
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        let distance = other.center - self.center;
        [self.along, self.across(), other.along, other.across()].into_iter().all(|axis| {
            let reach = |f: &Self| f.half.x * f.along.dot(axis).abs() + f.half.y * f.across().dot(axis).abs();
            distance.dot(axis).abs() < reach(self) + reach(other) - 1e-4
        })
    }
}

/// Rotates a point (x, z) about +Y.
pub(crate) fn rotated_yaw(p: Vec2, yaw_rad: f32) -> Vec2 {
    let (sin, cos) = yaw_rad.sin_cos();
    Vec2::new(p.x * cos + p.y * sin, p.y * cos - p.x * sin)
}

/// A volume that is occupied or kept free.
#[derive(Clone, Copy, Debug)]
struct Volume {
    footprint: Footprint,
    y: [f32; 2],
    /// Whether an object occupies it; otherwise it is kept free, as in front of a door.
    solid: bool,
    /// The occupying object, if it can carry others.
    owner: Option<usize>,
}

/// Occupied volumes and walkable floor of a room.
#[derive(Clone, Debug)]
pub(crate) struct Occupancy {
    volumes: Vec<Volume>,
    grid: WalkGrid,
}

impl Occupancy {
    pub(crate) fn new(plan: &Plan) -> Self {
        let mut occupancy = Self { volumes: Vec::new(), grid: WalkGrid::new(plan) };
        for wall in &plan.walls {
            for opening in wall.openings.iter().filter(|o| !o.is_window()) {
                // The swing of the leaf and one step.
                let middle = wall.start + wall.along * (0.5 * (opening.s[0] + opening.s[1]));
                let deep = opening.width_m().max(0.8);
                let half = Vec2::new(0.5 * opening.width_m() + 0.08, 0.5 * deep);
                let center = middle + wall.inward() * 0.5 * deep;
                occupancy.keep_free(Footprint { center, along: wall.along, half }, [0.0, 2.1]);
                occupancy.grid.doors.push(middle + wall.inward() * 0.45);
            }
        }
        occupancy
    }

    /// Keeps a volume free of objects placed later.
    pub(crate) fn keep_free(&mut self, footprint: Footprint, y: [f32; 2]) {
        self.volumes.push(Volume { footprint, y, solid: false, owner: None });
    }

    /// Marks a volume as occupied.
    pub(crate) fn occupy(&mut self, footprint: Footprint, y: [f32; 2]) {
        self.occupy_for(footprint, y, None);
    }

    /// Marks a volume as occupied by an object that can carry others.
    pub(crate) fn occupy_for(&mut self, footprint: Footprint, y: [f32; 2], owner: Option<usize>) {
        if blocks_walking(y) {
            self.grid.mark(&footprint);
        }
        self.volumes.push(Volume { footprint, y, solid: true, owner });
    }

    /// Whether a volume lies in the room, below the ceiling, outside all objects and outside kept-free volumes.
    pub(crate) fn fits(&self, plan: &Plan, footprint: &Footprint, y: [f32; 2]) -> bool {
        self.fits_beside(plan, footprint, y, true, None)
    }

    /// Like [`Occupancy::fits`], but allows overlap with kept-free volumes.
    pub(crate) fn is_clear(&self, plan: &Plan, footprint: &Footprint, y: [f32; 2]) -> bool {
        self.fits_beside(plan, footprint, y, false, None)
    }

    /// Like [`Occupancy::is_clear`], for an object on or in the object `carrier`.
    pub(crate) fn is_clear_on(&self, plan: &Plan, footprint: &Footprint, y: [f32; 2], carrier: usize) -> bool {
        self.fits_beside(plan, footprint, y, false, Some(carrier))
    }

    fn fits_beside(
        &self,
        plan: &Plan,
        footprint: &Footprint,
        y: [f32; 2],
        passages: bool,
        carrier: Option<usize>,
    ) -> bool {
        inside(plan, footprint, y[1])
            && self.volumes.iter().all(|volume| {
                let counts = (volume.solid || passages) && (carrier.is_none() || volume.owner != carrier);
                !counts || y[0] >= volume.y[1] || y[1] <= volume.y[0] || !volume.footprint.overlaps(footprint)
            })
    }

    /// Whether every door still reaches most of the free floor with an object at this place.
    pub(crate) fn leaves_passages(&self, footprint: &Footprint, y: [f32; 2]) -> bool {
        if !blocks_walking(y) {
            return true;
        }
        let mut grid = self.grid.clone();
        grid.mark(footprint);
        grid.is_connected()
    }
}

/// Whether an object of this vertical extent blocks walking: rugs and hanging lamps do not.
fn blocks_walking([low, high]: [f32; 2]) -> bool {
    high > 0.05 && low < 1.9
}

fn inside(plan: &Plan, footprint: &Footprint, top: f32) -> bool {
    let below = |p: Vec2| plan.contains(p, 0.0) && top < plan.ceiling(p) - 0.005;
    let ends = footprint.corners();
    ends.into_iter().all(below)
        && (0..4).all(|k| below((ends[k] + ends[(k + 1) % 4]) * 0.5))
        && below(footprint.center)
        && !plan.walls.iter().any(|wall| footprint.expanded(-0.002).contains(wall.start))
}

/// Floor cells that the centre of a person can occupy.
#[derive(Clone, Debug)]
struct WalkGrid {
    origin: Vec2,
    size: [usize; 2],
    free: Vec<bool>,
    doors: Vec<Vec2>,
}

impl WalkGrid {
    const CELL_M: f32 = 0.1;
    /// Half the width of a person.
    const PERSON_HALF_WIDTH_M: f32 = 0.24;
    /// Share of the free cells that must be reachable; corners behind chairs may be cut off.
    const MIN_REACHABLE_SHARE: f32 = 0.75;

    fn new(plan: &Plan) -> Self {
        let (min, max) = plan.extent();
        let size = (max - min) / Self::CELL_M;
        let size = [size.x.ceil() as usize, size.y.ceil() as usize];
        let mut grid = Self { origin: min, size, free: Vec::new(), doors: Vec::new() };
        grid.free = (0..size[0] * size[1]).map(|k| plan.contains(grid.cell(k), Self::PERSON_HALF_WIDTH_M)).collect();
        grid
    }

    fn cell(&self, index: usize) -> Vec2 {
        let (x, y) = (index % self.size[0], index / self.size[0]);
        self.origin + Vec2::new(x as f32 + 0.5, y as f32 + 0.5) * Self::CELL_M
    }

    fn mark(&mut self, footprint: &Footprint) {
        let expanded = footprint.expanded(Self::PERSON_HALF_WIDTH_M);
        let corners = expanded.corners();
        let min = corners.into_iter().fold(Vec2::INFINITY, Vec2::min) - self.origin;
        let max = corners.into_iter().fold(Vec2::NEG_INFINITY, Vec2::max) - self.origin;
        let range = |axis: usize| {
            let index = |x: f32| ((x / Self::CELL_M).max(0.0) as usize).min(self.size[axis] - 1);
            index(min[axis])..=index(max[axis])
        };
        for y in range(1) {
            for x in range(0) {
                let k = y * self.size[0] + x;
                if expanded.contains(self.cell(k)) {
                    self.free[k] = false;
                }
            }
        }
    }

    fn is_connected(&self) -> bool {
        let nearest = |p: Vec2| {
            let d = (p - self.origin) / Self::CELL_M;
            (d.y.max(0.0) as usize).min(self.size[1] - 1) * self.size[0] + (d.x.max(0.0) as usize).min(self.size[0] - 1)
        };
        let doors: Vec<usize> = self.doors.iter().map(|&door| nearest(door)).collect();
        let Some(&start) = doors.first() else {
            return true;
        };
        let mut visited = vec![false; self.free.len()];
        let mut stack = vec![start];
        let mut reached = 0;
        visited[start] = true;
        while let Some(k) = stack.pop() {
            if !self.free[k] {
                continue;
            }
            reached += 1;
            let (x, y) = (k % self.size[0], k / self.size[0]);
            let mut visit = |next: usize| {
                if !std::mem::replace(&mut visited[next], true) {
                    stack.push(next);
                }
            };
            if x > 0 {
                visit(k - 1);
            }
            if x + 1 < self.size[0] {
                visit(k + 1);
            }
            if y > 0 {
                visit(k - self.size[0]);
            }
            if y + 1 < self.size[1] {
                visit(k + self.size[0]);
            }
        }
        let all = self.free.iter().filter(|&&free| free).count();
        doors.iter().all(|&door| visited[door]) && reached as f32 >= Self::MIN_REACHABLE_SHARE * all as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_overlap_where_sampled_points_say_so() {
        let mut random = lo_random::stream(3, "footprints", 0);
        let mut both = [0; 2];
        for _ in 0..400 {
            let mut draw = || {
                let mut r = |low, high| crate::chance::between(&mut random, low, high);
                let half = Vec2::new(r(0.1, 1.0), r(0.1, 1.0));
                let center = Vec2::new(r(-1.5, 1.5), r(-1.5, 1.5));
                Footprint { center, along: rotated_yaw(Vec2::X, r(0.0, 3.0)), half }
            };
            let (a, b) = (draw(), draw());
            let common = (0..60 * 60).any(|k| {
                let share = |k: i32| (k as f32 + 0.5) / 60.0 * 2.0 - 1.0;
                let p = a.center + a.along * a.half.x * share(k % 60) + a.across() * a.half.y * share(k / 60);
                b.contains(p)
            });
            both[usize::from(common)] += 1;
            // Sampling can miss slivers but gives no false positives.
            assert!(!common || a.overlaps(&b));
            assert!(
                common
                    || !a.overlaps(&Footprint { half: b.half - Vec2::splat(0.06), ..b })
                    || b.half.min_element() < 0.1
            );
        }
        assert!(both[0] > 50 && both[1] > 50);
    }

    #[test]
    fn turns_seen_from_above_are_those_in_space() {
        let p = lo_geometry::Quat::from_rotation_y(0.7) * Vec3::new(1.0, 0.0, 2.0);
        assert!((rotated_yaw(Vec2::new(1.0, 2.0), 0.7) - Vec2::new(p.x, p.z)).length() < 1e-6);
    }
}
