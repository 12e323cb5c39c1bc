use lo_geometry::{Cube, Vec3};

use crate::{
    BuildReport, MAX_ALPHA, Octree, OctreeError, RadiancePoint,
    corners::without_corners,
    leaves::{Leaves, average_points},
    pyramid::pyramid,
    topology::check_depths,
};

/// An octree over a cube of the world whose non-empty nodes hold RGBα.
#[derive(Clone, Debug, PartialEq)]
pub struct LightOctree {
    /// Structure.
    pub octree: Octree,
    /// The part of the world that the root covers.
    pub cube: Cube,
    /// `rgba[d][row]`: linear RGB radiance and the opacity of one full crossing of the node, for each depth `d`.
    pub rgba: Vec<Vec<[f32; 4]>>,
    /// `seen[d][row]`: share, 0 for none and 255 for all, that the photo saw: of a finest node's points, and above that the
    /// mean of a node's non-empty children.
    pub seen: Vec<Vec<u8>>,
    /// Where light differs by direction: `lobes[d][row]`, whose gain ([`lobe_gain`](crate::lobe_gain)) towards a viewer the radiance
    /// is to be multiplied by, being the mean over directions ([`LightOctree::seen_from`]).
    pub lobes: Option<Vec<Vec<[f32; 3]>>>,
}

impl LightOctree {
    /// Builds the octree of `depth` (1 to [`MAX_DEPTH`](crate::MAX_DEPTH)), full down to `full_depth`, from surface points.
    ///
    /// A leaf holds the mean radiance of its points and the opacity [`MAX_ALPHA`]; the levels above hold the mean radiance of
    /// their children weighted by opacity, and the opacity of crossing the node: not the mean of the children's, which
    /// would make thin walls transparent from afar. Points outside of the cube and points that are
    /// not finite are dropped and counted; negative radiance counts as 0. The result is the same to the bit for every
    /// number of threads. Time and memory grow with the points and the occupied leaves.
    ///
    /// # Errors
    /// Depths out of range, a cube without volume.
    pub fn from_points(
        points: &[RadiancePoint],
        cube: Cube,
        depth: u32,
        full_depth: u32,
    ) -> Result<(Self, BuildReport), OctreeError> {
        Self::from_points_with_alpha(points, cube, depth, full_depth, MAX_ALPHA)
    }

    /// [`LightOctree::from_points`] with the opacity `alpha`, in (0, 1], for the leaves.
    pub fn from_points_with_alpha(
        points: &[RadiancePoint],
        cube: Cube,
        depth: u32,
        full_depth: u32,
        alpha: f32,
    ) -> Result<(Self, BuildReport), OctreeError> {
        check_depths(depth, full_depth)?;
        check_cube(cube)?;
        if !(alpha > 0.0 && alpha <= 1.0) {
            return Err(OctreeError::Alpha(alpha));
        }
        // One hand-over to the pool for all steps instead of one for each.
        Ok(rayon::scope(|_| {
            let (averaged, report) = average_points(points, cube, depth, alpha);
            (Self::from_valid_leaves(averaged.leaves, cube, depth, full_depth), report)
        }))
    }

    /// [`LightOctree::from_points`] for points that lie evenly on all surfaces, each of which stands for `area_m2`.
    ///
    /// A leaf that a surface just touches would be as opaque as one that it fills, and things would be up to a leaf too thick on
    /// each side. So a leaf that holds less than half a face of surface gives it to the fullest of its 26 neighbours that holds
    /// more; where there is none it stays, and thin things with it. In panoramas of 50 generated rooms 0.4 dB better at depth 7,
    /// 0.5 dB at depth 6 (`docs/design/003-octree-from-points.md`). With fewer than two points a face this changes nothing.
    ///
    /// # Errors
    /// Those of [`LightOctree::from_points`].
    pub fn from_even_points(
        points: &[RadiancePoint],
        area_m2: f32,
        cube: Cube,
        depth: u32,
        full_depth: u32,
    ) -> Result<(Self, BuildReport), OctreeError> {
        check_depths(depth, full_depth)?;
        check_cube(cube)?;
        let leaf_m = cube.edge_m / (1u32 << depth) as f32;
        let least = (0.5 * leaf_m * leaf_m / area_m2).round() as u32;
        Ok(rayon::scope(|_| {
            let (averaged, report) = average_points(points, cube, depth, MAX_ALPHA);
            let averaged = without_corners(averaged, least, depth);
            (Self::from_valid_leaves(averaged.leaves, cube, depth, full_depth), report)
        }))
    }

    /// Builds the octree from leaves of `depth` in strictly increasing order of their shuffled `keys`.
    ///
    /// `rgba[i]`: linear RGB radiance (finite, not negative) and opacity in [0, 1]; `seen[i]`: share that the photo saw,
    /// 0 to 255.
    ///
    /// # Errors
    /// Depths out of range, a cube without volume, lists of different lengths, keys out of order, features out of range.
    pub fn from_leaves(
        keys: Vec<u32>,
        rgba: Vec<[f32; 4]>,
        seen: Vec<u8>,
        cube: Cube,
        depth: u32,
        full_depth: u32,
    ) -> Result<Self, OctreeError> {
        check_depths(depth, full_depth)?;
        check_cube(cube)?;
        for (what, got) in [("rgba", rgba.len()), ("seen", seen.len())] {
            if got != keys.len() {
                return Err(OctreeError::Length { what, expected: keys.len(), got });
            }
        }
        for (index, &key) in keys.iter().enumerate() {
            if key >> (3 * depth) != 0 || (index > 0 && keys[index - 1] >= key) {
                return Err(OctreeError::LeafKey { index, key, depth });
            }
        }
        if let Some(index) = rgba.iter().position(|row| !is_feature(row)) {
            return Err(OctreeError::LeafFeature { index, rgba: rgba[index] });
        }
        Ok(Self::from_valid_leaves(Leaves { keys, rgba, seen }, cube, depth, full_depth))
    }

    fn from_valid_leaves(leaves: Leaves, cube: Cube, depth: u32, full_depth: u32) -> Self {
        let octree = Octree::from_leaf_keys(&leaves.keys, depth, full_depth);
        let (rgba, seen) = pyramid(&octree, leaves);
        Self { octree, cube, rgba, seen, lobes: None }
    }
}

/// Whether a row holds finite, non-negative radiance and an opacity in [0, 1].
pub(crate) fn is_feature(rgba: &[f32; 4]) -> bool {
    rgba.iter().all(|c| c.is_finite() && *c >= 0.0) && rgba[3] <= 1.0
}

/// Errors for a cube that is not finite or has no volume.
pub(crate) fn check_cube(cube: Cube) -> Result<(), OctreeError> {
    let far = cube.origin_m + Vec3::splat(cube.edge_m);
    if cube.origin_m.is_finite() && far.is_finite() && cube.edge_m > 0.0 {
        Ok(())
    } else {
        Err(OctreeError::Cube { origin_m: cube.origin_m.to_array(), edge_m: cube.edge_m })
    }
}
