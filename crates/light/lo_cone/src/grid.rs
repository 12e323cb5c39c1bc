use lo_octree::{LightOctree, MAX_ALPHA, xyz_from_key};
use rayon::prelude::*;

/// Greatest depth stored as a dense grid next to the tree: 64³ cells, whatever the octree's depth.
const DENSE_DEPTH: u32 = 6;

/// Content of a cell: the slot of an occupied node, or empty.
///
/// An empty entry is negative. Its low bits hold the chessboard distance to the nearest cell of that level that is
/// occupied or in a crease.
#[derive(Clone, Copy, Default, PartialEq)]
pub(crate) struct Entry(i32);

const EMPTY: i32 = i32::MIN;
/// Flag of an empty entry: faces on two different axes lead to occupied cells.
const CREASE: i32 = 1 << 30;

impl Entry {
    #[inline(always)]
    fn empty(radius: i32) -> Self {
        Self(EMPTY | radius)
    }

    /// Returns the slot of an occupied node.
    #[inline(always)]
    pub fn slot(self) -> Option<u32> {
        u32::try_from(self.0).ok()
    }

    /// Returns the distance, in cells of the entry's level, below which all cells are empty too; 0 for an occupied
    /// node.
    #[inline(always)]
    pub fn radius(self) -> i32 {
        // Without a branch: the sign fills a mask.
        self.0 & !(EMPTY | CREASE) & (self.0 >> 31)
    }

    /// Returns [`Entry::radius`], but 0 where the cell is in a crease between occupied ones, at its level or below.
    #[inline(always)]
    pub fn radius_without_crease(self) -> i32 {
        self.radius() & !((self.0 << 1) >> 31)
    }
}

/// A lighting octree in the layout of the inner loop.
///
/// Every occupied node (it or a descendant has features) has a *slot*, numbered through all depths from the root. An
/// [`Entry`] is a slot or empty. Down to the dense depth each cell has an entry that is found without a descent, and
/// empty cells store the distance to the next occupied cell. Below it each slot has the entries of its eight children;
/// for a node that is not split these are the node itself.
///
/// Positions are in leaf edges from the lowest corner of the cube. The *level* of a node counts from the leaves up.
#[derive(Clone)]
pub(crate) struct Grid {
    depth: u32,
    dense_depth: u32,
    max_level: u32,
    /// Entries of all cells of the dense depths, root first; in each depth z varies fastest.
    cells: Vec<Entry>,
    /// Entries of the children of each slot above the leaves.
    children: Vec<[Entry; 8]>,
    /// Linear RGB radiance and extinction per leaf edge of each slot.
    values: Vec<[f32; 4]>,
    nodes: Vec<SlotNode>,
    /// Whether there are leaves at several depths.
    mixed_depths: bool,
}

/// The node of a slot.
#[derive(Clone, Copy)]
pub(crate) struct SlotNode {
    pub depth: u8,
    /// Feature row, or −1 where only descendants have features.
    pub row: i32,
    /// Derivative of the extinction per leaf edge by opacity; 0 where opacity is clamped.
    pub extinction_slope: f32,
}

impl Grid {
    pub fn new(light: &LightOctree) -> Self {
        let depth = light.octree.depth();
        let dense_depth = depth.min(DENSE_DEPTH);
        let (entries, nodes, values) = number_slots(light);
        let children = child_entries(light, &entries);
        let cells = dense_cells(entries[0][0], &children, dense_depth);
        let max_level = depth - light.octree.full_depth();
        let mixed_depths = light.leaves().any(|(leaf_depth, _)| leaf_depth < depth as usize);
        let mut grid = Self { depth, dense_depth, max_level, cells, children, values, nodes, mixed_depths };
        grid.mark_creases_below_dense(light, &entries);
        grid
    }

    /// Returns the number of leaves along an edge of the cube.
    pub fn side(&self) -> i32 {
        1 << self.depth
    }

    /// Returns the level of the coarsest depth that is sampled.
    pub fn max_level(&self) -> u32 {
        self.max_level
    }

