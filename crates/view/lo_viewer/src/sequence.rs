//! Sequences that a page takes away: made frame by frame while the browser takes them in, so that no more than one waits in memory.

use std::io::{self, BufWriter, Write};
use std::ops::ControlFlow;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::task::{Context, Poll};
use std::time::Instant;

use axum::body::{Body, Bytes};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_core::Stream;
use lightoctree::imaging::Y4mWriter;
use lightoctree::insert::Quality;
use lo_session::{Sequence, State, outputs};
use tokio::sync::mpsc::{Receiver, Sender, channel};

use crate::failure::{Failure, guarded};
use crate::protocol::ToPage;
use crate::worker::Worker;

/// Bytes that are written at once at least.
const CHUNK: usize = 1 << 16;

/// Pieces that wait for the browser.
const WAITING: usize = 4;

/// What it is written as.
#[derive(Clone, Copy)]
pub(crate) enum Kind {
    /// PNG files in a tar archive.
    Frames,
    /// YUV4MPEG2.
    Video,
}

impl Kind {
    /// By the file's name.
    pub fn of(file: &str) -> Option<Self> {
        match file {
            "frames.tar" => Some(Self::Frames),
            "video.y4m" => Some(Self::Video),
            _ => None,
        }
    }
}

/// Begins a sequence; the answer's body grows as it is made.
pub(crate) fn download(work: &Arc<Worker>, kind: Kind, file: &str) -> Response {
    let state = work.state();
    if state.span_s().is_none() {
        return (StatusCode::CONFLICT, "nothing moves yet: add a keyframe first").into_response();
    }
    if work.film.is_running.swap(true, Ordering::SeqCst) {
        return (StatusCode::CONFLICT, "frames or a video are being taken away already").into_response();
    }
    work.film.is_stopped.store(false, Ordering::SeqCst);
    let (pieces, receiver) = channel(WAITING);
    let work = work.clone();
    tokio::task::spawn_blocking(move || {
        let frames = state.sequence_frames() as usize;
        let mut done = 0;
        let made = guarded(|| Ok(made(&work, &state, kind, &pieces, &mut done)));
        let ended = match made {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(error),
            Err(failure) => Some(failure.to_string()),
        };
        if let Some(why) = &ended {
            // The browser must not take the part for the whole.
            let _ = pieces.blocking_send(Err(io::Error::other(why.clone())));
        }
        work.film.is_running.store(false, Ordering::SeqCst);
        work.pages.tell(&ToPage::Film { done, frames, left_s: Some(0.0), ended }, &[]);
    });
    let disposition = format!("attachment; filename=\"{file}\"");
    let media_type = match kind {
        Kind::Frames => "application/x-tar",
        Kind::Video => "video/x-yuv4mpeg",
    };
    (
        [(header::CONTENT_TYPE, media_type.to_owned()), (header::CONTENT_DISPOSITION, disposition)],
        Body::from_stream(Pieces(receiver)),
    )
        .into_response()
}

fn made(work: &Arc<Worker>, state: &State, kind: Kind, pieces: &Pipe, done: &mut usize) -> Result<(), String> {
    let told = |failure: Failure| match failure {
        Failure::Session(error) if error.is_cancelled() => "stopped".to_owned(),
        failure => failure.to_string(),
    };
    let sequence = guarded(|| Sequence::new(&work.scenes, state, Quality::Normal)).map_err(told)?;
    let (frames, begun) = (sequence.frames(), Instant::now());
    work.pages.tell(&ToPage::Film { done: 0, frames, left_s: None, ended: None }, &[]);
    let target = BufWriter::with_capacity(CHUNK, PipeWriter(pieces));
    let cannot = |error: io::Error| error.to_string();
    let mut writer = match kind {
        Kind::Frames => Writer::Frames(tar::Builder::new(target)),
        Kind::Video => Writer::Video(Y4mWriter::new(target, sequence.size(), state.fps).map_err(cannot)?),
    };
    for frame in 0..frames {
        let hear = &mut |_| {
            let is_over = work.film.is_stopped.load(Ordering::SeqCst) || pieces.is_closed();
            if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let composite = guarded(|| sequence.render(frame, hear)).map_err(told)?;
        match &mut writer {
            Writer::Frames(archive) => {
                let png = outputs::picture(&composite).map_err(|error| error.to_string())?;
                append(archive, &format!("frame_{frame:04}.png"), &png).map_err(cannot)?;
            }
            Writer::Video(video) => video.add(&composite.image).map_err(cannot)?,
        }
        *done = frame + 1;
        let left_s = begun.elapsed().as_secs_f64() / *done as f64 * (frames - *done) as f64;
        work.pages.tell(&ToPage::Film { done: *done, frames, left_s: Some(left_s), ended: None }, &[]);
    }
    match writer {
        Writer::Frames(archive) => archive.into_inner().and_then(|mut target| target.flush()).map_err(cannot),
        // It writes its rest when it is dropped; where that fails, the page is gone.
        Writer::Video(_) => Ok(()),
    }
}

enum Writer<'a> {
    Frames(tar::Builder<BufWriter<PipeWriter<'a>>>),
    Video(Y4mWriter<BufWriter<PipeWriter<'a>>>),
}

type Pipe = Sender<io::Result<Bytes>>;

/// Waits where the browser does not keep up.
struct PipeWriter<'a>(&'a Pipe);

impl Write for PipeWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let piece = Bytes::copy_from_slice(bytes);
        self.0.blocking_send(Ok(piece)).map_err(|_| io::Error::other("the page is gone"))?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

struct Pieces(Receiver<io::Result<Bytes>>);

impl Stream for Pieces {
    type Item = io::Result<Bytes>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.0.poll_recv(context)
    }
}

/// Adds a file to a tar archive.
pub(crate) fn append(archive: &mut tar::Builder<impl Write>, name: &str, bytes: &[u8]) -> io::Result<()> {
    let mut head = tar::Header::new_gnu();
    head.set_size(bytes.len() as u64);
    head.set_mode(0o644);
    archive.append_data(&mut head, name, bytes)
}
