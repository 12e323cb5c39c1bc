//! Lamps for programs with light sources: clusters of the brightest leaves.
//!
//! A lamp and the mesh share an emitter's radiance, so that nothing is lit twice. A panel's faces keep radiance up to
//! the photo's white, and its lamp has the rest. An emitter that shines in all directions is a lamp only, because its
//! own faces would shadow it.

use std::cmp::Reverse;
use std::collections::HashMap;

use lo_geometry::Vec3;
use lo_lights::{ClusterShape, ClusterSurface, LeafSurface};
use lo_scene::{AnalyticLight, LightShape};

use crate::free_space::Leaf;

/// Largest number of lamps; web viewers support about this many.
const MAX_LAMPS: usize = 8;

/// Smallest luminance of an emitter, the photo's white.
pub(crate) const WHITE: f32 = 1.0;

/// Smallest luminance of a leaf in a cluster, as a share of its brightest leaf's.
const CLUSTER_SHARE: f32 = 0.25;

/// Part of a leaf's radiance that its faces emit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FaceEmission {
    /// All of it.
    All,
    /// Radiance up to the photo's white; a lamp has the rest.
    UpToWhite,
    /// None: there are no faces, a lamp has all of it.
    Nothing,
}

impl FaceEmission {
    /// Returns the part of linear RGB radiance that faces emit, of the same colour.
    pub fn of(self, radiance: [f32; 3]) -> [f32; 3] {
        let share = match self {
            Self::All => 1.0,
            Self::UpToWhite => 1.0 / radiance.into_iter().fold(1.0, f32::max),
            Self::Nothing => 0.0,
        };
        radiance.map(|c| c * share)
    }
}

/// A lamp: a cluster of bright leaves as one emitter, or an added light.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lamp {
    /// Its shape (a cluster's rectangle is half a leaf in front of the leaves' surface), and the radiance that the
    /// faces do not emit.
    pub light: AnalyticLight,
    /// Indices of its leaves; empty for an added light.
    pub leaves: Vec<usize>,
    /// Its name in the list of lights, if it is known.
    pub id: Option<String>,
}

impl Lamp {
    /// Returns its name: that of the list of lights, else its number.
    pub fn label(&self, index: usize) -> String {
        self.id.clone().unwrap_or_else(|| (index + 1).to_string())
    }

    /// Returns the power of the Lambertian emitter, `π · L · A` per channel, in radiance units · m² · sr.
    pub fn power(&self) -> [f32; 3] {
        self.light.radiance.map(|c| c * self.light.extent() * std::f32::consts::PI)
    }

    /// Returns the largest radiant intensity per channel, in radiance units · m²: along a rectangle's normal, or in
    /// any direction of a sphere. For a sun, returns its irradiance.
    pub fn intensity(&self) -> [f32; 3] {
        let seen = match self.light.shape {
            LightShape::Rectangle { .. } | LightShape::Sun { .. } => self.light.extent(),
            LightShape::Sphere { .. } => 0.25 * self.light.extent(),
        };
        self.light.radiance.map(|c| c * seen)
    }

    /// Returns the part of the radiance that the faces of its leaves emit.
    pub fn face_emission(&self) -> FaceEmission {
        match self.light.shape {
            LightShape::Sphere { .. } => FaceEmission::Nothing,
            LightShape::Rectangle { .. } | LightShape::Sun { .. } => FaceEmission::UpToWhite,
        }
    }
}

/// Returns the lamps of added lights, with one lamp per side of a rectangle.
pub(crate) fn added_lamps(lights: &[AnalyticLight]) -> Vec<Lamp> {
    let sides = lights.iter().flat_map(|light| match light.shape {
        LightShape::Rectangle { centre_m, direction, across, size_m, two_sided: true } => {
            let side = |direction| AnalyticLight {
                shape: LightShape::Rectangle { centre_m, direction, across, size_m, two_sided: false },
                ..*light
            };
            vec![side(direction), side(-direction)]
        }
        _ => vec![*light],
    });
    sides.map(|light| Lamp { light, leaves: Vec::new(), id: None }).collect()
}

