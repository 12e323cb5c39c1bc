//! Brightness of lamps, and of leaves that neither photo nor panorama shows.

use lo_cone::{ConeTracer, Settings};
use lo_geometry::{Vec3, pixel_solid_angle_sr};
use lo_imaging::luminance;
use lo_octree::{Ancestor, LightOctree, OctreeError};

use super::deposits::RayDeposits;
use super::leaves::{Leaf, LeafSet};
use super::matching::weighted_median;

/// Columns of the panorama in which lamps are balanced, bounds of the factor, and the error below which it is 1.
const BALANCE_COLUMNS: usize = 512;
const BALANCE: (f32, f32) = (0.5, 2.0);
const BALANCED: f32 = 0.005;

/// Bounds of the factor on leaves that neither photo nor panorama shows.
const HIDDEN: (f32, f32) = (0.2, 5.0);

impl LeafSet {
    /// Scales the lamps so that together they are as bright at `position_m` as in the panorama, and returns the factor
    /// in luminance. Cones read lamps that are smaller than their nodes less exactly than rays hit them.
    pub fn balance_lamps(
        &mut self,
        light: &LightOctree,
        deposits: &RayDeposits,
        position_m: Vec3,
    ) -> Result<f32, OctreeError> {
        let shown: f64 = deposits.sums.iter().map(|sum| f64::from(luminance(sum.closing_lamp.map(|c| c as f32)))).sum();
        if shown <= 0.0 {
            return Ok(1.0);
        }
        let of_lamps = |leaf: &Leaf| [leaf.lamp[0], leaf.lamp[1], leaf.lamp[2], leaf.rgba[3]];
        let lamps = self.octree_with(light, of_lamps, |_, _| Ancestor::Merged)?;
        let tracer =
            ConeTracer::new(&lamps, Settings::default()).expect("default settings are valid, and there are no lobes");
        let seen = tracer.panorama(position_m, BALANCE_COLUMNS, BALANCE_COLUMNS / 2).radiance;
        let pixels = seen.pixels().iter().enumerate();
        let pixels = pixels.map(|(index, &rgb)| {
            f64::from(luminance(rgb) * pixel_solid_angle_sr(index / seen.width(), seen.width(), seen.height()))
        });
        let factor = (shown / pixels.sum::<f64>().max(1e-30)) as f32;
        // Peaks that are read correctly are not changed.
        let factor = if (factor - 1.0).abs() < BALANCED { 1.0 } else { factor.clamp(BALANCE.0, BALANCE.1) };
        for leaf in &mut self.leaves {
            leaf.lamp = leaf.lamp.map(|c| factor * c);
        }
        Ok(factor)
    }

    /// Scales the leaves that neither photo nor panorama shows to the panorama's brightness, and returns the factors
    /// per channel.
    pub fn scale_hidden(&mut self, deposits: &RayDeposits) -> [f32; 3] {
        let factors = std::array::from_fn(|c| {
            let ratios = self.leaves.iter().zip(&deposits.sums).filter_map(|(leaf, sum)| {
                let (from_panorama, completed) = (leaf.light?[c], leaf.rgba[c]);
                (from_panorama > 0.0 && completed > 0.0).then(|| ((from_panorama / completed).ln(), sum.weight as f32))
            });
            weighted_median(ratios.collect()).map_or(1.0, f32::exp).clamp(HIDDEN.0, HIDDEN.1)
        });
        for leaf in self.leaves.iter_mut().filter(|leaf| leaf.open && leaf.light.is_none()) {
            (0..3).for_each(|c| leaf.rgba[c] *= factors[c]);
        }
        factors
    }
}
