use std::collections::HashMap;
use std::sync::Arc;

use lo_dual::{Direction, DualGraph, EDGE_TYPES};
use lo_octree::Octree;

/// The dual graph of one octree depth, with the data that layers need beside its edges.
#[derive(Debug)]
pub struct GraphLevel {
    /// Nodes and edges.
    pub graph: DualGraph,
    /// Origin of the nodes in the coarser graph; `None` at the full depth.
    pub refinement: Option<Refinement>,
    /// Depths of each node's neighbours.
    pub types: NodeTypes,
}

/// Refinement of the graph one depth coarser. In the finer graph, kept nodes come first, then the children of split
/// ones.
#[derive(Debug)]
pub struct Refinement {
    /// Coarser indices of the nodes that are kept.
    pub kept: Vec<u32>,
    /// Coarser indices of the nodes that are replaced by eight children each.
    pub split: Vec<u32>,
}

impl GraphLevel {
    /// Builds the levels of an octree, from its full depth to its finest.
    pub fn all(octree: &Octree) -> Vec<Arc<Self>> {
        let mut levels = vec![Self::full(octree)];
        for _ in octree.full_depth()..octree.depth() {
            let next = levels[levels.len() - 1].extended(octree);
            levels.push(next);
        }
        levels
    }

    /// Builds the level of the full depth.
    pub fn full(octree: &Octree) -> Arc<Self> {
        let graph = DualGraph::full(octree);
        let types = NodeTypes::new(&graph, octree.full_depth());
        Arc::new(Self { graph, refinement: None, types })
    }

    /// Builds the level one depth finer.
    ///
    /// # Panics
    /// Where `octree` has no finer level, or is not this level's octree (possibly grown since).
    pub fn extended(&self, octree: &Octree) -> Arc<Self> {
        let graph = self.graph.extended(octree);
        let children = &octree.levels()[self.graph.depth() as usize].children;
        let first = self.graph.first_finest();
        let is_split = |node: u32| (node as usize).checked_sub(first).is_some_and(|finest| children[finest] >= 0);
        let (split, kept) = (0..self.graph.len() as u32).partition(|&node| is_split(node));
        let types = NodeTypes::new(&graph, octree.full_depth());
        Arc::new(Self { graph, refinement: Some(Refinement { kept, split }), types })
    }

    /// Returns the number of nodes.
    pub fn len(&self) -> usize {
        self.graph.len()
    }

    /// Always false: a graph has at least the root.
    pub fn is_empty(&self) -> bool {
        self.graph.is_empty()
    }
}

/// Distribution of the depths of each node's neighbours, per edge type.
///
/// Dual-octree networks append the one-hot depth of each node to its features. Its means over the neighbours repeat for
/// very many nodes. Distinct rows of means are stored once, so that the convolution multiplies few rows.
#[derive(Debug)]
pub struct NodeTypes {
    /// Number of different depths, at least 1. With 1, `rows` and `shares` are empty.
    pub count: usize,
    /// For each node, its row in `shares`.
    pub rows: Vec<u32>,
    /// `shares[row, edge type, depth − full depth]`: share of that depth among the neighbours.
    pub shares: Vec<f64>,
}

impl NodeTypes {
    fn new(graph: &DualGraph, full_depth: u32) -> Self {
        let count = (graph.depth() - full_depth + 1) as usize;
        if count == 1 {
            return Self { count, rows: Vec::new(), shares: Vec::new() };
        }
        let type_of = |node: u32| (graph.nodes()[node as usize].depth - full_depth) as usize;
        // Code of a face: 0 without neighbours, type + 1 for neighbours of one depth, and a number above those for each
        // mixture.
        let mut mixtures: HashMap<Vec<u32>, u16> = HashMap::new();
        let mut known: HashMap<[u16; EDGE_TYPES], u32> = HashMap::new();
        let (mut rows, mut shares) = (Vec::with_capacity(graph.len()), Vec::new());
        for node in 0..graph.len() {
            let mut code = [0u16; EDGE_TYPES];
            code[6] = type_of(node as u32) as u16;
            for direction in Direction::ALL {
                let neighbours = graph.neighbours(node, direction);
                code[direction as usize] = match neighbours {
                    [] => 0,
                    [first, rest @ ..] if rest.iter().all(|&n| type_of(n) == type_of(*first)) => {
                        type_of(*first) as u16 + 1
                    }
                    _ => {
                        let mut counts = vec![0; count];
                        neighbours.iter().for_each(|&n| counts[type_of(n)] += 1);
                        let next = (count + 1 + mixtures.len()) as u16;
                        *mixtures.entry(counts).or_insert(next)
                    }
                };
            }
            let next = known.len() as u32;
            let row = *known.entry(code).or_insert_with(|| {
                let start = shares.len();
                shares.resize(start + EDGE_TYPES * count, 0.0);
                let new = &mut shares[start..];
                for direction in Direction::ALL {
                    let neighbours = graph.neighbours(node, direction);
                    for &neighbour in neighbours {
                        new[direction as usize * count + type_of(neighbour)] += 1.0 / neighbours.len() as f64;
                    }
                }
                new[6 * count + type_of(node as u32)] = 1.0;
                next
            });
            rows.push(row);
        }
        Self { count, rows, shares }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// An uneven octree of depth 4, full down to depth 1.
    pub(crate) fn uneven_octree() -> Octree {
        let mut octree = Octree::full(1).unwrap();
        for period in [3, 5, 4] {
            let finest = octree.levels().last().unwrap().len();
            let split: Vec<bool> = (0..finest).map(|node| node % period != 1).collect();
            octree.set_nonempty(&split).unwrap();
            octree.grow(&split).unwrap();
        }
        octree
    }

    #[test]
    fn shares_are_means_of_one_hot_depths() {
        for level in GraphLevel::all(&uneven_octree()) {
            let (graph, types) = (&level.graph, &level.types);
            if types.count == 1 {
                continue;
            }
            let one_hot: Vec<f64> = (0..graph.len() * types.count)
                .map(|i| f64::from(graph.nodes()[i / types.count].depth == (i % types.count) as u32 + 1))
                .collect();
            // Convolution with an identity matrix returns the means.
            let width = EDGE_TYPES * types.count;
            let unit: Vec<f64> = (0..width * width).map(|i| f64::from(i / width == i % width)).collect();
            let means = lo_dual::graph_conv(graph, &one_hot, &unit, [types.count, width]);
            for (node, means) in means.chunks_exact(width).enumerate() {
                let shares = &types.shares[types.rows[node] as usize * width..][..width];
                assert!(shares.iter().zip(means).all(|(a, b)| (a - b).abs() < 1e-12), "{shares:?} {means:?}");
            }
            assert!(types.shares.len() < width * graph.len(), "rows are shared");
        }
    }

    #[test]
    fn refinement_accounts_for_every_node() {
        let levels = GraphLevel::all(&uneven_octree());
        for pair in levels.windows(2) {
            let Refinement { kept, split } = pair[1].refinement.as_ref().unwrap();
            assert_eq!(kept.len() + split.len(), pair[0].len());
            assert_eq!(kept.len() + 8 * split.len(), pair[1].len());
            let nodes = pair[1].graph.nodes();
            assert!(kept.iter().enumerate().all(|(new, &old)| nodes[new] == pair[0].graph.nodes()[old as usize]));
        }
    }
}
