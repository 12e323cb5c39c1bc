//! Light hierarchy that bounds the contribution of each node to a point (Conty & Kulla 2018). Cuts through it (Walter
//! et al. 2005) split the light into clusters that are sampled separately.

use lo_bsdf::Ggx;
use lo_geometry::Vec3;

use crate::lights::Emitter;

/// Binary tree over emitters.
pub(crate) struct LightTree {
    nodes: Vec<Node>,
    /// Emitters in the order of the leaves.
    order: Vec<u32>,
    /// Index of each emitter in `order`.
    leaf_index: Vec<u32>,
}

struct Node {
    center: Vec3,
    radius_m: f32,
    /// Emission directions are within an angle of this axis; its cosine is in `cos_spread`.
    axis: Vec3,
    cos_spread: f32,
    weight: f32,
    /// Range `from..to` of `order`.
    from: u32,
    to: u32,
    /// Second child. The first child follows its parent. 0 for leaves.
    second: u32,
}

/// Node of a cut, with its importance: an estimate of the luminance of its unshadowed irradiance.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CutNode {
    pub node: u32,
    pub importance: f32,
}

/// Glossy lobe towards which a surface reflects the viewer's direction.
pub(crate) struct GlossyLobe {
    pub mirrored: Vec3,
    pub ggx: Ggx,
}

impl GlossyLobe {
    /// Minimum share of the peak: the estimate is not a strict bound.
    const MIN_SHARE: f32 = 1e-3;

    /// Returns about the greatest value of the BRDF towards a node, as a share of its peak.
    fn relative_peak(&self, point: Vec3, node: &Node) -> f32 {
        let offset = node.center - point;
        let distance = offset.length();
        if distance <= node.radius_m {
            return 1.0;
        }
        let sin_u = node.radius_m / distance;
        let cosine = widened(self.mirrored.dot(offset) / distance, (1.0 - sin_u * sin_u).sqrt(), sin_u);
        // The half vector rotates by half of the angle: 1 − cos² of it.
        let sin2_half = 0.5 * (1.0 - cosine);
        let alpha2 = self.ggx.alpha() * self.ggx.alpha();
        (alpha2 / (alpha2 + sin2_half * (1.0 - alpha2))).powi(2).max(Self::MIN_SHARE)
    }
}

