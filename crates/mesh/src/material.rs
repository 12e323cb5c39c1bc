use imaging::Image;

/// glTF 2.0 metallic-roughness material; textures multiply the factors.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name for messages.
    pub name: String,
    /// Linear RGBA.
    pub base_color: [f32; 4],
    /// sRGB texture with straight alpha.
    pub base_color_texture: Option<TextureRef>,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// Perceptual roughness; GGX α is its square.
    pub roughness: f32,
    /// Blue: metallic, green: roughness.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals, +Y up.
    pub normal_texture: Option<TextureRef>,
    /// Scale of the normal texture's x and y.
    pub normal_scale: f32,
    /// Red: ambient occlusion.
    pub occlusion_texture: Option<TextureRef>,
    /// Share of the occlusion texture that counts.
    pub occlusion_strength: f32,
    /// Linear RGB radiance that the surface gives off (emissive strength included).
    pub emissive: [f32; 3],
    /// sRGB texture.
    pub emissive_texture: Option<TextureRef>,
    /// How alpha is used.
    pub alpha_mode: AlphaMode,
    /// Whether the back shows too.
    pub double_sided: bool,
    /// Base colour is shown as it is, without light.
    pub unlit: bool,
}

/// glTF alpha modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Visible where alpha reaches the cutoff.
    Mask {
        /// Smallest alpha that is visible.
        cutoff: f32,
    },
    /// Alpha is coverage.
    Blend,
}

/// A decoded picture with its mip levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Finest first; RGBA as stored in the file (8 bits).
    pub levels: Vec<Image<[u8; 4]>>,
}

/// Use of a texture by a material.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into the model's textures.
    pub texture: usize,
    /// Which UV set (0 or 1).
    pub uv_set: usize,
    /// `KHR_texture_transform` as a 2×3 matrix, row-major; identity without it.
    pub uv_transform: [f32; 6],
}