    /// Returns linear RGB radiance and extinction per leaf edge.
    #[inline(always)]
    pub fn value(&self, slot: u32) -> [f32; 4] {
        self.values[slot as usize]
    }

    /// Returns the level of a slot's node where it is a leaf above the finest level. Elsewhere, returns at most the
    /// node's level.
    #[inline(always)]
    pub fn least_level(&self, slot: u32) -> i32 {
        if self.mixed_depths { self.depth as i32 - i32::from(self.nodes[slot as usize].depth) } else { 0 }
    }

    /// Returns the nodes of all slots.
    pub fn nodes(&self) -> &[SlotNode] {
        &self.nodes
    }

    /// Returns the level of the finest dense grid.
    #[inline(always)]
    pub fn dense_level(&self) -> i32 {
        (self.depth - self.dense_depth) as i32
    }

    /// Returns the entry at `level` that contains the leaf cell `leaf` inside the cube.
    #[inline(always)]
    pub fn find(&self, leaf: [i32; 3], level: i32) -> Entry {
        let mut shift = level.max(self.dense_level());
        let mut entry = self.dense_cell(leaf, shift);
        while shift > level && entry.slot().is_some() {
            shift -= 1;
            entry = self.child(entry, leaf, shift);
        }
        entry
    }

    /// Returns the entry at `level`, at or above the finest dense level, that contains the leaf cell `leaf` inside the
    /// cube.
    #[inline(always)]
    #[expect(unsafe_code)]
    pub fn dense_cell(&self, leaf: [i32; 3], level: i32) -> Entry {
        let side = self.side();
        debug_assert!(
            leaf.iter().all(|c| (0..side).contains(c)) && (self.dense_level()..=self.depth as i32).contains(&level)
        );
        let depth = self.depth as i32 - level;
        let [x, y, z] = leaf;
        let index = dense_start(depth) + ((((x >> level) << depth) | (y >> level)) << depth | (z >> level));
        // SAFETY: the leaf is in the cube and the level is dense, so its cell exists.
        unsafe { *self.cells.get_unchecked(index as usize) }
    }

    /// Descends from an occupied entry of the level above to its child at `level`.
    #[inline(always)]
    #[expect(unsafe_code)]
    pub fn child(&self, entry: Entry, leaf: [i32; 3], level: i32) -> Entry {
        debug_assert!((0..self.children.len() as i32).contains(&entry.0));
        // SAFETY: entries above the leaves are indices into `children`, and an octant is below 8.
        unsafe { *self.children.get_unchecked(entry.0 as usize).get_unchecked(octant(leaf, level)) }
    }

    /// Returns the child at `level` if `descend` (the entry must be occupied), else the entry; without a branch.
    #[inline(always)]
    pub fn child_if(&self, descend: bool, entry: Entry, leaf: [i32; 3], level: i32) -> Entry {
        // Row 0 always exists.
        let child = self.child(if descend { entry } else { Entry(0) }, leaf, level);
        if descend { child } else { entry }
    }

    fn mark_creases_below_dense(&mut self, light: &LightOctree, entries: &[Vec<Entry>]) {
        for depth in self.dense_depth..self.depth {
            let level = (self.depth - depth - 1) as i32;
            let nodes = light.octree.levels()[depth as usize].keys.par_iter().zip(&entries[depth as usize]);
            let creases: Vec<(u32, u8)> = nodes
                .filter_map(|(&key, entry)| Some((key, entry.slot()?)))
                .filter_map(|(key, slot)| {
                    let parent = xyz_from_key(key).map(|c| (c as i32) << (level + 1));
                    let mut mask = 0;
                    for (child, entry) in self.children[slot as usize].iter().enumerate() {
                        let leaf = [4, 2, 1].map(|bit| i32::from(child & bit != 0) << level);
                        let leaf = std::array::from_fn(|axis| parent[axis] + leaf[axis]);
                        let occupied = |neighbour| self.find(neighbour, level).slot().is_some();
                        if entry.slot().is_none() && is_crease(leaf, 1 << level, self.side(), occupied) {
                            mask |= 1 << child;
                        }
                    }
                    (mask != 0).then_some((slot, mask))
                })
                .collect();
            for (slot, mask) in creases {
                for (child, entry) in self.children[slot as usize].iter_mut().enumerate() {
                    entry.0 |= if mask >> child & 1 == 1 { CREASE } else { 0 };
                }
            }
        }
    }
}

