use octree::{LightOctree, MAX_ALPHA};

/// Greatest depth that is kept as a dense grid beside the tree: 64³ cells, whatever the octree's depth.
const DENSE_DEPTH: u32 = 6;

/// Marks an entry as empty; the low bits hold the chessboard distance to the nearest cell that is not.
const EMPTY: u32 = 1 << 31;

/// A lighting octree in the form that the inner loop wants.
///
/// Every occupied node (it or a node below it has features) has a *slot*, counted through all depths from the root. An
/// *entry* is a slot or [`EMPTY`]. Down to the dense depth each cell has an entry that is found without a descent, and empty
/// cells know how far away the next occupied cell is. Below it each slot has the entries of its eight children, for which a
/// node that is not split answers itself. Positions are in leaf edges from the lowest corner of the cube; the *level* of a
/// node counts from the leaves up.
pub(crate) struct Grid {
    depth: u32,
    dense_depth: u32,
    max_level: u32,
    /// Entries of all cells of the dense depths, the root first; in each depth z varies fastest.
    cells: Vec<u32>,
    /// Entries of the children of each slot above the leaves.
    children: Vec<[u32; 8]>,
    /// Linear RGB radiance and extinction per leaf edge of each slot.
    values: Vec<[f32; 4]>,
    nodes: Vec<SlotNode>,
}

/// The node behind a slot.
#[derive(Clone, Copy)]
pub(crate) struct SlotNode {
    pub depth: u8,
    /// Row of its features, or −1 where only nodes below it have some.
    pub row: i32,
    /// Derivative of its extinction per leaf edge by its opacity; 0 where that is clamped.
    pub extinction_slope: f32,
}

/// What lies at a position.
#[derive(Clone, Copy)]
pub(crate) enum Cell {
    /// An occupied node.
    Slot(u32),
    /// Nothing, nor in the other cells of `level` at a distance below `radius` from that of the position. In a coarser level
    /// they may share a node with something.
    Empty { level: u32, radius: i32 },
}

impl Grid {
    pub fn new(light: &LightOctree) -> Self {
        let depth = light.octree.depth();
        let dense_depth = depth.min(DENSE_DEPTH);
        let (entries, nodes, values) = number_slots(light);
        let children = child_entries(light, &entries);
        let cells = dense_cells(entries[0][0], &children, dense_depth);
        Self { depth, dense_depth, max_level: depth - light.octree.full_depth(), cells, children, values, nodes }
    }

    /// Leaves along an edge of the cube.
    pub fn side(&self) -> i32 {
        1 << self.depth
    }

    /// Level of the coarsest depth that is sampled.
    pub fn max_level(&self) -> u32 {
        self.max_level
    }

    /// Linear RGB radiance and extinction per leaf edge.
    #[inline(always)]
    pub fn value(&self, slot: u32) -> [f32; 4] {
        self.values[slot as usize]
    }

    /// The nodes of all slots.
    pub fn nodes(&self) -> &[SlotNode] {
        &self.nodes
    }

    /// What the leaf cell `leaf`, inside of the cube, belongs to at `level`.
    #[inline(always)]
    pub fn find(&self, leaf: [i32; 3], level: u32) -> Cell {
        let [entry] = self.dense_cells_at(&[[leaf[0]], [leaf[1]], [leaf[2]]], &[level]);
        self.descend(entry, leaf, level)
    }

    /// The entries of the dense cells that leaf cells belong to at a level, or at the finest dense one.
    #[inline(always)]
    pub fn dense_cells_at<const LANES: usize>(&self, leaf: &[[i32; LANES]; 3], level: &[u32; LANES]) -> [u32; LANES] {
        let mut index = [0u32; LANES];
        for lane in 0..LANES {
            let shift = level[lane].max(self.depth - self.dense_depth);
            let depth = self.depth - shift;
            let (x, y, z) =
                ((leaf[0][lane] >> shift) as u32, (leaf[1][lane] >> shift) as u32, (leaf[2][lane] >> shift) as u32);
            index[lane] = ((1 << (3 * depth)) - 1) / 7 + (((x << depth | y) << depth) | z);
        }
        let mut entries = [0u32; LANES];
        for lane in 0..LANES {
            entries[lane] = self.cells[index[lane] as usize];
        }
        entries
    }

    /// From the dense cell of `leaf` at `level` down to the level itself.
    #[inline(always)]
    pub fn descend(&self, mut entry: u32, leaf: [i32; 3], level: u32) -> Cell {
        let mut shift = level.max(self.depth - self.dense_depth);
        let mut radius = (entry & !EMPTY) as i32;
        while shift > level && entry & EMPTY == 0 {
            shift -= 1;
            entry = self.children[entry as usize][octant(leaf, shift)];
            radius = 1;
        }
        if entry & EMPTY != 0 { Cell::Empty { level: shift, radius } } else { Cell::Slot(entry) }
    }
}

