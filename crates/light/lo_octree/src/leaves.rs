//! Averages points per leaf, in time and memory proportional to the number of points.
//!
//! 1. Each chunk of points is sorted by *bucket* (the leaf's ancestor a few levels up) with one counting sort.
//! 2. A bucket has so few leaves that a small table finds the sums of each; the chunks are read in order.
//!
//! The points of a leaf are thus always added in input order, whatever the number of threads or the chunk size.

use lo_geometry::{Cube, Vec3};
use rayon::prelude::*;

use crate::key::{key_from_xyz, spread};
use crate::{Provenance, RadiancePoint};

/// Counts of the points used and dropped when an octree is built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BuildReport {
    /// Points that went into a leaf.
    pub used: usize,
    /// Points dropped because they lie outside of the cube.
    pub outside: usize,
    /// Points dropped because their position or radiance is NaN or infinite.
    pub not_finite: usize,
}

/// The occupied leaves of one depth, in the order of their keys.
#[derive(Debug, Default)]
pub(crate) struct Leaves {
    pub keys: Vec<u32>,
    pub rgba: Vec<[f32; 4]>,
    pub seen: Vec<u8>,
}

/// Means over the points of each leaf, with the number of points.
#[derive(Debug, Default)]
pub(crate) struct Averaged {
    pub leaves: Leaves,
    pub counts: Vec<u32>,
}

/// Small enough that sorting a chunk stays in a core's cache.
const CHUNK_POINTS: usize = 1 << 14;

/// Key of a dropped point; valid keys have at most 30 bits.
const DROPPED: u32 = u32::MAX;

/// Bit of [`Entry::leaf`] that marks an observed point; a leaf's number in its bucket has at most 15 bits.
const SEEN: u32 = 1 << 31;

/// Averages the finite points inside the cube per leaf of `depth`; every leaf gets opacity `alpha`.
pub(crate) fn average_points(points: &[RadiancePoint], cube: Cube, depth: u32, alpha: f32) -> (Averaged, BuildReport) {
    let buckets = Buckets::new(depth);
    // At most 64 chunks, so that their tables stay small compared with the points.
    let chunks: Vec<SortedChunk> =
        points.par_chunks(CHUNK_POINTS.max(points.len() / 64)).map(|chunk| buckets.sort(chunk, cube, depth)).collect();
    let report = BuildReport {
        used: chunks.iter().map(|chunk| chunk.entries.len()).sum(),
        outside: chunks.iter().map(|chunk| chunk.outside).sum(),
        not_finite: chunks.iter().map(|chunk| chunk.not_finite).sum(),
    };
    let parts: Vec<Averaged> = buckets
        .groups(&chunks, report.used)
        .into_par_iter()
        .map(|group| buckets.average(&chunks, group, alpha))
        .collect();
    let mut all = Averaged::default();
    for Averaged { leaves, counts } in parts {
        all.leaves.keys.extend(leaves.keys);
        all.leaves.rgba.extend(leaves.rgba);
        all.leaves.seen.extend(leaves.seen);
        all.counts.extend(counts);
    }
    (all, report)
}

/// Returns the key of the leaf of `depth` that contains a point of the half-open cube.
#[inline]
pub(crate) fn leaf_key(point: Vec3, cube: Cube, depth: u32) -> u32 {
    let position = (point - cube.origin_m) * ((1i32 << depth) as f32 / cube.edge_m);
    key_from_xyz(position.to_array().map(|p| leaf_coordinate(p, depth)))
}

/// Converts a position in leaf edges to an integer coordinate.
#[inline]
fn leaf_coordinate(position: f32, depth: u32) -> u32 {
    // Rounding may carry a position just below the far face up to it. (Conversion to i32 is one instruction, to u32
    // several.)
    (position as i32).min((1 << depth) - 1) as u32
}

/// Returns [`leaf_key`] of each point, or [`DROPPED`] for one that is outside the half-open cube or not finite.
fn leaf_keys(points: &[RadiancePoint], cube: Cube, depth: u32) -> Vec<u32> {
    /// Without branches and with one array per coordinate, the compiler vectorises over a group.
    const GROUP: usize = 16;
    let scale = (1i32 << depth) as f32 / cube.edge_m;
    let mut keys = vec![0; points.len()];
    for (group, keys) in points.chunks(GROUP).zip(keys.chunks_mut(GROUP)) {
        let (mut position, mut zero) = ([[0.0; GROUP]; 3], [0.0; GROUP]);
        for (lane, point) in group.iter().enumerate() {
            for (axis, position) in position.iter_mut().enumerate() {
                position[lane] = point.position_m[axis];
                // 0 · x is NaN unless x is finite.
                zero[lane] += 0.0 * point.radiance[axis];
            }
        }
        let (mut key, mut inside) = ([0; GROUP], [true; GROUP]);
        for (axis, position) in position.iter().enumerate() {
            for lane in 0..GROUP {
                let p = position[lane] - cube.origin_m[axis];
                inside[lane] &= (p >= 0.0) & (p < cube.edge_m);
                key[lane] |= spread(leaf_coordinate(p * scale, depth)) << (2 - axis);
            }
        }
        for lane in 0..GROUP {
            key[lane] = if inside[lane] & (zero[lane] == 0.0) { key[lane] } else { DROPPED };
        }
        keys.copy_from_slice(&key[..keys.len()]);
    }
    keys
}

