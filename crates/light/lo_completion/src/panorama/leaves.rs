//! The leaves of an octree while a panorama is laid onto them.

use std::collections::HashSet;
use std::ops::ControlFlow;

use lo_cone::{ConeTracer, Settings};
use lo_geometry::{Ray, Vec3, pixel_solid_angle_sr};
use lo_imaging::luminance;
use lo_octree::{Ancestor, LeafRows, LightOctree, MAX_ALPHA, MAX_DEPTH, OctreeError, key_from_xyz};
use lo_scene::Frame;
use rayon::prelude::*;

use super::march::{Crossing, march};
use super::matching::weighted_median;
use super::rays::{RayLight, Rays};

/// Standard deviation of ln(1 + luminance / median) within a leaf from which it is split.
const DETAIL: f64 = 0.1;

/// Fewest rays, and pixels of the panorama, within a leaf that is split.
const MIN_RAYS: u32 = 3;
const MIN_PIXELS: f64 = 1.0;

/// Deviation that lamps make: they are split to one depth more, and as long as so many rays meet them.
const LAMP_DETAIL: f64 = 0.5;
const LAMP_RAYS: u32 = 2;

/// Surfaces nearer to the panorama's place than this, metres, are errors of the geometry: no camera stands there.
const CLEARANCE_M: f32 = 0.15;

/// What lies no more than so many edges of the leaf that closes the view behind it has the same light, with at least this weight: cones blend between leaves.
const BACKING: f32 = 2.0;
const BACKING_WEIGHT: f32 = 0.02;

/// The same for lamps on leaves that were half open: one leaf more, or what was guessed over a wide depth would all shine.
const LAMP_BACKING: f32 = 1.05;

/// The view is closed where less than this of a ray is left, and the ray ends where less than that is.
const CLOSED: f32 = 0.5;
const MIN_TRANSMITTANCE: f32 = 1e-3;

/// A leaf farther behind gets light where at least this share of a ray ends on it.
const MIN_SHARE: f32 = 0.05;

/// Where more than this of a ray leaves the cube, a leaf at the cube's side takes it up.
const OPEN: f32 = 0.5;

/// Opacity of leaves on which lamps are: parts of opaque leaves have no less.
const CLOSING_ALPHA: f32 = 0.89;

/// Columns of the panorama by which lamps are balanced, and bounds of the factor.
const BALANCE_COLUMNS: usize = 512;
const BALANCE: (f32, f32) = (0.5, 2.0);
const BALANCED: f32 = 0.005;

/// Bounds of the factor for what neither photo nor panorama sees.
const HIDDEN: (f32, f32) = (0.2, 5.0);

/// Depth and shuffled key.
type Node = (u32, u32);

/// Leaves of all depths.
pub(super) struct Leaves {
    pub leaves: Vec<Leaf>,
    /// Depth that leaves at the cube's side begin with.
    side_depth: u32,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    depth: u32,
    key: u32,
    /// As completion left it.
    rgba: [f32; 4],
    seen: u8,
    confidence: u8,
    lobe: [f32; 3],
    /// Whether the photo says nothing of its light.
    open: bool,
    /// Whether it closes a place where nothing was, or was only half closed: at the cube's side, or where a lamp is.
    closing: bool,
    /// What the panorama shows of it, without what is a lamp's.
    pub light: Option<[f32; 3]>,
    /// What a lamp has beyond that.
    lamp: [f32; 3],
}

/// What the rays give.
pub(super) struct Given {
    /// By leaf.
    sums: Vec<Sum>,
    /// Depths and keys of the empty nodes at the cube's side through which rays leave.
    pub sides: Vec<Node>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    weight: f64,
    light: [f64; 3],
    log: f64,
    log_squared: f64,
    clipped: f64,
    rays: u32,
    /// Of lamps, by solid angle, and the solid angle of what comes as far as the leaf.
    lamp: [f64; 3],
    arriving: f64,
    /// Of lamps that close the view.
    shown: [f64; 3],
    /// Brightest lamp of a ray.
    peak: [f32; 3],
}

/// A part of a ray that ends on a leaf.
struct Gift {
    leaf: u32,
    column: u32,
    weight: f32,
    /// Share of the ray that comes as far as the leaf.
    arriving: f32,
    /// Whether the view is closed here, or just before: lamps are nowhere else on the ray.
    closes: bool,
    behind: bool,
}

