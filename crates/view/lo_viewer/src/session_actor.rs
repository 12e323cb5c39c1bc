//! The session thread: receives the messages of all pages, opens scenes and executes commands.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lightoctree::{Event, KnownLength, OnEvent};
use lo_mesh::{Material, Model};
use lo_session::{Files, OpenScene, Session, SessionError, plain_name};
use tokio::sync::mpsc::{Receiver, Sender, channel};

use crate::autosave::{Autosave, SaveRequest};
use crate::failure::{Failure, stage_of};
use crate::opening::{Opened, SceneSource};
use crate::outbox::{Outbox, Pages, send};
use crate::outside::OutsideRequest;
use crate::protocol::{EXPOSURES_EV, FromPage, PROBE_LIFTS_M, Preset, SceneInfo, ToPage};
use crate::random_hex::random_hex;
use crate::recent::{RecentRoom, RecentRooms, now_s};
use crate::sample::Sample;
use crate::uploads::{Reservation, Uploads};
use crate::warning_text::WarningText;
use crate::worker::{Change, ProbeRequest, Worker};

/// Maximum number of pending messages.
const QUEUE: usize = 256;

/// A message to the session thread.
enum Message {
    /// A message from a page.
    Page(FromPage, Arc<Outbox>),
    /// An uploaded mesh to add to the photo.
    Mesh(Box<UploadedMesh>),
    /// A request to open a scene, with the reservation of its upload and the recent room that it is.
    Open(Box<(SceneSource, Option<Reservation>, Option<RecentRoom>)>),
    /// Number of the attempt to open a scene, its result, and the recent room that it is.
    Opened(u64, Result<Box<Opened>, String>, Option<RecentRoom>),
}

/// A mesh uploaded by a page.
pub(crate) struct UploadedMesh {
    /// Name and content of the file.
    pub file: String,
    pub content: Arc<[u8]>,
    /// Files that the mesh references, by name.
    pub parts: Files,
    pub model: Model,
    /// Photo position at which it was dropped.
    pub pixel: Option<[f64; 2]>,
    pub warnings: Vec<String>,
    pub reservation: Reservation,
}

/// Handle of the session thread.
pub(crate) struct SessionHandle {
    messages: Sender<Message>,
    pub pages: Arc<Pages>,
    pub uploads: Arc<Uploads>,
    pub recent: Option<RecentRooms>,
    autosave: Option<Arc<Autosave>>,
    can_estimate: bool,
    samples: Arc<[Sample]>,
    /// Worker of the open scene.
    current: Mutex<Option<Arc<Worker>>>,
}

impl SessionHandle {
    /// Starts the session thread, and the one that saves open rooms to `recent`.
    ///
    /// # Errors
    /// If a thread cannot be started.
    pub fn start(
        warning_text: WarningText,
        can_estimate: bool,
        samples: Arc<[Sample]>,
        recent: Option<RecentRooms>,
    ) -> std::io::Result<Arc<Self>> {
        let (messages, receiver) = channel(QUEUE);
        let pages: Arc<Pages> = Arc::default();
        let autosave = recent.clone().map(|rooms| Autosave::start(rooms, pages.clone())).transpose()?;
        let (uploads, current) = (Arc::default(), Mutex::default());
        let handle = Arc::new(Self { messages, pages, uploads, recent, autosave, can_estimate, samples, current });
        let (open, opening) = (None, None);
        let actor =
            SessionActor { handle: handle.clone(), warning_text, open, opening, attempt: 0, change: 0, sequence: 0 };
        handle.pages.send(&ToPage::Empty { error: None }, &[]);
        let rooms = handle.recent.as_ref().map_or_else(Vec::new, RecentRooms::list);
        handle.pages.send(&ToPage::Recent { rooms }, &[]);
        std::thread::Builder::new().name("session".into()).spawn(move || actor.serve(receiver))?;
        Ok(handle)
    }

