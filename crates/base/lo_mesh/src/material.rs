use lo_bsdf::GLASS_IOR;

/// A glTF 2.0 metallic-roughness material; textures multiply the factors.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name, for messages.
    pub name: String,
    /// Base colour and alpha, linear RGBA.
    pub base_color: [f32; 4],
    /// Base colour texture: sRGB with straight alpha.
    pub base_color_texture: Option<TextureRef>,
    /// Metalness: 0 for dielectrics, 1 for metals.
    pub metallic: f32,
    /// Perceptual roughness; GGX α is its square.
    pub roughness: f32,
    /// Texture of metalness (blue) and roughness (green).
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Normal texture: tangent-space normals, +Y up.
    pub normal_texture: Option<TextureRef>,
    /// Scale of the normal texture's x and y.
    pub normal_scale: f32,
    /// Texture of ambient occlusion (red).
    pub occlusion_texture: Option<TextureRef>,
    /// Strength of the occlusion texture, from 0 to 1.
    pub occlusion_strength: f32,
    /// Emitted radiance, linear RGB, including the emissive strength.
    pub emissive: [f32; 3],
    /// Emissive texture: sRGB.
    pub emissive_texture: Option<TextureRef>,
    /// Use of alpha.
    pub alpha_mode: AlphaMode,
    /// Whether back faces are visible.
    pub double_sided: bool,
    /// Whether the base colour is shown without lighting.
    pub unlit: bool,
    /// Share of the light not reflected at the surface that passes through it (`KHR_materials_transmission`), tinted by
    /// the base colour. Without a volume, the surface is a thin sheet like a window pane and does not refract.
    pub transmission: f32,
    /// Interior of a solid, which refracts; `None` for thin sheets.
    pub volume: Option<Volume>,
    /// Index of refraction (`KHR_materials_ior`), at least 1.
    pub ior: f32,
    /// Factor on the reflectance of dielectrics at normal incidence, linear RGB (`KHR_materials_specular`).
    pub specular: [f32; 3],
    /// Strength of a clear coat of index 1.5, from 0 to 1 (`KHR_materials_clearcoat`).
    pub clearcoat: f32,
    /// Perceptual roughness of the clear coat.
    pub clearcoat_roughness: f32,
    /// Colour of a layer of sheen, linear RGB; black for none (`KHR_materials_sheen`).
    pub sheen: [f32; 3],
    /// Perceptual roughness of the sheen.
    pub sheen_roughness: f32,
    /// Share of diffusely scattered light that leaves on the other side, as from paper or curtains
    /// (`KHR_materials_diffuse_transmission`, with the base colour as its colour).
    pub diffuse_transmission: f32,
}

/// Interior of a transmissive solid (`KHR_materials_volume` with a thickness).
///
/// Meshes are taken to be closed; light is refracted at each of their surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Share of white light that remains after the attenuation distance, linear RGB.
    pub attenuation_color: [f32; 3],
    /// Attenuation distance in world metres; infinite for a clear interior.
    pub attenuation_distance_m: f32,
}

impl Volume {
    /// A clear interior.
    pub const CLEAR: Self = Self { attenuation_color: [1.0; 3], attenuation_distance_m: f32::INFINITY };

    /// Returns the share of light that remains after a distance (Beer's law), linear RGB.
    pub fn transmittance(&self, distance_m: f32) -> [f32; 3] {
        let distances = distance_m / self.attenuation_distance_m;
        self.attenuation_color.map(|color| color.max(1e-6).powf(distances))
    }
}

impl Default for Material {
    /// Matte white and double-sided: the material of meshes without materials (OBJ, PLY, STL).
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
            volume: None,
            ior: GLASS_IOR,
            specular: [1.0; 3],
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            sheen: [0.0; 3],
            sheen_roughness: 0.0,
            diffuse_transmission: 0.0,
        }
    }
}

impl Material {
    /// Whether its alpha factor makes it invisible.
    pub(crate) fn is_transparent(&self) -> bool {
        let alpha = self.base_color[3];
        match self.alpha_mode {
            AlphaMode::Opaque => false,
            AlphaMode::Mask { cutoff } => alpha < cutoff,
            AlphaMode::Blend => alpha <= 0.0,
        }
    }
}

/// Alpha mode of a material, as in glTF.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Opaque where alpha reaches the cutoff, else fully transparent.
    Mask {
        /// Smallest visible alpha.
        cutoff: f32,
    },
    /// Alpha is coverage.
    Blend,
}

/// A reference from a material to a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into the model's textures.
    pub texture: usize,
    /// Index of the UV set (0 or 1).
    pub uv_set: usize,
    /// `KHR_texture_transform` as a 2×3 matrix, row-major; identity without it.
    pub uv_transform: [f32; 6],
    /// Addressing modes outside [0, 1], along u and v.
    pub wrap: [Wrap; 2],
    /// Whether magnification takes the nearest texel (glTF `magFilter` NEAREST).
    pub nearest: bool,
}

impl TextureRef {
    /// Creates a reference with the first UV set, repeated and with bilinear magnification.
    pub fn new(texture: usize) -> Self {
        Self {
            texture,
            uv_set: 0,
            uv_transform: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            wrap: [Wrap::Repeat; 2],
            nearest: false,
        }
    }

    /// Applies `KHR_texture_transform` to texture coordinates.
    pub(crate) fn transform(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let m = &self.uv_transform;
        [m[0] * u + m[1] * v + m[2], m[3] * u + m[4] * v + m[5]]
    }
}

/// Texture addressing mode outside [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Repeats the image.
    Repeat,
    /// Repeats the image, mirroring every second copy.
    Mirror,
    /// Clamps to the border.
    Clamp,
}
