//! Reference implementation of cone tracing as specified in §3, in f64, simple and slow: every sample of every ray,
//! nothing skipped.

use lo_cone::{Cone, SampleGradient, SampleWeight, Sampling, Settings, StepRule};
use lo_geometry::Cube;
use lo_octree::{LightOctree, Octree};

/// α is clamped below 1 − 1e-4.
const MAX_ALPHA: f64 = lo_octree::MAX_ALPHA as f64;

pub struct Reference<'a> {
    pub octree: &'a Octree,
    pub cube: Cube,
    pub settings: Settings,
    /// RGBα of each row of each depth.
    pub rgba: Vec<Vec<[f64; 4]>>,
}

pub struct ReferenceSample {
    pub radiance: [f64; 3],
    pub distance_m: f64,
    pub opacity: f64,
    /// Least distance, in leaf edges, of a sample from a discontinuity: a node's face, a level's end or the cube's
    /// side.
    pub margin: f64,
}

/// One sample of a ray.
struct Read {
    distance: f64,
    length: f64,
    weight: f64,
    /// Rows that contribute to the value, with their weights in radiance and in extinction.
    footprint: Vec<(usize, usize, [f64; 2])>,
    transmittance: f64,
    opacity: f64,
    colour: [f64; 3],
    /// Weighted sum of the extinctions over which the colour is averaged.
    colour_extinction: f64,
}

impl<'a> Reference<'a> {
    pub fn new(light: &'a LightOctree, settings: Settings) -> Self {
        let rgba = light.rgba.iter().map(|rows| rows.iter().map(|row| row.map(f64::from)).collect()).collect();
        Self { octree: &light.octree, cube: light.cube, settings, rgba }
    }

    pub fn trace(&self, cone: &Cone) -> ReferenceSample {
        let (reads, far, transmittance, margin) = self.march(cone);
        let mut sample = ReferenceSample { radiance: [0.0; 3], distance_m: 0.0, opacity: 1.0 - transmittance, margin };
        for read in &reads {
            let share = read.transmittance * read.opacity;
            for channel in 0..3 {
                sample.radiance[channel] += read.weight * read.colour[channel] * share;
            }
            sample.distance_m += read.distance * share;
        }
        sample.distance_m += far * transmittance;
        sample
    }

    /// Adds the gradient of Σ d_sample · sample to `gradient`: derivatives by the chain rule over all samples, O(n²).
    pub fn add_gradient(&self, cone: &Cone, d_sample: &SampleGradient, gradient: &mut [Vec<[f64; 4]>]) {
        let (reads, far, transmittance, _) = self.march(cone);
        let d_radiance = d_sample.radiance.map(f64::from);
        let (d_distance, d_opacity) = (f64::from(d_sample.distance_m), f64::from(d_sample.opacity));
        let dot = |c: [f64; 3]| (0..3).map(|i| d_radiance[i] * c[i]).sum::<f64>();
        let shade = |read: &Read| read.weight * dot(read.colour) + d_distance * read.distance;
        for (n, read) in reads.iter().enumerate() {
            let after = read.transmittance * (1.0 - read.opacity);
            let behind: f64 = reads[n + 1..].iter().map(|r| r.transmittance * r.opacity * shade(r)).sum();
            let d_thickness = after * shade(read) - behind - transmittance * (d_distance * far - d_opacity);
            for &(depth, row, [colour_weight, weight]) in &read.footprint {
                let [r, g, b, alpha] = self.rgba[depth][row];
                let (extinction, slope) = self.extinction(depth, alpha);
                // colour = Σ weight · extinction · rgb / Σ weight · extinction
                let sum = read.colour_extinction;
                let rate = if sum != 0.0 { read.opacity / sum } else { read.length };
                let part = read.weight * read.transmittance * rate * colour_weight;
                let d_colour = part * extinction;
                for channel in 0..3 {
                    gradient[depth][row][channel] += d_colour * d_radiance[channel];
                }
                let change = dot([r - read.colour[0], g - read.colour[1], b - read.colour[2]]);
                gradient[depth][row][3] += (d_thickness * read.length * weight + part * change) * slope;
            }
        }
    }