/// Returns the part of the radiance that the faces of each leaf emit beside these lamps.
pub(crate) fn face_emission(leaves: &[Leaf], lamps: &[Lamp]) -> Vec<FaceEmission> {
    let mut kept = vec![FaceEmission::All; leaves.len()];
    for lamp in lamps {
        lamp.leaves.iter().for_each(|&leaf| kept[leaf] = lamp.face_emission());
    }
    kept
}

/// Returns the room's strongest flat or omnidirectional emitters, by decreasing power. Others, such as bright corners
/// of a room, are left to the mesh.
///
/// An emitter starts at a leaf above the photo's white, and includes its neighbours above white down to a quarter of
/// its luminance.
pub(crate) fn find_lamps(leaves: &[Leaf]) -> Vec<Lamp> {
    let bright = |&i: &usize| leaves[i].exposed != 0 && leaves[i].luminance() > WHITE;
    let mut seeds: Vec<usize> = (0..leaves.len()).filter(bright).collect();
    let mut open: HashMap<(u32, [u32; 3]), usize> =
        seeds.iter().map(|&i| ((leaves[i].depth, leaves[i].xyz), i)).collect();
    seeds.sort_by(|&a, &b| leaves[b].luminance().total_cmp(&leaves[a].luminance()).then(a.cmp(&b)));
    let mut lamps = Vec::new();
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
        lamps.extend(lamp_from_cluster(leaves, cluster));
    }
    lamps.sort_by_key(|lamp: &Lamp| Reverse(ordered(lamp.power().iter().sum())));
    lamps.truncate(MAX_LAMPS);
    lamps
}

/// Converts a cluster to a lamp; `None` if it is neither flat nor convex.
fn lamp_from_cluster(leaves: &[Leaf], cluster: Vec<usize>) -> Option<Lamp> {
    let surface = |leaf: &Leaf| LeafSurface {
        centre_m: leaf.centre_m,
        edge_m: leaf.edge_m,
        area_m2: leaf.surface_area_m2(),
        vector_area_m2: leaf.vector_area_m2(),
        luminance: leaf.luminance(),
    };
    let surfaces: Vec<LeafSurface> = cluster.iter().map(|&i| surface(&leaves[i])).collect();
    let ClusterSurface { centre_m, area_m2, shape } = ClusterSurface::of(&surfaces)?;
    let shape = match shape {
        ClusterShape::Panel { direction, across, size_m } => {
            // The surface is half an edge in front of the leaf's centre; another half keeps the lamp out of its own
            // wall.
            let centre_m = centre_m + direction * leaves[cluster[0]].edge_m;
            LightShape::Rectangle { centre_m, direction, across, size_m, two_sided: false }
        }
        ClusterShape::Ball { radius_m } => LightShape::Sphere { centre_m, radius_m },
        ClusterShape::Concave => return None,
    };
    let mut lamp = Lamp { light: AnalyticLight { shape, radiance: [0.0; 3] }, leaves: Vec::new(), id: None };
    let kept = lamp.face_emission();
    let given =
        |leaf: &Leaf| (Vec3::from(leaf.radiance()) - Vec3::from(kept.of(leaf.radiance()))) * leaf.surface_area_m2();
    let radiance: Vec3 = cluster.iter().map(|&i| given(&leaves[i])).sum();
    lamp.light.radiance = (radiance / area_m2).to_array();
    lamp.leaves = cluster;
    Some(lamp)
}

/// Returns the 26 neighbours of a node; coordinates below zero wrap to values that no leaf has.
fn neighbours([x, y, z]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..27).filter(|i| *i != 13).map(move |i| {
        [
            x.wrapping_add(i / 9).wrapping_sub(1),
            y.wrapping_add(i / 3 % 3).wrapping_sub(1),
            z.wrapping_add(i % 3).wrapping_sub(1),
        ]
    })
}

