//! What may shine: bright regions, seen or guessed, and what is not seen high above the floor.

use std::collections::BTreeMap;

use lo_geometry::{Vec3, smoothstep};
use lo_imaging::luminance;
use lo_octree::{LeafNode, LightOctree, key_from_xyz, xyz_from_key};
use lo_scene::{Room, RoomPlane, Side};

/// Leaves brighter than this multiple of the mean are lamps, windows or what they shine on.
const CAP: f32 = 2.0;

/// Shortest distance of candidates, metres.
const MIN_EDGE_M: f32 = 0.4;

/// Lamps of which nothing is known hang at least so high above the floor, metres.
const MIN_HEIGHT_M: f32 = 1.6;

/// Radius of a candidate, in distances of candidates.
const RADIUS: f32 = 0.6;

/// A candidate on a plane of the room shines away from it: within this distance, metres.
const ON_PLANE_M: f32 = 0.35;

/// Share of the radius within which a lamp has its full radiance; from there it fades.
const FULL: f32 = 0.5;

/// What may give more light than is known.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Candidate {
    pub shape: Shape,
    /// Middle of what shines.
    pub position_m: Vec3,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Shape {
    /// A soft disc on what is not seen.
    Disc(Disc),
    /// What is brighter than surfaces are: lamps and windows, seen or guessed, which may be brighter still. Of each coarse node the middle of
    /// what shines in it, and the radius of a disc as large, metres.
    Bright { nodes: Vec<(Vec3, f32)> },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Disc {
    /// Into the room, where it lies on one of its planes.
    pub normal: Option<Vec3>,
    pub radius_m: f32,
    /// ∫ of the share of its radiance over its disc.
    pub area_m2: f32,
}

/// All candidates, and what of the leaves' luminance is a lamp's.
pub(crate) struct Candidates {
    pub all: Vec<Candidate>,
    depth: u32,
    /// Luminance from which on a leaf shines.
    pub cap: f32,
    /// Key of a coarse node → number of the bright candidate that it belongs to.
    owners: BTreeMap<u32, usize>,
}

/// Sums over the leaves of a coarse node.
#[derive(Clone, Copy, Default)]
struct Sums {
    place: Vec3,
    area: f32,
    excess_place: Vec3,
    excess: f32,
    bright_area: f32,
}

impl Sums {
    fn disc(&self) -> (Vec3, f32) {
        (self.excess_place / self.excess, (self.bright_area / std::f32::consts::PI).sqrt())
    }
}

impl Candidates {
    /// Bright regions, and one disc for each other coarse node with leaves that are not seen, high enough.
    pub fn new(light: &LightOctree, room: &Room) -> Self {
        let cube = light.cube;
        let depth = (0..=light.octree.depth()).rev().find(|&d| cube.node_edge_m(d) >= MIN_EDGE_M).unwrap_or(0);
        let edge_m = cube.node_edge_m(depth);
        let floor = room.floor();
        let leaves = || {
            let fine = light.octree.leaf_nodes().filter(move |leaf| leaf.depth >= depth);
            // Its surface in m², and its luminance.
            let weighed = |leaf: LeafNode| (leaf, cube.node_edge_m(leaf.depth).powi(2), lightness(light, leaf));
            fine.filter(|leaf| light.rgba[leaf.depth as usize][leaf.row][3] > 0.0).map(weighed)
        };
        let (sum, area) = leaves()
            .fold((0.0, 0.0), |(sum, total), (_, area_m2, luminance)| (sum + luminance * area_m2, total + area_m2));
        let cap = CAP * sum / area.max(1e-12);
        let mut nodes: BTreeMap<u32, Sums> = BTreeMap::new();
        for (leaf, area_m2, luminance) in leaves() {
            let key = light.octree.key(leaf);
            let middle_m = light.node_middle_m(leaf.depth, key);
            let sums = nodes.entry(key >> (3 * (leaf.depth - depth))).or_default();
            let excess = (luminance - cap).max(0.0) * area_m2;
            if excess > 0.0 {
                sums.excess += excess;
                sums.bright_area += area_m2;
                sums.excess_place += middle_m * excess;
            }
            let is_high = floor.is_none_or(|floor| floor.signed_distance_m(middle_m) > MIN_HEIGHT_M);
            if light.unseen(leaf) > 0.5 && is_high {
                sums.place += middle_m * area_m2;
                sums.area += area_m2;
            }
        }
        let (groups, owners) = bright_groups(&nodes);
        let radius_m = RADIUS * edge_m;
        let mut all: Vec<Candidate> = groups
            .iter()
            .map(|keys| {
                let own = || keys.iter().map(|key| &nodes[key]);
                let excess: f32 = own().map(|sums| sums.excess).sum();
                Candidate {
                    shape: Shape::Bright { nodes: own().map(Sums::disc).collect() },
                    position_m: own().map(|sums| sums.excess_place).sum::<Vec3>() / excess,
                }
            })
            .collect();
        for (key, sums) in &nodes {
            // A node that holds but a corner of a surface is its neighbour's.
            if owners.contains_key(key) || sums.area < 0.25 * edge_m * edge_m {
                continue;
            }
            let position_m = sums.place / sums.area;
            let near = |plane: &RoomPlane| plane.plane.signed_distance_m(position_m).abs();
            let planes = room.planes.iter().filter(|plane| plane.side != Side::Floor && near(plane) < ON_PLANE_M);
            let normal = planes.min_by(|a, b| near(a).total_cmp(&near(b))).map(|plane| plane.plane.normal);
            let shape = Shape::Disc(Disc { normal, radius_m, area_m2: effective_area_m2(radius_m) });
            all.push(Candidate { shape, position_m });
        }
        Self { all, depth, cap, owners }
    }

    /// Of bright regions alone what exceeds surfaces, as luminance.
    pub fn excess(&self, light: &LightOctree) -> LightOctree {
        let excess = light.merged(|leaf| Vec3::splat(self.excess_of(light, leaf).map_or(0.0, |(_, excess)| excess)));
        LightOctree { rgba: light.rows_with(|depth, row, _| excess[depth][row]), ..light.clone() }
    }

    /// The bright region of a leaf, and by how much the leaf's luminance exceeds a surface's.
    fn excess_of(&self, light: &LightOctree, leaf: LeafNode) -> Option<(usize, f32)> {
        let key = light.octree.key(leaf) >> (3 * leaf.depth.checked_sub(self.depth)?);
        let excess = lightness(light, leaf) - self.cap;
        Some((*self.owners.get(&key)?, excess)).filter(|_| excess > 0.0)
    }

    /// Gives candidates their radiance, bright regions so many times more than they have, and scales what is guessed.
    pub fn shine(&self, light: &mut LightOctree, solution: &[f32], scale: f32) {
        let shining = self.all.iter().zip(solution).filter(|(_, value)| **value > 0.0);
        let discs: Vec<(Vec3, f32, f32)> = shining
            .filter_map(|(candidate, &value)| match &candidate.shape {
                Shape::Disc(disc) => Some((candidate.position_m, disc.radius_m, value)),
                Shape::Bright { .. } => None,
            })
            .collect();
        light.change_leaves(|light, leaf| {
            let (radiance, open) = (light.radiance(leaf), light.unseen(leaf));
            let middle_m = light.node_middle_m(leaf.depth, light.octree.key(leaf));
            let of_disc = |&(position_m, radius_m, value): &(Vec3, f32, f32)| {
                value * share((middle_m - position_m).length() / radius_m)
            };
            let added = open * discs.iter().map(of_disc).sum::<f32>();
            let own = lightness(light, leaf).max(1e-6);
            let brighter = self.excess_of(light, leaf).map_or(0.0, |(owner, excess)| solution[owner] * excess / own);
            radiance * (1.0 + open * (scale - 1.0) + brighter) + added
        });
    }
}

/// Scales what is not seen, as [`fit_lamps`](crate::fit_lamps) does.
pub fn scale_guessed(light: &mut LightOctree, scale: f32) {
    light.change_leaves(|light, leaf| light.radiance(leaf) * (1.0 + light.unseen(leaf) * (scale - 1.0)));
}

/// Luminance of a leaf.
fn lightness(light: &LightOctree, leaf: LeafNode) -> f32 {
    luminance(light.radiance(leaf).to_array())
}

/// Coarse nodes with bright leaves, those that touch together, and the group of each.
fn bright_groups(nodes: &BTreeMap<u32, Sums>) -> (Vec<Vec<u32>>, BTreeMap<u32, usize>) {
    let is_bright = |key: &u32| nodes.get(key).is_some_and(|sums| sums.excess > 0.0);
    let (mut groups, mut owners) = (Vec::new(), BTreeMap::new());
    for &start in nodes.keys().filter(|key| is_bright(key)) {
        if owners.contains_key(&start) {
            continue;
        }
        let mut group = vec![start];
        owners.insert(start, groups.len());
        let mut next = 0;
        while let Some(&key) = group.get(next) {
            next += 1;
            let own = xyz_from_key(key).map(i64::from);
            let offsets = (0..27).map(|n| [n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1]);
            for offset in offsets {
                let at: [Option<u32>; 3] = std::array::from_fn(|i| u32::try_from(own[i] + offset[i]).ok());
                let [Some(x), Some(y), Some(z)] = at else { continue };
                let neighbour = key_from_xyz([x, y, z]);
                if is_bright(&neighbour) && !owners.contains_key(&neighbour) {
                    owners.insert(neighbour, groups.len());
                    group.push(neighbour);
                }
            }
        }
        groups.push(group);
    }
    (groups, owners)
}

/// ∫ share over the disc of a lamp.
fn effective_area_m2(radius_m: f32) -> f32 {
    const RINGS: usize = 64;
    let ring = |i: usize| {
        let at = (i as f32 + 0.5) / RINGS as f32;
        2.0 * std::f32::consts::PI * at * share(at) / RINGS as f32
    };
    (0..RINGS).map(ring).sum::<f32>() * radius_m * radius_m
}

/// Share of a lamp's radiance at a distance from its middle, in radii.
fn share(distance: f32) -> f32 {
    smoothstep(1.0, FULL, distance)
}
