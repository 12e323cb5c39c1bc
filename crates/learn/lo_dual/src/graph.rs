use lo_octree::{Level, Octree};
use rayon::prelude::*;

use crate::Direction;

/// Dual graph over the leaves above a depth and all nodes of that depth, with edges between face neighbours of any
/// size.
///
/// Nodes are sorted by depth and then by shuffled key. Those of the graph's own depth come last, in the octree's order.
/// Each face of a node has a *segment* of neighbours: none at the cube's border, one of the same size or larger, or all
/// smaller ones that touch it. Order and content depend on the octree alone.
#[derive(Clone, Debug, PartialEq)]
pub struct DualGraph {
    depth: u32,
    nodes: Vec<GraphNode>,
    /// Index of the first node of the graph's own depth.
    first_finest: usize,
    /// `neighbours[offsets[6·n + d]..offsets[6·n + d + 1]]` are in direction `d` of node `n`.
    offsets: Vec<u32>,
    neighbours: Vec<u32>,
}

/// Octree node of a graph node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GraphNode {
    /// Depth of the node.
    pub depth: u32,
    /// Index in the level of that depth.
    pub index: u32,
}

impl DualGraph {
    /// Builds the graphs of an octree, from its full depth to its finest.
    pub fn all(octree: &Octree) -> Vec<Self> {
        let mut graphs = vec![Self::full(octree)];
        for _ in octree.full_depth()..octree.depth() {
            let next = graphs[graphs.len() - 1].extended(octree);
            graphs.push(next);
        }
        graphs
    }

    /// Builds the graph of the full depth: a regular grid.
    pub fn full(octree: &Octree) -> Self {
        let root = Self {
            depth: 0,
            nodes: vec![GraphNode { depth: 0, index: 0 }],
            first_finest: 0,
            offsets: vec![0; 7],
            neighbours: Vec::new(),
        };
        (0..octree.full_depth()).fold(root, |graph, _| graph.extended(octree))
    }

    /// Builds the graph one depth finer, in which the children of split nodes replace them.
    ///
    /// Takes time proportional to the nodes and edges of the new graph, without any search.
    ///
    /// # Panics
    /// Where `octree` has no finer level, or is not the octree of this graph (possibly grown since).
    pub fn extended(&self, octree: &Octree) -> Self {
        let level = &octree.levels()[self.depth as usize];
        assert_eq!(level.len(), self.nodes.len() - self.first_finest, "the graph must belong to the octree");
        let refiner = Refiner::new(self, level);
        let chunks: Vec<NeighbourRows> = refiner
            .rows()
            .par_chunks(1 << 12)
            .map(|rows| {
                let mut chunk = NeighbourRows::default();
                for &row in rows {
                    for direction in Direction::ALL {
                        refiner.append_neighbours(row, direction, &mut chunk.neighbours);
                        chunk.ends.push(chunk.neighbours.len() as u32);
                    }
                }
                chunk
            })
            .collect();
        let mut graph = Self {
            depth: self.depth + 1,
            nodes: refiner.nodes(),
            first_finest: refiner.kept.len(),
            offsets: vec![0],
            neighbours: Vec::new(),
        };
        for chunk in chunks {
            let start = graph.neighbours.len() as u32;
            graph.offsets.extend(chunk.ends.iter().map(|end| start + end));
            graph.neighbours.extend(chunk.neighbours);
        }
        graph
    }

    /// Returns the depth of the finest nodes.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Returns the octree node of each graph node.
    pub fn nodes(&self) -> &[GraphNode] {
        &self.nodes
    }

    /// Returns the number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Always false: a graph has at least the root.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Returns the index of the first node of the graph's own depth. Nodes before it are leaves of the depths above.
    pub fn first_finest(&self) -> usize {
        self.first_finest
    }

    /// Returns the neighbours of a node across one of its faces, in increasing order.
    #[inline]
    pub fn neighbours(&self, node: usize, direction: Direction) -> &[u32] {
        let segment = 6 * node + direction as usize;
        &self.neighbours[self.offsets[segment] as usize..self.offsets[segment + 1] as usize]
    }