/// Maps a non-negative float to an integer of the same order.
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
        let lamps = find_lamps(&free_space::leaves(&box_room().light, None));
        assert_eq!(lamps.len(), 1);
        let lamp = &lamps[0];
        assert_eq!(lamp.leaves.len(), 4);
        assert!((lamp.light.extent() - 1.0).abs() < 1e-6);
        let LightShape::Rectangle { centre_m, direction, across, size_m, .. } = lamp.light.shape else {
            panic!("{:?} is no panel", lamp.light)
        };
        assert!(direction == Vec3::NEG_Y && across.dot(direction).abs() < 1e-6);
        assert!(size_m.iter().all(|m| (m - 1.0).abs() < 1e-3), "{size_m:?}");
        // (10, 8, 6) minus the part up to the photo's white.
        assert!(lamp.light.radiance.iter().zip([9.0, 7.2, 5.4]).all(|(a, b)| (a - b).abs() < 1e-5), "{:?}", lamp.light);
        // Half a cell below the ceiling at y = 1.5.
        assert_eq!(centre_m, Vec3::new(0.0, 1.25, 0.0));
    }

    #[test]
    fn a_lamp_and_its_faces_give_the_emitter() {
        let leaves = free_space::leaves(&box_room().light, None);
        let lamps = find_lamps(&leaves);
        let kept = face_emission(&leaves, &lamps);
        let lamp = Vec3::from(lamps[0].light.radiance);
        for (leaf, kept) in leaves.iter().zip(&kept) {
            let faces = Vec3::from(kept.of(leaf.radiance()));
            let whole = if *kept == FaceEmission::All { faces } else { faces + lamp };
            assert!((whole - Vec3::from(leaf.radiance())).length() < 1e-5);
        }
        assert_eq!(kept.iter().filter(|kept| **kept == FaceEmission::UpToWhite).count(), 4);
    }

    #[test]
    fn a_window_is_as_wide_as_it_is() {
        // 2 × 6 cells of a wall in the plane x = 0.
        let cube = Cube { origin_m: Vec3::splat(-2.0), edge_m: 4.0 };
        let cells: Vec<_> = (0..12).map(|i| ([0, 3 + i % 2, 1 + i / 2], [5.0, 5.0, 5.0, 1.0])).collect();
        let mut leaves = free_space::leaves(&light_of(&cells, cube, 3), None);
        leaves.iter_mut().for_each(|leaf| leaf.exposed = 0b10);
        let LightShape::Rectangle { direction, across, size_m, .. } = find_lamps(&leaves)[0].light.shape else {
            panic!("no panel")
        };
        assert_eq!(direction, Vec3::X);
        assert!(across.z.abs() > 0.999, "{across}");
        assert!((size_m[0] - 3.0).abs() < 1e-3 && (size_m[1] - 1.0).abs() < 1e-3, "{size_m:?}");
    }

    #[test]
    fn the_bright_inside_of_a_room_is_no_lamp() {
        let cells: Vec<_> = (0..512)
            .map(|i| [i / 64, i / 8 % 8, i % 8])
            .filter(|xyz| xyz.iter().any(|c| *c == 0 || *c == 7))
            .map(|xyz| (xyz, [3.0, 3.0, 3.0, 1.0]))
            .collect();
        let light = light_of(&cells, Cube::centred(Vec3::ZERO, 4.0), 3);
        assert!(find_lamps(&free_space::leaves(&light, None)).is_empty());
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
        let lamps = find_lamps(&free_space::leaves(&light_of(&cells, cube, 6), None));
        assert_eq!(lamps.len(), 1);
        let lamp = &lamps[0];
        let area_m2 = 4.0 * std::f32::consts::PI * 0.64;
        // The faces alone sum to 1.5 times that.
        assert!((lamp.light.extent() / area_m2 - 1.0).abs() < 0.15, "{} of {area_m2}", lamp.light.extent());
        let LightShape::Sphere { centre_m, radius_m } = lamp.light.shape else { panic!("{:?} is no ball", lamp.light) };
        assert!((radius_m / 0.8 - 1.0).abs() < 0.08, "{radius_m}");
        assert!((centre_m - Vec3::new(0.0, 0.0, -1.5)).length() < 1e-3);
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
        let lamps = find_lamps(&free_space::leaves(&light_of(&cells, cube, 3), None));
        let levels: Vec<f32> = lamps.iter().map(|lamp| lamp.light.radiance[0]).collect();
        // The panels' faces emit 1; the leaf of 6 shines in all directions, and its faces emit nothing.
        assert_eq!(levels, [19.0, 6.0, 1.0]);
        assert_eq!(lamps.iter().map(|lamp| lamp.leaves.len()).collect::<Vec<_>>(), [1, 1, 2]);
        assert!(find_lamps(&[]).is_empty());
    }
}
