//! Writes the open room to the recent rooms when it rests after a change, and at the end of the program.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use lo_imaging::Photo;
use lo_session::{OpenScene, SessionError, State, outputs};

use crate::failure::guarded;
use crate::outbox::Pages;
use crate::protocol::ToPage;
use crate::recent::{RecentRoom, RecentRooms};

/// A room is written after this time without a change, and after the longer one in any case.
const REST: Duration = Duration::from_secs(2);
const MAX_DELAY: Duration = Duration::from_secs(20);

/// Longer side of previews, pixels.
const PREVIEW_SIDE: usize = 480;

/// A room to write.
pub(crate) struct SaveRequest {
    pub room: RecentRoom,
    pub scene: Arc<OpenScene>,
    pub state: Arc<State>,
    /// Returns the last rendered image, if there is one.
    pub image: Box<dyn FnOnce() -> Option<Photo> + Send>,
}

/// Writes the newest request of each room.
pub(crate) struct Autosave {
    rooms: RecentRooms,
    pages: Arc<Pages>,
    state: Mutex<Pending>,
    changed: Condvar,
}

#[derive(Default)]
struct Pending {
    request: Option<SaveRequest>,
    first: Option<Instant>,
    last: Option<Instant>,
    is_writing: bool,
    has_failed: bool,
}

impl Autosave {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn start(rooms: RecentRooms, pages: Arc<Pages>) -> std::io::Result<Arc<Self>> {
        let autosave = Arc::new(Self { rooms, pages, state: Mutex::default(), changed: Condvar::new() });
        let serving = autosave.clone();
        std::thread::Builder::new().name("autosave".into()).spawn(move || serving.serve())?;
        Ok(autosave)
    }

    /// Requests to write a room. A pending request of the same room is replaced; one of another room is written first.
    pub fn request(&self, request: SaveRequest) {
        let is_other = self.lock().request.as_ref().is_some_and(|pending| pending.room.id != request.room.id);
        if is_other {
            self.flush();
        }
        let mut pending = self.lock();
        let now = Instant::now();
        pending.request = Some(request);
        pending.first.get_or_insert(now);
        pending.last = Some(now);
        self.changed.notify_all();
    }

    /// Writes a pending request now, and waits for one that is being written.
    pub fn flush(&self) {
        let mut pending = self.lock();
        while pending.is_writing {
            pending = self.changed.wait(pending).unwrap_or_else(PoisonError::into_inner);
        }
        self.write(pending);
    }

    fn lock(&self) -> MutexGuard<'_, Pending> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn serve(&self) {
        loop {
            let mut pending = self.lock();
            loop {
                let due = pending.first.zip(pending.last).map(|(first, last)| (last + REST).min(first + MAX_DELAY));
                let left = due.map(|due| due.saturating_duration_since(Instant::now()));
                pending = match left {
                    _ if pending.is_writing || left.is_none() => {
                        self.changed.wait(pending).unwrap_or_else(PoisonError::into_inner)
                    }
                    Some(left) if !left.is_zero() => {
                        self.changed.wait_timeout(pending, left).unwrap_or_else(PoisonError::into_inner).0
                    }
                    _ => break,
                };
            }
            self.write(pending);
        }
    }

    fn write(&self, mut pending: MutexGuard<'_, Pending>) {
        let Some(request) = pending.request.take() else { return };
        (pending.first, pending.last) = (None, None);
        pending.is_writing = true;
        drop(pending);
        let written = written(&self.rooms, request);
        let mut pending = self.lock();
        pending.is_writing = false;
        let is_new_failure = written.is_err() && !pending.has_failed;
        pending.has_failed = written.is_err();
        drop(pending);
        self.changed.notify_all();
        match written {
            Ok(()) => self.pages.send(&ToPage::Recent { rooms: self.rooms.list() }, &[]),
            Err(why) if is_new_failure => {
                let why = format!("autosaving failed; save the scene yourself (Ctrl+S): {why}");
                self.pages.send(&ToPage::Refused { why }, &[]);
            }
            Err(_) => {}
        }
    }
}

fn written(rooms: &RecentRooms, request: SaveRequest) -> Result<(), String> {
    let SaveRequest { room, scene, state, image } = request;
    let files = guarded(|| {
        let image = image();
        let preview = outputs::preview(image.as_ref().unwrap_or(&scene.estimate().frame.photo), PREVIEW_SIDE)?;
        Ok::<_, SessionError>((outputs::scene(&scene, &state)?, preview))
    });
    let (scene, preview) = files.map_err(|failure| failure.to_string())?;
    rooms.write(&room, &scene, &preview).map_err(|error| error.to_string())
}
