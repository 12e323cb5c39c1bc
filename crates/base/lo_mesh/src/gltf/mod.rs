//! glTF 2.0: JSON with external or embedded buffers, and GLB.

mod buffers;
mod json;
mod material_json;
mod materials;
mod pose;
mod primitives;
mod specular_glossiness;
mod texture_loader;
mod transform;
mod write;

use self::buffers::Buffers;
use self::json::{Animation, Root};
use self::pose::Pose;
pub(crate) use self::write::write;
pub use self::write::{GlbScene, GlbSun};
use crate::model::Resolver;
use crate::{MeshError, MeshWarning, Model};

/// Extensions accepted in `extensionsRequired`, besides all of [`MATERIAL_EXTENSIONS`]: those that are read, and those
/// that can be ignored without changing the model's appearance.
const SUPPORTED_EXTENSIONS: [&str; 4] =
    ["KHR_texture_transform", "KHR_mesh_quantization", "EXT_texture_webp", "KHR_lights_punctual"];

/// Prefixes of the names of material extensions. Those that are not applied leave a plainer material, with a warning.
const MATERIAL_EXTENSIONS: [&str; 2] = ["KHR_materials_", "EXT_materials_"];

/// Reads the model at rest, without checking or completing its vertices.
pub(crate) fn read(bytes: &[u8], resolve: &Resolver) -> Result<Model, MeshError> {
    let (root, binary) = parse(bytes)?;
    let mut model = Model::default();
    let buffers = Buffers::load(&root, binary, resolve)?;
    let file_bytes = bytes.len() + buffers.external_bytes();
    materials::read(&root, &buffers, resolve, file_bytes, &mut model)?;
    primitives::read(&root, &buffers, &Pose::rest(&root), triangle_limit(file_bytes), &mut model)?;
    if !root.animations.is_empty() {
        let names = (0..root.animations.len()).map(|index| animation_name(&root, index)).collect();
        model.warnings.push(MeshWarning::Animations { names });
    }
    Ok(model)
}

/// Name of all animations together, of files that have none of this name.
const ALL: &str = "all";

/// Returns the indices of the animations of a name, and their duration in seconds.
pub(crate) fn animations(bytes: &[u8], resolve: &Resolver, name: &str) -> Result<(Vec<usize>, f32), MeshError> {
    let (root, binary) = parse(bytes)?;
    let names: Vec<String> = (0..root.animations.len()).map(|index| animation_name(&root, index)).collect();
    let of_name: Vec<usize> = (0..names.len()).filter(|&index| names[index] == name).collect();
    let chosen = match of_name[..] {
        [] if name == ALL && !names.is_empty() => (0..names.len()).collect(),
        [] => return Err(MeshError::NoAnimation { name: name.to_owned(), names }),
        _ => of_name,
    };
    let buffers = Buffers::load(&root, binary, resolve)?;
    let limit = triangle_limit(bytes.len() + buffers.external_bytes());
    let mut duration_s = 0.0f32;
    for &index in &chosen {
        duration_s = duration_s.max(root.animations[index].duration_s(&buffers, limit)?);
    }
    Ok((chosen, duration_s))
}

/// Reads the vertices of the model at a time of animations; materials are those of `at_rest`.
pub(crate) fn read_posed(
    bytes: &[u8],
    resolve: &Resolver,
    animations: &[usize],
    time_s: f32,
    at_rest: &Model,
) -> Result<Model, MeshError> {
    let (root, binary) = parse(bytes)?;
    let buffers = Buffers::load(&root, binary, resolve)?;
    let limit = triangle_limit(bytes.len() + buffers.external_bytes());
    let playing: Vec<&Animation> = animations.iter().filter_map(|&index| root.animations.get(index)).collect();
    let pose = Pose::at(&root, &buffers, &playing, time_s, limit)?;
    let (materials, textures) = (at_rest.materials.clone(), at_rest.textures.clone());
    let mut model = Model { materials, textures, ..Model::default() };
    primitives::read(&root, &buffers, &pose, limit, &mut model)?;
    Ok(model)
}