/// Returns whether faces on at least two axes of the cell with corner `leaf` and this edge lead to occupied cells.
fn is_crease(leaf: [i32; 3], edge: i32, side: i32, occupied: impl Fn([i32; 3]) -> bool) -> bool {
    let axes = (0..3).filter(|&axis| {
        [-edge, edge].into_iter().any(|step| {
            let mut neighbour = leaf;
            neighbour[axis] += step;
            (0..side).contains(&neighbour[axis]) && occupied(neighbour)
        })
    });
    axes.count() >= 2
}

#[inline(always)]
fn octant(leaf: [i32; 3], shift: i32) -> usize {
    let bit = |c: i32| ((c >> shift) & 1) as usize;
    bit(leaf[0]) << 2 | bit(leaf[1]) << 1 | bit(leaf[2])
}

/// Returns the index of the first cell of a depth: (8^depth − 1) / 7 cells are in the depths above.
#[inline(always)]
fn dense_start(depth: i32) -> i32 {
    ((1 << (3 * depth)) - 1) / 7
}

/// Computes the entry of each node of each depth, and node and value of each slot.
fn number_slots(light: &LightOctree) -> (Vec<Vec<Entry>>, Vec<SlotNode>, Vec<[f32; 4]>) {
    let levels = light.octree.levels();
    let mut occupied: Vec<Vec<bool>> =
        levels.iter().map(|level| level.rows.iter().map(|&row| row >= 0).collect()).collect();
    for d in (0..levels.len() - 1).rev() {
        let (upper, lower) = occupied.split_at_mut(d + 1);
        for (node, &first) in levels[d].children.iter().enumerate() {
            if first >= 0 {
                upper[d][node] |= lower[0][first as usize..][..8].contains(&true);
            }
        }
    }
    let (mut nodes, mut values) = (Vec::new(), Vec::new());
    let entries = levels
        .iter()
        .zip(&occupied)
        .enumerate()
        .map(|(depth, (level, occupied))| {
            let mut entry = |(&row, &occupied): (&i32, &bool)| {
                if !occupied {
                    return Entry::empty(1);
                }
                let (value, extinction_slope) = value(light, depth, row);
                nodes.push(SlotNode { depth: depth as u8, row, extinction_slope });
                values.push(value);
                Entry(nodes.len() as i32 - 1)
            };
            level.rows.iter().zip(occupied).map(&mut entry).collect()
        })
        .collect();
    (entries, nodes, values)
}

fn child_entries(light: &LightOctree, entries: &[Vec<Entry>]) -> Vec<[Entry; 8]> {
    let levels = light.octree.levels();
    let mut children = Vec::new();
    for (d, level) in levels[..levels.len() - 1].iter().enumerate() {
        for (&first, &entry) in level.children.iter().zip(&entries[d]).filter(|(_, entry)| entry.slot().is_some()) {
            children.push(match usize::try_from(first) {
                Ok(first) => std::array::from_fn(|octant| entries[d + 1][first + octant]),
                Err(_) => [entry; 8],
            });
        }
    }
    if children.is_empty() {
        children.push([Entry::empty(1); 8]);
    }
    children
}

