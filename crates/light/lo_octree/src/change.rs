use lo_geometry::Vec3;

use crate::{LeafNode, LightOctree};

impl LightOctree {
    /// Returns the linear RGB radiance of a leaf.
    pub fn radiance(&self, leaf: LeafNode) -> Vec3 {
        let [r, g, b, _] = self.rgba[leaf.depth as usize][leaf.row];
        Vec3::new(r, g, b)
    }

    /// Returns the unobserved share of a leaf, 0 to 1.
    pub fn unseen(&self, leaf: LeafNode) -> f32 {
        1.0 - f32::from(self.seen[leaf.depth as usize][leaf.row]) / 255.0
    }

    /// Computes `values[depth][row]` of all rows from values of the leaves. A split node has the mean of its children,
    /// weighted by opacity as its colour is. `of_leaf` is called from the finest depth to the coarsest, in node order.
    pub fn merged(&self, mut of_leaf: impl FnMut(LeafNode) -> Vec3) -> Vec<Vec<Vec3>> {
        let levels = self.octree.levels();
        let mut values: Vec<Vec<Vec3>> = self.rgba.iter().map(|rows| vec![Vec3::ZERO; rows.len()]).collect();
        for (depth, level) in levels.iter().enumerate().rev() {
            for node in 0..level.len() {
                let Ok(row) = usize::try_from(level.rows[node]) else { continue };
                values[depth][row] = match usize::try_from(level.children[node]) {
                    Ok(first) => self.mean_of(depth + 1, &levels[depth + 1].rows[first..first + 8], &values),
                    Err(_) => of_leaf(LeafNode { depth: depth as u32, node, row }),
                };
            }
        }
        values
    }

    /// Returns the opacity-weighted mean of the values of rows of one depth; −1 marks empty nodes.
    fn mean_of(&self, depth: usize, rows: &[i32], values: &[Vec<Vec3>]) -> Vec3 {
        let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
        for row in rows.iter().filter_map(|&row| usize::try_from(row).ok()) {
            let opacity = self.rgba[depth][row][3];
            weight += opacity;
            sum += values[depth][row] * opacity;
        }
        if weight > 0.0 { sum / weight } else { Vec3::ZERO }
    }

    /// Returns the octree's rows with radiance `of_row(depth, row, radiance)`, clamped at 0; opacities are kept.
    pub fn rows_with(&self, of_row: impl Fn(usize, usize, Vec3) -> Vec3) -> Vec<Vec<[f32; 4]>> {
        let of_depth = |(depth, rows): (usize, &Vec<[f32; 4]>)| {
            let new = |(row, &[r, g, b, alpha]): (usize, &[f32; 4])| {
                let [r, g, b] = of_row(depth, row, Vec3::new(r, g, b)).max(Vec3::ZERO).to_array();
                [r, g, b, alpha]
            };
            rows.iter().enumerate().map(new).collect()
        };
        self.rgba.iter().enumerate().map(of_depth).collect()
    }

    /// Sets the radiance of leaves; `change` must return finite, non-negative values. Nodes above change by the mean of
    /// their children's changes ([`merged`](Self::merged)).
    pub fn change_leaves(&mut self, change: impl Fn(&Self, LeafNode) -> Vec3) {
        let changes = self.merged(|leaf| change(self, leaf) - self.radiance(leaf));
        self.rgba = self.rows_with(|depth, row, radiance| radiance + changes[depth][row]);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Cube, Vec3};

    use crate::{LightOctree, Provenance, RadiancePoint};

    /// Points on a curved surface with this radiance; half of them have the radiance `brighter`.
    fn octree(radiance: f32, brighter: f32) -> LightOctree {
        let point = |n: usize| {
            let (x, y) = (((n % 40) as f32 + 0.5) / 40.0, ((n / 40) as f32 + 0.5) / 40.0);
            let lit = if x > 0.5 { brighter } else { radiance };
            let position_m = Vec3::new(x, y, 0.5 + 0.2 * (6.0 * x).sin());
            RadiancePoint { position_m, radiance: [lit, 2.0 * lit, 0.5], provenance: Provenance::Inferred }
        };
        let points: Vec<RadiancePoint> = (0..1600).map(point).collect();
        LightOctree::from_points(&points, Cube::centred(Vec3::splat(0.5), 1.0), 5, 2).unwrap().0
    }

    #[test]
    fn a_changed_octree_is_that_of_changed_points() {
        let (mut light, expected) = (octree(0.3, 0.3), octree(0.3, 0.9));
        light.change_leaves(|light, leaf| {
            let x = light.node_middle_m(leaf.depth, light.octree.key(leaf)).x;
            if x > 0.5 { Vec3::new(0.9, 1.8, 0.5) } else { light.radiance(leaf) }
        });
        for (a, b) in light.rgba.iter().flatten().zip(expected.rgba.iter().flatten()) {
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4), "{a:?} {b:?}");
        }
        assert_eq!(light.seen, expected.seen);
    }
}
