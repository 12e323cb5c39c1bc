//! The session thread: receives the messages of all pages, opens scenes and executes commands.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lightoctree::{Event, OnEvent};
use lo_mesh::{Material, Model};
use lo_session::{Files, OpenScene, Session, SessionError};
use tokio::sync::mpsc::{Receiver, Sender, channel};

use crate::failure::{Failure, stage_of};
use crate::opening::{Opened, SceneSource};
use crate::outbox::{Outbox, Pages, send};
use crate::outside::OutsideRequest;
use crate::protocol::{EXPOSURES_EV, FromPage, PROBE_LIFTS_M, Preset, SceneInfo, ToPage};
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
    /// A request to open a scene, with the reservation of its upload.
    Open(SceneSource, Option<Reservation>),
    /// Number of the attempt to open a scene, and its result.
    Opened(u64, Result<Box<Opened>, String>),
}

/// A mesh uploaded by a page.
pub(crate) struct UploadedMesh {
    /// Name and content of the file.
    pub file: String,
    pub content: Arc<[u8]>,
    /// Files that the mesh references, by name.
    pub parts: Files,
    pub model: Model,
    pub warnings: Vec<String>,
    pub reservation: Reservation,
}

/// Handle of the session thread.
pub(crate) struct SessionHandle {
    messages: Sender<Message>,
    pub pages: Arc<Pages>,
    pub uploads: Arc<Uploads>,
    /// Worker of the open scene.
    current: Mutex<Option<Arc<Worker>>>,
}

impl SessionHandle {
    /// Starts the session thread.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn start(warning_text: WarningText, can_estimate: bool) -> std::io::Result<Arc<Self>> {
        let (messages, receiver) = channel(QUEUE);
        let handle =
            Arc::new(Self { messages, pages: Arc::default(), uploads: Arc::default(), current: Mutex::default() });
        let actor = SessionActor {
            handle: handle.clone(),
            warning_text,
            can_estimate,
            status: Status::Nothing { error: None },
            attempt: 0,
            change: 0,
            sequence: 0,
        };
        handle.pages.send(&actor.status_message(), &[]);
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
        self.pages.join(&ToPage::Hello { version: env!("CARGO_PKG_VERSION"), materials }, limit)
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

