//! Doors and windows.

use lo_random::Stream;

use super::{Opening, OpeningKind, Plan, Wall};
use crate::chance::{between, chance, count, pick, shuffled, weighted};
use crate::config::SynthConfig;
use crate::description::RoomKind;

impl Plan {
    pub(super) fn open_doors(&mut self, random: &mut Stream, kind: RoomKind) {
        let number = match kind {
            RoomKind::Bathroom => 1,
            RoomKind::Corridor => count(random, 3, 4),
            RoomKind::OpenPlan | RoomKind::Living => count(random, 1, 3),
            _ => count(random, 1, 2),
        };
        let order = shuffled(random, (0..self.walls.len()).filter(|&w| self.walls[w].can_have_openings).collect());
        for k in 0..number {
            let wall = order[k % order.len()];
            let (width, top) = (pick(random, &[0.8, 0.86, 0.9]), between(random, 2.0, 2.1));
            let room = self.walls[wall].length_m;
            if room < width + 0.5 {
                continue;
            }
            // Most doors are near a corner.
            let near = between(random, 0.12, 0.35);
            let start = match weighted(random, &[(0, 0.35), (1, 0.35), (2, 0.3)]) {
                0 => near,
                1 => room - width - near,
                _ => between(random, 0.2, room - width - 0.2),
            };
            let lit = chance(random, 0.5);
            let kind = match weighted(random, &[(0, 0.55), (1, 0.33), (2, 0.12)]) {
                0 => OpeningKind::ClosedDoor,
                1 => OpeningKind::OpenDoor { leaf: true, lit },
                _ => OpeningKind::OpenDoor { leaf: false, lit },
            };
            self.open(wall, Opening { kind, s: [start, start + width], h: [0.0, top] });
        }
        if self.walls.iter().all(|w| w.openings.is_empty()) {
            // The longest wall always has room for a door.
            let longest = order
                .iter()
                .copied()
                .fold(order[0], |best, w| if self.walls[w].length_m > self.walls[best].length_m { w } else { best });
            let middle = 0.5 * self.walls[longest].length_m;
            let opening = Opening { kind: OpeningKind::ClosedDoor, s: [middle - 0.4, middle + 0.4], h: [0.0, 1.98] };
            self.walls[longest].openings.push(opening);
        }
    }

    pub(super) fn open_windows(&mut self, random: &mut Stream, kind: RoomKind, config: &SynthConfig) {
        let without = match kind {
            RoomKind::Bathroom => 0.5,
            RoomKind::Corridor => 0.65,
            RoomKind::Cellar => 0.7,
            _ => config.windowless_share,
        };
        if chance(random, without) {
            return;
        }
        let order = shuffled(random, (0..self.walls.len()).filter(|&w| self.walls[w].can_have_openings).collect());
        let walls = if chance(random, 0.35) { 2 } else { 1 };
        let style = weighted(random, &[(0, 0.5), (1, 0.2), (2, 0.18), (3, 0.12)]);
        let mut served = 0;
        for wall in order {
            if served == walls {
                break;
            }
            if self.windows_in(random, wall, kind, style) {
                served += 1;
            }
        }
    }

    /// Glazes one or two walls from end to end, beside any door.
    ///
    /// The glass reaches the floor, stands on a sill, or forms a band below the ceiling of a high room.
    pub(super) fn glaze(&mut self, random: &mut Stream) {
        let order = shuffled(random, (0..self.walls.len()).filter(|&w| self.walls[w].can_have_openings).collect());
        let walls = if chance(random, 0.35) { 2 } else { 1 };
        let sill = match weighted(random, &[(0, 0.4), (1, 0.4), (2, 0.2)]) {
            0 => 0.06,
            2 if self.height_m > 3.6 => 0.55 * self.height_m,
            _ => between(random, 0.4, 1.0),
        };
        let mut glazed = 0;
        for wall in order {
            if glazed == walls {
                break;
            }
            let [left, right] = [(); 2].map(|()| between(random, 0.15, 0.6));
            let below_ceiling_m = between(random, 0.1, 0.35);
            let [from, to] = self.widest_gap(wall);
            let s = [from + left, to - right];
            if s[1] - s[0] < 1.2 {
                continue;
            }
            let top = self.lowest_ceiling(wall, s[0], s[1] - s[0]) - below_ceiling_m;
            if top > sill + 0.6 && self.open(wall, Opening { kind: OpeningKind::Window, s, h: [sill, top] }) {
                glazed += 1;
            }
        }
    }

