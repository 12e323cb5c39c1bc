use std::path::Path;

use lo_events::{Cancelled, OnEvent};
use lo_export::{ExportError, WEB_PANORAMA_HEIGHT, WebGrid, WebProbe, WebReport, write_web};
use lo_scene::LitScene;

use crate::render_probes;

/// Reasons why a web page is not written.
#[derive(Debug, thiserror::Error)]
pub enum WebExportError {
    /// The scene cannot be exported, or a file cannot be written.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// `on_event` broke off.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Writes a web page that shows objects in the photo to a folder, which is created. It needs no server.
///
/// The light is that of `scene` at the points of a regular grid, and is interpolated among them. `on_event` receives
/// the progress of rendering it.
///
/// # Errors
/// If no pixel of the photo has depth, if a file cannot be written, or if `on_event` breaks off.
pub fn export_web(
    scene: &LitScene,
    title: &str,
    folder: impl AsRef<Path>,
    on_event: OnEvent<'_>,
) -> Result<WebReport, WebExportError> {
    let grid = WebGrid::of(scene)?;
    let mut probes = Vec::new();
    let keep = |_, rendering: lo_cone::Rendering| {
        probes.push(WebProbe { radiance: rendering.radiance, distance_m: rendering.distance_m });
        Ok::<(), WebExportError>(())
    };
    render_probes(scene, &grid.points(), WEB_PANORAMA_HEIGHT, keep, on_event)?;
    Ok(write_web(scene, title, &grid, &probes, folder.as_ref())?)
}
