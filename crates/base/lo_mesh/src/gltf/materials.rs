use lo_bsdf::GLASS_IOR;

use super::buffers::Buffers;
use super::json::Root;
use super::material_json::{self as json, SpecularGlossiness, Transmission};
use super::specular_glossiness;
use super::texture_loader::TextureLoader;
use crate::model::Resolver;
use crate::{AlphaMode, Material, MeshError, MeshWarning, Model, Volume};

/// Largest index of refraction; it reflects 96 %.
const MAX_IOR: f32 = 100.0;

/// Appends all materials and glTF's default material to the model, with their textures.
pub(super) fn read(
    root: &Root,
    buffers: &Buffers,
    resolve: &Resolver,
    file_bytes: usize,
    model: &mut Model,
) -> Result<(), MeshError> {
    let mut textures = TextureLoader::new(root, buffers, resolve, file_bytes);
    for (index, source) in root.materials.iter().enumerate() {
        model.materials.push(read_material(index, source, &mut textures)?);
    }
    model.materials.push(read_material(root.materials.len(), &json::Material::default(), &mut textures)?);
    model.textures = textures.textures;
    model.warnings.extend(textures.warnings);
    let thin = model.materials.iter().filter(|material| material.transmission > 0.0 && material.volume.is_none());
    let thin: Vec<String> = thin.map(|material| material.name.clone()).collect();
    if !thin.is_empty() {
        model.warnings.push(MeshWarning::ThinGlass { materials: thin });
    }
    let extensions = root.materials.iter().map(|source| &source.extensions);
    let mut ignored: Vec<&str> = extensions.flat_map(|e| e.ignored().chain(e.ignored_textures())).collect();
    ignored.sort_unstable();
    ignored.dedup();
    if !ignored.is_empty() {
        let names = ignored.into_iter().map(str::to_owned).collect();
        model.warnings.push(MeshWarning::MaterialExtensions { names });
    }
    Ok(())
}

fn read_material(index: usize, source: &json::Material, textures: &mut TextureLoader) -> Result<Material, MeshError> {
    let (pbr, extensions) = (&source.pbr_metallic_roughness, &source.extensions);
    let strength = extensions.emissive_strength.as_ref().map_or(1.0, |e| non_negative(e.emissive_strength));
    let diffuse_transmission = extensions.diffuse_transmission.as_ref();
    let material = Material {
        name: source.name.clone().unwrap_or_else(|| format!("material {index}")),
        normal_texture: textures.optional(source.normal_texture.as_ref().map(|normal| &normal.info), false)?,
        normal_scale: source.normal_texture.as_ref().map_or(1.0, |n| if n.scale.is_finite() { n.scale } else { 1.0 }),
        occlusion_texture: textures.optional(source.occlusion_texture.as_ref().map(|o| &o.info), false)?,
        occlusion_strength: source.occlusion_texture.as_ref().map_or(1.0, |o| share(o.strength)),
        emissive: source.emissive_factor.map(|e| (non_negative(e) * strength).min(f32::MAX)),
        emissive_texture: textures.optional(source.emissive_texture.as_ref(), true)?,
        alpha_mode: match source.alpha_mode.as_str() {
            "MASK" => AlphaMode::Mask { cutoff: non_negative(source.alpha_cutoff) },
            "BLEND" => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        },
        double_sided: source.double_sided,
        unlit: extensions.unlit.is_some(),
        transmission: extensions.transmission.as_ref().map_or(Ok(0.0), |given| transmission(given, textures))?,
        volume: extensions.volume.as_ref().filter(|v| v.thickness_factor > 0.0).map(volume),
        ior: extensions.ior.as_ref().map_or(GLASS_IOR, |given| refractive_index(given.ior)),
        specular: extensions.specular.as_ref().map_or([1.0; 3], |given| {
            let strength = share(given.specular_factor);
            given.specular_color_factor.map(|color| non_negative(color) * strength)
        }),
        clearcoat: extensions.clearcoat.as_ref().map_or(0.0, |given| share(given.clearcoat_factor)),
        clearcoat_roughness: extensions.clearcoat.as_ref().map_or(0.0, |c| share(c.clearcoat_roughness_factor)),
        sheen: extensions.sheen.as_ref().map_or([0.0; 3], |given| given.sheen_color_factor.map(share)),
        sheen_roughness: extensions.sheen.as_ref().map_or(0.0, |given| share(given.sheen_roughness_factor)),
        diffuse_transmission: diffuse_transmission.map_or(0.0, |t| share(t.diffuse_transmission_factor)),
        ..Material::default()
    };
    match &extensions.specular_glossiness {
        Some(given) => specular_glossiness::convert(&in_range(given), material, textures),
        None => Ok(Material {
            base_color: pbr.base_color_factor.map(share),
            base_color_texture: textures.optional(pbr.base_color_texture.as_ref(), true)?,
            metallic: share(pbr.metallic_factor),
            roughness: share(pbr.roughness_factor),
            metallic_roughness_texture: textures.optional(pbr.metallic_roughness_texture.as_ref(), false)?,
            ..material
        }),
    }
}

/// Returns the transmitted share; of a texture, its mean.
fn transmission(given: &Transmission, textures: &mut TextureLoader) -> Result<f32, MeshError> {
    let texture = textures.optional(given.transmission_texture.as_ref(), false)?;
    let coarsest = texture.and_then(|reference| textures.textures[reference.texture].levels.last());
    let mean = coarsest.map_or(1.0, |level| f32::from(level.pixels()[0][0]) / 255.0);
    Ok(share(given.transmission_factor) * mean)
}

/// Returns the interior; its thickness only tells that the surface is not a thin sheet, as light is traced through the
/// mesh.
fn volume(given: &json::Volume) -> Volume {
    let distance = given.attenuation_distance;
    Volume {
        attenuation_color: given.attenuation_color.map(share),
        attenuation_distance_m: if distance > 0.0 { distance } else { f32::INFINITY },
    }
}

/// Returns an index of refraction; 0, which stands for a mirror, becomes a very high one.
fn refractive_index(given: f32) -> f32 {
    if given == 0.0 {
        MAX_IOR
    } else if given.is_finite() {
        given.clamp(1.0, MAX_IOR)
    } else {
        GLASS_IOR
    }
}

fn in_range(given: &SpecularGlossiness) -> SpecularGlossiness {
    SpecularGlossiness {
        diffuse_factor: given.diffuse_factor.map(share),
        specular_factor: given.specular_factor.map(share),
        glossiness_factor: share(given.glossiness_factor),
        ..given.clone()
    }
}

/// Clamps to [0, 1]; NaN becomes 0.
fn share(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
}

fn non_negative(value: f32) -> f32 {
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}
