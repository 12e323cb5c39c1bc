use std::collections::{HashMap, HashSet};

use super::buffers::{Buffers, read_uri};
use super::json::{Image, Root, TextureInfo, TextureTransform, get};
use crate::model::Resolver;
use crate::texture::TextureBudget;
use crate::{AlphaMode, Material, MeshError, MeshWarning, Model, Texture, TextureRef, Wrap};

/// Appends all materials and glTF's default material to the model, with their textures.
pub(super) fn read(
    root: &Root,
    buffers: &Buffers,
    resolve: &Resolver,
    file_bytes: usize,
    model: &mut Model,
) -> Result<(), MeshError> {
    let mut textures = TextureLoader {
        root,
        buffers,
        resolve,
        known: HashMap::new(),
        textures: Vec::new(),
        warnings: Vec::new(),
        budget: TextureBudget::new(file_bytes),
        counted: HashSet::new(),
    };
    for (index, source) in root.materials.iter().enumerate() {
        model.materials.push(read_material(index, source, &mut textures)?);
    }
    model.materials.push(read_material(root.materials.len(), &super::json::Material::default(), &mut textures)?);
    model.textures = textures.textures;
    model.warnings.extend(textures.warnings);
    Ok(())
}

fn read_material(
    index: usize,
    source: &super::json::Material,
    textures: &mut TextureLoader,
) -> Result<Material, MeshError> {
    let pbr = &source.pbr_metallic_roughness;
    let strength = source.extensions.emissive_strength.as_ref().map_or(1.0, |e| non_negative(e.emissive_strength));
    let optional = |info: &Option<TextureInfo>, srgb: bool, textures: &mut TextureLoader| match info {
        Some(info) => textures.get(info, srgb),
        None => Ok(None),
    };
    Ok(Material {
        name: source.name.clone().unwrap_or_else(|| format!("material {index}")),
        base_color: pbr.base_color_factor.map(share),
        base_color_texture: optional(&pbr.base_color_texture, true, textures)?,
        metallic: share(pbr.metallic_factor),
        roughness: share(pbr.roughness_factor),
        metallic_roughness_texture: optional(&pbr.metallic_roughness_texture, false, textures)?,
        normal_texture: match &source.normal_texture {
            Some(normal) => textures.get(&normal.info, false)?,
            None => None,
        },
        normal_scale: source.normal_texture.as_ref().map_or(1.0, |n| if n.scale.is_finite() { n.scale } else { 1.0 }),
        occlusion_texture: match &source.occlusion_texture {
            Some(occlusion) => textures.get(&occlusion.info, false)?,
            None => None,
        },
        occlusion_strength: source.occlusion_texture.as_ref().map_or(1.0, |o| share(o.strength)),
        emissive: source.emissive_factor.map(|e| (non_negative(e) * strength).min(f32::MAX)),
        emissive_texture: optional(&source.emissive_texture, true, textures)?,
        alpha_mode: match source.alpha_mode.as_str() {
            "MASK" => AlphaMode::Mask { cutoff: non_negative(source.alpha_cutoff) },
            "BLEND" => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        },
        double_sided: source.double_sided,
        unlit: source.extensions.unlit.is_some(),
        transmission: source.extensions.transmission.as_ref().map_or(0.0, |t| share(t.transmission_factor)),
        diffuse_transmission: source
            .extensions
            .diffuse_transmission
            .as_ref()
            .map_or(0.0, |t| share(t.diffuse_transmission_factor)),
    })
}

/// Clamps to [0, 1]; NaN becomes 0.
fn share(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
}

fn non_negative(value: f32) -> f32 {
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}

/// Loads textures; decodes each image once per colour space.
struct TextureLoader<'a> {
    root: &'a Root,
    buffers: &'a Buffers<'a>,
    resolve: &'a Resolver<'a>,
    /// Texture index by (image, sRGB); `None` for an image that could not be used.
    known: HashMap<(usize, bool), Option<usize>>,
    textures: Vec<Texture>,
    warnings: Vec<MeshWarning>,
    budget: TextureBudget,
    /// Image files already counted in the budget.
    counted: HashSet<&'a str>,
}