    /// Minimum height of the ceiling over a part of a wall.
    fn lowest_ceiling(&self, wall: usize, from: f32, width: f32) -> f32 {
        let Wall { start, along, .. } = self.walls[wall];
        (0..=4).map(|q| self.ceiling(start + along * (from + width * 0.25 * q as f32))).fold(f32::INFINITY, f32::min)
    }

    /// Longest interval of a wall without openings.
    fn widest_gap(&self, wall: usize) -> [f32; 2] {
        let Wall { length_m, ref openings, .. } = self.walls[wall];
        let mut taken: Vec<[f32; 2]> = openings.iter().map(|opening| opening.s).collect();
        taken.sort_by(|a, b| a[0].total_cmp(&b[0]));
        taken.push([length_m; 2]);
        let mut from = 0.0;
        let mut widest = [0.0; 2];
        for [start, end] in taken {
            if start - from > widest[1] - widest[0] {
                widest = [from, start];
            }
            from = end.max(from);
        }
        widest
    }

    /// Adds windows along a wall. Styles: 0 single, 1 wide, 2 down to the floor, 3 a band.
    fn windows_in(&mut self, random: &mut Stream, wall: usize, kind: RoomKind, style: u32) -> bool {
        let length = self.walls[wall].length_m;
        let small = matches!(kind, RoomKind::Bathroom | RoomKind::Cellar);
        let (width, sill) = match style {
            _ if small => (between(random, 0.5, 0.9), between(random, 1.1, 1.5)),
            0 => (between(random, 0.8, 1.3), between(random, 0.75, 1.0)),
            1 => (between(random, 1.5, 2.6), between(random, 0.7, 0.95)),
            2 => (between(random, 0.9, 2.4), 0.06),
            _ => (length - between(random, 0.5, 1.2), between(random, 0.8, 1.1)),
        };
        let pier = between(random, 0.4, 1.0);
        let fitting = (((length - 0.5 + pier) / (width + pier)).floor() as usize).min(4);
        if fitting == 0 {
            return false;
        }
        let number = if style == 3 || small { 1 } else { count(random, 1, fitting) };
        let total = number as f32 * width + (number - 1) as f32 * pier;
        let free = length - total;
        let start = if chance(random, 0.6) { 0.5 * free } else { between(random, 0.25, free - 0.25) };
        let mut any = false;
        for k in 0..number {
            let s = start + k as f32 * (width + pier);
            let top = (self.lowest_ceiling(wall, s, width) - between(random, 0.12, 0.5))
                .min(between(random, 2.05, 2.5).max(sill + 0.5));
            if top > sill + 0.45 {
                let opening = Opening { kind: OpeningKind::Window, s: [s, s + width], h: [sill, top] };
                any |= self.open(wall, opening);
            }
        }
        any
    }

    /// Adds an opening if it keeps its distance from others and fits below the ceiling.
    fn open(&mut self, wall: usize, opening: Opening) -> bool {
        let Wall { length_m, ref openings, .. } = self.walls[wall];
        let clear = openings.iter().all(|o| opening.s[0] > o.s[1] + 0.2 || opening.s[1] < o.s[0] - 0.2);
        let inside = opening.s[0] > 0.1 && opening.s[1] < length_m - 0.1;
        let high = self.lowest_ceiling(wall, opening.s[0], opening.width_m()) > opening.h[1] + 0.08;
        let fits = clear && inside && high;
        if fits {
            self.walls[wall].openings.push(opening);
        }
        fits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn openings_stay_inside_their_walls() {
        let config = SynthConfig::default();
        for index in 0..300 {
            let mut random = lo_random::stream(5, "plan", index);
            let kind = RoomKind::ALL[index as usize % RoomKind::ALL.len()];
            let glazed = (index % 2 == 1).then(|| lo_random::stream(5, "glazed", index));
            let plan = Plan::draw(&mut random, kind, &config, 1.0, glazed);
            assert!((2.2..=if kind == RoomKind::Hall { 7.0 } else { 4.2 }).contains(&plan.height_m));
            assert!(plan.walls.iter().any(|w| w.openings.iter().any(|o| !o.is_window())), "{index} has no door");
            for wall in &plan.walls {
                for o in &wall.openings {
                    assert!(
                        wall.can_have_openings && o.s[0] > 0.0 && o.s[1] < wall.length_m && o.h[0] < o.h[1],
                        "{index} {o:?}"
                    );
                    for s in o.s {
                        assert!(plan.ceiling(wall.start + wall.along * s) > o.h[1], "{index}");
                    }
                }
            }
        }
    }
}