    /// Adds a page, which receives the current state; `None` if `limit` pages are open.
    pub fn join(&self, limit: usize) -> Option<Arc<Outbox>> {
        let preset = |name: &'static str| {
            let Material { base_color: [r, g, b, _], metallic, roughness, .. } = Material::preset(name)?;
            Some(Preset { name, base_color: [r, g, b], metallic, roughness })
        };
        let materials = Material::preset_names().filter_map(preset).collect();
        let samples = self.samples.iter().map(Sample::view).collect();
        let (version, can_estimate) = (env!("CARGO_PKG_VERSION"), self.can_estimate);
        let autosaves = self.autosave.is_some();
        self.pages.join(&ToPage::Hello { version, materials, can_estimate, autosaves, samples }, limit)
    }

    /// Enqueues a page's message. If the queue is full, replaceable messages are dropped, and others wait.
    pub async fn receive(&self, message: FromPage, outbox: &Arc<Outbox>) {
        let is_replaceable = message.is_replaceable();
        let message = Message::Page(message, outbox.clone());
        // The session thread lives as long as the program, so that only full queues fail.
        if is_replaceable {
            let _ = self.messages.try_send(message);
        } else {
            let _ = self.messages.send(message).await;
        }
    }

    /// Requests to open a scene, which is `room` of the recent rooms or a new one. Must not be called by asynchronous
    /// code.
    pub fn open(&self, source: SceneSource, reservation: Option<Reservation>, room: Option<RecentRoom>) {
        self.send(Message::Open(Box::new((source, reservation, room))));
    }

    /// Saves changes that are not saved automatically yet.
    pub fn flush(&self) {
        if let Some(autosave) = &self.autosave {
            autosave.flush();
        }
    }

    /// Requests to add a mesh to the photo. Must not be called by asynchronous code.
    pub fn add_mesh(&self, mesh: UploadedMesh) {
        self.send(Message::Mesh(Box::new(mesh)));
    }

    /// Returns the worker of the open scene.
    pub fn current(&self) -> Option<Arc<Worker>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn send(&self, message: Message) {
        // The session thread lives as long as the program.
        let _ = self.messages.blocking_send(message);
    }

    fn set_current(&self, worker: Option<Arc<Worker>>) {
        let before = std::mem::replace(&mut *self.current.lock().unwrap_or_else(PoisonError::into_inner), worker);
        if let Some(before) = before {
            before.end();
        }
    }
}

/// State of the session thread.
struct SessionActor {
    handle: Arc<SessionHandle>,
    warning_text: WarningText,
    open: Option<OpenRoom>,
    opening: Option<OpeningJob>,
    /// Number of the last attempt to open a scene.
    attempt: u64,
    /// Number of the last change.
    change: u64,
    /// Number of the last preview.
    sequence: u64,
}

/// The open scene.
struct OpenRoom {
    session: Box<Session>,
    worker: Arc<Worker>,
    /// Id among the recent rooms.
    id: String,
    /// Unique number of the opened scene, and warnings of opening it.
    number: u64,
    notes: Vec<String>,
}

impl OpenRoom {
    /// Describes the scene for pages.
    fn info(&self) -> SceneInfo {
        let scene = self.session.scene();
        SceneInfo {
            scene: self.number,
            camera: scene.estimate().frame.camera,
            up: scene.up().to_array(),
            extent: scene.extent(),
            predicted_depth: scene.estimate().origin.predicted_depth,
            has_panorama: scene.estimate().panorama.is_some(),
            notes: self.notes.clone(),
        }
    }
}

/// A scene that is being opened, while the open one stays.
struct OpeningJob {
    stop: Arc<AtomicBool>,
}

impl SessionActor {
    fn serve(mut self, mut receiver: Receiver<Message>) {
        let mut waiting = Vec::new();
        while receiver.blocking_recv_many(&mut waiting, QUEUE) > 0 {
            for index in 0..waiting.len() {
                // Of consecutive previews of one kind, and of consecutive seeks, only the last is shown.
                let is_superseded = matches!(
                    (&waiting[index], waiting.get(index + 1)),
                    (
                        Message::Page(FromPage::Preview { command, .. }, _),
                        Some(Message::Page(FromPage::Preview { command: next, .. }, _)),
                    ) if std::mem::discriminant(command) == std::mem::discriminant(next)
                ) || matches!(
                    (&waiting[index], waiting.get(index + 1)),
                    (Message::Page(FromPage::Seek { .. }, _), Some(Message::Page(FromPage::Seek { .. }, _)))
                );
                if is_superseded {
                    continue;
                }
                let message = std::mem::replace(&mut waiting[index], Message::Page(FromPage::Stop, Arc::default()));
                if catch_unwind(AssertUnwindSafe(|| self.handle_message(message))).is_err() {
                    self.handle.pages.send(&ToPage::Refused { why: Failure::Panic.to_string() }, &[]);
                }
            }
            waiting.clear();
        }
    }

    fn handle_message(&mut self, message: Message) {
        match message {
            Message::Page(message, outbox) => self.handle_page(message, &outbox),
            Message::Mesh(mesh) => self.add_mesh(*mesh),
            Message::Open(request) => {
                let (source, reservation, room) = *request;
                self.open(source, reservation, room);
            }
            Message::Opened(attempt, opened, room) => {
                if attempt == self.attempt
                    && let Some(job) = self.opening.take()
                {
                    self.opened(opened, room, job.stop.load(Ordering::SeqCst));
                }
            }
        }
    }

