//! What a session's user takes away, as files in memory.

use lightoctree::SceneRenderer;
use lightoctree::export::{self, Content, Format, LightProbe};
use lightoctree::geometry::Vec3;
use lightoctree::imaging::{self, ExrOptions};
use lightoctree::insert::Composite;

use crate::lit::LitScenes;
use crate::{OpenScene, SessionError, State};

/// Width of the panorama that an export holds, as `lightoctree export` makes it.
const PROBE_WIDTH: usize = 1024;

/// What `lightoctree insert -o picture.png` writes.
///
/// # Errors
/// None that a picture of a scene could cause.
pub fn picture(composite: &Composite) -> Result<Vec<u8>, SessionError> {
    Ok(imaging::encode_photo("picture.png", &composite.image, "lightoctree insert")?)
}

/// What `lightoctree insert --layers layers.exr` writes.
///
/// # Errors
/// None that a picture of a scene could cause.
pub fn layers(composite: &Composite) -> Result<Vec<u8>, SessionError> {
    let size = (composite.alpha.width(), composite.alpha.height());
    let options = ExrOptions { generator: "lightoctree insert".to_owned(), ..ExrOptions::default() };
    Ok(imaging::encode_exr("layers.exr", size, &composite.channels(), &options)?)
}

/// The scene's file with the state's objects and edits of the light.
///
/// # Errors
/// Numbers that are not finite, or more files than a scene holds.
pub fn scene(open: &OpenScene, state: &State) -> Result<Vec<u8>, SessionError> {
    Ok(state.to_document(&open.document)?.to_bytes("lightoctree estimate")?)
}

/// What `lightoctree insert --layout` reads.
///
/// # Errors
/// Without objects.
pub fn layout(state: &State) -> Result<Vec<u8>, SessionError> {
    let mut text = serde_json::to_vec_pretty(&state.layout()?)?;
    text.push(b'\n');
    Ok(text)
}

/// The room for other programs, with the light at a place, as `lightoctree export` writes it: names and contents of the files, the scene first.
///
/// # Errors
/// Where the scene has nothing to show, or there is no place for temporary files.
pub fn export(
    scenes: &LitScenes,
    state: &State,
    format: Format,
    probe_at: Option<Vec3>,
) -> Result<Vec<(String, Vec<u8>)>, SessionError> {
    let lit = scenes.of(state)?;
    let panorama = probe_at.map(|at| (at, SceneRenderer::new(&lit).panorama(at, PROBE_WIDTH, PROBE_WIDTH / 2)));
    let probes: Vec<LightProbe> =
        panorama.iter().map(|(at, seen)| LightProbe { radiance: &seen.radiance, position_m: *at }).collect();
    let folder = tempfile::tempdir()?;
    let options = export::Options { format, content: Content::Leaves, level: false, probes: &probes };
    let written = export::write(&lit, &options, &folder.path().join(format!("room.{format}")))?;
    let file = |path: &std::path::PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Ok((name, std::fs::read(path)?))
    };
    written.files.iter().map(file).collect()
}