    /// Returns the `6 · len() + 1` segment boundaries in [`DualGraph::columns`], by node, then by direction.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    /// Returns the neighbours of all segments, concatenated.
    pub fn columns(&self) -> &[u32] {
        &self.neighbours
    }
}

/// Neighbours of consecutive rows of the new graph.
#[derive(Default)]
struct NeighbourRows {
    neighbours: Vec<u32>,
    /// End of each segment in `neighbours`.
    ends: Vec<u32>,
}

/// Origin of a node of the finer graph.
#[derive(Clone, Copy)]
enum NodeOrigin {
    /// Node with this index in the coarser graph.
    Kept(u32),
    /// Child of a node of the coarser graph.
    Child { parent: u32, child: u32 },
}

/// Builds the next finer graph from a graph.
struct Refiner<'a> {
    graph: &'a DualGraph,
    level: &'a Level,
    /// Coarser indices of the nodes that are kept.
    kept: Vec<u32>,
    /// For each coarser node, its index in the finer graph where it is kept, or that of its first child where it is
    /// split.
    new: Vec<u32>,
}

impl<'a> Refiner<'a> {
    fn new(graph: &'a DualGraph, level: &'a Level) -> Self {
        let mut refiner = Self { graph, level, kept: Vec::with_capacity(graph.len()), new: vec![0; graph.len()] };
        for node in 0..graph.len() as u32 {
            if refiner.first_child(node).is_none() {
                refiner.new[node as usize] = refiner.kept.len() as u32;
                refiner.kept.push(node);
            }
        }
        for node in graph.first_finest as u32..graph.len() as u32 {
            if let Some(first) = refiner.first_child(node) {
                refiner.new[node as usize] = refiner.kept.len() as u32 + first;
            }
        }
        refiner
    }

    /// Returns the index of a split node's first child in the octree's next level.
    fn first_child(&self, node: u32) -> Option<u32> {
        let finest = (node as usize).checked_sub(self.graph.first_finest)?;
        u32::try_from(self.level.children[finest]).ok()
    }

    fn rows(&self) -> Vec<NodeOrigin> {
        let split =
            (self.graph.first_finest as u32..self.graph.len() as u32).filter(|&n| self.first_child(n).is_some());
        let children = split.flat_map(|parent| (0..8).map(move |child| NodeOrigin::Child { parent, child }));
        self.kept.iter().map(|&node| NodeOrigin::Kept(node)).chain(children).collect()
    }

    fn nodes(&self) -> Vec<GraphNode> {
        let depth = self.graph.depth + 1;
        let children = 8 * self.level.children.iter().filter(|&&first| first >= 0).count() as u32;
        let kept = self.kept.iter().map(|&node| self.graph.nodes[node as usize]);
        kept.chain((0..children).map(|index| GraphNode { depth, index })).collect()
    }

    fn append_neighbours(&self, row: NodeOrigin, direction: Direction, out: &mut Vec<u32>) {
        match row {
            NodeOrigin::Kept(node) => {
                let start = out.len();
                for &neighbour in self.graph.neighbours(node as usize, direction) {
                    let new = self.new[neighbour as usize];
                    match self.first_child(neighbour) {
                        Some(_) => out.extend(direction.opposite_face().map(|child| new + child)),
                        None => out.push(new),
                    }
                }
                // Children come after the kept nodes.
                out[start..].sort_unstable();
            }
            NodeOrigin::Child { parent, child } => {
                let inner = (child & direction.bit() == 0) == direction.is_positive();
                let mirrored = child ^ direction.bit();
                if inner {
                    out.push(self.new[parent as usize] + mirrored);
                    return;
                }
                // Only nodes of the graph's own depth are split, and none is finer: each face has at most one
                // neighbour.
                for &neighbour in self.graph.neighbours(parent as usize, direction) {
                    let new = self.new[neighbour as usize];
                    out.push(if self.first_child(neighbour).is_some() { new + mirrored } else { new });
                }
            }
        }
    }
}

