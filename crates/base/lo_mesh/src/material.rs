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
    /// Share of the light not reflected at the surface that passes straight through, as through a window pane: the surface is a thin sheet
    /// (`KHR_materials_transmission` without a volume); the base colour tints what passes.
    pub transmission: f32,
    /// Share of the diffusely scattered light that leaves on the other side, as from paper or curtains
    /// (`KHR_materials_diffuse_transmission`, its colour being the base colour).
    pub diffuse_transmission: f32,
}

impl Default for Material {
    /// Matte white, both sides: what a mesh without materials (OBJ, PLY, STL) gets.
    fn default() -> Self {
        Self {
            name: "default".to_owned(),
            base_color: [0.8, 0.8, 0.8, 1.0],
            base_color_texture: None,
            metallic: 0.0,
            roughness: 0.9,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: [0.0; 3],
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: true,
            unlit: false,
            transmission: 0.0,
            diffuse_transmission: 0.0,
        }
    }
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

/// Use of a texture by a material.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into the model's textures.
    pub texture: usize,
    /// Which UV set (0 or 1).
    pub uv_set: usize,
    /// `KHR_texture_transform` as a 2×3 matrix, row-major; identity without it.
    pub uv_transform: [f32; 6],
    /// What lies outside [0, 1], along u and v.
    pub wrap: [Wrap; 2],
    /// Texels stay hard squares when seen from near (glTF `magFilter` NEAREST).
    pub nearest: bool,
}

impl TextureRef {
    /// The first UV set, repeated, smooth.
    pub fn new(texture: usize) -> Self {
        Self {
            texture,
            uv_set: 0,
            uv_transform: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            wrap: [Wrap::Repeat; 2],
            nearest: false,
        }
    }

    /// Texture coordinates after `KHR_texture_transform`.
    pub(crate) fn transform(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let m = &self.uv_transform;
        [m[0] * u + m[1] * v + m[2], m[3] * u + m[4] * v + m[5]]
    }
}

/// Addressing outside [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The picture again.
    Repeat,
    /// The picture again, every second copy mirrored.
    Mirror,
    /// The border's colour.
    Clamp,
}
