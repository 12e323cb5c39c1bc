//! The room's light sources, as lamps for programs that light by lamps: clusters of the brightest leaves.

use std::cmp::Reverse;
use std::collections::HashMap;

use lo_geometry::Vec3;

use crate::free_space::Leaf;

/// At most so many lamps: viewers on the web stop at about this number.
const MAX_SOURCES: usize = 8;

/// A leaf belongs to the cluster of a brighter one while its luminance is at least this share of the brightest's.
const CLUSTER_SHARE: f32 = 0.25;

/// A cluster of bright leaves, taken as one emitter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Source {
    /// Centre of the emitting surface, half a leaf in front of it, in metres.
    pub position_m: Vec3,
    /// Unit direction of the surface's mean normal; zero for an emitter that is bright all around.
    pub direction: Vec3,
    /// Area of the emitting surface in m².
    pub area_m2: f32,
    /// Mean linear RGB radiance over the area.
    pub radiance: [f32; 3],
    /// |Σ nA| / ΣA, in [0, 1]: 1 for a flat panel, 0 for a closed lamp shade.
    pub flatness: f32,
    /// Leaves in the cluster.
    pub leaves: usize,
}

impl Source {
    /// Power of the Lambertian emitter, `π · L · A` for each channel, in radiance units · m² · sr.
    pub fn power(&self) -> [f32; 3] {
        self.radiance.map(|c| c * self.area_m2 * std::f32::consts::PI)
    }

    /// Mean radiant intensity for each channel over the directions into the room, in radiance units · m².
    ///
    /// A closed emitter sends its power into 4π, a flat panel into 2π; what lies between is interpolated.
    pub fn intensity(&self) -> [f32; 3] {
        let solid_angle_sr = 4.0 * std::f32::consts::PI * (1.0 - 0.5 * self.flatness);
        self.power().map(|c| c / solid_angle_sr)
    }

    /// Whether it is rather a panel, lit on one side, than a lamp lit all around.
    pub fn is_panel(&self) -> bool {
        self.flatness > 0.5
    }
}

/// The room's strongest emitters, by falling power.
///
/// An emitter begins at a leaf above the photo's white (1.0), or above half of the brightest leaf where that is dimmer, and
/// takes in its neighbours down to a quarter of its luminance.
pub(crate) fn sources(leaves: &[Leaf]) -> Vec<Source> {
    let visible: Vec<usize> = (0..leaves.len()).filter(|&i| leaves[i].exposed != 0).collect();
    let brightest = visible.iter().map(|&i| leaves[i].luminance()).fold(0.0, f32::max);
    let threshold = (0.5 * brightest).min(1.0);
    if brightest <= 0.0 {
        return Vec::new();
    }
    let mut seeds: Vec<usize> = visible.iter().copied().filter(|&i| leaves[i].luminance() >= threshold).collect();
    let mut open: HashMap<(u32, [u32; 3]), usize> =
        seeds.iter().map(|&i| ((leaves[i].depth, leaves[i].xyz), i)).collect();
    seeds.sort_by(|&a, &b| leaves[b].luminance().total_cmp(&leaves[a].luminance()).then(a.cmp(&b)));
    let mut sources = Vec::new();
    for seed in seeds {
        if open.remove(&(leaves[seed].depth, leaves[seed].xyz)).is_none() {
            continue;
        }
        let least = CLUSTER_SHARE * leaves[seed].luminance();
        let mut cluster = vec![seed];
        let mut next = 0;
        while let Some(&leaf) = cluster.get(next) {
            next += 1;
            for neighbour in neighbours(leaves[leaf].xyz) {
                let key = (leaves[leaf].depth, neighbour);
                if open.get(&key).is_some_and(|&i| leaves[i].luminance() >= least) {
                    cluster.extend(open.remove(&key));
                }
            }
        }
        sources.push(source(leaves, &cluster));
    }
    sources.sort_by_key(|source: &Source| Reverse(ordered(source.power().iter().sum())));
    sources.truncate(MAX_SOURCES);
    sources
}

/// The sums over one cluster.
fn source(leaves: &[Leaf], cluster: &[usize]) -> Source {
    let mut area_m2 = 0.0;
    let mut vector_area_m2 = Vec3::ZERO;
    let mut moment = Vec3::ZERO;
    let mut radiance = Vec3::ZERO;
    let mut weight = 0.0;
    for leaf in cluster.iter().map(|&i| &leaves[i]) {
        let leaf_area_m2 = leaf.surface_area_m2();
        area_m2 += leaf_area_m2;
        vector_area_m2 += leaf.vector_area_m2();
        radiance += Vec3::from(leaf.radiance()) * leaf_area_m2;
        moment += leaf.centre_m * (leaf.luminance() * leaf_area_m2);
        weight += leaf.luminance() * leaf_area_m2;
    }
    let direction = vector_area_m2.normalize_or_zero();
    let flatness = (vector_area_m2.length() / area_m2).min(1.0);
    // The surface lies half an edge before the leaf's centre; another half keeps the lamp out of its own wall.
    let edge_m = leaves[cluster[0]].edge_m;
    Source {
        position_m: moment / weight + direction * (flatness * edge_m),
        direction,
        area_m2,
        radiance: (radiance / area_m2).to_array(),
        flatness,
        leaves: cluster.len(),
    }
}

