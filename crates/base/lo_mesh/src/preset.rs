//! Material presets and materials from JSON, for meshes without materials and to override those of others.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::load::MAX_FILE_BYTES;
use crate::{AlphaMode, Material, MeshError, MeshWarning, Model, Texture, TextureRef, Volume, tangents};

/// Name, linear base colour, metalness and roughness of each preset.
///
/// Base colours of metals are published reflectances at normal incidence for metallic-roughness renderers (Hoffman,
/// "Physics and Math of Shading", SIGGRAPH 2015; physicallybased.info).
const PRESETS: [(&str, [f32; 3], f32, f32); 19] = [
    ("matte-white", [0.8, 0.8, 0.8], 0.0, 1.0),
    ("matte-grey", [0.18, 0.18, 0.18], 0.0, 1.0),
    ("matte-black", [0.03, 0.03, 0.03], 0.0, 1.0),
    ("glossy-white", [0.8, 0.8, 0.8], 0.0, 0.1),
    ("plastic-red", [0.6, 0.02, 0.02], 0.0, 0.3),
    ("plastic-green", [0.03, 0.4, 0.06], 0.0, 0.3),
    ("plastic-blue", [0.02, 0.08, 0.5], 0.0, 0.3),
    ("plastic-black", [0.02, 0.02, 0.02], 0.0, 0.3),
    ("clay", [0.46, 0.27, 0.19], 0.0, 0.95),
    ("rubber", [0.023, 0.023, 0.023], 0.0, 0.9),
    ("mirror", [1.0, 1.0, 1.0], 1.0, 0.0),
    ("chrome", [0.549, 0.556, 0.554], 1.0, 0.05),
    ("silver", [0.972, 0.960, 0.915], 1.0, 0.1),
    ("rough-silver", [0.972, 0.960, 0.915], 1.0, 0.5),
    ("aluminium", [0.913, 0.922, 0.924], 1.0, 0.2),
    ("brushed-steel", [0.562, 0.565, 0.578], 1.0, 0.35),
    ("gold", [1.0, 0.766, 0.336], 1.0, 0.15),
    ("copper", [0.955, 0.638, 0.538], 1.0, 0.2),
    ("brass", [0.887, 0.789, 0.434], 1.0, 0.25),
];

/// Name, index of refraction, roughness, and colour of white light after one centimetre of each solid glass.
///
/// Indices are those of soda-lime glass, water and diamond at 589 nm (refractiveindex.info). Attenuations are set by
/// eye, so that a bottle with walls of 3 mm has the usual colour.
const GLASSES: [(&str, f32, f32, [f32; 3]); 6] = [
    ("glass", 1.52, 0.0, [1.0, 1.0, 1.0]),
    ("frosted-glass", 1.52, 0.35, [1.0, 1.0, 1.0]),
    ("green-glass", 1.52, 0.0, [0.12, 0.55, 0.16]),
    ("amber-glass", 1.52, 0.0, [0.55, 0.2, 0.02]),
    ("water", 1.333, 0.0, [1.0, 1.0, 1.0]),
    ("diamond", 2.417, 0.0, [1.0, 1.0, 1.0]),
];

/// Distance of the colours in [`GLASSES`], in metres.
const GLASS_DISTANCE_M: f32 = 0.01;

impl Material {
    /// Returns the double-sided material of a name of [`Material::preset_names`].
    pub fn preset(name: &str) -> Option<Self> {
        if let Some(&(name, ior, roughness, color)) = GLASSES.iter().find(|preset| preset.0 == name) {
            let tinted = Volume { attenuation_color: color, attenuation_distance_m: GLASS_DISTANCE_M };
            let volume = if color == [1.0; 3] { Volume::CLEAR } else { tinted };
            return Some(Self {
                name: name.to_owned(),
                base_color: [1.0; 4],
                roughness,
                transmission: 1.0,
                volume: Some(volume),
                ior,
                ..Self::default()
            });
        }
        let &(name, [r, g, b], metallic, roughness) = PRESETS.iter().find(|preset| preset.0 == name)?;
        Some(Self { name: name.to_owned(), base_color: [r, g, b, 1.0], metallic, roughness, ..Self::default() })
    }

    /// Names of all presets.
    pub fn preset_names() -> impl Iterator<Item = &'static str> {
        PRESETS.iter().map(|preset| preset.0).chain(GLASSES.iter().map(|preset| preset.0))
    }
}

