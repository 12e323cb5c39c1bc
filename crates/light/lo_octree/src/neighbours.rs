use rayon::prelude::*;

use crate::{Level, Octree};

/// Indices of the 3 × 3 × 3 nodes of the same depth around a node, −1 where there is none.
///
/// Entry `9·(dx + 1) + 3·(dy + 1) + (dz + 1)` is at offset `(dx, dy, dz)`; entry 13 is the node itself. The order is
/// that of `ocnn`.
pub type Neighbours = [i32; 27];

impl Octree {
    /// Computes the neighbours of every node of level `depth` (at most the octree's), in node order.
    pub fn neighbours(&self, depth: u32) -> Vec<Neighbours> {
        self.levels()[..depth as usize]
            .iter()
            .fold(root_neighbours(), |table, level| children_neighbours(level, &table))
    }

    /// Computes the neighbours of every node of every level, by depth.
    pub fn all_neighbours(&self) -> Vec<Vec<Neighbours>> {
        self.neighbour_tables(self.levels().len())
    }

    /// Computes the tables of the `count` (at least one) coarsest levels.
    pub(crate) fn neighbour_tables(&self, count: usize) -> Vec<Vec<Neighbours>> {
        let mut tables = vec![root_neighbours()];
        for (depth, level) in self.levels()[..count - 1].iter().enumerate() {
            tables.push(children_neighbours(level, &tables[depth]));
        }
        tables
    }
}

fn root_neighbours() -> Vec<Neighbours> {
    let mut root = [-1; 27];
    root[13] = 0;
    vec![root]
}

/// Computes the table of the next level: neighbours of a child are children of its parent's neighbours.
fn children_neighbours(level: &Level, neighbours: &[Neighbours]) -> Vec<Neighbours> {
    let split: Vec<usize> = (0..level.len()).filter(|&node| level.children[node] >= 0).collect();
    let families: Vec<[Neighbours; 8]> = split
        .par_iter()
        .with_min_len(256)
        .map(|&node| family_neighbours(&neighbours[node].map(|n| if n < 0 { -1 } else { level.children[n as usize] })))
        .collect();
    families.into_flattened()
}

/// Computes the neighbours of a node's eight children, from the first child (or −1) of each of the node's neighbours.
fn family_neighbours(first_children: &Neighbours) -> [Neighbours; 8] {
    // Along each axis the family and its surroundings are four nodes: far child of the lower neighbour, two children,
    // the near child of the upper neighbour.
    const NEIGHBOUR: [usize; 4] = [0, 1, 1, 2];
    const CHILD: [i32; 4] = [1, 0, 1, 0];
    let mut block = [[[-1; 4]; 4]; 4];
    for x in 0..4 {
        for y in 0..4 {
            for z in 0..4 {
                let first = first_children[9 * NEIGHBOUR[x] + 3 * NEIGHBOUR[y] + NEIGHBOUR[z]];
                let child = CHILD[x] << 2 | CHILD[y] << 1 | CHILD[z];
                // −1 stays −1
                block[x][y][z] = first + (child & !(first >> 31));
            }
        }
    }
    let mut family = [[0; 27]; 8];
    for (child, table) in family.iter_mut().enumerate() {
        let [cx, cy, cz] = [child >> 2, child >> 1 & 1, child & 1];
        for dx in 0..3 {
            for dy in 0..3 {
                let row = &block[cx + dx][cy + dy];
                for dz in 0..3 {
                    table[9 * dx + 3 * dy + dz] = row[cz + dz];
                }
            }
        }
    }
    family
}
