//! Materials of the glTF 2.0 schema, as serde structures.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct Material {
    pub name: Option<String>,
    pub pbr_metallic_roughness: MetallicRoughness,
    pub normal_texture: Option<NormalTexture>,
    pub occlusion_texture: Option<OcclusionTexture>,
    pub emissive_texture: Option<TextureInfo>,
    pub emissive_factor: [f32; 3],
    pub alpha_mode: String,
    pub alpha_cutoff: f32,
    pub double_sided: bool,
    pub extensions: MaterialExtensions,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: None,
            pbr_metallic_roughness: MetallicRoughness::default(),
            normal_texture: None,
            occlusion_texture: None,
            emissive_texture: None,
            emissive_factor: [0.0; 3],
            alpha_mode: "OPAQUE".to_owned(),
            alpha_cutoff: 0.5,
            double_sided: false,
            extensions: MaterialExtensions::default(),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct MetallicRoughness {
    pub base_color_factor: [f32; 4],
    pub base_color_texture: Option<TextureInfo>,
    pub metallic_factor: f32,
    pub roughness_factor: f32,
    pub metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for MetallicRoughness {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
pub struct MaterialExtensions {
    #[serde(rename = "KHR_materials_unlit")]
    pub unlit: Option<IgnoredAny>,
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_transmission")]
    pub transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_volume")]
    pub volume: Option<Volume>,
    #[serde(rename = "KHR_materials_ior")]
    pub ior: Option<Ior>,
    #[serde(rename = "KHR_materials_specular")]
    pub specular: Option<Specular>,
    #[serde(rename = "KHR_materials_clearcoat")]
    pub clearcoat: Option<Clearcoat>,
    #[serde(rename = "KHR_materials_sheen")]
    pub sheen: Option<Sheen>,
    #[serde(rename = "KHR_materials_diffuse_transmission")]
    pub diffuse_transmission: Option<DiffuseTransmission>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub specular_glossiness: Option<SpecularGlossiness>,
    /// All other extensions of the material.
    #[serde(flatten)]
    pub other: BTreeMap<String, Value>,
}

impl MaterialExtensions {
    /// Returns the names of textures of extensions of which only the factors are applied.
    pub fn ignored_textures(&self) -> impl Iterator<Item = &str> {
        let specular = self.specular.as_ref();
        let clearcoat = self.clearcoat.as_ref();
        let sheen = self.sheen.as_ref();
        let given = [
            ("specularTexture", specular.is_some_and(|s| s.specular_texture.is_some())),
            ("specularColorTexture", specular.is_some_and(|s| s.specular_color_texture.is_some())),
            ("clearcoatTexture", clearcoat.is_some_and(|c| c.clearcoat_texture.is_some())),
            ("clearcoatRoughnessTexture", clearcoat.is_some_and(|c| c.clearcoat_roughness_texture.is_some())),
            ("clearcoatNormalTexture", clearcoat.is_some_and(|c| c.clearcoat_normal_texture.is_some())),
            ("sheenColorTexture", sheen.is_some_and(|s| s.sheen_color_texture.is_some())),
            ("sheenRoughnessTexture", sheen.is_some_and(|s| s.sheen_roughness_texture.is_some())),
            ("thicknessTexture", self.volume.as_ref().is_some_and(|v| v.thickness_texture.is_some())),
        ];
        given.into_iter().filter_map(|(name, given)| given.then_some(name))
    }

    /// Returns the names of the extensions that would change the material's appearance, but are not applied.
    pub fn ignored(&self) -> impl Iterator<Item = &str> {
        let changes = |(name, value): &(&String, &Value)| {
            let has = |factor: &str| match value.get(factor) {
                Some(Value::Array(values)) => values.iter().any(|value| value.as_f64() != Some(0.0)),
                value => value.and_then(Value::as_f64).is_some_and(|value| value != 0.0),
            };
            match name.as_str() {
                "KHR_materials_iridescence" => has("iridescenceFactor"),
                "KHR_materials_anisotropy" => has("anisotropyStrength"),
                "KHR_materials_dispersion" => has("dispersion"),
                _ => true,
            }
        };
        self.other.iter().filter(changes).map(|(name, _)| name.as_str())
    }
}

/// `KHR_materials_pbrSpecularGlossiness`, archived by Khronos but still exported.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct SpecularGlossiness {
    pub diffuse_factor: [f32; 4],
    pub diffuse_texture: Option<TextureInfo>,
    pub specular_factor: [f32; 3],
    pub glossiness_factor: f32,
    pub specular_glossiness_texture: Option<TextureInfo>,
}

impl Default for SpecularGlossiness {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Transmission {
    #[serde(default)]
    pub transmission_factor: f32,
    pub transmission_texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct Volume {
    pub thickness_factor: f32,
    pub thickness_texture: Option<IgnoredAny>,
    pub attenuation_distance: f32,
    pub attenuation_color: [f32; 3],
}

impl Default for Volume {
    fn default() -> Self {
        Self {
            thickness_factor: 0.0,
            thickness_texture: None,
            attenuation_distance: f32::INFINITY,
            attenuation_color: [1.0; 3],
        }
    }
}

#[derive(Debug, Deserialize)]
pub struct Ior {
    #[serde(default = "glass_ior")]
    pub ior: f32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct Specular {
    pub specular_factor: f32,
    pub specular_texture: Option<IgnoredAny>,
    pub specular_color_factor: [f32; 3],
    pub specular_color_texture: Option<IgnoredAny>,
}

impl Default for Specular {
    fn default() -> Self {
        Self {
            specular_factor: 1.0,
            specular_texture: None,
            specular_color_factor: [1.0; 3],
            specular_color_texture: None,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct Clearcoat {
    pub clearcoat_factor: f32,
    pub clearcoat_texture: Option<IgnoredAny>,
    pub clearcoat_roughness_factor: f32,
    pub clearcoat_roughness_texture: Option<IgnoredAny>,
    pub clearcoat_normal_texture: Option<IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct DiffuseTransmission {
    #[serde(default)]
    pub diffuse_transmission_factor: f32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct EmissiveStrength {
    #[serde(default = "one")]
    pub emissive_strength: f32,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct TextureInfo {
    pub index: usize,
    #[serde(default)]
    pub tex_coord: usize,
    #[serde(default)]
    pub extensions: TextureInfoExtensions,
}

#[derive(Debug, Deserialize)]
pub struct NormalTexture {
    #[serde(flatten)]
    pub info: TextureInfo,
    #[serde(default = "one")]
    pub scale: f32,
}

#[derive(Debug, Deserialize)]
pub struct OcclusionTexture {
    #[serde(flatten)]
    pub info: TextureInfo,
    #[serde(default = "one")]
    pub strength: f32,
}

#[derive(Clone, Debug, Default, Deserialize)]
pub struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub transform: Option<TextureTransform>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct TextureTransform {
    #[serde(default)]
    pub offset: [f32; 2],
    #[serde(default)]
    pub rotation: f32,
    #[serde(default = "ones")]
    pub scale: [f32; 2],
    pub tex_coord: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct Sheen {
    pub sheen_color_factor: [f32; 3],
    pub sheen_color_texture: Option<IgnoredAny>,
    pub sheen_roughness_factor: f32,
    pub sheen_roughness_texture: Option<IgnoredAny>,
}

fn glass_ior() -> f32 {
    lo_bsdf::GLASS_IOR
}

fn one() -> f32 {
    1.0
}

fn ones() -> [f32; 2] {
    [1.0; 2]
}
