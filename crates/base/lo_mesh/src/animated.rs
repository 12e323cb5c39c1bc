use std::path::{Path, PathBuf};

use lo_imaging::read_regular_file;

use crate::load::{MAX_FILE_BYTES, local_path, read_file};
use crate::{MeshError, Model, gltf};

/// A glTF model with its animations: skins, morph targets and moving nodes.
///
/// Its vertices are read anew for each pose, its materials once.
#[derive(Clone, Debug)]
pub struct AnimatedModel {
    path: PathBuf,
    bytes: Vec<u8>,
    animations: Vec<usize>,
    duration_s: f32,
    /// The materials.
    at_rest: Model,
}

impl AnimatedModel {
    /// Reads a `.gltf` or `.glb` file. `animation` is a name in the file, a number from 0 if it has no names, or `all`
    /// for all animations together: exporters write one per object.
    ///
    /// # Errors
    /// As for [`Model::load`]; [`MeshError::NoAnimation`] if there is none of that name.
    pub fn load(path: impl AsRef<Path>, animation: &str) -> Result<Self, MeshError> {
        let path = path.as_ref().to_owned();
        let bytes =
            read_regular_file(&path, MAX_FILE_BYTES).map_err(|source| MeshError::Io { path: path.clone(), source })?;
        let read = || {
            let is_gltf = bytes.starts_with(b"glTF") || bytes.trim_ascii_start().starts_with(b"{");
            if !is_gltf {
                return Err(MeshError::NoAnimation { name: animation.to_owned(), names: Vec::new() });
            }
            let resolve = resolver(&path);
            let at_rest = Model::from_gltf_bytes(&bytes, &resolve)?;
            Ok((at_rest, gltf::animations(&bytes, &resolve, animation)?))
        };
        let (at_rest, (animations, duration_s)) =
            read().map_err(|source| MeshError::InFile { path: path.clone(), source: Box::new(source) })?;
        Ok(Self { path, bytes, animations, duration_s, at_rest })
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
        let read =
            || gltf::read_posed(&self.bytes, &resolver(&self.path), &self.animations, time_s, &self.at_rest)?.finish();
        read().map_err(|source| MeshError::InFile { path: self.path.clone(), source: Box::new(source) })
    }
}

/// Returns what reads the files that a mesh refers to.
fn resolver(path: &Path) -> impl Fn(&str) -> std::io::Result<Vec<u8>> + use<> {
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    move |name| read_file(&folder.join(local_path(name)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::collections::BTreeMap;

    use super::*;

    /// A skinned strip with a morph target under a turned parent, by Blender 4.5, and its vertices by frame as Blender
    /// evaluates them (`testdata/bend.py`).
    #[test]
    fn poses_are_blenders() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bend.glb");
        std::fs::write(&path, include_bytes!("gltf/testdata/bend.glb")).unwrap();
        let frames: BTreeMap<String, Vec<[f32; 3]>> =
            serde_json::from_str(include_str!("gltf/testdata/bend.json")).unwrap();
        let model = AnimatedModel::load(&path, "all").unwrap();
        // Blender's first frame is 1, which is not at 0 s.
        assert!((model.duration_s() - 25.0 / 24.0).abs() < 1e-3, "{}", model.duration_s());
        for (frame, vertices) in &frames {
            let time_s = (frame.parse::<f32>().unwrap() + 1.0) / 24.0;
            let posed = model.at(time_s).unwrap();
            // Vertices are split by their normals.
            for vertex in vertices {
                let near = |p: &lo_geometry::Vec3| (*p - lo_geometry::Vec3::from_array(*vertex)).length();
                let nearest = posed.positions.iter().map(near).fold(f32::INFINITY, f32::min);
                assert!(nearest < 2e-4, "frame {frame}: {vertex:?} is {nearest} off");
            }
        }
        // It repeats, and one animation alone is another pose.
        let later = model.at(0.25 + model.duration_s()).unwrap();
        let first = model.at(0.25).unwrap();
        let off = later.positions.iter().zip(&first.positions).map(|(a, b)| (*a - *b).length());
        assert!(off.fold(0.0, f32::max) < 1e-4);
        let bones = AnimatedModel::load(&path, "rig").unwrap();
        assert_ne!(bones.at(0.5).unwrap().positions, model.at(0.5).unwrap().positions);
    }

    #[test]
    fn other_names_are_refused_with_those_that_exist() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bend.glb");
        std::fs::write(&path, include_bytes!("gltf/testdata/bend.glb")).unwrap();
        let message = AnimatedModel::load(&path, "Walk").unwrap_err().to_string();
        assert!(message.contains("no animation `Walk`") && message.contains("rig, strip"), "{message}");
        std::fs::write(&path, "ply\n").unwrap();
        assert!(AnimatedModel::load(&path, "Walk").unwrap_err().to_string().contains("it has none"));
    }
}
