use crate::TransportError;

/// How finely light is baked and sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct BakeSettings {
    /// Distance of cache points on surfaces, metres.
    pub spacing_m: f32,
    /// Rays per cache point that gather indirect light.
    pub gather_rays: u32,
    /// Shadow rays per cache point towards lamps and portals.
    pub light_rays: u32,
    /// Shadow rays per pixel of a view, at least: pictures of few pixels take more.
    pub pixel_light_rays: u32,
    /// Whether each sample of a pixel at an edge asks for the sun anew. Otherwise it takes the light of a pixel, and edges of sunny patches are
    /// jagged.
    pub sun_at_edges: bool,
    /// Chance: where samples lie. Has no influence on what is right, only on the noise.
    pub seed: u64,
}

impl Default for BakeSettings {
    /// What a room of 150 m² takes few core-seconds with.
    fn default() -> Self {
        Self { spacing_m: 0.16, gather_rays: 64, light_rays: 16, pixel_light_rays: 2, sun_at_edges: false, seed: 0 }
    }
}

impl BakeSettings {
    pub(crate) fn check(&self) -> Result<(), TransportError> {
        let ranges = [
            ("spacing_m", self.spacing_m, 0.01, 10.0),
            ("gather_rays", self.gather_rays as f32, 1.0, 4096.0),
            ("light_rays", self.light_rays as f32, 1.0, 4096.0),
            ("pixel_light_rays", self.pixel_light_rays as f32, 1.0, 256.0),
        ];
        match ranges.into_iter().find(|(_, value, least, most)| !(least..=most).contains(&value)) {
            Some((name, value, least, most)) => Err(TransportError::Setting { name, value, least, most }),
            None => Ok(()),
        }
    }
}
