use serde::{Deserialize, Serialize};

use crate::TransportError;

/// Sampling settings of a bake. Each field has a default, so a file only needs the fields that differ.
///
/// More samples take longer and leave less noise. Noise appears as stains on walls, ceilings and curtains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BakeSettings {
    /// Distance between cache points on surfaces, in metres.
    pub spacing_m: f32,
    /// Rays per cache point that gather indirect light.
    pub gather_rays: u32,
    /// Shadow rays per cache point towards lamps and portals.
    pub light_rays: u32,
    /// Minimum shadow rays per pixel of a view towards lamps and portals. Views with few pixels take more.
    pub pixel_rays: u32,
    /// Whether each sample of an edge pixel traces its own sun ray. Otherwise it reuses a pixel's sun light, and the
    /// edges of sunlit patches are jagged.
    pub sun_at_edges: bool,
    /// Seed of the sample positions. It changes only the noise. Not part of a file.
    #[serde(skip)]
    pub seed: u64,
}

impl Default for BakeSettings {
    /// Settings with which a room of 150 m² takes a few core-seconds.
    fn default() -> Self {
        Self { spacing_m: 0.16, gather_rays: 64, light_rays: 16, pixel_rays: 2, sun_at_edges: false, seed: 0 }
    }
}

impl BakeSettings {
    pub(crate) fn check(&self) -> Result<(), TransportError> {
        let ranges = [
            ("spacing_m", self.spacing_m, 0.01, 10.0),
            ("gather_rays", self.gather_rays as f32, 1.0, 4096.0),
            ("light_rays", self.light_rays as f32, 1.0, 4096.0),
            ("pixel_rays", self.pixel_rays as f32, 1.0, 256.0),
        ];
        match ranges.into_iter().find(|(_, value, min, max)| !(min..=max).contains(&value)) {
            Some((name, value, min, max)) => Err(TransportError::Setting { name, value, min, max }),
            None => Ok(()),
        }
    }
}