/// The 26 cells around one; those below zero wrap to coordinates that no leaf has.
fn neighbours([x, y, z]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..27).filter(|i| *i != 13).map(move |i| {
        [
            x.wrapping_add(i / 9).wrapping_sub(1),
            y.wrapping_add(i / 3 % 3).wrapping_sub(1),
            z.wrapping_add(i % 3).wrapping_sub(1),
        ]
    })
}

/// A non-negative float as an integer of the same order.
fn ordered(value: f32) -> u32 {
    value.max(0.0).to_bits()
}

#[cfg(test)]
mod tests {
    use lo_geometry::Cube;

    use super::*;
    use crate::free_space;
    use crate::test_scene::{box_room, light_of};

    #[test]
    fn a_ceiling_panel_is_one_flat_lamp() {
        let lamps = sources(&free_space::leaves(&box_room().light, None));
        assert_eq!(lamps.len(), 1);
        let lamp = &lamps[0];
        assert_eq!((lamp.leaves, lamp.area_m2, lamp.flatness), (4, 1.0, 1.0));
        assert_eq!((lamp.radiance, lamp.direction), ([10.0, 8.0, 6.0], Vec3::NEG_Y));
        // Half a cell below the ceiling at y = 1.5.
        assert_eq!(lamp.position_m, Vec3::new(0.0, 1.25, 0.0));
        assert!(lamp.is_panel());
    }

    #[test]
    fn a_ball_is_lit_all_around_and_has_the_area_of_a_ball() {
        // A solid ball of radius 0.8 m in cells of 4 m / 64; the camera is outside of it.
        let cells: Vec<_> = (0..64u32.pow(3))
            .map(|i| [i / 4096, i / 64 % 64, i % 64])
            .filter(|xyz| Vec3::from(xyz.map(|c| c as f32 - 31.5)).length() < 0.8 * 16.0)
            .map(|xyz| (xyz, [3.0, 3.0, 3.0, 1.0]))
            .collect();
        let cube = Cube { origin_m: Vec3::new(-2.0, -2.0, -3.5), edge_m: 4.0 };
        let lamps = sources(&free_space::leaves(&light_of(&cells, cube, 6), None));
        assert_eq!(lamps.len(), 1);
        let lamp = &lamps[0];
        let area_m2 = 4.0 * std::f32::consts::PI * 0.64;
        // The faces alone sum to 1.5 times that.
        assert!((lamp.area_m2 / area_m2 - 1.0).abs() < 0.15, "{} of {area_m2}", lamp.area_m2);
        assert!(lamp.flatness < 1e-3 && !lamp.is_panel());
        assert!((lamp.position_m - Vec3::new(0.0, 0.0, -1.5)).length() < 1e-3);
        // A sphere of radiance L and radius r has the intensity L π r² in every direction.
        let expected = 3.0 * std::f32::consts::PI * 0.64;
        assert!((lamp.intensity()[0] / expected - 1.0).abs() < 0.15);
    }

    #[test]
    fn lamps_are_told_from_what_they_light_and_from_each_other() {
        let cube = Cube { origin_m: Vec3::splat(-2.0), edge_m: 4.0 };
        let grey = |c: f32| [c, c, c, 1.0];
        // A lamp of 20 in a halo of 2, another of 6 apart from it, and walls of 0.9.
        let cells = [
            ([0, 7, 0], grey(20.0)),
            ([1, 7, 0], grey(2.0)),
            ([2, 7, 0], grey(2.0)),
            ([5, 7, 5], grey(6.0)),
            ([3, 0, 3], grey(0.9)),
        ];
        let lamps = sources(&free_space::leaves(&light_of(&cells, cube, 3), None));
        let levels: Vec<f32> = lamps.iter().map(|lamp| lamp.radiance[0]).collect();
        assert_eq!(levels, [20.0, 6.0, 2.0]);
        assert_eq!(lamps.iter().map(|lamp| lamp.leaves).collect::<Vec<_>>(), [1, 1, 2]);
        assert!(sources(&[]).is_empty());
    }
}
