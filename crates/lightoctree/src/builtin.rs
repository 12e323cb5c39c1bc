//! Models embedded in the library; `models/README.md` lists their sources and licences.

use lo_mesh::{Material, Model};

use crate::ModelError;
use crate::builtin_names::BUILTIN_PREFIX;

/// Radius of `sphere` in metres.
const RADIUS_M: f32 = 0.1;

static SUZANNE: &[u8] = include_bytes!("../models/suzanne.glb");
static TEA_SET: &[u8] = include_bytes!("../models/tea_set.glb");

/// Returns a model embedded in this library.
///
/// The names are those of [`BUILTIN_MODELS`](crate::BUILTIN_MODELS), without [`BUILTIN_PREFIX`]:
/// - `sphere`: a diffuse sphere of 0.2 m diameter
/// - `suzanne`: Blender's monkey head, about two units wide
/// - `tea-set`: a textured tea set in metres
/// - `glass-sphere`: the sphere, of solid glass
/// - `wine-glass`: an empty wine glass of 21 cm
/// - `bottle`: an empty bottle of green glass, 30 cm
///
/// # Errors
/// [`ModelError::Builtin`] if no model has this name.
pub fn builtin_model(name: &str) -> Result<Model, ModelError> {
    let no_files = |_: &str| Err(std::io::ErrorKind::NotFound.into());
    let model = match name {
        "sphere" => Model::sphere(RADIUS_M, 5, Material::default()),
        "suzanne" => Model::from_gltf_bytes(SUZANNE, &no_files),
        "tea-set" => Model::from_gltf_bytes(TEA_SET, &no_files),
        "glass-sphere" => Model::sphere(RADIUS_M, 6, Material::preset("glass").expect("it is a preset")),
        "wine-glass" => Model::wine_glass(),
        "bottle" => Model::bottle(),
        _ => return Err(ModelError::Builtin { name: name.to_owned() }),
    };
    Ok(model?)
}

/// Returns the model of a name with [`BUILTIN_PREFIX`], or `None` for a name without it.
pub(crate) fn builtin_mesh(name: &str) -> Result<Option<Model>, ModelError> {
    let Some(name) = name.strip_prefix(BUILTIN_PREFIX) else { return Ok(None) };
    builtin_model(name).map(Some)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn every_listed_model_loads() {
        let triangles = crate::BUILTIN_MODELS.map(|name| builtin_model(name).unwrap().triangles.len());
        // models/README.md states the counts of the two files; an icosphere split five times has 20 · 4⁵ triangles.
        assert_eq!(triangles[..4], [20_480, 15_744, 40_296, 81_920]);
        assert!(triangles[4..].iter().all(|count| (5_000..20_000).contains(count)), "{triangles:?}");
        assert!(builtin_model("teapot").is_err());
        let tea_set = builtin_model("tea-set").unwrap();
        assert!(tea_set.warnings.is_empty() && tea_set.textures.len() == 3, "{:?}", tea_set.warnings);
    }
}
