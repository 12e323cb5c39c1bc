//! Uploads: meshes with the files that they reference, scenes, and photos with depth and panoramas.

use std::cell::RefCell;

use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use lo_mesh::{LoadOptions, Model};
use lo_session::{Files, plain_name};
use percent_encoding::percent_decode_str;

use crate::app::App;
use crate::body::read_body;
use crate::query::query_number;
use crate::session_actor::UploadedMesh;
use crate::uploads::{MAX_UPLOAD, Reservation};
use crate::{NamedFile, PhotoSource, SceneSource};

/// Header with the percent-encoded file name. Other sites' pages cannot set it without a CORS preflight.
const NAME: &str = "x-file-name";

/// Receives a file. The response is empty, or the reason of a refusal.
pub(crate) async fn upload(
    State(app): State<App>,
    Path((_, kind)): Path<(String, String)>,
    uri: Uri,
    headers: HeaderMap,
    body: Body,
) -> Response {
    let refused = |why: String| (StatusCode::BAD_REQUEST, why).into_response();
    let Some(name) = headers.get(NAME).and_then(|name| name.to_str().ok()) else {
        return refused(format!("the header {NAME} is missing"));
    };
    let name = percent_decode_str(name).decode_utf8_lossy();
    // Folders are dropped: the name only identifies the file.
    let name = plain_name(name.rsplit(['/', '\\']).next().unwrap_or_default());
    if matches!(name.as_str(), "" | "." | "..") || name.len() > 200 {
        return refused("the file has no usable name".to_owned());
    }
    let uploads = app.session.uploads.clone();
    let (bytes, mut reservation) = match read_body(body, &uploads, MAX_UPLOAD).await {
        Ok(read) => read,
        Err(refusal) => return refusal.into_response(),
    };
    match kind.as_str() {
        // Held until the mesh or photo arrives.
        "part" | "depth" | "depth-model" | "depth-model-config" | "panorama" => {
            let key = if kind == "part" { name } else { format!("{kind}/{name}") };
            match uploads.keep(key, bytes) {
                Ok(()) => StatusCode::NO_CONTENT.into_response(),
                Err(error) => refused(error.to_string()),
            }
        }
        "mesh" => {
            if app.session.current().is_none() {
                return refused("open a photo or a scene first".to_owned());
            }
            let _reading = uploads.reading.lock().await;
            let parts = reservation.take_waiting();
            let session = app.session.clone();
            // Photo position at which the mesh was dropped.
            let pixel = query_number(&uri, "u").zip(query_number(&uri, "v")).map(|(u, v)| [u, v]);
            let read = tokio::task::spawn_blocking(move || {
                // Referenced files are stored in the scene file, too.
                let referenced: RefCell<Files> = RefCell::default();
                let resolve = |part: &str| {
                    let part = plain_name(part.rsplit(['/', '\\']).next().unwrap_or_default());
                    let bytes =
                        parts.get(&part).ok_or_else(|| std::io::Error::other("drop it together with the mesh"))?;
                    referenced.borrow_mut().insert(part, bytes.as_slice().into());
                    Ok(bytes.clone())
                };
                let model = Model::from_bytes(&name, &bytes, &resolve, &LoadOptions::default());
                let model = model.map_err(|error| error.to_string())?;
                let warnings = model.warnings.iter().map(|warning| format!("{name}: {warning}")).collect();
                let (content, parts) = (bytes.into(), referenced.into_inner());
                session.add_mesh(UploadedMesh { file: name, content, parts, model, pixel, warnings, reservation });
                Ok::<_, String>(())
            });
            match read.await {
                Ok(Ok(())) => StatusCode::NO_CONTENT.into_response(),
                Ok(Err(why)) => refused(why),
                Err(_) => refused("internal error; see the terminal output".to_owned()),
            }
        }
        "scene" => open(app, SceneSource::Scene { file: name, bytes, is_saved: true }, reservation).await,
        "photo" => {
            let Some(estimator) = app.estimator.clone() else {
                return refused("this program was built without weights, so it opens scenes only".to_owned());
            };
            let mut files = reservation.take_waiting();
            let mut take = |kind: &str| {
                let key = files.keys().find(|key| key.starts_with(kind)).cloned()?;
                Some(NamedFile { bytes: files.remove(&key)?, name: key[kind.len()..].to_owned() })
            };
            let source = SceneSource::Photo(PhotoSource {
                photo: NamedFile { name, bytes },
                depth: take("depth/"),
                #[cfg(feature = "depth-models")]
                depth_model: take("depth-model/").map(|model| depth_model(model, take("depth-model-config/"))),
                panorama: take("panorama/"),
                intrinsics: None,
                estimator,
            });
            open(app, source, reservation).await
        }
        _ => (StatusCode::NOT_FOUND, "no such upload").into_response(),
    }
}

async fn open(app: App, source: SceneSource, reservation: Reservation) -> Response {
    let opened = tokio::task::spawn_blocking(move || app.session.open(source, Some(reservation), None)).await;
    match opened {
        Ok(()) => StatusCode::NO_CONTENT.into_response(),
        Err(_) => (StatusCode::INTERNAL_SERVER_ERROR, "internal error; see the terminal output").into_response(),
    }
}

/// Returns name and reader of an uploaded depth model with its optional config.
#[cfg(feature = "depth-models")]
fn depth_model(model: NamedFile, config: Option<NamedFile>) -> (String, crate::ReadDepthModel) {
    use lo_depth_models::{DepthModel, ModelConfig, ModelError};
    let name = model.name.clone();
    let read = move || {
        let NamedFile { name, bytes } = model;
        let config = config.map(|NamedFile { name, bytes }| {
            ModelConfig::parse(&String::from_utf8_lossy(&bytes)).map_err(|error| format!("{name}: {error}"))
        });
        DepthModel::from_bytes(&bytes, config.transpose()?.as_ref()).map_err(|error| match error {
            ModelError::Unknown { .. } => format!("{name}: {error}\nas a TOML file beside it"),
            error => format!("{name}: {error}"),
        })
    };
    (name, Box::new(read))
}
