//! Materials of the glTF 2.0 schema, as serde structures.

use std::collections::BTreeMap;

use serde::Deserialize;
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
    pub unlit: Option<serde::de::IgnoredAny>,
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_transmission")]
    pub transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_diffuse_transmission")]
    pub diffuse_transmission: Option<DiffuseTransmission>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub specular_glossiness: Option<SpecularGlossiness>,
    /// All other extensions of the material.
    #[serde(flatten)]
    pub other: BTreeMap<String, Value>,
}

impl MaterialExtensions {
    /// Returns the names of the extensions that would change the material's appearance, but are not applied.
    pub fn ignored(&self) -> impl Iterator<Item = &str> {
        let changes = |(name, value): &(&String, &Value)| {
            let has = |factor: &str| match value.get(factor) {
                Some(Value::Array(values)) => values.iter().any(|value| value.as_f64() != Some(0.0)),
                value => value.and_then(Value::as_f64).is_some_and(|value| value != 0.0),
            };
            let differs = |factor: &str, neutral: f64| {
                let is_other = |value: &Value| value.as_f64() != Some(neutral);
                value.get(factor).is_some_and(|value| match value {
                    Value::Array(values) => values.iter().any(is_other),
                    value => is_other(value),
                })
            };
            match name.as_str() {
                "KHR_materials_clearcoat" => has("clearcoatFactor"),
                "KHR_materials_sheen" => has("sheenColorFactor"),
                "KHR_materials_iridescence" => has("iridescenceFactor"),
                "KHR_materials_anisotropy" => has("anisotropyStrength"),
                "KHR_materials_dispersion" => has("dispersion"),
                "KHR_materials_specular" => {
                    let textures = ["specularTexture", "specularColorTexture"];
                    differs("specularFactor", 1.0)
                        || differs("specularColorFactor", 1.0)
                        || textures.iter().any(|texture| value.get(texture).is_some())
                }
                // The reflection of all dielectrics is that of an index of 1.5.
                "KHR_materials_ior" => self.transmission.is_none() && differs("ior", 1.5),
                // The warning about transmission covers it.
                "KHR_materials_volume" => false,
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

fn one() -> f32 {
    1.0
}

fn ones() -> [f32; 2] {
    [1.0; 2]
}
