//! The start page: sample rooms and recent rooms.

use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

use crate::app::App;
use crate::opening::SceneSource;
use crate::protocol::ToPage;
use crate::recent::RecentRoom;

/// Serves the photo of a sample.
pub(crate) async fn sample_photo(State(app): State<App>, Path((_, index)): Path<(String, usize)>) -> Response {
    let sample = app.samples.get(index);
    sample.map_or_else(not_found, |sample| ([(header::CONTENT_TYPE, "image/jpeg")], sample.photo.1).into_response())
}

/// Opens a sample.
pub(crate) async fn open_sample(State(app): State<App>, Path((_, index)): Path<(String, usize)>) -> Response {
    let (Some(sample), Some(estimator)) = (app.samples.get(index), app.estimator.clone()) else { return not_found() };
    let source = sample.source(estimator);
    blocking(move || {
        app.session.open(source, None, None);
        StatusCode::NO_CONTENT.into_response()
    })
    .await
}

/// Serves the preview of a recent room.
pub(crate) async fn recent_preview(app: State<App>, Path((_, id)): Path<(String, String)>) -> Response {
    with_room(app, id, |app, room| {
        let preview = app.session.recent.as_ref().and_then(|rooms| rooms.preview(&room).ok());
        // The picture of an id changes.
        let headers = [(header::CONTENT_TYPE, "image/jpeg"), (header::CACHE_CONTROL, "no-store")];
        preview.map_or_else(not_found, |bytes| (headers, bytes).into_response())
    })
    .await
}

/// Opens a recent room.
pub(crate) async fn open_recent(app: State<App>, Path((_, id)): Path<(String, String)>) -> Response {
    with_room(app, id, |app, room| {
        let Some(rooms) = &app.session.recent else { return not_found() };
        match rooms.scene(&room) {
            Ok(bytes) => {
                let source = SceneSource::Scene { file: room.file.clone(), bytes, is_saved: room.has_file };
                app.session.open(source, None, Some(room));
                StatusCode::NO_CONTENT.into_response()
            }
            Err(error) => (StatusCode::CONFLICT, format!("{}: {error}", room.file)).into_response(),
        }
    })
    .await
}

/// Removes a recent room. The open room stays open, and is listed again after its next change.
pub(crate) async fn forget_recent(app: State<App>, Path((_, id)): Path<(String, String)>) -> Response {
    with_room(app, id, |app, room| {
        let Some(rooms) = &app.session.recent else { return not_found() };
        rooms.remove(&room);
        app.session.pages.send(&ToPage::Recent { rooms: rooms.list() }, &[]);
        StatusCode::NO_CONTENT.into_response()
    })
    .await
}

/// Answers a request about a recent room. `id` is compared with those of the folder; it is never part of a path.
async fn with_room(
    State(app): State<App>,
    id: String,
    answer: impl FnOnce(App, RecentRoom) -> Response + Send + 'static,
) -> Response {
    blocking(move || {
        let room = app.session.recent.as_ref().and_then(|rooms| rooms.room(&id));
        room.map_or_else(not_found, |room| answer(app, room))
    })
    .await
}

async fn blocking(work: impl FnOnce() -> Response + Send + 'static) -> Response {
    tokio::task::spawn_blocking(work).await.unwrap_or_else(|_| {
        (StatusCode::INTERNAL_SERVER_ERROR, "internal error; see the terminal output").into_response()
    })
}

fn not_found() -> Response {
    (StatusCode::NOT_FOUND, "no such room").into_response()
}