    fn march(&self, cone: &Cone) -> (Vec<Read>, f64, f64, f64) {
        let leaf = f64::from(self.cube.edge_m) / f64::from(1u32 << self.octree.depth());
        let origin = (cone.origin.as_dvec3() - self.cube.origin_m.as_dvec3()) / leaf;
        let direction = cone.direction.as_dvec3();
        let side = f64::from(1u32 << self.octree.depth());
        // the part inside the cube, in leaf edges
        let (mut near, mut far) = (0.0f64, f64::INFINITY);
        for axis in 0..3 {
            let (a, b) = (-origin[axis] / direction[axis], (side - origin[axis]) / direction[axis]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        if near >= far {
            return (Vec::new(), 0.0, 1.0, f64::INFINITY);
        }
        let k = f64::from(self.settings.growth) * f64::from(cone.tan_half_angle);
        let floor = match self.settings.step {
            StepRule::Literal => 0.0,
            StepRule::Floored(fraction) => f64::from(fraction),
        };
        let max_level = f64::from(self.octree.depth() - self.octree.full_depth());
        let most = match self.settings.step {
            StepRule::Literal => f64::INFINITY,
            StepRule::Floored(_) => max_level.exp2().max(floor),
        };
        let mut length = f64::from(self.settings.first_step);
        let mut distance = length;
        let (mut transmittance, mut margin, mut reads) = (1.0, f64::INFINITY, Vec::new());
        let first = length;
        while distance < far {
            // The first length is exact on both sides.
            if length != first && self.settings.sampling != Sampling::Interpolated && max_level > 0.0 {
                let level = length.log2();
                margin = margin.min((level - level.round().clamp(0.0, max_level - 1.0)).abs());
            }
            margin = margin.min((distance - near).abs()).min(far - distance);
            if distance >= near {
                let level = length.log2().clamp(0.0, max_level);
                let at = |distance: f64| (origin + direction * distance).to_array();
                let footprint = self.footprint(at, distance, level, &mut margin);
                let (mut sum, mut extinction) = ([0.0; 4], 0.0);
                for &(depth, row, [colour_weight, weight]) in &footprint {
                    let [r, g, b, alpha] = self.rgba[depth][row];
                    let of_row = self.extinction(depth, alpha).0;
                    extinction += weight * of_row;
                    let of_row = colour_weight * of_row;
                    sum = [sum[0] + of_row * r, sum[1] + of_row * g, sum[2] + of_row * b, sum[3] + of_row];
                }
                if self.settings.sampling == Sampling::Blended && sum[3] == 0.0 && !footprint.is_empty() {
                    // The node that is hit comes first and contributes its own colour.
                    let [r, g, b, _] = self.rgba[footprint[0].0][footprint[0].1];
                    sum = [r, g, b, f64::INFINITY];
                }
                let [r, g, b, colour_extinction] = sum;
                if !footprint.is_empty() {
                    let opacity = 1.0 - (-extinction * length).exp();
                    let weight = match self.settings.weight {
                        SampleWeight::One => 1.0,
                        SampleWeight::Paper => length / distance,
                    };
                    let colour = [r, g, b].map(|c| match colour_extinction {
                        0.0 => 0.0,
                        f64::INFINITY => c,
                        sum => c / sum,
                    });
                    reads.push(Read {
                        distance: distance * leaf,
                        length,
                        weight,
                        footprint,
                        transmittance,
                        opacity,
                        colour,
                        colour_extinction,
                    });
                    transmittance *= 1.0 - opacity;
                    let least = f64::from(self.settings.min_transmittance);
                    margin = margin.min((transmittance / least - 1.0).abs());
                    if transmittance < least {
                        break;
                    }
                }
            }
            length = (k * distance).max(floor).min(most);
            distance += length;
        }
        (reads, far * leaf, transmittance, margin)
    }

    /// Returns a node's extinction per leaf edge and its derivative by α.
    fn extinction(&self, depth: usize, alpha: f64) -> (f64, f64) {
        let edge = f64::from(1u32 << (self.octree.depth() as usize - depth));
        let slope = if alpha <= MAX_ALPHA { 1.0 / ((1.0 - alpha) * edge) } else { 0.0 };
        (-(1.0 - alpha.min(MAX_ALPHA)).ln() / edge, slope)
    }

    /// Returns the rows at a distance with their weights in radiance and in extinction.
    fn footprint(
        &self,
        at: impl Fn(f64) -> [f64; 3],
        distance: f64,
        level: f64,
        margin: &mut f64,
    ) -> Vec<(usize, usize, [f64; 2])> {
        if self.settings.sampling == Sampling::Interpolated {
            let fine = level.floor();
            let mut rows = Vec::new();
            for (level, blend) in [(fine, 1.0 - level.fract()), (fine + 1.0, level.fract())] {
                if blend > 0.0 {
                    rows.extend(self.trilinear(at(distance), level, |weight| [blend * weight; 2]));
                }
            }
            return rows;
        }
        let (cell, level) = (self.nearest(at(distance), level.ceil(), margin), level.ceil());
        let Some((depth, row)) = self.row(cell, self.octree.depth() - level as u32) else { return Vec::new() };
        if self.settings.sampling == Sampling::Nearest {
            return vec![(depth, row, [1.0; 2])];
        }
        let mut rows = vec![(depth, row, [f64::from(0.1f32), 1.0])];
        // A leaf above the level is read at its own level.
        let level = level.max((self.octree.depth() as usize - depth) as f64);
        rows.extend(self.trilinear(at(distance + 0.5 * level.exp2()), level, |weight| [weight, 0.0]));
        rows
    }

    /// Returns the cell of an integer level that is read at a position.
    fn nearest(&self, position: [f64; 3], level: f64, margin: &mut f64) -> [i64; 3] {
        let edge = level.exp2();
        *margin = position.iter().fold(*margin, |margin, p| margin.min((p / edge - (p / edge).round()).abs() * edge));
        let cell = position.map(|p| (p / edge).floor() as i64);
        let depth = self.octree.depth() - level as u32;
        // An empty cell is replaced by the nearer of two occupied neighbours where the distances to their faces sum to
        // < 0.6.
        let mut neighbours = Vec::new();
        if !self.occupied(cell, depth) {
            for axis in 0..3 {
                let fraction = position[axis] / edge - cell[axis] as f64;
                *margin = margin.min((fraction - 0.5).abs() * edge);
                let mut neighbour = cell;
                neighbour[axis] += if fraction > 0.5 { 1 } else { -1 };
                if self.occupied(neighbour, depth) {
                    neighbours.push((fraction.min(1.0 - fraction), neighbour));
                }
            }
            neighbours.sort_by(|a, b| a.0.total_cmp(&b.0));
            if neighbours.len() > 1 {
                *margin = margin.min((neighbours[1].0 - neighbours[0].0) * edge);
                *margin = margin.min((neighbours[0].0 + neighbours[1].0 - 0.6).abs() * edge);
            }
        }
        let in_crack = neighbours.len() > 1 && neighbours[0].0 + neighbours[1].0 < 0.6;
        if in_crack { neighbours[0].1 } else { cell }
    }

    /// Returns the rows of the eight cells of an integer level around a position.
    fn trilinear(
        &self,
        position: [f64; 3],
        level: f64,
        weights: impl Fn(f64) -> [f64; 2],
    ) -> Vec<(usize, usize, [f64; 2])> {
        let p = position.map(|p| p / level.exp2() - 0.5);
        let corners = (0..8i64).filter_map(|corner| {
            let offset = [corner >> 2, corner >> 1 & 1, corner & 1];
            let (mut cell, mut weight) = ([0; 3], 1.0);
            for axis in 0..3 {
                cell[axis] = p[axis].floor() as i64 + offset[axis];
                let fraction = p[axis] - p[axis].floor();
                weight *= if offset[axis] == 1 { fraction } else { 1.0 - fraction };
            }
            let (depth, row) = self.row(cell, self.octree.depth() - level as u32)?;
            Some((depth, row, weights(weight)))
        });
        corners.collect()
    }

    /// Returns whether a node of the tree, or the leaf above it where the tree ends, has features or a descendant with
    /// features.
    fn occupied(&self, cell: [i64; 3], depth: u32) -> bool {
        // In all trees of the tests, ancestors of nodes with features have features.
        self.row(cell, depth).is_some()
    }

    /// Returns depth and row of the node at integer coordinates of `depth`, or of the leaf above where the tree ends.
    fn row(&self, cell: [i64; 3], depth: u32) -> Option<(usize, usize)> {
        if cell.iter().any(|c| !(0..1i64 << depth).contains(c)) {
            return None;
        }
        let mut node = 0;
        for d in 0..=depth {
            let level = &self.octree.levels()[d as usize];
            let first = level.children[node];
            if d == depth || first < 0 {
                return usize::try_from(level.rows[node]).ok().map(|row| (d as usize, row));
            }
            let bit = |axis: usize| (cell[axis] >> (depth - d - 1) & 1) as usize;
            node = first as usize + (bit(0) << 2 | bit(1) << 1 | bit(2));
        }
        unreachable!("the loop returns at `depth`")
    }
}
