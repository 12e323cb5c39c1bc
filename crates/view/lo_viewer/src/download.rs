//! Downloads: files made in memory on request.

use std::sync::Arc;

use axum::extract::{Path, State};
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use lo_export::Format;
use lo_geometry::Vec3;
use lo_session::{Probe, SessionError, outputs, probe_position};

use crate::app::App;
use crate::failure::guarded;
use crate::protocol::PROBE_LIFTS_M;
use crate::query::query_number;
use crate::sequence::{self, SequenceFormat};
use crate::worker::{Change, Worker};
use crate::zip_archive::ZipArchive;

/// Header with the number of the change that a file has.
const CHANGE: &str = "x-change";

/// Height of the HDR panorama, pixels.
const PANORAMA_HEIGHT: usize = 512;

/// Serves a download.
pub(crate) async fn download(State(app): State<App>, Path((_, file)): Path<(String, String)>, uri: Uri) -> Response {
    let Some(worker) = app.session.current() else {
        return (StatusCode::CONFLICT, "no scene is open").into_response();
    };
    if let Some(format) = SequenceFormat::from_name(&file) {
        return sequence::download(&worker, format, &file);
    }
    let name = file.clone();
    let change = worker.change();
    let number = change.number;
    match tokio::task::spawn_blocking(move || make_file(&worker, &change, &file, &uri)).await {
        Ok(Ok(Some((media_type, bytes)))) => {
            let disposition = format!("attachment; filename=\"{name}\"");
            let headers = [(header::CONTENT_TYPE, media_type.to_owned()), (header::CONTENT_DISPOSITION, disposition)];
            (headers, [(CHANGE, number.to_string())], bytes).into_response()
        }
        Ok(Ok(None)) => (StatusCode::NOT_FOUND, "no such file").into_response(),
        Ok(Err(why)) => (StatusCode::CONFLICT, why).into_response(),
        Err(_) => (StatusCode::INTERNAL_SERVER_ERROR, "internal error; see the terminal output").into_response(),
    }
}

/// Makes a file and returns its media type and content; `None` for unknown names.
fn make_file(
    worker: &Arc<Worker>,
    change: &Change,
    file: &str,
    uri: &Uri,
) -> Result<Option<(&'static str, Vec<u8>)>, String> {
    let (scenes, state) = (&worker.scenes, &change.state);
    let scene = scenes.scene();
    let checked = |result: Result<Vec<u8>, SessionError>| guarded(|| result).map_err(|failure| failure.to_string());
    let bytes = match file {
        "picture.png" => checked(outputs::image(&*worker.final_composite()?))?,
        "photo.jpg" => checked(outputs::photo(scene))?,
        "layers.exr" => checked(outputs::layers(&*worker.final_composite()?))?,
        "room.scene" => checked(outputs::scene(scene, &change.document))?,
        "objects.json" => checked(outputs::layout(&change.document))?,
        "light.exr" => {
            let at = probe_at(worker, uri)?.ok_or("no probe position: point at the photo first")?;
            checked(Probe::exr(scenes, state, at, PANORAMA_HEIGHT))?
        }
        "room.glb" => {
            let files =
                outputs::export(scenes, state, Format::Glb, probe_at(worker, uri)?).map_err(|e| e.to_string())?;
            files.into_iter().next().map(|(_, bytes)| bytes).unwrap_or_default()
        }
        "room_usd.zip" => {
            let files =
                outputs::export(scenes, state, Format::Usda, probe_at(worker, uri)?).map_err(|e| e.to_string())?;
            archive(&files).map_err(|error| error.to_string())?
        }
        _ => return Ok(None),
    };
    let media_type = match file.rsplit('.').next() {
        Some("png") => "image/png",
        Some("jpg") => "image/jpeg",
        Some("json") => "application/json",
        Some("glb") => "model/gltf-binary",
        Some("exr") => "image/x-exr",
        Some("zip") => "application/zip",
        _ => "application/octet-stream",
    };
    Ok(Some((media_type, bytes)))
}

/// Returns the probe's position if the query has one: `u=…&v=…&lift=…`.
fn probe_at(worker: &Arc<Worker>, uri: &Uri) -> Result<Option<Vec3>, String> {
    let number = |name: &str| query_number(uri, name);
    let (Some(u), Some(v), Some(lift)) = (number("u"), number("v"), number("lift")) else { return Ok(None) };
    if !PROBE_LIFTS_M.contains(&(lift as f32)) {
        return Err("the probe's distance from the surface must be from 0 to 10 m".to_owned());
    }
    let position = probe_position(worker.scenes.scene(), [u, v], lift as f32);
    position.map(Some).ok_or_else(|| "the photo has no depth at the probe; choose another position".to_owned())
}

/// Packs files into a ZIP archive.
fn archive(files: &[(String, Vec<u8>)]) -> std::io::Result<Vec<u8>> {
    let mut archive = ZipArchive::new(Vec::new());
    for (name, bytes) in files {
        archive.add(name, bytes)?;
    }
    archive.finish()
}
