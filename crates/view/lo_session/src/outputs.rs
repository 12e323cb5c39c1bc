//! Downloadable files of a session, made in memory.

use lightoctree::SceneRenderer;
use lo_export as export;
use lo_export::{Content, Format, LightProbe};
use lo_geometry::Vec3;
use lo_imaging as imaging;
use lo_imaging::{ExrOptions, Photo};
use lo_insert::Composite;
use lo_lights::ListedLight;

use crate::lit::LitSceneCache;
use crate::renderer::photo_at_side;
use crate::{OpenScene, SessionError, State};

/// Width of an export's panorama, as in `lightoctree export`.
const PROBE_WIDTH: usize = 1024;

/// JPEG quality of previews.
const PREVIEW_JPEG_QUALITY: u8 = 85;

/// Encodes what `lightoctree insert -o picture.png` writes.
///
/// # Errors
/// Never for a composite of a session.
pub fn image(composite: &Composite) -> Result<Vec<u8>, SessionError> {
    Ok(imaging::encode_photo("picture.png", &composite.image, "lightoctree insert")?)
}

/// Encodes what `lightoctree insert --layers layers.exr` writes.
///
/// # Errors
/// Never for a composite of a session.
pub fn layers(composite: &Composite) -> Result<Vec<u8>, SessionError> {
    let size = (composite.alpha.width(), composite.alpha.height());
    let (generator, metadata) = ("lightoctree insert".to_owned(), composite.metadata());
    let options = ExrOptions { generator, metadata, ..ExrOptions::default() };
    Ok(imaging::encode_exr("layers.exr", size, &composite.channels(), &options)?)
}

/// Encodes the photo without objects in full size, a JPEG.
///
/// # Errors
/// Never for a photo of a session.
pub fn photo(scene: &OpenScene) -> Result<Vec<u8>, SessionError> {
    Ok(imaging::encode_photo("photo.jpg", &scene.estimate().frame.photo, "lightoctree view")?)
}

/// Encodes a small JPEG of a photo or of a rendered image.
///
/// # Errors
/// Never for a photo of a session.
pub fn preview(photo: &Photo, side: usize) -> Result<Vec<u8>, SessionError> {
    let small = photo_at_side(photo, side).into_srgb8();
    Ok(imaging::encode_srgb8("preview.jpg", &small, PREVIEW_JPEG_QUALITY, "lightoctree view")?)
}

/// Encodes the scene file with the state's objects and light edits.
///
/// # Errors
/// If a number is not finite, or there are more files than a scene holds.
pub fn scene(scene: &OpenScene, state: &State) -> Result<Vec<u8>, SessionError> {
    Ok(state.to_document(&scene.document)?.to_bytes("lightoctree estimate")?)
}

/// Encodes the layout that `lightoctree insert --layout` reads.
///
/// # Errors
/// If there are no objects.
pub fn layout(state: &State) -> Result<Vec<u8>, SessionError> {
    let mut text = serde_json::to_vec_pretty(&state.layout()?)?;
    text.push(b'\n');
    Ok(text)
}

/// Exports the room with the light at a point, as `lightoctree export` does. Returns names and contents of the files,
/// the scene first.
///
/// # Errors
/// If the scene has nothing to export, or temporary files cannot be written.
pub fn export(
    scenes: &LitSceneCache,
    state: &State,
    format: Format,
    probe_at: Option<Vec3>,
) -> Result<Vec<(String, Vec<u8>)>, SessionError> {
    let lit = scenes.lit(state)?;
    let panorama = probe_at.map(|at| (at, SceneRenderer::new(&lit).panorama(at, PROBE_WIDTH, PROBE_WIDTH / 2)));
    let probes: Vec<LightProbe> =
        panorama.iter().map(|(at, seen)| LightProbe { radiance: &seen.radiance, position_m: *at }).collect();
    let folder = tempfile::tempdir()?;
    let lights = listed(scenes.scene(), state);
    let options = export::Options { format, content: Content::Leaves, level: false, probes: &probes, lights: &lights };
    let written = export::write(&lit, &options, folder.path().join(format!("room.{format}")))?;
    let file = |path: &std::path::PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Ok((name, std::fs::read(path)?))
    };
    written.files.iter().map(file).collect()
}

/// Returns the lights of `lightoctree lights`.
fn listed(scene: &OpenScene, state: &State) -> Vec<ListedLight> {
    let change = |id: &str| state.lights.emitters.iter().find(|edit| edit.id == id).map(|edit| edit.change);
    let found = scene.lights().iter().map(|light| ListedLight { change: change(&light.id), ..light.clone() });
    found.chain(state.lights.added.iter().map(ListedLight::of_added)).collect()
}