impl LightTree {
    pub(crate) fn build(emitters: &[Emitter]) -> Self {
        let mut order: Vec<u32> = (0..emitters.len() as u32).filter(|&e| emitters[e as usize].weight() > 0.0).collect();
        let mut nodes = Vec::with_capacity(2 * order.len());
        let count = order.len();
        if count > 0 {
            split(emitters, &mut order, 0, &mut nodes);
        }
        let mut leaf_index = vec![u32::MAX; emitters.len()];
        for (at, &emitter) in order.iter().enumerate() {
            leaf_index[emitter as usize] = at as u32;
        }
        Self { nodes, order, leaf_index }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Splits the light into at most `max` clusters of similar importance. Valid for points within `reach_m` of `point`
    /// and normals near `normal`. Replaces the contents of `cut`; nodes without importance are omitted.
    pub(crate) fn cut(&self, point: Vec3, normal: Vec3, reach_m: f32, max: usize, cut: &mut Vec<CutNode>) {
        cut.clear();
        if self.is_empty() {
            return;
        }
        let weighted =
            |node: u32| CutNode { node, importance: self.nodes[node as usize].importance(point, normal, reach_m) };
        cut.extend(Some(weighted(0)).filter(|entry| entry.importance > 0.0));
        while cut.len() < max {
            let total: f32 = cut.iter().map(|entry| entry.importance).sum();
            let worth = |entry: &CutNode| {
                let node = &self.nodes[entry.node as usize];
                let spread = node.radius_m / (node.center.distance(point) + 1e-6);
                // Nodes seen under a wide angle may be partly occluded.
                if node.second == 0 { 0.0 } else { entry.importance * spread.min(1.0) }
            };
            let Some((at, gain)) =
                cut.iter().map(worth).enumerate().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))
            else {
                break;
            };
            if gain <= 2e-3 * total {
                break;
            }
            let node = cut[at].node;
            let children = [weighted(node + 1), weighted(self.nodes[node as usize].second)];
            cut.swap_remove(at);
            cut.extend(children.into_iter().filter(|entry| entry.importance > 0.0));
        }
        cut.sort_unstable_by_key(|entry| self.nodes[entry.node as usize].from);
    }

    /// Chooses an emitter below a node by its importance at a point, with `u` in [0, 1). Also returns its probability.
    pub(crate) fn choose(&self, node: u32, u: f32, point: Vec3, normal: Vec3) -> Option<(u32, f32)> {
        self.descend(node, u, |node| node.importance(point, normal, 0.0))
    }

    /// Chooses an emitter by its importance for a glossy reflection.
    pub(crate) fn choose_reflected(&self, u: f32, point: Vec3, normal: Vec3, gloss: &GlossyLobe) -> Option<(u32, f32)> {
        if self.is_empty() {
            return None;
        }
        self.descend(0, u, |node| node.importance(point, normal, 0.0) * gloss.relative_peak(point, node))
    }

    fn descend(&self, mut node: u32, mut u: f32, weight: impl Fn(&Node) -> f32) -> Option<(u32, f32)> {
        let mut probability = 1.0;
        while self.nodes[node as usize].second != 0 {
            let share = self.first_share(node, &weight)?;
            if u < share {
                u /= share;
                probability *= share;
                node += 1;
            } else {
                u = (u - share) / (1.0 - share);
                probability *= 1.0 - share;
                node = self.nodes[node as usize].second;
            }
        }
        Some((self.order[self.nodes[node as usize].from as usize], probability))
    }

    /// Returns the index of the cut's node that contains the emitter, and the probability of choosing it there.
    pub(crate) fn find(
        &self,
        cut: impl Iterator<Item = u32>,
        emitter: u32,
        point: Vec3,
        normal: Vec3,
    ) -> Option<(usize, f32)> {
        let leaf_index = self.leaf_index[emitter as usize];
        if leaf_index == u32::MAX {
            return None;
        }
        let inside = |node: u32| (self.nodes[node as usize].from..self.nodes[node as usize].to).contains(&leaf_index);
        let (at, node) = cut.enumerate().find(|&(_, node)| inside(node))?;
        let probability = self.probability(node, leaf_index, |node| node.importance(point, normal, 0.0))?;
        Some((at, probability))
    }

    /// Returns the probability with which [`LightTree::choose_reflected`] chooses the emitter.
    pub(crate) fn probability_reflected(
        &self,
        emitter: u32,
        point: Vec3,
        normal: Vec3,
        gloss: &GlossyLobe,
    ) -> Option<f32> {
        let leaf_index = self.leaf_index[emitter as usize];
        if leaf_index == u32::MAX {
            return None;
        }
        self.probability(0, leaf_index, |node| node.importance(point, normal, 0.0) * gloss.relative_peak(point, node))
    }

    /// Returns the probability with which [`LightTree::descend`] gets from a node to a leaf.
    fn probability(&self, mut node: u32, leaf_index: u32, weight: impl Fn(&Node) -> f32) -> Option<f32> {
        let mut probability = 1.0;
        while self.nodes[node as usize].second != 0 {
            let share = self.first_share(node, &weight)?;
            let second = self.nodes[node as usize].second;
            let in_first = leaf_index < self.nodes[second as usize].from;
            probability *= if in_first { share } else { 1.0 - share };
            node = if in_first { node + 1 } else { second };
        }
        Some(probability)
    }

    /// Returns the first child's share of a node's importance. `None` if both children have none.
    fn first_share(&self, node: u32, weight: impl Fn(&Node) -> f32) -> Option<f32> {
        let second = self.nodes[node as usize].second;
        let [first, second] = [node + 1, second].map(|n| weight(&self.nodes[n as usize]));
        let share = first / (first + second);
        share.is_finite().then_some(share)
    }
}

