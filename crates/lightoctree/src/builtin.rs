//! Models that the library carries; `models/README.md` says where they come from.

use lo_mesh::{Material, MeshError, Model};

use crate::ModelError;

/// Names of the models that [`builtin_model`] knows.
pub const BUILTIN_MODELS: [&str; 3] = ["sphere", "suzanne", "tea-set"];

/// What stands before such a name where a file's could stand: `builtin:sphere`.
pub const BUILTIN_PREFIX: &str = "builtin:";

/// Radius of `sphere`, metres.
const RADIUS_M: f32 = 0.1;

static SUZANNE: &[u8] = include_bytes!("../models/suzanne.glb");
static TEA_SET: &[u8] = include_bytes!("../models/tea_set.glb");

/// A model that the library carries: a sphere of 0.2 m, Suzanne of about two units, or a tea set in metres. `None` for other names.
///
/// # Errors
/// None, unless the library itself is damaged.
pub fn builtin_model(name: &str) -> Option<Result<Model, MeshError>> {
    let no_files = |_: &str| Err(std::io::ErrorKind::NotFound.into());
    match name {
        "sphere" => Some(Model::sphere(RADIUS_M, 5, Material::default())),
        "suzanne" => Some(Model::from_gltf_bytes(SUZANNE, &no_files)),
        "tea-set" => Some(Model::from_gltf_bytes(TEA_SET, &no_files)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn all_that_are_named_are_there() {
        let triangles = BUILTIN_MODELS.map(|name| builtin_model(name).unwrap().unwrap().triangles.len());
        // The two files' are those of models/README.md; an icosphere split five times has 20 · 4⁵.
        assert_eq!(triangles, [20_480, 15_744, 40_296]);
        assert!(builtin_model("teapot").is_none());
        let tea_set = builtin_model("tea-set").unwrap().unwrap();
        assert!(tea_set.warnings.is_empty() && tea_set.textures.len() == 3, "{:?}", tea_set.warnings);
    }
}

/// The model of a name that begins with [`BUILTIN_PREFIX`]; `None` for other names.
pub(crate) fn builtin_mesh(name: &str) -> Result<Option<Model>, ModelError> {
    let Some(name) = name.strip_prefix(BUILTIN_PREFIX) else { return Ok(None) };
    let model = builtin_model(name).ok_or_else(|| ModelError::Builtin { name: name.to_owned() })??;
    Ok(Some(model))
}