#[inline(always)]
fn octant(leaf: [i32; 3], shift: u32) -> usize {
    let bit = |c: i32| ((c >> shift) & 1) as usize;
    bit(leaf[0]) << 2 | bit(leaf[1]) << 1 | bit(leaf[2])
}

/// Index of a cell among those of all dense depths: (8^depth − 1) / 7 cells are in the depths above.
#[inline(always)]
fn dense_index(leaf: [i32; 3], depth: u32, shift: u32) -> usize {
    let [x, y, z] = leaf.map(|c| (c >> shift) as usize);
    dense_start(depth) + (((x << depth) | y) << depth | z)
}

#[inline(always)]
fn dense_start(depth: u32) -> usize {
    ((1usize << (3 * depth)) - 1) / 7
}

/// The entry of each node of each depth; node and value of each slot.
fn number_slots(light: &LightOctree) -> (Vec<Vec<u32>>, Vec<SlotNode>, Vec<[f32; 4]>) {
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
                    return EMPTY | 1;
                }
                let (value, extinction_slope) = value(light, depth, row);
                nodes.push(SlotNode { depth: depth as u8, row, extinction_slope });
                values.push(value);
                nodes.len() as u32 - 1
            };
            level.rows.iter().zip(occupied).map(&mut entry).collect()
        })
        .collect();
    (entries, nodes, values)
}

fn child_entries(light: &LightOctree, entries: &[Vec<u32>]) -> Vec<[u32; 8]> {
    let levels = light.octree.levels();
    let mut children = Vec::new();
    for (d, level) in levels[..levels.len() - 1].iter().enumerate() {
        for (&first, &entry) in level.children.iter().zip(&entries[d]).filter(|(_, entry)| **entry & EMPTY == 0) {
            children.push(match usize::try_from(first) {
                Ok(first) => std::array::from_fn(|octant| entries[d + 1][first + octant]),
                Err(_) => [entry; 8],
            });
        }
    }
    children
}

/// Radiance and extinction per leaf edge, and the derivative of that by the opacity α: −ln(1 − α) / edge, α clamped.
fn value(light: &LightOctree, depth: usize, row: i32) -> ([f32; 4], f32) {
    let Ok(row) = usize::try_from(row) else { return ([0.0; 4], 0.0) };
    let [r, g, b, alpha] = light.rgba[depth][row];
    let edge = (1u32 << (light.octree.depth() as usize - depth)) as f32;
    let slope = if (0.0..=MAX_ALPHA).contains(&alpha) { 1.0 / ((1.0 - alpha) * edge) } else { 0.0 };
    ([r, g, b, -(-alpha.clamp(0.0, MAX_ALPHA)).ln_1p() / edge], slope)
}

/// Entries of all cells down to `dense_depth`, with distances.
fn dense_cells(root: u32, children: &[[u32; 8]], dense_depth: u32) -> Vec<u32> {
    let mut cells = vec![root];
    for depth in 1..=dense_depth {
        let side = 1i32 << depth;
        let mut grid = Vec::with_capacity(1 << (3 * depth));
        for x in 0..side {
            for y in 0..side {
                for z in 0..side {
                    let parent = cells[dense_index([x, y, z], depth - 1, 1)];
                    grid.push(if parent & EMPTY != 0 {
                        EMPTY
                    } else {
                        children[parent as usize][octant([x, y, z], 0)]
                    });
                }
            }
        }
        set_distances(&mut grid, side as usize);
        cells.extend(grid);
    }
    cells
}

/// Writes into each empty cell its chessboard distance to the nearest occupied one.
///
/// A row of cells is a word of `side` ≤ 64 bits; the occupied cells grow by one cell in all directions until they fill the grid.
fn set_distances(grid: &mut [u32], side: usize) {
    let mut reached: Vec<u64> = grid
        .chunks(side)
        .map(|row| row.iter().rev().fold(0, |word, entry| word << 1 | u64::from(entry & EMPTY == 0)))
        .collect();
    if reached.iter().all(|&word| word == 0) {
        grid.fill(EMPTY | side as u32);
        return;
    }
    for distance in 1..side as u32 {
        let along_z: Vec<u64> = reached.iter().map(|word| word | word << 1 | word >> 1).collect();
        let along_y: Vec<u64> = (0..side * side)
            .map(|row| {
                let y = row % side;
                let before = if y > 0 { along_z[row - 1] } else { 0 };
                let after = if y + 1 < side { along_z[row + 1] } else { 0 };
                before | along_z[row] | after
            })
            .collect();
        let mut grew = false;
        for row in 0..side * side {
            let before = if row >= side { along_y[row - side] } else { 0 };
            let after = along_y.get(row + side).copied().unwrap_or(0);
            let mut new = (before | along_y[row] | after) & !reached[row] & (u64::MAX >> (64 - side));
            reached[row] |= new;
            grew |= new != 0;
            while new != 0 {
                grid[row * side + new.trailing_zeros() as usize] = EMPTY | distance;
                new &= new - 1;
            }
        }
        if !grew {
            break;
        }
    }
}