impl<'a> TextureLoader<'a> {
    /// Returns the texture that a material refers to; `None`, with a warning, if its image is missing or unreadable.
    fn get(&mut self, info: &TextureInfo, srgb: bool) -> Result<Option<TextureRef>, MeshError> {
        let texture = get(&self.root.textures, info.index, "texture")?;
        let Some(image) = texture.extensions.webp.as_ref().map(|webp| webp.source).or(texture.source) else {
            self.warnings.push(MeshWarning::texture(&info.index.to_string(), "it has no image in a supported format"));
            return Ok(None);
        };
        let index = match self.known.get(&(image, srgb)) {
            Some(&index) => index,
            None => {
                let index = self.load(image, srgb)?;
                self.known.insert((image, srgb), index);
                index
            }
        };
        let Some(index) = index else {
            return Ok(None);
        };
        let sampler = texture.sampler.map(|sampler| get(&self.root.samplers, sampler, "sampler")).transpose()?;
        let transform = info.extensions.transform.as_ref();
        let uv_set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
        if uv_set > 1 {
            let reason = format!("it uses UV set {uv_set}; only sets 0 and 1 are supported");
            self.warnings.push(MeshWarning::texture(&info.index.to_string(), &reason));
            return Ok(None);
        }
        Ok(Some(TextureRef {
            uv_set,
            uv_transform: transform.map_or(TextureRef::new(0).uv_transform, matrix),
            wrap: [sampler.and_then(|s| s.wrap_s), sampler.and_then(|s| s.wrap_t)].map(wrap),
            nearest: sampler.and_then(|s| s.mag_filter) == Some(9728),
            ..TextureRef::new(index)
        }))
    }

    fn load(&mut self, index: usize, srgb: bool) -> Result<Option<usize>, MeshError> {
        let image = get(&self.root.images, index, "image")?;
        let name = image.name.clone().or_else(|| image.uri.clone().filter(|uri| !uri.starts_with("data:")));
        let name = name.unwrap_or_else(|| format!("image {index}"));
        let texture = self.bytes(image).and_then(|bytes| {
            Texture::decode(&name, &bytes, srgb, &mut self.budget).map_err(|error| error.to_string())
        });
        match texture {
            Ok(texture) => {
                self.textures.push(texture);
                Ok(Some(self.textures.len() - 1))
            }
            Err(reason) => {
                self.warnings.push(MeshWarning::texture(&name, &reason));
                Ok(None)
            }
        }
    }

    fn bytes(&mut self, image: &'a Image) -> Result<Vec<u8>, String> {
        match (&image.uri, image.buffer_view) {
            (Some(uri), _) => {
                let bytes = read_uri(uri, self.resolve).map_err(|failure| failure.text())?;
                if !uri.starts_with("data:") && self.counted.insert(uri) {
                    self.budget.grow(bytes.len());
                }
                Ok(bytes)
            }
            (None, Some(view)) => self.buffers.view(view).map(<[u8]>::to_vec).map_err(|error| error.to_string()),
            (None, None) => Err("the image has neither a URI nor a buffer view".to_owned()),
        }
    }
}

/// Matrix of `KHR_texture_transform`: translation · rotation · scale.
fn matrix(transform: &TextureTransform) -> [f32; 6] {
    let (sin, cos) = transform.rotation.sin_cos();
    let ([sx, sy], [tx, ty]) = (transform.scale, transform.offset);
    let matrix = [cos * sx, sin * sy, tx, -sin * sx, cos * sy, ty];
    if matrix.iter().all(|x| x.is_finite()) { matrix } else { TextureRef::new(0).uv_transform }
}

fn wrap(code: Option<u32>) -> Wrap {
    match code {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}
