use crate::LightOctree;

impl LightOctree {
    /// Gives leaves another radiance: `change(depth, node, radiance)`, whose result must be finite and not negative. Above, nodes change by the mean
    /// of their children's changes, weighted by opacity, as their colour is the mean of their children's.
    pub fn change_leaves(&mut self, change: impl Fn(u32, usize, [f32; 3]) -> [f32; 3]) {
        let levels = self.octree.levels();
        let mut below: Vec<[f32; 3]> = Vec::new();
        for (depth, level) in levels.iter().enumerate().rev() {
            let mut own = vec![[0.0f32; 3]; level.len()];
            for (node, own) in own.iter_mut().enumerate() {
                let Ok(row) = usize::try_from(level.rows[node]) else { continue };
                let [r, g, b, _] = self.rgba[depth][row];
                if let Ok(first) = usize::try_from(level.children[node]) {
                    let (mut sum, mut weight) = ([0.0; 3], 0.0);
                    for (row, change) in levels[depth + 1].rows[first..first + 8].iter().zip(&below[first..first + 8]) {
                        let opacity = usize::try_from(*row).map_or(0.0, |row| self.rgba[depth + 1][row][3]);
                        weight += opacity;
                        sum.iter_mut().zip(change).for_each(|(sum, change)| *sum += opacity * change);
                    }
                    if weight > 0.0 {
                        *own = sum.map(|sum| sum / weight);
                    }
                } else {
                    let changed = change(depth as u32, node, [r, g, b]);
                    *own = [changed[0] - r, changed[1] - g, changed[2] - b];
                }
                for (value, change) in self.rgba[depth][row].iter_mut().zip(*own) {
                    *value = (*value + change).max(0.0);
                }
            }
            below = own;
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Cube, Vec3};

    use crate::{Coverage, LightOctree, RadiancePoint};

    /// Points on a bent surface with this radiance, half of them brighter.
    fn octree(radiance: f32, brighter: f32) -> LightOctree {
        let point = |n: usize| {
            let (x, y) = (((n % 40) as f32 + 0.5) / 40.0, ((n / 40) as f32 + 0.5) / 40.0);
            let lit = if x > 0.5 { brighter } else { radiance };
            let position_m = Vec3::new(x, y, 0.5 + 0.2 * (6.0 * x).sin());
            RadiancePoint { position_m, radiance: [lit, 2.0 * lit, 0.5], coverage: Coverage::Inferred }
        };
        let points: Vec<RadiancePoint> = (0..1600).map(point).collect();
        LightOctree::from_points(&points, Cube::centred(Vec3::splat(0.5), 1.0), 5, 2).unwrap().0
    }

    #[test]
    fn a_changed_octree_is_that_of_changed_points() {
        let (mut light, expected) = (octree(0.3, 0.3), octree(0.3, 0.9));
        let cube = light.cube;
        let octree = light.octree.clone();
        light.change_leaves(|depth, node, radiance| {
            let levels = octree.levels();
            let x = crate::node_middle_m(cube, depth, levels[depth as usize].keys[node]).x;
            if x > 0.5 { [0.9, 1.8, 0.5] } else { radiance }
        });
        for (a, b) in light.rgba.iter().flatten().zip(expected.rgba.iter().flatten()) {
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4), "{a:?} {b:?}");
        }
        assert_eq!(light.seen, expected.seen);
    }
}