/// Builds an uneven octree of depth 5 for kernel tests.
#[cfg(test)]
pub(crate) fn test_octree() -> Octree {
    let labels =
        [vec![true, false, true], vec![false, true, true, false, true], vec![true, false, false], vec![true, false]];
    tests::grown(&labels)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_octree::xyz_from_key;
    use proptest::prelude::*;

    use super::*;

    /// Builds an octree of depth 1 + `labels.len()`, grown from the full depth 1 by random labels.
    pub(super) fn grown(labels: &[Vec<bool>]) -> Octree {
        let mut octree = Octree::full(1).unwrap();
        for labels in labels {
            let finest = octree.levels().last().unwrap().len();
            let split: Vec<bool> = (0..finest).map(|node| labels[node % labels.len()]).collect();
            octree.set_nonempty(&split).unwrap();
            octree.grow(&split).unwrap();
        }
        octree
    }

    /// Returns the lowest and highest corner of a node, in nodes of depth `finest`.
    fn corners(octree: &Octree, node: GraphNode, finest: u32) -> ([u32; 3], [u32; 3]) {
        let shift = finest - node.depth;
        let xyz = xyz_from_key(octree.levels()[node.depth as usize].keys[node.index as usize]);
        (xyz.map(|c| c << shift), xyz.map(|c| (c + 1) << shift))
    }

    /// Finds neighbours by comparing every node with every other one.
    fn searched(octree: &Octree, graph: &DualGraph, node: usize, direction: Direction) -> Vec<u32> {
        let axis = 2 - direction as usize / 2;
        let (low, high) = corners(octree, graph.nodes()[node], graph.depth());
        (0..graph.len() as u32)
            .filter(|&other| {
                let (other_low, other_high) = corners(octree, graph.nodes()[other as usize], graph.depth());
                let touches = if (direction as usize).is_multiple_of(2) {
                    other_low[axis] == high[axis]
                } else {
                    other_high[axis] == low[axis]
                };
                let overlaps = |c: usize| other_low[c] < high[c] && low[c] < other_high[c];
                touches && (0..3).all(|c| c == axis || overlaps(c))
            })
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn edges_are_those_of_a_brute_force_search(labels in prop::collection::vec(prop::collection::vec(prop::bool::weighted(0.3), 1..40), 1..4)) {
            let octree = grown(&labels);
            let graphs = DualGraph::all(&octree);
            prop_assert_eq!(graphs.len() as u32, octree.depth() - octree.full_depth() + 1);
            for graph in &graphs {
                for node in 0..graph.len() {
                    for direction in Direction::ALL {
                        prop_assert_eq!(graph.neighbours(node, direction), searched(&octree, graph, node, direction));
                    }
                }
            }
        }

        #[test]
        fn nodes_tile_the_cube_and_edges_go_both_ways(labels in prop::collection::vec(prop::collection::vec(prop::bool::weighted(0.4), 1..300), 1..5)) {
            let octree = grown(&labels);
            for graph in DualGraph::all(&octree) {
                let volume: u64 = graph.nodes().iter().map(|node| 1u64 << (3 * (graph.depth() - node.depth))).sum();
                prop_assert_eq!(volume, 1u64 << (3 * graph.depth()));
                for node in 0..graph.len() {
                    for direction in Direction::ALL {
                        let back = direction.opposite();
                        for &other in graph.neighbours(node, direction) {
                            prop_assert!(graph.neighbours(other as usize, back).contains(&(node as u32)));
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_full_grid_has_all_its_faces() {
        let octree = Octree::full(3).unwrap();
        let graph = DualGraph::full(&octree);
        // 3 axes · 7 layers of faces · 64 faces, in both directions.
        assert_eq!(graph.columns().len(), 2 * 3 * 7 * 64);
        assert_eq!(graph.first_finest(), 0);
    }

    #[test]
    fn growing_the_octree_extends_the_graph() {
        let octree = grown(&[vec![true, false, true], vec![false, true, false, false, true]]);
        let all = DualGraph::all(&octree);
        let mut partial = grown(&[vec![true, false, true]]);
        let graph = DualGraph::all(&partial).pop().unwrap();
        let finest = partial.levels().last().unwrap().len();
        let split: Vec<bool> = (0..finest).map(|n| [false, true, false, false, true][n % 5]).collect();
        partial.set_nonempty(&split).unwrap();
        partial.grow(&split).unwrap();
        assert_eq!(&graph.extended(&partial), all.last().unwrap());
    }
}