/// A material description by a user: a preset's name, or JSON such as
/// `{"preset":"gold","roughness":0.4}` or `{"base_color":"#c02020","base_color_texture":"wood.png"}`.
///
/// Omitted fields keep the preset's values (without a preset: white, dielectric, roughness 0.5, double-sided).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialSpec {
    /// Preset that the other fields modify.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<String>,
    /// Base colour: linear RGB or RGBA in [0, 1], or sRGB as "#rrggbb".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_color: Option<Color>,
    /// Coverage in [0, 1]; below 1 the alpha mode becomes "blend" unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha: Option<f32>,
    /// Metalness: 0 for dielectrics, 1 for metals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic: Option<f32>,
    /// Perceptual roughness in [0, 1].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roughness: Option<f32>,
    /// Share of the light not reflected at the surface that passes through it, in [0, 1].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transmission: Option<f32>,
    /// Whether transmitted light is refracted, as by a closed solid; thin sheets otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub solid: Option<bool>,
    /// Index of refraction, from 1 to 4.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ior: Option<f32>,
    /// Colour of white light inside a solid after the attenuation distance: linear RGB or sRGB as "#rrggbb".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attenuation_color: Option<Color>,
    /// Attenuation distance in metres; 0.01 by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attenuation_distance_m: Option<f32>,
    /// Strength of a clear coat, in [0, 1].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearcoat: Option<f32>,
    /// Perceptual roughness of the clear coat, in [0, 1].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clearcoat_roughness: Option<f32>,
    /// Emitted radiance: linear RGB, where 1 is the photo's white, or sRGB as "#rrggbb".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emissive: Option<Color>,
    /// Image file of the base colour, sRGB.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_color_texture: Option<String>,
    /// Image file of roughness (green) and metalness (blue).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub metallic_roughness_texture: Option<String>,
    /// Image file of tangent-space normals, +Y up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_texture: Option<String>,
    /// Scale of the normal texture's x and y.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_scale: Option<f32>,
    /// Image file of the emission, sRGB.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emissive_texture: Option<String>,
    /// Alpha mode: "opaque", "mask" or "blend".
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_mode: Option<AlphaModeName>,
    /// Smallest visible alpha under "mask"; 0.5 by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alpha_cutoff: Option<f32>,
    /// Whether back faces are visible.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub double_sided: Option<bool>,
    /// Whether the base colour is shown without lighting.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unlit: Option<bool>,
}

/// A colour in a material description.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "a colour is [r, g, b], [r, g, b, a] or \"#rrggbb\"")]
pub enum Color {
    /// Linear RGB.
    Rgb([f32; 3]),
    /// Linear RGBA.
    Rgba([f32; 4]),
    /// sRGB, "#rrggbb".
    Hex(String),
}

/// Alpha mode of a material description.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AlphaModeName {
    /// Alpha is ignored.
    Opaque,
    /// Opaque where alpha reaches the cutoff, else fully transparent.
    Mask,
    /// Alpha is coverage.
    Blend,
}

impl MaterialSpec {
    /// Parses a preset's name or JSON, and checks every value.
    ///
    /// # Errors
    /// [`MeshError::UnknownMaterial`] with the names of all presets; [`MeshError::MaterialJson`] naming the field.
    pub fn parse(text: &str) -> Result<Self, MeshError> {
        let text = text.trim();
        let spec = if text.starts_with('{') {
            serde_json::from_str(text).map_err(|error| MeshError::MaterialJson(error.to_string()))?
        } else {
            Self { preset: Some(text.to_owned()), ..Self::default() }
        };
        spec.factors()?;
        Ok(spec)
    }