    fn handle_page(&mut self, message: FromPage, outbox: &Arc<Outbox>) {
        if message == FromPage::Stop {
            if let Some(job) = &self.opening {
                job.stop.store(true, Ordering::SeqCst);
            }
            return;
        }
        let Some(OpenRoom { session, worker, .. }) = &mut self.open else { return };
        let result = match message {
            FromPage::Command { command } => session.apply(&command),
            FromPage::Preview { command, sequence } => {
                self.sequence = sequence;
                session.preview(&command)
            }
            FromPage::Seek { time_s, sequence } => {
                self.sequence = sequence;
                session.seek(time_s)
            }
            FromPage::StopSequence => {
                worker.sequence_download.stop();
                return;
            }
            FromPage::Commit => {
                session.commit();
                Ok(())
            }
            FromPage::Cancel => {
                session.cancel();
                Ok(())
            }
            FromPage::Undo => {
                session.undo();
                Ok(())
            }
            FromPage::Redo => {
                session.redo();
                Ok(())
            }
            FromPage::Probe { pixel, lift_m, exposure_ev } => {
                if let Some(what) = invalid_probe(lift_m, exposure_ev) {
                    send(outbox, &ToPage::Refused { why: SessionError::OutOfRange(what).to_string() }, &[]);
                } else {
                    worker.request_probe(ProbeRequest { pixel, lift_m, exposure_ev });
                }
                return;
            }
            FromPage::Outside { sequence, view } => {
                match view.check(session.scene().up()) {
                    Ok(()) => {
                        worker.outside.request(outbox, OutsideRequest { sequence, view, state: worker.state() });
                    }
                    Err(error) => send(outbox, &ToPage::Refused { why: error.to_string() }, &[]),
                }
                return;
            }
            FromPage::Measure { ends } => {
                // The real length does not matter here.
                let measured = KnownLength { ends, length_m: 1.0 }.estimated_m(session.scene().estimate());
                send(outbox, &ToPage::Measured { ends, length_m: measured.ok() }, &[]);
                return;
            }
            FromPage::Overlay { what } => {
                worker.overlays.request(outbox, what);
                return;
            }
            FromPage::Saved { change, file } => {
                // Changes made since then are in no file.
                if change == self.change && !session.is_previewing() {
                    session.mark_saved(plain_name(&file));
                    self.send_state();
                    self.autosave();
                }
                return;
            }
            FromPage::Stop => return,
        };
        match result {
            Ok(()) => self.changed(),
            Err(error) => send(outbox, &ToPage::Refused { why: error.to_string() }, &[]),
        }
    }

    /// Sends the changed session to all pages and requests its image.
    fn changed(&mut self) {
        self.change += 1;
        self.follow_scale();
        let Some(OpenRoom { session, worker, .. }) = &self.open else { return };
        // Before the pages know of the change: a download that follows must include it.
        worker.set_change(change_of(session, self.change, self.sequence));
        self.send_state();
        self.autosave();
    }

    /// Starts a worker for the scaled scene, if the scale of the room changed.
    fn follow_scale(&mut self) {
        let Some(room) = &mut self.open else { return };
        let scene = room.session.scene();
        if Arc::ptr_eq(scene, room.worker.scenes.scene()) {
            return;
        }
        // The first draft is that of the change that follows.
        let before = change_of(&room.session, self.change - 1, self.sequence);
        match Worker::start(scene.clone(), before, self.handle.pages.clone(), self.warning_text) {
            Ok(worker) => {
                room.worker = worker.clone();
                self.handle.set_current(Some(worker));
                self.handle.pages.send(&ToPage::Scene(room.info()), &[]);
            }
            Err(error) => self.handle.pages.send(&ToPage::Refused { why: error.to_string() }, &[]),
        }
    }

    /// Sends the session to all pages.
    fn send_state(&self) {
        let Some(OpenRoom { session, .. }) = &self.open else { return };
        let view = Box::new(session.view());
        self.handle.pages.send(&ToPage::State { change: self.change, view }, &[]);
    }

    /// Requests to save the room automatically, unless a gesture is in progress.
    fn autosave(&self) {
        let (Some(OpenRoom { session, worker, id, .. }), Some(autosave)) = (&self.open, &self.handle.autosave) else {
            return;
        };
        if session.is_previewing() {
            return;
        }
        let worker = worker.clone();
        let document = worker.change().document;
        let room = RecentRoom {
            id: id.clone(),
            file: session.file().to_owned(),
            has_file: session.has_file(),
            unsaved: session.is_unsaved(),
            objects: document.objects.len(),
            changed_s: now_s(),
        };
        let scene = session.scene().clone();
        let image = Box::new(move || worker.last_image().map(|composite| composite.image.clone()));
        autosave.request(SaveRequest { room, scene, state: document, image });
    }