impl Node {
    fn importance(&self, point: Vec3, normal: Vec3, reach_m: f32) -> f32 {
        let offset = self.center - point;
        let distance = offset.length();
        let radius = self.radius_m + reach_m;
        if distance <= radius {
            return self.weight / (self.radius_m * self.radius_m).max(1e-4);
        }
        let direction = offset / distance;
        let sin_u = radius / distance;
        let cos_u = (1.0 - sin_u * sin_u).max(0.0).sqrt();
        let receiver = widened(normal.dot(direction), cos_u, sin_u);
        let sin_spread = (1.0 - self.cos_spread * self.cos_spread).max(0.0).sqrt();
        let emitter = if self.cos_spread <= -1.0 {
            1.0
        } else {
            // First the spread of the normals, then the extent of the node.
            let within = widened(-self.axis.dot(direction), self.cos_spread, sin_spread);
            widened(within, cos_u, sin_u)
        };
        self.weight * receiver.max(0.0) * emitter.max(0.0) / (distance * distance)
    }
}

/// Returns the cosine of an angle reduced by another one, whose cosine and sine are given.
fn widened(cosine: f32, cos_by: f32, sin_by: f32) -> f32 {
    if cosine >= cos_by {
        return 1.0;
    }
    cosine * cos_by + (1.0 - cosine * cosine).max(0.0).sqrt() * sin_by
}

/// Appends the node of `order` (which begins at `start`) and its descendants.
fn split(emitters: &[Emitter], order: &mut [u32], start: u32, nodes: &mut Vec<Node>) {
    let index = nodes.len();
    nodes.push(node_around(emitters, order, start));
    if order.len() == 1 {
        return;
    }
    let center = |e: u32| {
        let corners = emitters[e as usize].corners();
        (corners[0] + corners[1] + corners[2] + corners[3]) * 0.25
    };
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &emitter in order.iter() {
        low = low.min(center(emitter));
        high = high.max(center(emitter));
    }
    let size = high - low;
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    order.sort_unstable_by(|&a, &b| center(a)[axis].total_cmp(&center(b)[axis]).then(a.cmp(&b)));
    let middle = 0.5 * (low[axis] + high[axis]);
    let mut at = order.partition_point(|&e| center(e)[axis] < middle);
    if at == 0 || at == order.len() {
        at = order.len() / 2;
    }
    let (first, second) = order.split_at_mut(at);
    split(emitters, first, start, nodes);
    nodes[index].second = nodes.len() as u32;
    split(emitters, second, start + at as u32, nodes);
}

fn node_around(emitters: &[Emitter], order: &[u32], start: u32) -> Node {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (mut axis, mut weight, mut both) = (Vec3::ZERO, 0.0, false);
    for &index in order {
        let emitter = &emitters[index as usize];
        for corner in emitter.corners() {
            low = low.min(corner);
            high = high.max(corner);
        }
        weight += emitter.weight();
        let sides = emitter.radiance.map(|r| r != Vec3::ZERO);
        both |= sides == [true, true];
        axis += if sides[1] { -emitter.normal } else { emitter.normal } * emitter.weight();
    }
    let axis = axis.normalize_or_zero();
    let cosine = |&e: &u32| {
        let emitter = &emitters[e as usize];
        axis.dot(emitter.normal) * if emitter.radiance[0] == Vec3::ZERO { -1.0 } else { 1.0 }
    };
    let least = order.iter().map(cosine).fold(1.0, f32::min);
    let cos_spread = if both || axis == Vec3::ZERO { -1.0 } else { least - 1e-4 };
    Node {
        center: (low + high) * 0.5,
        radius_m: (high - low).length() * 0.5,
        axis,
        cos_spread,
        weight,
        from: start,
        to: start + order.len() as u32,
        second: 0,
    }
}