    /// Names of the texture files.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        let files =
            [&self.base_color_texture, &self.metallic_roughness_texture, &self.normal_texture, &self.emissive_texture];
        files.into_iter().flatten().map(String::as_str)
    }

    /// Formats the description so that [`MaterialSpec::parse`] reads it back: the preset's name if nothing else is set.
    pub fn to_text(&self) -> String {
        match &self.preset {
            Some(name) if *self == (Self { preset: Some(name.clone()), ..Self::default() }) => name.clone(),
            _ => serde_json::to_string(self).expect("serialising strings and numbers cannot fail"),
        }
    }

    /// Returns the material without its textures.
    fn factors(&self) -> Result<Material, MeshError> {
        let mut material = match &self.preset {
            Some(name) => Material::preset(name).ok_or_else(|| MeshError::UnknownMaterial {
                name: name.clone(),
                known: Material::preset_names().collect::<Vec<_>>().join(", "),
            })?,
            None => Material { name: "given".to_owned(), base_color: [1.0; 4], roughness: 0.5, ..Material::default() },
        };
        if let Some(color) = &self.base_color {
            let [r, g, b, a] = color.linear("base_color")?;
            material.base_color = [
                unit_interval("base_color", r)?,
                unit_interval("base_color", g)?,
                unit_interval("base_color", b)?,
                unit_interval("base_color", a)?,
            ];
        }
        if let Some(alpha) = self.alpha {
            material.base_color[3] = unit_interval("alpha", alpha)?;
        }
        if let Some(metallic) = self.metallic {
            material.metallic = unit_interval("metallic", metallic)?;
        }
        if let Some(roughness) = self.roughness {
            material.roughness = unit_interval("roughness", roughness)?;
        }
        self.set_glass(&mut material)?;
        if let Some(clearcoat) = self.clearcoat {
            material.clearcoat = unit_interval("clearcoat", clearcoat)?;
        }
        if let Some(roughness) = self.clearcoat_roughness {
            material.clearcoat_roughness = unit_interval("clearcoat_roughness", roughness)?;
        }
        if let Some(emissive) = &self.emissive {
            let [r, g, b, _] = emissive.linear("emissive")?;
            material.emissive = [r, g, b];
        } else if self.emissive_texture.is_some() {
            material.emissive = [1.0; 3];
        }
        if let Some(scale) = self.normal_scale {
            if !scale.is_finite() {
                return Err(MeshError::MaterialJson(format!("normal_scale must be finite, got {scale}")));
            }
            material.normal_scale = scale;
        }
        let cutoff = unit_interval("alpha_cutoff", self.alpha_cutoff.unwrap_or(0.5))?;
        material.alpha_mode = match self.alpha_mode {
            Some(AlphaModeName::Mask) => AlphaMode::Mask { cutoff },
            Some(AlphaModeName::Blend) => AlphaMode::Blend,
            Some(AlphaModeName::Opaque) => AlphaMode::Opaque,
            None if material.base_color[3] < 1.0 => AlphaMode::Blend,
            None => AlphaMode::Opaque,
        };
        material.double_sided = self.double_sided.unwrap_or(material.double_sided);
        material.unlit = self.unlit.unwrap_or(false);
        Ok(material)
    }
}

impl MaterialSpec {
    /// Sets the fields of transmission and of the interior.
    fn set_glass(&self, material: &mut Material) -> Result<(), MeshError> {
        if let Some(transmission) = self.transmission {
            material.transmission = unit_interval("transmission", transmission)?;
        }
        if let Some(ior) = self.ior {
            if !(1.0..=4.0).contains(&ior) {
                return Err(MeshError::MaterialJson(format!("ior must be between 1 and 4, got {ior}")));
            }
            material.ior = ior;
        }
        let is_tinted = self.attenuation_color.is_some() || self.attenuation_distance_m.is_some();
        if let Some(solid) = self.solid.or(is_tinted.then_some(true)) {
            material.volume = solid.then(|| material.volume.unwrap_or(Volume::CLEAR));
        }
        if let Some(color) = &self.attenuation_color {
            let [r, g, b, _] = color.linear("attenuation_color")?;
            let mut volume = material.volume.unwrap_or(Volume::CLEAR);
            for (to, value) in volume.attenuation_color.iter_mut().zip([r, g, b]) {
                *to = unit_interval("attenuation_color", value)?;
            }
            volume.attenuation_distance_m = volume.attenuation_distance_m.min(GLASS_DISTANCE_M);
            material.volume = Some(volume);
        }
        if let Some(distance_m) = self.attenuation_distance_m {
            if !(distance_m > 0.0 && distance_m.is_finite()) {
                let message = format!("attenuation_distance_m must be positive, got {distance_m}");
                return Err(MeshError::MaterialJson(message));
            }
            if let Some(volume) = &mut material.volume {
                volume.attenuation_distance_m = distance_m;
            }
        }
        Ok(())
    }
}

