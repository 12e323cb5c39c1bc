use serde::{Deserialize, Serialize};

use crate::shade::visibility::AdaptiveCoverage;

/// Sample counts and resolutions of a rendering.
///
/// | | draft | normal | high |
/// | --- | --- | --- | --- |
/// | coverage samples per pixel | 4 on edges, else 1 | 8, or 4 that agree | 16 |
/// | diffuse cones over the sphere per shaded point | 24 | 64 | 192 |
/// | solid angle of a diffuse cone, of its share of the sphere | 1 | 1/2 | 1/4 |
/// | pixels that share diffuse light; in photos of 1,440 pixels and more | 4 × 4, 4 × 4 | 2 × 2, 4 × 4 | no, 2 × 2 |
/// | transmittance at which cones of diffuse light end | 1 % | 0.3 % | 0.01 % |
/// | side of the image of the room behind the object, texels | 32 | 48 | 96 |
/// | cones of a blurred reflection | 1 | 6 | 24 |
/// | rays per pixel through glass | 2 | 3 | 8 |
/// | directions of a reflection in a glossy floor | 4 | 16 | 64 |
/// | light samples on the object | 6 | 32 | 128 |
/// | directions per background point (× 16 by interleaving) | 8 | 16 | 96 |
/// | light samples per background point (× 16 by interleaving) | 3 | 8 | 16 |
/// | side of the object's shadow map from each of those, texels | 16 | 32 | (rays) |
/// | longer side of the shadow map | 128 | 480 | 512, 2048 where it is not smooth |
/// | longer side of the shadow map for light reflected to the object | 64 | 80 | 512 |
/// | the photo's sharpness and grain, if asked for | no | yes | yes |
/// | points that represent the object's bounced light | 192 | 512 | 1536 |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quality {
    /// For interactive moving: at least ten frames per second at 480 × 320.
    Draft,
    /// For previews within about a second.
    #[default]
    Normal,
    /// For the final image.
    High,
}

/// Sample counts of a [`Quality`], which documents them in a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counts {
    pub coverage: usize,
    pub diffuse_cones: usize,
    /// Solid angle of a diffuse cone as a share of its share of the sphere. Full cones meet the supporting surface:
    /// compared with a path tracer, the error of a box is then 10.1 instead of 6.9 % at high quality
    /// (`tests/it/truth.rs`). Few cones must not leave gaps.
    pub diffuse_aperture: f32,
    /// Side in pixels of the blocks that share diffuse light, in small and in large photos.
    pub shade_stride: [usize; 2],
    /// Condition under which pixels use fewer coverage samples.
    pub adaptive_coverage: AdaptiveCoverage,
    /// Transmittance at which cones of diffuse light end.
    pub min_transmittance: f32,
    pub specular_cones: usize,
    /// Rays per pixel through glass.
    pub glass_rays: usize,
    /// Directions per pixel of a reflection in a glossy support.
    pub gloss_samples: usize,
    pub object_lights: usize,
    pub background_cones: usize,
    pub background_lights: usize,
    /// Side in texels of the backdrop, the image of the room behind the object.
    pub backdrop_side: usize,
    /// Side in texels of the object's shadow map from each light sample; 0 casts a ray from each background point
    /// instead.
    pub silhouette_side: usize,
    pub shadow_side: usize,
    /// Longer side of the coarse shadow map.
    pub coarse_shadow_side: usize,
    /// Whether the shadow map is computed only where the coarse one is not smooth.
    pub refines_shadow: bool,
    /// Points that represent the object's own light.
    pub patches: usize,
    /// Share of a real surface's hemisphere below which the object's effect is neglected; it fades in up to twice
    /// this.
    pub negligible: f32,
    /// Whether a light that all corners of the object's box agree on has that visibility everywhere on it.
    pub share_light_visibility: bool,
    /// Whether reflections use the photo where it observes what they meet, and its detail in unobserved regions.
    pub photo_lookup: bool,
    /// Whether objects get the photo's sharpness and grain, if asked for.
    pub photo_look: bool,
}

impl Quality {
    pub(crate) fn counts(self) -> Counts {
        match self {
            Self::Draft => Counts {
                coverage: 4,
                diffuse_cones: 24,
                diffuse_aperture: 1.0,
                shade_stride: [4, 4],
                adaptive_coverage: AdaptiveCoverage::InsideOutline,
                min_transmittance: 0.01,
                specular_cones: 1,
                glass_rays: 2,
                gloss_samples: 4,
                object_lights: 6,
                background_cones: 8,
                background_lights: 3,
                backdrop_side: 32,
                silhouette_side: 16,
                shadow_side: 128,
                coarse_shadow_side: 64,
                refines_shadow: false,
                patches: 192,
                negligible: 0.02,
                share_light_visibility: true,
                photo_lookup: false,
                photo_look: false,
            },
            Self::Normal => Counts {
                coverage: 8,
                diffuse_cones: 64,
                diffuse_aperture: 0.5,
                shade_stride: [2, 4],
                adaptive_coverage: AdaptiveCoverage::HalfAgree,
                min_transmittance: 0.003,
                specular_cones: 6,
                glass_rays: 3,
                gloss_samples: 16,
                object_lights: 32,
                background_cones: 16,
                background_lights: 8,
                backdrop_side: 48,
                silhouette_side: 32,
                shadow_side: 480,
                coarse_shadow_side: 80,
                refines_shadow: false,
                patches: 512,
                negligible: 0.004,
                share_light_visibility: true,
                photo_lookup: true,
                photo_look: true,
            },
            Self::High => Counts {
                coverage: 16,
                diffuse_cones: 192,
                diffuse_aperture: 0.25,
                shade_stride: [1, 2],
                adaptive_coverage: AdaptiveCoverage::None,
                min_transmittance: 1e-4,
                specular_cones: 24,
                glass_rays: 8,
                gloss_samples: 64,
                object_lights: 128,
                background_cones: 96,
                background_lights: 16,
                backdrop_side: 96,
                silhouette_side: 0,
                shadow_side: 2048,
                coarse_shadow_side: 512,
                refines_shadow: true,
                patches: 1536,
                negligible: 0.003,
                share_light_visibility: false,
                photo_lookup: true,
                photo_look: true,
            },
        }
    }
}
