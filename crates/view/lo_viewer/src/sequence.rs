//! Sequence downloads, rendered frame by frame at the browser's pace, so that at most a few chunks are in memory.

use std::io::{self, BufWriter, Write};
use std::ops::ControlFlow;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use std::time::Instant;

use axum::body::{Body, Bytes};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_core::Stream;
use lo_imaging::Y4mWriter;
use lo_insert::Quality;
use lo_session::{Sequence, State, outputs};
use tokio::runtime::Handle;
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tokio::sync::watch;

use crate::failure::{Failure, guarded};
use crate::protocol::ToPage;
use crate::worker::Worker;
use crate::zip_archive::ZipArchive;

/// Minimum size of a chunk, bytes.
const CHUNK: usize = 1 << 16;

/// Maximum number of chunks that wait for the browser.
const MAX_PENDING_CHUNKS: usize = 4;

/// File format of a sequence download.
#[derive(Clone, Copy)]
pub(crate) enum SequenceFormat {
    /// PNG files in a ZIP archive.
    Frames,
    /// PNG files, and EXR files of their layers, in a ZIP archive.
    Layers,
    /// YUV4MPEG2.
    Video,
}

impl SequenceFormat {
    /// Returns the format of a file name.
    pub fn from_name(file: &str) -> Option<Self> {
        match file {
            "frames.zip" => Some(Self::Frames),
            "layers.zip" => Some(Self::Layers),
            "video.y4m" => Some(Self::Video),
            _ => None,
        }
    }
}

/// Starts a sequence download. The response body is streamed while frames are rendered.
pub(crate) fn download(worker: &Arc<Worker>, format: SequenceFormat, file: &str) -> Response {
    let state = worker.state();
    if state.span_s().is_none() {
        return (StatusCode::CONFLICT, "nothing is animated yet: add a keyframe first").into_response();
    }
    let Some(is_stopped) = worker.sequence_download.begin() else {
        return (StatusCode::CONFLICT, "another download of frames or a video is in progress").into_response();
    };
    let (sender, receiver) = channel(MAX_PENDING_CHUNKS);
    let failure = Arc::default();
    let chunks = ChunkSender { sender, is_stopped, failure: Arc::clone(&failure), runtime: Handle::current() };
    let worker = worker.clone();
    tokio::task::spawn_blocking(move || {
        let frames = state.sequence_frames() as usize;
        let mut done = 0;
        let result = guarded(|| Ok(write_sequence(&worker, &state, format, &chunks, &mut done)));
        let ended = match result {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(error),
            Err(failure) => Some(failure.to_string()),
        };
        if let Some(why) = &ended {
            *chunks.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(why.clone());
        }
        drop(chunks);
        worker.sequence_download.end();
        worker.pages.send(&ToPage::SequenceProgress { done, frames, left_s: Some(0.0), ended }, &[]);
    });
    let disposition = format!("attachment; filename=\"{file}\"");
    let media_type = match format {
        SequenceFormat::Frames | SequenceFormat::Layers => "application/zip",
        SequenceFormat::Video => "video/x-yuv4mpeg",
    };
    (
        [(header::CONTENT_TYPE, media_type.to_owned()), (header::CONTENT_DISPOSITION, disposition)],
        Body::from_stream(ChunkStream { receiver, failure }),
    )
        .into_response()
}

/// Renders and writes all frames; `done` counts them.
fn write_sequence(
    worker: &Arc<Worker>,
    state: &State,
    format: SequenceFormat,
    chunks: &ChunkSender,
    done: &mut usize,
) -> Result<(), String> {
    let message = |failure: Failure| match failure {
        Failure::Session(error) if error.is_cancelled() => "stopped".to_owned(),
        failure => failure.to_string(),
    };
    let sequence = guarded(|| Sequence::new(&worker.scenes, state, Quality::Normal)).map_err(message)?;
    let with_layers = matches!(format, SequenceFormat::Layers);
    let sequence = if with_layers { sequence.with_layers() } else { sequence };
    let (frames, begun) = (sequence.frames(), Instant::now());
    worker.pages.send(&ToPage::SequenceProgress { done: 0, frames, left_s: None, ended: None }, &[]);
    let target = BufWriter::with_capacity(CHUNK, ChunkWriter(chunks));
    let io_message = |error: io::Error| error.to_string();
    let mut writer = match format {
        SequenceFormat::Frames | SequenceFormat::Layers => SequenceWriter::Frames(Box::new(ZipArchive::new(target))),
        SequenceFormat::Video => {
            SequenceWriter::Video(Y4mWriter::new(target, sequence.size(), state.fps).map_err(io_message)?)
        }
    };
    for frame in 0..frames {
        let on_event = &mut |_| {
            let is_over = *chunks.is_stopped.borrow() || chunks.sender.is_closed();
            if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let composite = guarded(|| sequence.render(frame, on_event)).map_err(message)?;
        match &mut writer {
            SequenceWriter::Frames(archive) => {
                let png = outputs::image(&composite).map_err(|error| error.to_string())?;
                archive.add(&format!("frame_{frame:04}.png"), &png).map_err(io_message)?;
                if with_layers {
                    let exr = outputs::layers(&composite).map_err(|error| error.to_string())?;
                    archive.add(&format!("layers_{frame:04}.exr"), &exr).map_err(io_message)?;
                }
            }
            SequenceWriter::Video(video) => video.add(&composite.image).map_err(io_message)?,
        }
        *done = frame + 1;
        let left_s = begun.elapsed().as_secs_f64() / *done as f64 * (frames - *done) as f64;
        worker.pages.send(&ToPage::SequenceProgress { done: *done, frames, left_s: Some(left_s), ended: None }, &[]);
    }
    match writer {
        SequenceWriter::Frames(archive) => archive.finish().and_then(|mut target| target.flush()).map_err(io_message),
        // The buffer is flushed on drop; that fails only if the page is gone.
        SequenceWriter::Video(_) => Ok(()),
    }
}

enum SequenceWriter<'a> {
    Frames(Box<ZipArchive<BufWriter<ChunkWriter<'a>>>>),
    Video(Y4mWriter<BufWriter<ChunkWriter<'a>>>),
}

/// Why a download ended early.
type DownloadFailure = Arc<Mutex<Option<String>>>;

/// Sends chunks to the response body.
struct ChunkSender {
    sender: Sender<Bytes>,
    is_stopped: watch::Receiver<bool>,
    failure: DownloadFailure,
    runtime: Handle,
}

/// Writes chunks; blocks until the browser keeps up or the download is stopped.
struct ChunkWriter<'a>(&'a ChunkSender);

impl Write for ChunkWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let ChunkSender { sender, is_stopped, runtime, .. } = self.0;
        let (chunk, mut is_stopped) = (Bytes::copy_from_slice(bytes), is_stopped.clone());
        runtime.block_on(async {
            tokio::select! {
                sent = sender.send(chunk) => sent.map_err(|_| io::Error::other("the page was closed")),
                _ = is_stopped.wait_for(|is_stopped| *is_stopped) => Err(io::Error::other("stopped")),
            }
        })?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The response body. After a failure it ends with an error, so that the browser does not take a truncated file for a
/// complete one.
struct ChunkStream {
    receiver: Receiver<Bytes>,
    failure: DownloadFailure,
}

impl Stream for ChunkStream {
    type Item = io::Result<Bytes>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.receiver.poll_recv(context).map(|chunk| match chunk {
            Some(chunk) => Some(Ok(chunk)),
            None => {
                self.failure.lock().unwrap_or_else(PoisonError::into_inner).take().map(|why| Err(io::Error::other(why)))
            }
        })
    }
}