impl Leaves {
    /// All leaves of an octree, `confidence` by depth and row where there is one. Those that the photo did not see are open, and those in
    /// which every pixel of `frame` is clipped.
    pub fn new(light: &LightOctree, confidence: Option<&Vec<Vec<u8>>>, frame: &Frame) -> Self {
        let certain = certain(light, frame);
        let levels = light.octree.levels().iter().zip(0..);
        let leaves = levels.flat_map(|(level, depth)| {
            let nodes = (0..level.len()).filter(|&node| level.rows[node] >= 0 && level.children[node] < 0);
            let certain = &certain;
            nodes.map(move |node| {
                let (d, row) = (depth as usize, level.rows[node] as usize);
                let seen = light.seen[d][row];
                Leaf {
                    depth,
                    key: level.keys[node],
                    rgba: light.rgba[d][row],
                    seen,
                    confidence: confidence.map_or(0, |confidence| confidence[d][row]),
                    lobe: light.lobes.as_ref().map_or([0.0; 3], |lobes| lobes[d][row]),
                    open: seen == 0 || certain.get(&(depth, row)) == Some(&false),
                    closing: false,
                    light: None,
                    lamp: [0.0; 3],
                }
            })
        });
        let side_depth = light.octree.depth().saturating_sub(1).max(light.octree.full_depth());
        Self { leaves: leaves.collect(), side_depth }
    }

    /// Casts the rays from `place_m` through `topology`, an octree of these leaves.
    pub fn given(&self, topology: &LightOctree, rays: &Rays, place_m: Vec3) -> Given {
        let indices = self.indices(topology);
        let row = |row: usize| {
            let (mut gifts, mut sides) = (Vec::new(), Vec::new());
            for (column, direction) in (0..).zip(rays.directions(row)) {
                let ray = Ray { origin: place_m, direction };
                sides.extend(self.cast(topology, &indices, &ray, |gift| gifts.push(Gift { column, ..gift })));
            }
            (gifts, sides)
        };
        let rows: Vec<(Vec<Gift>, Vec<Node>)> = (0..rays.rows()).into_par_iter().map(row).collect();
        // Sums in the order of the rays, whatever the number of threads.
        let mut sums = vec![Sum::default(); self.leaves.len()];
        let mut sides = Vec::new();
        for (row, (gifts, open)) in rows.into_iter().enumerate() {
            let solid_angle = rays.solid_angle_sr(row);
            for gift in gifts {
                sums[gift.leaf as usize].add(rays.light(gift.column as usize, row), &gift, solid_angle);
            }
            sides.extend(open);
        }
        sides.sort_unstable();
        sides.dedup();
        Given { sums, sides }
    }