    /// Requests to open a scene. Must not be called by asynchronous code.
    pub fn open(&self, source: SceneSource, reservation: Option<Reservation>) {
        self.send(Message::Open(source, reservation));
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
    can_estimate: bool,
    status: Status,
    /// Number of the last attempt to open a scene.
    attempt: u64,
    /// Number of the last change.
    change: u64,
    /// Number of the last preview.
    sequence: u64,
}

/// State of the open scene.
enum Status {
    Nothing { error: Option<String> },
    Opening { file: String, stop: Arc<AtomicBool> },
    Scene { session: Box<Session>, worker: Arc<Worker>, info: Box<SceneInfo> },
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
            Message::Open(source, reservation) => self.open(source, reservation),
            Message::Opened(attempt, opened) => {
                let is_awaited = matches!(self.status, Status::Opening { .. }) && attempt == self.attempt;
                if is_awaited {
                    self.opened(opened);
                }
            }
        }
    }

    fn status_message(&self) -> ToPage {
        match &self.status {
            Status::Nothing { error } => ToPage::Empty { error: error.clone(), can_estimate: self.can_estimate },
            Status::Opening { file, .. } => ToPage::Opening { file: file.clone(), stage: String::new(), done: None },
            Status::Scene { info, .. } => ToPage::Scene((**info).clone()),
        }
    }

    fn handle_page(&mut self, message: FromPage, outbox: &Arc<Outbox>) {
        match message {
            FromPage::Stop => {
                if let Status::Opening { stop, .. } = &self.status {
                    stop.store(true, Ordering::SeqCst);
                }
                return;
            }
            FromPage::Close => {
                self.handle.set_current(None);
                self.handle.uploads.set_meshes(0);
                self.status = Status::Nothing { error: None };
                self.handle.pages.send(&self.status_message(), &[]);
                return;
            }
            _ => {}
        }
        let Status::Scene { session, worker, .. } = &mut self.status else { return };
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
            FromPage::Overlay { what } => {
                worker.overlays.request(outbox, what);
                return;
            }
            FromPage::Stop | FromPage::Close => return,
        };
        match result {
            Ok(()) => self.changed(),
            Err(error) => send(outbox, &ToPage::Refused { why: error.to_string() }, &[]),
        }
    }

    /// Sends the changed session to all pages and requests its image.
    fn changed(&mut self) {
        let Status::Scene { session, worker, .. } = &self.status else { return };
        self.change += 1;
        let (view, state) = (Box::new(session.view()), Arc::new(session.state().clone()));
        // Before the pages know of the change: a download that follows must include it.
        worker.set_change(Change { number: self.change, sequence: self.sequence, state });
        self.handle.pages.send(&ToPage::State { change: self.change, view }, &[]);
    }

    fn add_mesh(&mut self, mesh: UploadedMesh) {
        let UploadedMesh { file, content, parts, model, warnings, reservation } = mesh;
        let Status::Scene { session, .. } = &mut self.status else { return };
        let added = session
            .add_mesh(&file, model, content, parts)
            .and_then(|mesh| session.apply(&lo_session::Command::Add { mesh, pixel: None, material: None }));
        self.handle.uploads.set_meshes(session.mesh_bytes());
        drop(reservation);
        for why in warnings.into_iter().chain(added.err().map(|error: SessionError| error.to_string())) {
            self.handle.pages.send(&ToPage::Refused { why }, &[]);
        }
        self.changed();
    }

    fn open(&mut self, source: SceneSource, reservation: Option<Reservation>) {
        if let Status::Opening { stop, .. } = &self.status {
            stop.store(true, Ordering::SeqCst);
        }
        self.handle.set_current(None);
        self.handle.uploads.set_meshes(0);
        self.attempt += 1;
        let (attempt, file, stop) = (self.attempt, source.file(), Arc::new(AtomicBool::new(false)));
        self.status = Status::Opening { file: file.clone(), stop: stop.clone() };
        self.handle.pages.send(&self.status_message(), &[]);
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
            handle.send(Message::Opened(attempt, opened.map(Box::new)));
        };
        if let Err(error) = std::thread::Builder::new().name("opening".into()).spawn(job) {
            self.status = Status::Nothing { error: Some(error.to_string()) };
            self.handle.pages.send(&self.status_message(), &[]);
        }
    }

    fn opened(&mut self, opened: Result<Box<Opened>, String>) {
        let status = opened.and_then(|opened| {
            let Opened { scene, is_saved, notes } = *opened;
            let scene: Arc<OpenScene> = Arc::new(scene);
            let info = SceneInfo {
                scene: self.attempt,
                file: scene.file.clone(),
                is_saved,
                camera: scene.estimate().frame.camera,
                up: scene.up().to_array(),
                extent: scene.extent(),
                predicted_depth: scene.estimate().origin.predicted_depth,
                has_panorama: scene.estimate().panorama.is_some(),
                notes,
            };
            let session = Session::new(scene.clone()).map_err(|error| format!("{}: {error}", scene.file))?;
            let change = Change { number: self.change, sequence: 0, state: Arc::new(session.state().clone()) };
            let worker = Worker::start(scene, change, self.handle.pages.clone(), self.warning_text)
                .map_err(|e| e.to_string())?;
            Ok(Status::Scene { session: Box::new(session), worker, info: Box::new(info) })
        });
        match status {
            Ok(status) => {
                if let Status::Scene { session, worker, .. } = &status {
                    self.handle.uploads.set_meshes(session.mesh_bytes());
                    self.handle.set_current(Some(worker.clone()));
                }
                self.status = status;
                self.handle.pages.send(&self.status_message(), &[]);
                self.changed();
            }
            Err(error) => {
                self.status = Status::Nothing { error: Some(error) };
                self.handle.pages.send(&self.status_message(), &[]);
            }
        }
    }
}

/// Returns the name of a value of a probe that is out of range.
fn invalid_probe(lift_m: f32, exposure_ev: f32) -> Option<&'static str> {
    if !PROBE_LIFTS_M.contains(&lift_m) {
        return Some("the probe's distance from the surface");
    }
    (!EXPOSURES_EV.contains(&exposure_ev)).then_some("the probe's exposure")
}