impl Color {
    fn linear(&self, field: &str) -> Result<[f32; 4], MeshError> {
        let color = match self {
            Self::Rgb([r, g, b]) => [*r, *g, *b, 1.0],
            Self::Rgba(rgba) => *rgba,
            Self::Hex(text) => {
                let code = text.strip_prefix('#').filter(|hex| hex.len() == 6 && hex.is_ascii());
                let code = code.and_then(|hex| u32::from_str_radix(hex, 16).ok()).ok_or_else(|| {
                    MeshError::MaterialJson(format!("{field} must be a colour code like \"#c02020\", got \"{text}\""))
                })?;
                let [_, r, g, b] = code.to_be_bytes();
                let [r, g, b] = [r, g, b].map(lo_imaging::linear_from_srgb8);
                [r, g, b, 1.0]
            }
        };
        if color.iter().all(|x| x.is_finite() && *x >= 0.0) {
            Ok(color)
        } else {
            Err(MeshError::MaterialJson(format!("{field} must be finite and not negative, got {color:?}")))
        }
    }
}

fn unit_interval(field: &str, value: f32) -> Result<f32, MeshError> {
    if (0.0..=1.0).contains(&value) {
        Ok(value)
    } else {
        Err(MeshError::MaterialJson(format!("{field} must be between 0 and 1, got {value}")))
    }
}

