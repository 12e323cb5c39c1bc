use std::path::{Path, PathBuf};

use lo_imaging::read_regular_file;

use crate::load::{MAX_FILE_BYTES, local_path, read_file};
use crate::{MeshError, Model, gltf};

/// A glTF model with one of its animations: skins, morph targets and moving nodes.
///
/// Its vertices are read anew for each pose, its materials once.
#[derive(Clone, Debug)]
pub struct AnimatedModel {
    path: PathBuf,
    bytes: Vec<u8>,
    animation: usize,
    duration_s: f32,
    /// The materials.
    at_rest: Model,
}

impl AnimatedModel {
    /// Reads a `.gltf` or `.glb` file. `animation` is a name in the file, or a number from 0 if it has no names.
    ///
    /// # Errors
    /// As for [`Model::load`]; [`MeshError::NoAnimation`] if there is none of that name.
    pub fn load(path: impl AsRef<Path>, animation: &str) -> Result<Self, MeshError> {
        let path = path.as_ref().to_owned();
        let bytes = read_regular_file(&path, MAX_FILE_BYTES)
            .map_err(|source| MeshError::Io { path: path.clone(), source })?;
        let read = || {
            let is_gltf = bytes.starts_with(b"glTF") || bytes.trim_ascii_start().starts_with(b"{");
            if !is_gltf {
                return Err(MeshError::NoAnimation { name: animation.to_owned(), names: Vec::new() });
            }
            let resolve = resolver(&path);
            let at_rest = Model::from_gltf_bytes(&bytes, &resolve)?;
            Ok((at_rest, gltf::animation(&bytes, &resolve, animation)?))
        };
        let (at_rest, (animation, duration_s)) =
            read().map_err(|source| MeshError::InFile { path: path.clone(), source: Box::new(source) })?;
        Ok(Self { path, bytes, animation, duration_s, at_rest })
    }

    /// Returns the duration of the animation in seconds.
    pub fn duration_s(&self) -> f32 {
        self.duration_s
    }

    /// Returns the model at a time in seconds. The animation repeats.
    ///
    /// # Errors
    /// As for [`Model::load`].
    pub fn at(&self, time_s: f32) -> Result<Model, MeshError> {
        let time_s = if time_s > self.duration_s { time_s % self.duration_s.max(f32::MIN_POSITIVE) } else { time_s };
        let read = || {
            gltf::read_posed(&self.bytes, &resolver(&self.path), self.animation, time_s, &self.at_rest)?.finish()
        };
        read().map_err(|source| MeshError::InFile { path: self.path.clone(), source: Box::new(source) })
    }
}

/// Returns what reads the files that a mesh refers to.
fn resolver(path: &Path) -> impl Fn(&str) -> std::io::Result<Vec<u8>> + use<> {
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    move |name| read_file(&folder.join(local_path(name)))
}
