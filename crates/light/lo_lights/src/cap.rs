//! Threshold between lights and the surfaces that they illuminate: a multiple of the mean radiance.

use lo_geometry::Vec3;
use lo_octree::LightOctree;

/// Multiple of the mean radiance above which radiance counts as light.
pub const CAP: f32 = 4.0;

/// Returns the cap for surroundings with this mean luminance.
pub fn cap_luminance(mean: f32) -> f32 {
    CAP * mean
}

/// Returns the [`cap_luminance`] of an octree; the mean is over its leaves, weighted by area and opacity.
pub fn cap_of(light: &LightOctree) -> f32 {
    let mut mean = (0.0f64, 0.0f64);
    for leaf in light.octree.leaf_nodes() {
        let area = f64::from(light.cube.node_edge_m(leaf.depth)).powi(2);
        let alpha = light.rgba[leaf.depth as usize][leaf.row][3];
        mean.0 += f64::from(luminance(light.radiance(leaf)) * alpha) * area;
        mean.1 += f64::from(alpha) * area;
    }
    cap_luminance((mean.0 / mean.1.max(1e-30)) as f32)
}

/// Returns the part of `radiance` above the cap, with the same colour.
pub fn excess(radiance: Vec3, cap: f32) -> Vec3 {
    let bright = luminance(radiance);
    if bright > cap { radiance * (1.0 - cap / bright) } else { Vec3::ZERO }
}

/// Returns the Rec. 709 luminance.
pub fn luminance(rgb: Vec3) -> f32 {
    lo_imaging::luminance(rgb.to_array())
}
