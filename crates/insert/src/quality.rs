use serde::{Deserialize, Serialize};

/// How much work goes into a composite.
///
/// | | draft | normal | high |
/// | --- | --- | --- | --- |
/// | coverage samples on edges of the object | 4 | 8 | 16 |
/// | diffuse cones over the sphere per shaded point | 24 | 64 | 192 |
/// | diffuse shading shared by neighbouring pixels | 2 × 2 | no | no |
/// | specular cones | 1 | 6 | 24 |
/// | light samples on the object | 8 | 32 | 128 |
/// | directions per background point (× 16 by interleaving) | 16 | 32 | 96 |
/// | light samples per background point (× 16 by interleaving) | 3 | 8 | 16 |
/// | longer side of the shadow map | 240 | 640 | 2048 |
/// | longer side of the shadow map that the object sees | 80 | 120 | 240 |
/// | points that carry the object's bounced light | 192 | 512 | 1536 |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quality {
    /// For moving an object about: ten frames a second and more at 480 × 320.
    Draft,
    /// For a picture within about a second.
    #[default]
    Normal,
    /// For the final picture.
    High,
}

/// Sample counts of a [`Quality`]; its documentation has the table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Counts {
    pub coverage: usize,
    pub diffuse_cones: usize,
    pub shade_stride: usize,
    pub specular_cones: usize,
    pub object_lights: usize,
    pub background_cones: usize,
    pub background_lights: usize,
    pub shadow_side: usize,
    /// Longer side of the coarse shadow map.
    pub coarse_shadow_side: usize,
    /// Points that carry the object's own light.
    pub patches: usize,
    /// Share of a real surface's hemisphere below which the object's effect is neglected; it fades in up to twice this.
    pub negligible: f32,
}

impl Quality {
    pub(crate) fn counts(self) -> Counts {
        match self {
            Self::Draft => Counts {
                coverage: 4,
                diffuse_cones: 24,
                shade_stride: 2,
                specular_cones: 1,
                object_lights: 8,
                background_cones: 16,
                background_lights: 3,
                shadow_side: 240,
                coarse_shadow_side: 80,
                patches: 192,
                negligible: 0.01,
            },
            Self::Normal => Counts {
                coverage: 8,
                diffuse_cones: 64,
                shade_stride: 1,
                specular_cones: 6,
                object_lights: 32,
                background_cones: 32,
                background_lights: 8,
                shadow_side: 640,
                coarse_shadow_side: 120,
                patches: 512,
                negligible: 0.004,
            },
            Self::High => Counts {
                coverage: 16,
                diffuse_cones: 192,
                shade_stride: 1,
                specular_cones: 24,
                object_lights: 128,
                background_cones: 96,
                background_lights: 16,
                shadow_side: 2048,
                coarse_shadow_side: 240,
                patches: 1536,
                negligible: 0.003,
            },
        }
    }
}
