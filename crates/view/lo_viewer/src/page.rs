//! The page, embedded in the program.

use axum::extract::Path;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

const INDEX: &str = include_str!("../page/index.html");

/// Name, media type and content of the page's files.
const FILES: [(&str, &str, &str); 32] = [
    ("icon.svg", "image/svg+xml", include_str!("../page/icon.svg")),
    ("style.css", "text/css; charset=utf-8", include_str!("../page/style.css")),
    ("main.js", SCRIPT, include_str!("../page/main.js")),
    ("camera.js", SCRIPT, include_str!("../page/camera.js")),
    ("dom.js", SCRIPT, include_str!("../page/dom.js")),
    ("file_roles.js", SCRIPT, include_str!("../page/file_roles.js")),
    ("gestures.js", SCRIPT, include_str!("../page/gestures.js")),
    ("handles.js", SCRIPT, include_str!("../page/handles.js")),
    ("image_view.js", SCRIPT, include_str!("../page/image_view.js")),
    ("inferred.js", SCRIPT, include_str!("../page/inferred.js")),
    ("light_marks.js", SCRIPT, include_str!("../page/light_marks.js")),
    ("lights.js", SCRIPT, include_str!("../page/lights.js")),
    ("measure.js", SCRIPT, include_str!("../page/measure.js")),
    ("objects.js", SCRIPT, include_str!("../page/objects.js")),
    ("orbit.js", SCRIPT, include_str!("../page/orbit.js")),
    ("outside.js", SCRIPT, include_str!("../page/outside.js")),
    ("outside_images.js", SCRIPT, include_str!("../page/outside_images.js")),
    ("outside_input.js", SCRIPT, include_str!("../page/outside_input.js")),
    ("outside_lights.js", SCRIPT, include_str!("../page/outside_lights.js")),
    ("outside_lines.js", SCRIPT, include_str!("../page/outside_lines.js")),
    ("panels.js", SCRIPT, include_str!("../page/panels.js")),
    ("photo_stage.js", SCRIPT, include_str!("../page/photo_stage.js")),
    ("photo_view.js", SCRIPT, include_str!("../page/photo_view.js")),
    ("probe.js", SCRIPT, include_str!("../page/probe.js")),
    ("saving.js", SCRIPT, include_str!("../page/saving.js")),
    ("selection.js", SCRIPT, include_str!("../page/selection.js")),
    ("server.js", SCRIPT, include_str!("../page/server.js")),
    ("slider.js", SCRIPT, include_str!("../page/slider.js")),
    ("start.js", SCRIPT, include_str!("../page/start.js")),
    ("store.js", SCRIPT, include_str!("../page/store.js")),
    ("timeline.js", SCRIPT, include_str!("../page/timeline.js")),
    ("uploads.js", SCRIPT, include_str!("../page/uploads.js")),
];

const SCRIPT: &str = "text/javascript; charset=utf-8";

pub(crate) async fn index() -> Response {
    ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], INDEX).into_response()
}

pub(crate) async fn file(Path((_, name)): Path<(String, String)>) -> Response {
    match FILES.iter().find(|(file, ..)| *file == name) {
        Some(&(_, media_type, text)) => ([(header::CONTENT_TYPE, media_type)], text).into_response(),
        None => (StatusCode::NOT_FOUND, "no such file").into_response(),
    }
}