/// Returns radiance and extinction per leaf edge, −ln(1 − α) / edge, and the derivative of extinction by opacity α; α
/// is clamped.
fn value(light: &LightOctree, depth: usize, row: i32) -> ([f32; 4], f32) {
    let Ok(row) = usize::try_from(row) else { return ([0.0; 4], 0.0) };
    let [r, g, b, alpha] = light.rgba[depth][row];
    let edge = (1u32 << (light.octree.depth() as usize - depth)) as f32;
    let slope = if (0.0..=MAX_ALPHA).contains(&alpha) { 1.0 / ((1.0 - alpha) * edge) } else { 0.0 };
    ([r, g, b, -(-alpha.clamp(0.0, MAX_ALPHA)).ln_1p() / edge], slope)
}

/// Computes the entries of all cells down to `dense_depth`, with distances and creases.
fn dense_cells(root: Entry, children: &[[Entry; 8]], dense_depth: u32) -> Vec<Entry> {
    let mut cells = vec![root];
    let mut above = 0;
    for depth in 1..=dense_depth {
        let side = 1i32 << depth;
        let mut grid = Vec::with_capacity(1 << (3 * depth));
        for x in 0..side {
            for y in 0..side {
                for z in 0..side {
                    let parent = ((x >> 1) << (depth - 1) | y >> 1) << (depth - 1) | z >> 1;
                    grid.push(match cells[above + parent as usize].slot() {
                        Some(slot) => children[slot as usize][octant([x, y, z], 0)],
                        None => Entry::empty(1),
                    });
                }
            }
        }
        set_distances(&mut grid, side as usize);
        above = cells.len();
        cells.extend(grid);
    }
    cells
}

/// Marks the empty cells in creases. Writes into each other empty cell its chessboard distance to the nearest cell that
/// is occupied or in a crease.
///
/// A row of cells is a word of `side` ≤ 64 bits. The reached region grows by one cell in all directions until it fills
/// the grid.
fn set_distances(grid: &mut [Entry], side: usize) {
    let occupied: Vec<u64> = grid
        .chunks(side)
        .map(|row| row.iter().rev().fold(0, |word, entry| word << 1 | u64::from(entry.slot().is_some())))
        .collect();
    if occupied.iter().all(|&word| word == 0) {
        grid.fill(Entry::empty(side as i32));
        return;
    }
    let inside = u64::MAX >> (64 - side);
    // The rows before and behind a row, along y and along x.
    let beside = |words: &[u64], row: usize| {
        let before = if row.is_multiple_of(side) { 0 } else { words[row - 1] };
        let behind = if row % side + 1 < side { words[row + 1] } else { 0 };
        (before, behind)
    };
    let across = |words: &[u64], row: usize| {
        let before = if row >= side { words[row - side] } else { 0 };
        (before, words.get(row + side).copied().unwrap_or(0))
    };
    let mark = |grid: &mut [Entry], row: usize, mut cells: u64, entry: Entry| {
        while cells != 0 {
            grid[row * side + cells.trailing_zeros() as usize] = entry;
            cells &= cells - 1;
        }
    };

    let mut reached = occupied.clone();
    for row in 0..side * side {
        let ((x0, x1), (y0, y1)) = (across(&occupied, row), beside(&occupied, row));
        let (x, y, z) = (x0 | x1, y0 | y1, occupied[row] << 1 | occupied[row] >> 1);
        let creases = (x & y | y & z | z & x) & !occupied[row] & inside;
        mark(grid, row, creases, Entry(EMPTY | CREASE | 1));
        reached[row] |= creases;
    }
    for distance in 1..side as i32 {
        let along_z: Vec<u64> = reached.iter().map(|word| word | word << 1 | word >> 1).collect();
        let with_y = |row: usize| {
            let (before, behind) = beside(&along_z, row);
            before | along_z[row] | behind
        };
        let along_y: Vec<u64> = (0..side * side).map(with_y).collect();
        let mut grew = false;
        for row in 0..side * side {
            let (before, behind) = across(&along_y, row);
            let new = (before | along_y[row] | behind) & !reached[row] & inside;
            mark(grid, row, new, Entry::empty(distance));
            reached[row] |= new;
            grew |= new != 0;
        }
        if !grew {
            break;
        }
    }
}
