//! The page of a study: static files that work from a folder.

use std::io::Write;
use std::path::Path;

use lo_imaging as imaging;
use serde_json::json;

use crate::{Pair, Study, StudyError};

/// The page, in the study's folder.
pub const PAGE_FILE: &str = "index.html";

/// Folder of all videos in the study's folder, each a folder of frames.
pub const VIDEO_FOLDER: &str = "videos";

/// Files of the page that are the same for all studies.
const FILES: [(&str, &str); 3] = [
    (PAGE_FILE, include_str!("../page/index.html")),
    ("page.js", include_str!("../page/page.js")),
    ("style.css", include_str!("../page/style.css")),
];

/// Script with the pairs. Pages opened from a folder cannot read other files than scripts, styles and images.
const DATA_FILE: &str = "study.js";

/// Returns the file name of a frame.
pub(crate) fn frame_name(frame: u32) -> String {
    format!("{frame:04}.jpg")
}

/// Writes the page into the study's folder.
pub(crate) fn write(folder: &Path, study: &Study) -> Result<(), StudyError> {
    let data = format!("globalThis.study = {};\n", data(study));
    for (name, text) in FILES.into_iter().chain([(DATA_FILE, data.as_str())]) {
        imaging::write_atomically(&folder.join(name), |out| out.write_all(text.as_bytes())).map_err(StudyError::Io)?;
    }
    Ok(())
}

/// Returns what the page needs: pairs without methods, rooms or sides.
fn data(study: &Study) -> serde_json::Value {
    let pair = |pair: &Pair| {
        let videos = [&pair.left, &pair.middle, &pair.right].map(|id| format!("{VIDEO_FOLDER}/{id}"));
        json!({ "id": pair.id, "videos": videos })
    };
    let key = study.key();
    json!({
        "id": key.study,
        "fps": study.config.fps,
        "frames": (0..study.config.frames).map(frame_name).collect::<Vec<_>>(),
        "pairs": key.pairs.iter().map(pair).collect::<Vec<_>>(),
    })
}