/// Returns the name of an animation; its number, from 0, if it has none.
fn animation_name(root: &Root, index: usize) -> String {
    let Animation { name, .. } = &root.animations[index];
    if name.is_empty() { index.to_string() } else { name.clone() }
}

fn parse(bytes: &[u8]) -> Result<(Root, Option<&[u8]>), MeshError> {
    let (json, binary) = if bytes.starts_with(b"glTF") { split_glb(bytes)? } else { (bytes, None) };
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    let root: Root = serde_json::from_slice(json).map_err(|error| {
        MeshError::syntax("glTF", format!("line {}, column {}", error.line(), error.column()), error.to_string())
    })?;
    if !root.asset.version.starts_with("2.") {
        let what = format!("unsupported glTF version {}; only 2.0 is supported", root.asset.version);
        return Err(MeshError::syntax("glTF", "asset.version", what));
    }
    check_extensions(&root)?;
    Ok((root, binary))
}

/// Returns the limit of triangles and vertices after expanding instances and shared accessors, for a file of this size.
fn triangle_limit(bytes: usize) -> u64 {
    2_000_000 + bytes as u64
}

fn check_extensions(root: &Root) -> Result<(), MeshError> {
    let is_supported = |name: &str| {
        SUPPORTED_EXTENSIONS.contains(&name) || MATERIAL_EXTENSIONS.iter().any(|prefix| name.starts_with(prefix))
    };
    match root.extensions_required.iter().find(|name| !is_supported(name)) {
        None => Ok(()),
        Some(name) => {
            let remedy = match name.as_str() {
                "KHR_draco_mesh_compression" => {
                    "export without Draco compression, or decompress the file with `gltf-transform cp in.glb out.glb`"
                }
                "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
                    "export without meshopt compression, or decompress the file with `gltf-transform cp in.glb out.glb`"
                }
                "KHR_texture_basisu" => {
                    "export with PNG or JPEG textures, or convert the file with `gltf-transform ktxdecompress`"
                }
                _ => "export the model without this extension",
            };
            Err(MeshError::UnsupportedExtension { name: name.clone(), remedy })
        }
    }
}

/// Returns the JSON and BIN chunks of a GLB file.
fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), MeshError> {
    let invalid = |at: usize, what: String| MeshError::syntax("GLB", format!("byte {at}"), what);
    let word = |at: usize| -> Result<u32, MeshError> {
        let word = bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
        word.ok_or_else(|| invalid(at, "unexpected end of file in a header".to_owned()))
    };
    let version = word(4)?;
    if version != 2 {
        return Err(invalid(4, format!("unsupported container version {version}; only 2 is supported")));
    }
    let length = word(8)? as usize;
    if length > bytes.len() {
        return Err(invalid(8, format!("the header declares {length} bytes, the file has {}", bytes.len())));
    }
    let chunk = |at: usize, kind: &[u8; 4]| -> Result<&[u8], MeshError> {
        let length = word(at)? as usize;
        if word(at + 4)?.to_le_bytes() != *kind {
            return Err(invalid(
                at + 4,
                format!("expected a {} chunk", String::from_utf8_lossy(kind).trim_end_matches('\0')),
            ));
        }
        let end = (at + 8).checked_add(length).filter(|&end| end <= bytes.len());
        let end =
            end.ok_or_else(|| invalid(at, format!("a chunk of {length} bytes extends past the end of the file")))?;
        Ok(&bytes[at + 8..end])
    };
    let json = chunk(12, b"JSON")?;
    let next = 20 + json.len();
    let binary = if next + 8 <= length { Some(chunk(next, b"BIN\0")?) } else { None };
    Ok((json, binary))
}

#[cfg(test)]
mod tests;