/// A point without its position.
#[derive(Clone, Copy, Default)]
struct Entry {
    radiance: [f32; 3],
    /// Number of the leaf in its bucket, with the [`SEEN`] bit.
    leaf: u32,
}

/// The points of one chunk, stably sorted by bucket.
struct SortedChunk {
    entries: Vec<Entry>,
    /// `entries[starts[b]..starts[b + 1]]` belong to bucket `b`.
    starts: Vec<u32>,
    outside: usize,
    not_finite: usize,
}

/// Sums over the points of one leaf; f64 because a leaf may hold millions of points.
#[derive(Clone, Copy, Default)]
struct Sums {
    radiance: [f64; 3],
    points: u32,
    seen: u32,
}

/// Division of leaves into buckets: `leaf key = bucket << leaf_bits | number in the bucket`.
struct Buckets {
    count: usize,
    leaf_bits: u32,
}

impl Buckets {
    fn new(depth: u32) -> Self {
        let bucket_depth = if depth <= 8 { depth.min(4) } else { 5 };
        Self { count: 1 << (3 * bucket_depth), leaf_bits: 3 * (depth - bucket_depth) }
    }

    fn sort(&self, points: &[RadiancePoint], cube: Cube, depth: u32) -> SortedChunk {
        let (mut outside, mut not_finite) = (0, 0);
        let mut starts = vec![0; self.count + 1];
        let keys = leaf_keys(points, cube, depth);
        for (point, &key) in points.iter().zip(&keys) {
            if key != DROPPED {
                starts[(key >> self.leaf_bits) as usize + 1] += 1;
            } else if point.position_m.is_finite() && point.radiance.iter().all(|c| c.is_finite()) {
                outside += 1;
            } else {
                not_finite += 1;
            }
        }
        for bucket in 0..self.count {
            starts[bucket + 1] += starts[bucket];
        }
        let mut next = starts.clone();
        let mut entries = vec![Entry::default(); starts[self.count] as usize];
        for (point, key) in points.iter().zip(keys).filter(|&(_, key)| key != DROPPED) {
            let seen = if point.provenance == Provenance::Observed { SEEN } else { 0 };
            let place = &mut next[(key >> self.leaf_bits) as usize];
            entries[*place as usize] =
                Entry { radiance: point.radiance, leaf: key & ((1 << self.leaf_bits) - 1) | seen };
            *place += 1;
        }
        SortedChunk { entries, starts, outside, not_finite }
    }

    /// Returns ranges of buckets with similar numbers of points.
    fn groups(&self, chunks: &[SortedChunk], points: usize) -> Vec<std::ops::Range<usize>> {
        let group_points = (points / (8 * rayon::current_num_threads())).max(1 << 12);
        let (mut groups, mut first, mut sum) = (Vec::new(), 0, 0);
        for bucket in 0..self.count {
            sum += chunks.iter().map(|c| (c.starts[bucket + 1] - c.starts[bucket]) as usize).sum::<usize>();
            if sum >= group_points || bucket + 1 == self.count {
                groups.push(first..bucket + 1);
                (first, sum) = (bucket + 1, 0);
            }
        }
        groups
    }

    fn average(&self, chunks: &[SortedChunk], buckets: std::ops::Range<usize>, alpha: f32) -> Averaged {
        const EMPTY: u32 = u32::MAX;
        let Averaged { mut leaves, mut counts } = Averaged::default();
        // Index into `sums` of each leaf of the bucket.
        let mut slots = vec![EMPTY; 1 << self.leaf_bits];
        let mut sums: Vec<Sums> = Vec::new();
        for bucket in buckets {
            for chunk in chunks {
                for entry in &chunk.entries[chunk.starts[bucket] as usize..chunk.starts[bucket + 1] as usize] {
                    let slot = &mut slots[(entry.leaf & !SEEN) as usize];
                    if *slot == EMPTY {
                        *slot = sums.len() as u32;
                        sums.push(Sums::default());
                    }
                    let sum = &mut sums[*slot as usize];
                    for (total, value) in sum.radiance.iter_mut().zip(entry.radiance) {
                        *total += f64::from(value.max(0.0));
                    }
                    sum.points += 1;
                    sum.seen += entry.leaf >> 31;
                }
            }
            if sums.is_empty() {
                continue;
            }
            for (leaf, slot) in slots.iter_mut().enumerate().filter(|(_, slot)| **slot != EMPTY) {
                let sum = sums[*slot as usize];
                *slot = EMPTY;
                let [r, g, b] = sum.radiance.map(|total| (total / f64::from(sum.points)) as f32);
                leaves.keys.push((bucket << self.leaf_bits | leaf) as u32);
                leaves.rgba.push([r, g, b, alpha]);
                leaves.seen.push((255.0 * f64::from(sum.seen) / f64::from(sum.points)).round() as u8);
                counts.push(sum.points);
            }
            sums.clear();
        }
        Averaged { leaves, counts }
    }
}
