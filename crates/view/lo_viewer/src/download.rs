//! What a page takes away: files made in memory when they are asked for.

use std::sync::Arc;

use axum::extract::{Path, State};
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use lightoctree::export::Format;
use lightoctree::geometry::Vec3;
use lo_session::{Probe, SessionError, outputs, probe_place};

use crate::app::App;
use crate::failure::guarded;
use crate::sequence::{self, Kind};
use crate::worker::Worker;

/// Height of the HDR panorama, pixels.
const PANORAMA_HEIGHT: usize = 512;

/// Makes a file.
pub(crate) async fn download(State(app): State<App>, Path((_, file)): Path<(String, String)>, uri: Uri) -> Response {
    let Some(work) = app.session.current() else {
        return (StatusCode::CONFLICT, "no scene is open").into_response();
    };
    if let Some(kind) = Kind::of(&file) {
        return sequence::download(&work, kind, &file);
    }
    let query = uri.query().unwrap_or_default().to_owned();
    let name = file.clone();
    match tokio::task::spawn_blocking(move || made(&work, &file, &query)).await {
        Ok(Ok(Some((media_type, bytes)))) => {
            let disposition = format!("attachment; filename=\"{name}\"");
            ([(header::CONTENT_TYPE, media_type.to_owned()), (header::CONTENT_DISPOSITION, disposition)], bytes)
                .into_response()
        }
        Ok(Ok(None)) => (StatusCode::NOT_FOUND, "there is no such file").into_response(),
        Ok(Err(why)) => (StatusCode::CONFLICT, why).into_response(),
        Err(_) => (StatusCode::INTERNAL_SERVER_ERROR, "internal error; see the terminal output").into_response(),
    }
}

/// Media type and content of a file; `None` where there is none of that name.
fn made(work: &Arc<Worker>, file: &str, query: &str) -> Result<Option<(&'static str, Vec<u8>)>, String> {
    let (scenes, state) = (&work.scenes, work.state());
    let open = scenes.open();
    let told = |result: Result<Vec<u8>, SessionError>| guarded(|| result).map_err(|failure| failure.to_string());
    let bytes = match file {
        "picture.png" => told(outputs::picture(&*work.last()?))?,
        "layers.exr" => told(outputs::layers(&*work.last()?))?,
        "room.scene" => told(outputs::scene(open, &state))?,
        "objects.json" => told(outputs::layout(&state))?,
        "light.exr" => {
            let at = place(work, query)?.ok_or("the light of which place? Point at the photo first")?;
            told(Probe::exr(scenes, &state, at, PANORAMA_HEIGHT))?
        }
        "room.glb" => {
            let files = outputs::export(scenes, &state, Format::Glb, place(work, query)?).map_err(|e| e.to_string())?;
            files.into_iter().next().map(|(_, bytes)| bytes).unwrap_or_default()
        }
        "room_usd.tar" => {
            let files =
                outputs::export(scenes, &state, Format::Usda, place(work, query)?).map_err(|e| e.to_string())?;
            archive(&files).map_err(|error| error.to_string())?
        }
        _ => return Ok(None),
    };
    let media_type = match file.rsplit('.').next() {
        Some("png") => "image/png",
        Some("json") => "application/json",
        Some("glb") => "model/gltf-binary",
        Some("exr") => "image/x-exr",
        Some("tar") => "application/x-tar",
        _ => "application/octet-stream",
    };
    Ok(Some((media_type, bytes)))
}

/// The place of the probe, where the query names one: `u=…&v=…&lift=…`.
fn place(work: &Arc<Worker>, query: &str) -> Result<Option<Vec3>, String> {
    let number = |name: &str| {
        let value = query.split('&').find_map(|pair| pair.strip_prefix(name)?.strip_prefix('='))?;
        value.parse::<f64>().ok().filter(|value| value.is_finite())
    };
    let (Some(u), Some(v), Some(lift)) = (number("u"), number("v"), number("lift")) else { return Ok(None) };
    let place = probe_place(work.scenes.open(), [u, v], lift.clamp(0.0, 10.0) as f32);
    place.map(Some).ok_or_else(|| "the probe's place has no depth; choose another one".to_owned())
}

/// Files as one tar archive.
fn archive(files: &[(String, Vec<u8>)]) -> std::io::Result<Vec<u8>> {
    let mut archive = tar::Builder::new(Vec::new());
    for (name, bytes) in files {
        sequence::append(&mut archive, name, bytes)?;
    }
    archive.into_inner()
}