    /// One ray: what ends on which open leaf, and the empty node through which the better part of it leaves the cube.
    fn cast(
        &self,
        topology: &LightOctree,
        indices: &[Vec<u32>],
        ray: &Ray,
        mut give: impl FnMut(Gift),
    ) -> Option<Node> {
        let (mut left, mut closed_to_m) = (1.0f32, f32::INFINITY);
        // What came as far as the leaf that closes the view, its edge, and where the one behind it ends.
        let (mut came, mut closing_m, mut lamp_to_m, mut solid) = (0.0, 0.0, 0.0, false);
        let mut last = None;
        march(topology, ray, |crossing| {
            last = Some(crossing);
            let Some(row) = crossing.row.filter(|_| crossing.leave_m > CLEARANCE_M) else {
                return ControlFlow::Continue(());
            };
            let edge_m = topology.cube.node_edge_m(crossing.depth);
            let index = indices[crossing.depth as usize][row];
            let leaf = &self.leaves[index as usize];
            let opacity = crossing.opacity(leaf.rgba[3], edge_m);
            let ends = left * opacity;
            let backing = closed_to_m.is_finite() && crossing.enter_m <= closed_to_m;
            // Cones blend a leaf with the one behind it, so that has the lamp's light too.
            let behind = backing && crossing.enter_m <= lamp_to_m && (solid || edge_m <= 1.01 * closing_m);
            let arriving = match backing {
                true if behind => came,
                true => 0.0,
                false => left,
            };
            left -= ends;
            let closes = left < CLOSED && closed_to_m.is_infinite();
            if closes {
                (came, closing_m) = (arriving, edge_m);
                closed_to_m = crossing.enter_m + BACKING * edge_m;
                solid = !leaf.closing;
                let backing = if solid { BACKING } else { LAMP_BACKING };
                lamp_to_m = crossing.enter_m + backing * edge_m;
            }
            if leaf.open && (ends >= MIN_SHARE * opacity || backing) {
                let weight = ends.max(BACKING_WEIGHT * opacity);
                give(Gift { leaf: index, column: 0, weight, arriving, closes, behind });
            }
            let over = left < MIN_TRANSMITTANCE && crossing.leave_m > closed_to_m;
            if over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let last = last.filter(|last: &Crossing| left > OPEN && last.row.is_none())?;
        let depth = last.depth.max(self.side_depth);
        let end = topology.cube.unit_from_world(ray.origin + ray.direction * last.leave_m);
        let side = (1u32 << depth) as f32;
        let cell = (end * side).clamp(Vec3::ZERO, Vec3::splat(side - 1.0)).as_uvec3();
        // Rounding may have put the end into the neighbour, which need not be empty.
        let key = key_from_xyz(cell.to_array());
        let (found, node) = topology
            .octree
            .deepest(depth.min(topology.octree.depth()), key >> (3 * depth.saturating_sub(topology.octree.depth())));
        (topology.octree.levels()[found as usize].rows[node] < 0).then_some((depth, key))
    }

    /// The leaf of each row of an octree of these leaves, by depth; `u32::MAX` for rows above the leaves.
    fn indices(&self, topology: &LightOctree) -> Vec<Vec<u32>> {
        let by_depth = self.by_depth(topology.octree.depth());
        let levels = topology.octree.levels().iter().zip(by_depth);
        let of_level = levels.map(|(level, leaves)| {
            let mut leaves = leaves.into_iter();
            let rows = (0..level.len()).filter(|&node| level.rows[node] >= 0);
            rows.map(|node| if level.children[node] < 0 { leaves.next().unwrap_or(u32::MAX) } else { u32::MAX })
                .collect()
        });
        of_level.collect()
    }

    /// The leaves of each depth down to `depth`, in the order of their keys.
    fn by_depth(&self, depth: u32) -> Vec<Vec<u32>> {
        let mut by_depth = vec![Vec::new(); depth as usize + 1];
        for (index, leaf) in (0..).zip(&self.leaves) {
            by_depth[leaf.depth as usize].push(index);
        }
        for leaves in &mut by_depth {
            leaves.sort_unstable_by_key(|&index: &u32| self.leaves[index as usize].key);
        }
        by_depth
    }

    /// The leaves within which the panorama differs most, so many that no more than `budget` are added, none of depth `finest`.
    pub fn to_split(&self, given: &Given, rays: &Rays, finest: u32, budget: usize) -> Vec<usize> {
        let least = f64::from(MIN_RAYS).max(MIN_PIXELS * (rays.per_pixel * rays.per_pixel) as f64);
        let gain = |(index, (leaf, sum)): (usize, (&Leaf, &Sum))| {
            let variance = sum.variance();
            let lamp = variance > LAMP_DETAIL * LAMP_DETAIL;
            let (deepest, least) =
                if lamp { ((finest + 1).min(MAX_DEPTH), f64::from(LAMP_RAYS)) } else { (finest, least) };
            let fine = leaf.depth >= deepest || f64::from(sum.rays) < least;
            (!fine && variance > DETAIL * DETAIL).then_some((sum.weight * variance, index))
        };
        let mut gains: Vec<(f64, usize)> = self.leaves.iter().zip(&given.sums).enumerate().filter_map(gain).collect();
        gains.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        gains.truncate(budget / 7);
        gains.into_iter().map(|(_, index)| index).collect()
    }

    /// Divides leaves into eight. The opacity of crossing both halves is what that of the whole was.
    pub fn split(&mut self, chosen: &[usize], given: &Given) {
        for &index in chosen {
            let whole = self.leaves[index];
            let [r, g, b, alpha] = whole.rgba;
            let rgba = [r, g, b, 1.0 - (1.0 - alpha).sqrt()];
            // A part that no ray meets has the whole's light, but for the lamp.
            let light = given.sums[index].mean().or(whole.light);
            let child = |child: u32| Leaf { depth: whole.depth + 1, key: whole.key << 3 | child, rgba, light, ..whole };
            let mut children = (0..8).map(child);
            self.leaves[index] = children.next().unwrap_or(whole);
            self.leaves.extend(children);
        }
    }

    /// Makes leaves opaque on which lamps are: their light must not come from before and behind them. Whether there are any that were not.
    pub fn close_lamps(&mut self, given: &Given) -> bool {
        let mut closed = false;
        for (leaf, sum) in self.leaves.iter_mut().zip(&given.sums) {
            if sum.shown.iter().any(|&c| c > 0.0) && leaf.rgba[3] < CLOSING_ALPHA {
                leaf.rgba[3] = CLOSING_ALPHA;
                (leaf.closing, closed) = (true, true);
            }
        }
        closed
    }

    /// Puts opaque leaves into empty nodes.
    pub fn add_sides(&mut self, sides: &[Node]) {
        let leaf = |&(depth, key): &Node| Leaf {
            depth,
            key,
            rgba: [0.0, 0.0, 0.0, MAX_ALPHA],
            seen: 0,
            confidence: 0,
            lobe: [0.0; 3],
            open: true,
            closing: true,
            light: None,
            lamp: [0.0; 3],
        };
        self.leaves.extend(sides.iter().map(leaf));
    }

    /// Gives the leaves their light. Where the panorama was clipped it is a lower bound, and what completion guessed may be more.
    pub fn take(&mut self, given: &Given) {
        for (leaf, sum) in self.leaves.iter_mut().zip(&given.sums) {
            if let Some(mean) = sum.mean() {
                let bound = sum.clipped > 0.5 * sum.weight;
                leaf.light = Some(std::array::from_fn(|c| if bound { mean[c].max(leaf.rgba[c]) } else { mean[c] }));
                leaf.lamp = sum.lamp();
            }
        }
    }

    /// Makes the lamps together as bright at `place_m` as the panorama has them: cones read lamps that are smaller than their nodes less exactly than rays
    /// meet them. The factor, luminances together.
    pub fn balance_lamps(&mut self, light: &LightOctree, given: &Given, place_m: Vec3) -> Result<f32, OctreeError> {
        let shown: f64 = given.sums.iter().map(|sum| f64::from(luminance(sum.shown.map(|c| c as f32)))).sum();
        if shown <= 0.0 {
            return Ok(1.0);
        }
        let of_lamps = |leaf: &Leaf| [leaf.lamp[0], leaf.lamp[1], leaf.lamp[2], leaf.rgba[3]];
        let lamps = self.octree_with(light, of_lamps, |_, _| Ancestor::Merged)?;
        let tracer =
            ConeTracer::new(&lamps, Settings::default()).expect("the usual settings are valid, and there are no lobes");
        let seen = tracer.panorama(place_m, BALANCE_COLUMNS, BALANCE_COLUMNS / 2).radiance;
        let pixels = seen.pixels().iter().enumerate();
        let pixels = pixels.map(|(index, &rgb)| {
            f64::from(luminance(rgb) * pixel_solid_angle_sr(index / seen.width(), seen.width(), seen.height()))
        });
        let factor = (shown / pixels.sum::<f64>().max(1e-30)) as f32;
        // Peaks that are read right stay as they are.
        let factor = if (factor - 1.0).abs() < BALANCED { 1.0 } else { factor.clamp(BALANCE.0, BALANCE.1) };
        for leaf in &mut self.leaves {
            leaf.lamp = leaf.lamp.map(|c| factor * c);
        }
        Ok(factor)
    }

    /// Brings what neither photo nor panorama sees to the panorama's brightness, and gives the factors by channel.
    pub fn scale_hidden(&mut self, given: &Given) -> [f32; 3] {
        let factors = std::array::from_fn(|c| {
            let ratios = self.leaves.iter().zip(&given.sums).filter_map(|(leaf, sum)| {
                let (laid, guessed) = (leaf.light?[c], leaf.rgba[c]);
                (laid > 0.0 && guessed > 0.0).then(|| ((laid / guessed).ln(), sum.weight as f32))
            });
            weighted_median(ratios.collect()).map_or(1.0, f32::exp).clamp(HIDDEN.0, HIDDEN.1)
        });
        for leaf in self.leaves.iter_mut().filter(|leaf| leaf.open && leaf.light.is_none()) {
            (0..3).for_each(|c| leaf.rgba[c] *= factors[c]);
        }
        factors
    }

    /// Octree of these leaves, over the cube of `light`.
    pub fn octree(
        &self,
        light: &LightOctree,
        ancestor: impl Fn(u32, u32) -> Ancestor + Sync,
    ) -> Result<LightOctree, OctreeError> {
        self.octree_with(light, Leaf::final_rgba, ancestor)
    }

    fn octree_with(
        &self,
        light: &LightOctree,
        rgba: impl Fn(&Leaf) -> [f32; 4],
        ancestor: impl Fn(u32, u32) -> Ancestor + Sync,
    ) -> Result<LightOctree, OctreeError> {
        let finest = self.leaves.iter().map(|leaf| leaf.depth).max().unwrap_or(0).max(light.octree.depth());
        let of_depth = |indices: Vec<u32>| {
            let leaves = || indices.iter().map(|&index| &self.leaves[index as usize]);
            LeafRows {
                keys: leaves().map(|leaf| leaf.key).collect(),
                rgba: leaves().map(&rgba).collect(),
                seen: leaves().map(|leaf| if leaf.light.is_some() { 0 } else { leaf.seen }).collect(),
            }
        };
        let leaves = self.by_depth(finest).into_iter().map(of_depth).collect();
        LightOctree::from_leaves_by_depth(leaves, light.cube, light.octree.full_depth(), ancestor)
    }

    /// Makes `light` the octree of these leaves, and `confidence` that of its rows, at least `sure` (0 to 1) where the panorama gave the light; gives the
    /// panorama's share of each row.
    pub fn finish(
        &self,
        light: &mut LightOctree,
        confidence: Option<&mut Vec<Vec<u8>>>,
        sure: f32,
    ) -> Result<Vec<Vec<u8>>, OctreeError> {
        // Nodes above leaves that changed, and above those that were put where nothing was.
        let (mut touched, mut grown) = (HashSet::new(), HashSet::new());
        for leaf in self.leaves.iter().filter(|leaf| leaf.open) {
            for up in 1..=leaf.depth {
                let node = (leaf.depth - up, leaf.key >> (3 * up));
                let known = !touched.insert(node);
                if leaf.closing && grown.insert(node) {
                    continue;
                }
                if known {
                    break;
                }
            }
        }
        let before = &*light;
        let ancestor = |depth: u32, key: u32| match before.row(depth, key) {
            Some(row) if !touched.contains(&(depth, key)) => {
                Ancestor::Known(before.rgba[depth as usize][row], before.seen[depth as usize][row])
            }
            Some(row) if !grown.contains(&(depth, key)) => Ancestor::Opacity(before.rgba[depth as usize][row][3]),
            _ => Ancestor::Merged,
        };
        let mut laid = self.octree(before, ancestor)?;
        let indices = self.indices(&laid);
        let leaf_of = |depth: usize, row: usize| self.leaves.get(indices[depth][row] as usize);
        let share =
            above(&laid, |depth, _, row| leaf_of(depth, row).map(|leaf| if leaf.light.is_some() { 255 } else { 0 }));
        if let Some(confidence) = confidence {
            let sure = (255.0 * sure).round() as u8;
            let known = &*confidence;
            let new = above(&laid, |depth, key, row| match leaf_of(depth, row) {
                Some(leaf) if leaf.light.is_some() => Some(leaf.confidence.max(sure)),
                Some(leaf) => Some(leaf.confidence),
                None if touched.contains(&(depth as u32, key)) => None,
                None => before.row(depth as u32, key).map(|row| known[depth][row]),
            });
            *confidence = new;
        }
        if let Some(lobes) = &before.lobes {
            let of_level = |(depth, level): (usize, &lo_octree::Level)| {
                let of_row = |(row, key): (usize, u32)| match leaf_of(depth, row) {
                    Some(leaf) if leaf.light.is_some() => [0.0; 3],
                    Some(leaf) => leaf.lobe,
                    None => before.row(depth as u32, key).map_or([0.0; 3], |old| {
                        let own = 1.0 - f32::from(share[depth][row]) / 255.0;
                        lobes[depth][old].map(|v| own * v)
                    }),
                };
                level.row_keys().enumerate().map(of_row).collect()
            };
            laid.lobes = Some(laid.octree.levels().iter().enumerate().map(of_level).collect());
        }
        *light = laid;
        Ok(share)
    }
}

impl Leaf {
    fn final_rgba(&self) -> [f32; 4] {
        let lit = |[r, g, b]: [f32; 3]| [r + self.lamp[0], g + self.lamp[1], b + self.lamp[2], self.rgba[3]];
        self.light.map_or(self.rgba, lit)
    }
}

impl Sum {
    fn add(&mut self, ray: &RayLight, gift: &Gift, solid_angle: f32) {
        let [weight, arriving] = [gift.weight, gift.arriving].map(|share| f64::from(share * solid_angle));
        self.weight += weight;
        self.arriving += arriving;
        (0..3).for_each(|c| self.light[c] += weight * f64::from(ray.radiance[c]));
        if gift.closes || gift.behind {
            (0..3).for_each(|c| {
                self.lamp[c] += f64::from(solid_angle * ray.lamp[c]);
                self.shown[c] += if gift.closes { f64::from(solid_angle * ray.lamp[c]) } else { 0.0 };
                self.peak[c] = self.peak[c].max(ray.lamp[c]);
            });
        }
        let log = f64::from(if gift.closes { ray.lamp_log } else { ray.log });
        self.log += weight * log;
        self.log_squared += weight * log * log;
        self.clipped += if ray.clipped { weight } else { 0.0 };
        self.rays += 1;
    }

    /// Light without lamps, by what ends on the leaf.
    fn mean(&self) -> Option<[f32; 3]> {
        (self.weight > 0.0).then(|| self.light.map(|sum| (sum / self.weight) as f32))
    }

    /// Lamps, by what comes as far as the leaf: that is what is seen of it. No brighter than they are.
    fn lamp(&self) -> [f32; 3] {
        let seen = |c: usize| ((self.lamp[c] / self.arriving) as f32).min(self.peak[c]);
        if self.arriving > 0.0 { std::array::from_fn(seen) } else { [0.0; 3] }
    }

    fn variance(&self) -> f64 {
        if self.weight > 0.0 {
            (self.log_squared / self.weight - (self.log / self.weight).powi(2)).max(0.0)
        } else {
            0.0
        }
    }
}

/// By depth and row of the leaves that a frame's pixels with depth lie in: whether any of these is not clipped.
fn certain(light: &LightOctree, frame: &Frame) -> std::collections::HashMap<(u32, usize), bool> {
    let (clipped, clean) = (frame.clipped(), frame.without_flying_pixels());
    let mut certain = std::collections::HashMap::new();
    let pixels = (0..clean.depth_m.height()).flat_map(|y| (0..clean.depth_m.width()).map(move |x| (x, y)));
    for (x, y) in pixels {
        let at = light.cube.pulled_inside(clean.point(x, y).unwrap_or(Vec3::NAN));
        let Some((depth, node)) = light.locate(at, light.octree.depth()) else { continue };
        if let Ok(row) = usize::try_from(light.octree.levels()[depth as usize].rows[node]) {
            *certain.entry((depth, row)).or_insert(false) |= !clipped[(x, y)];
        }
    }
    certain
}

/// A value for each row of an octree, by depth: what `own` says by depth, key and row, else the mean of the node's non-empty children.
fn above(light: &LightOctree, own: impl Fn(usize, u32, usize) -> Option<u8>) -> Vec<Vec<u8>> {
    let levels = light.octree.levels();
    let mut values: Vec<Vec<u8>> = vec![Vec::new(); levels.len()];
    for (depth, level) in levels.iter().enumerate().rev() {
        let nodes = (0..level.len()).filter(|&node| level.rows[node] >= 0);
        let of_node = |node: usize| {
            own(depth, level.keys[node], level.rows[node] as usize).unwrap_or_else(|| {
                let first = level.children[node].max(0) as usize;
                let below = levels.get(depth + 1).map_or(&[][..], |below| &below.rows[first..first + 8]);
                let rows = below.iter().filter_map(|&row| usize::try_from(row).ok());
                let (sum, count) =
                    rows.fold((0, 0), |(sum, count), row| (sum + u32::from(values[depth + 1][row]), count + 1));
                ((sum + count / 2) / count.max(1)) as u8
            })
        };
        let of_level = nodes.map(of_node).collect();
        values[depth] = of_level;
    }
    values
}