    fn add_mesh(&mut self, mesh: UploadedMesh) {
        let UploadedMesh { file, content, parts, model, pixel, warnings, reservation } = mesh;
        let Some(OpenRoom { session, .. }) = &mut self.open else { return };
        let added = session
            .add_mesh(&file, model, content, parts)
            .and_then(|mesh| session.apply(&lo_session::Command::Add { mesh, pixel, material: None }));
        self.handle.uploads.set_meshes(session.mesh_bytes());
        drop(reservation);
        for why in warnings.into_iter().chain(added.err().map(|error: SessionError| error.to_string())) {
            self.handle.pages.send(&ToPage::Refused { why }, &[]);
        }
        self.changed();
    }

    /// Starts to open a scene. The open one stays until then, and if that fails.
    fn open(&mut self, source: SceneSource, reservation: Option<Reservation>, room: Option<RecentRoom>) {
        if let Some(job) = &self.opening {
            job.stop.store(true, Ordering::SeqCst);
        }
        self.attempt += 1;
        let (attempt, file, stop) = (self.attempt, source.file(), Arc::new(AtomicBool::new(false)));
        self.opening = Some(OpeningJob { stop: stop.clone() });
        let opening = ToPage::Opening { file: file.clone(), stage: String::new(), done: None };
        self.handle.pages.send(&opening, &[]);
        let (handle, warning_text) = (self.handle.clone(), self.warning_text);
        let job = move || {
            let mut sent = Instant::now();
            let mut last = None;
            let mut on_event = |event: Event| {
                let stage = stage_of(&event).cloned();
                if let (Some(done), Some(stage)) = (event.fraction(), stage)
                    && (last.as_ref() != Some(&stage) || sent.elapsed() > Duration::from_millis(100))
                {
                    sent = Instant::now();
                    let name = stage.name().to_owned();
                    last = Some(stage);
                    handle.pages.send(&ToPage::Opening { file: file.clone(), stage: name, done: Some(done) }, &[]);
                }
                if stop.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let opened = catch_unwind(AssertUnwindSafe(|| source.open(warning_text, &mut on_event as OnEvent<'_>)));
            let opened = opened.unwrap_or_else(|_| Err("internal error; see the terminal output".to_owned()));
            drop(reservation);
            handle.send(Message::Opened(attempt, opened.map(Box::new), room));
        };
        if let Err(error) = std::thread::Builder::new().name("opening".into()).spawn(job) {
            self.opening = None;
            self.refused_to_open(error.to_string());
        }
    }

    /// Reports why a scene could not be opened.
    fn refused_to_open(&self, why: String) {
        self.handle.pages.send(&ToPage::OpeningEnded, &[]);
        match self.open {
            Some(_) => self.handle.pages.send(&ToPage::Refused { why }, &[]),
            None => self.handle.pages.send(&ToPage::Empty { error: Some(why) }, &[]),
        }
    }

    fn opened(&mut self, opened: Result<Box<Opened>, String>, room: Option<RecentRoom>, is_stopped: bool) {
        let opened = opened.and_then(|opened| {
            let Opened { scene, notes } = *opened;
            let scene: Arc<OpenScene> = Arc::new(scene);
            let mut session = Session::new(scene.clone()).map_err(|error| format!("{}: {error}", scene.file))?;
            if room.as_ref().is_some_and(|room| room.unsaved) {
                session.mark_unsaved();
            }
            let id = room.map_or_else(random_hex::<8>, |room| Ok(room.id)).map_err(|error| error.to_string())?;
            let change = change_of(&session, self.change, 0);
            let worker = Worker::start(scene, change, self.handle.pages.clone(), self.warning_text)
                .map_err(|e| e.to_string())?;
            Ok(OpenRoom { session: Box::new(session), worker, id, number: self.attempt, notes })
        });
        match opened {
            Ok(room) => {
                let info = room.info();
                self.handle.uploads.set_meshes(room.session.mesh_bytes());
                self.handle.set_current(Some(room.worker.clone()));
                self.open = Some(room);
                self.handle.pages.send(&ToPage::OpeningEnded, &[]);
                self.handle.pages.send(&ToPage::Scene(info), &[]);
                self.changed();
            }
            Err(_) if is_stopped => self.handle.pages.send(&ToPage::OpeningEnded, &[]),
            Err(why) => self.refused_to_open(why),
        }
    }
}

/// Returns the shown state of a session as a change to render.
fn change_of(session: &Session, number: u64, sequence: u64) -> Change {
    let document = Arc::new(session.state().clone());
    let has_hidden = document.objects.iter().any(|object| object.is_hidden);
    let state = if has_hidden { Arc::new(document.shown_in_images()) } else { document.clone() };
    Change { number, sequence, state, document }
}

/// Returns the name of a value of a probe that is out of range.
fn invalid_probe(lift_m: f32, exposure_ev: f32) -> Option<&'static str> {
    if !PROBE_LIFTS_M.contains(&lift_m) {
        return Some("the probe's distance from the surface");
    }
    (!EXPOSURES_EV.contains(&exposure_ev)).then_some("the probe's exposure")
}
