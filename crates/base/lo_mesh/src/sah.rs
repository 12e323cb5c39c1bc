use lo_geometry::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

/// Number of bins per axis.
const BINS: usize = 16;

/// Depth beyond which nodes are halved, so that the tree's depth is at most this plus log₂ of the triangles.
///
/// (The library's own builder needs quadratic time and overflows the stack for thousands of equal boxes.)
const MAX_SAH_DEPTH: u32 = 40;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Box3 {
    pub min: Vec3,
    pub max: Vec3,
}

impl Box3 {
    const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    pub(crate) fn around(points: [Vec3; 3]) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self { min: b.min.min(p), max: b.max.max(p) })
    }

    pub(crate) fn grown(self, by: f32) -> Self {
        Self { min: self.min - Vec3::splat(by), max: self.max + Vec3::splat(by) }
    }

    fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    fn half_area(&self) -> f32 {
        let size = self.max - self.min;
        size.x * size.y + size.y * size.z + size.z * size.x
    }

    /// Twice the centre; the factor is irrelevant for comparisons.
    fn center2(&self) -> Vec3 {
        self.min + self.max
    }
}

/// Builds a binary tree by the binned surface area heuristic (Wald 2007), one box per leaf. `boxes` must not be empty.
pub(crate) fn build(boxes: &[Box3]) -> Bvh2 {
    let mut indices: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut nodes = Vec::with_capacity(2 * boxes.len());
    nodes.push(Bvh2Node::default());
    let mut work = vec![(0_usize, 0_usize, boxes.len(), 0_u32)];
    while let Some((node, from, to, depth)) = work.pop() {
        let range = &mut indices[from..to];
        let mut bounds = Box3::EMPTY;
        let mut centers = Box3::EMPTY;
        for &index in range.iter() {
            let member = boxes[index as usize];
            let center = member.center2();
            bounds = bounds.union(member);
            centers = centers.union(Box3 { min: center, max: center });
        }
        let aabb = Aabb::new(bounds.min.into(), bounds.max.into());
        if range.len() == 1 {
            nodes[node] = Bvh2Node::new(aabb, 1, from as u32);
            continue;
        }
        let split = if depth < MAX_SAH_DEPTH { best_split(boxes, range, &centers) } else { None };
        let middle = match split {
            Some(split) => partition(range, |index| split.bin(boxes[index as usize].center2()) <= split.last),
            None => range.len() / 2,
        };
        let first_child = nodes.len();
        nodes[node] = Bvh2Node::new(aabb, 0, first_child as u32);
        nodes.extend([Bvh2Node::default(); 2]);
        work.push((first_child + 1, from + middle, to, depth + 1));
        work.push((first_child, from, from + middle, depth + 1));
    }
    Bvh2 { nodes, primitive_indices: indices, ..Bvh2::default() }
}

/// A plane between two bins.
struct SplitPlane {
    axis: usize,
    start: f32,
    bins_per_unit: f32,
    /// Last bin on the near side.
    last: usize,
}

impl SplitPlane {
    fn bin(&self, center2: Vec3) -> usize {
        (((center2[self.axis] - self.start) * self.bins_per_unit) as usize).min(BINS - 1)
    }
}

/// Returns the split of least cost; `None` if all centres (nearly) coincide.
fn best_split(boxes: &[Box3], range: &[u32], centers: &Box3) -> Option<SplitPlane> {
    let mut best: Option<(f32, SplitPlane)> = None;
    for axis in 0..3 {
        let bins_per_unit = BINS as f32 / (centers.max[axis] - centers.min[axis]);
        if !bins_per_unit.is_finite() {
            continue;
        }
        let mut split = SplitPlane { axis, start: centers.min[axis], bins_per_unit, last: 0 };
        let mut bins = [(Box3::EMPTY, 0_usize); BINS];
        for &index in range {
            let member = boxes[index as usize];
            let (bounds, count) = &mut bins[split.bin(member.center2())];
            *bounds = bounds.union(member);
            *count += 1;
        }
        // Cost of all bins beyond each one, then of all bins up to it.
        let mut beyond = [0.0; BINS];
        let (mut bounds, mut count) = (Box3::EMPTY, 0);
        for bin in (1..BINS).rev() {
            bounds = bounds.union(bins[bin].0);
            count += bins[bin].1;
            beyond[bin - 1] = if count == 0 { f32::INFINITY } else { bounds.half_area() * count as f32 };
        }
        let (mut bounds, mut count) = (Box3::EMPTY, 0);
        for last in 0..BINS - 1 {
            bounds = bounds.union(bins[last].0);
            count += bins[last].1;
            if count == 0 {
                continue;
            }
            let cost = bounds.half_area() * count as f32 + beyond[last];
            if cost.is_finite() && best.as_ref().is_none_or(|(least, _)| cost < *least) {
                split.last = last;
                best = Some((cost, SplitPlane { ..split }));
            }
        }
    }
    best.map(|(_, split)| split)
}

/// Moves the indices that are `near` to the front and returns their number.
fn partition(range: &mut [u32], near: impl Fn(u32) -> bool) -> usize {
    let mut middle = 0;
    for i in 0..range.len() {
        if near(range[i]) {
            range.swap(i, middle);
            middle += 1;
        }
    }
    middle
}