impl Model {
    /// Replaces all materials of the model by one, and drops the warnings about them. Texture files are relative to
    /// `base_dir`.
    ///
    /// # Errors
    /// As for [`MaterialSpec::parse`]; [`MeshError::Texture`] if an image cannot be used.
    pub fn override_material(&mut self, spec: &MaterialSpec, base_dir: &Path) -> Result<(), MeshError> {
        let mut material = spec.factors()?;
        self.warnings.retain(|warning| !warning.is_about_materials());
        let mut textures = Vec::new();
        let slots = [
            (&spec.base_color_texture, true, &mut material.base_color_texture),
            (&spec.metallic_roughness_texture, false, &mut material.metallic_roughness_texture),
            (&spec.normal_texture, false, &mut material.normal_texture),
            (&spec.emissive_texture, true, &mut material.emissive_texture),
        ];
        for (file, srgb, slot) in slots {
            let Some(file) = file else { continue };
            if self.uvs[0].is_empty() {
                self.warnings.push(MeshWarning::texture(file, "the mesh has no texture coordinates"));
                continue;
            }
            let bytes = lo_imaging::read_regular_file(base_dir.join(file), MAX_FILE_BYTES)
                .map_err(|error| MeshError::Texture { name: file.clone(), reason: error.to_string() })?;
            textures.push(Texture::from_bytes(file, &bytes, srgb)?);
            *slot = Some(TextureRef::new(textures.len() - 1));
        }
        // The texture multiplies the factors, whose metalness is 0 by default.
        if material.metallic_roughness_texture.is_some() && spec.preset.is_none() {
            material.metallic = spec.metallic.unwrap_or(1.0);
            material.roughness = spec.roughness.unwrap_or(1.0);
        }
        self.textures = textures;
        self.triangle_materials.fill(0);
        self.materials = vec![material];
        tangents::complete(self);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::LoadOptions;
    use lo_geometry::Vec3;

    #[test]
    fn every_preset_is_physical_and_has_its_own_name() {
        for name in Material::preset_names() {
            let material = Material::preset(name).unwrap();
            assert!(material.base_color.iter().all(|c| (0.0..=1.0).contains(c)), "{name}");
            assert_eq!(Material::preset_names().filter(|&other| other == name).count(), 1);
            assert_eq!(MaterialSpec::parse(name).unwrap().factors().unwrap(), material);
        }
    }

    #[test]
    fn what_is_written_is_read_as_the_same() {
        for text in
            ["gold", r##"{"preset":"gold","roughness":0.1,"emissive":"#ff8000"}"##, r#"{"base_color":[0.1,0.2,0.3]}"#]
        {
            let spec = MaterialSpec::parse(text).unwrap();
            assert_eq!(spec.to_text(), text);
            assert_eq!(MaterialSpec::parse(&spec.to_text()).unwrap(), spec);
        }
    }

    #[test]
    fn json_changes_what_it_names() {
        let spec = MaterialSpec::parse(r##"{"preset":"gold","roughness":0.4,"emissive":"#ff8000"}"##).unwrap();
        let material = spec.factors().unwrap();
        let gold = Material::preset("gold").unwrap();
        assert_eq!((material.roughness, material.base_color, material.metallic), (0.4, gold.base_color, 1.0));
        // IEC 61966-2-1 of 128: 0.21586.
        assert_eq!(material.emissive[0], 1.0);
        assert!((material.emissive[1] - 0.215_86).abs() < 1e-5);
        let glass = MaterialSpec::parse(r#"{"base_color":[0.5,0.25,1,0.5]}"#).unwrap().factors().unwrap();
        assert_eq!((glass.base_color, glass.alpha_mode), ([0.5, 0.25, 1.0, 0.5], AlphaMode::Blend));
    }

    #[test]
    fn glass_is_solid_unless_said_otherwise() {
        let material = |text| MaterialSpec::parse(text).unwrap().factors().unwrap();
        let glass = material("glass");
        assert_eq!((glass.transmission, glass.volume, glass.ior), (1.0, Some(Volume::CLEAR), 1.52));
        assert_eq!(material(r#"{"preset":"glass","solid":false}"#).volume, None);
        assert_eq!(material(r#"{"transmission":0.5}"#).volume, None);
        // Twice the distance squares the colour.
        let tinted = material(r#"{"transmission":1,"attenuation_color":[0.5,1,0.25],"attenuation_distance_m":0.2}"#);
        let passed = tinted.volume.unwrap().transmittance(0.4);
        assert!([0.25, 1.0, 0.0625].iter().zip(passed).all(|(a, b)| (a - b).abs() < 1e-5), "{passed:?}");
        assert_eq!(Volume::CLEAR.transmittance(3.0), [1.0; 3]);
        // Green bottles with walls of 3 mm: most of the green passes, half of the red does not.
        let [red, green, _] = material("green-glass").volume.unwrap().transmittance(0.003);
        assert!(green > 0.8 && red < 0.6, "{red} {green}");
        let error = |text| MaterialSpec::parse(text).unwrap_err().to_string();
        assert_eq!(error(r#"{"ior":0.5}"#), "material JSON: ior must be between 1 and 4, got 0.5");
        assert_eq!(
            error(r#"{"attenuation_distance_m":0}"#),
            "material JSON: attenuation_distance_m must be positive, got 0"
        );
    }

    #[test]
    fn errors_name_the_field() {
        let error = |text| MaterialSpec::parse(text).unwrap_err().to_string();
        assert!(error("gould").starts_with(
            "unknown material 'gould'; give JSON such as {\"base_color\":[0.8,0.1,0.1]} or one of: matte-white, matte-grey"
        ));
        assert!(
            error(r#"{"roughnes":0.4}"#)
                .starts_with("material JSON: unknown field `roughnes`, expected one of `preset`")
        );
        assert_eq!(error(r#"{"roughness":1.4}"#), "material JSON: roughness must be between 0 and 1, got 1.4");
        assert_eq!(
            error(r#"{"base_color":"red"}"#),
            "material JSON: base_color must be a colour code like \"#c02020\", got \"red\""
        );
        assert!(error(r#"{"base_color":[1,2]}"#).contains("a colour is [r, g, b], [r, g, b, a] or \"#rrggbb\""));
        assert!(
            error(r#"{"emissive":[1,-2,0]}"#).starts_with("material JSON: emissive must be finite and not negative")
        );
        assert!(error(r#"{"metallic":"#).starts_with("material JSON: EOF"));
    }

    #[test]
    fn overriding_reads_textures_relative_to_the_folder() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let mut model =
            Model::from_triangles(positions, vec![[0, 1, 2]], Material::default(), &LoadOptions::default()).unwrap();
        model.uvs[0] = vec![[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]];
        let folder = tempfile::tempdir().unwrap();
        let picture = lo_imaging::Image::new(1, 1, vec![[128, 128, 255, 255]]);
        lo_imaging::write_rgba8(folder.path().join("up.png"), &picture, lo_imaging::GENERATOR).unwrap();
        let spec = MaterialSpec::parse(r#"{"normal_texture":"up.png"}"#).unwrap();
        model.override_material(&spec, folder.path()).unwrap();
        // u increases along +X, v (down) along −Y: tangent +X, bitangent +Y.
        assert_eq!(model.tangents, vec![[1.0, 0.0, 0.0, 1.0]; 3]);
        let spec = MaterialSpec::parse(r#"{"base_color_texture":"missing.png"}"#).unwrap();
        let error = model.override_material(&spec, folder.path()).unwrap_err().to_string();
        assert!(error.starts_with("texture missing.png: "), "{error}");
    }
}
