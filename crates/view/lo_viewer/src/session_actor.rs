//! The session thread: receives the messages of all pages, opens scenes and executes commands.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lightoctree::{Event, OnEvent};
use lo_mesh::{Material, Model};
use lo_session::{Files, OpenScene, Session, SessionError, overlay};

use crate::failure::{Failure, guarded, stage_of};
use crate::opening::{Opened, SceneSource};
use crate::outbox::{Outbox, Pages, send};
use crate::outside::OutsideRequest;
use crate::protocol::{FromPage, Preset, SceneInfo, ToPage};
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
    /// A request to open a scene.
    Open(SceneSource),
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
}

/// Handle of the session thread.
pub(crate) struct SessionHandle {
    messages: SyncSender<Message>,
    pub pages: Arc<Pages>,
    /// Worker of the open scene.
    current: Mutex<Option<Arc<Worker>>>,
}

impl SessionHandle {
    /// Starts the session thread.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn start(warning_text: WarningText, can_estimate: bool) -> std::io::Result<Arc<Self>> {
        let (messages, receiver) = sync_channel(QUEUE);
        let handle = Arc::new(Self { messages, pages: Arc::default(), current: Mutex::default() });
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
        std::thread::Builder::new().name("session".into()).spawn(move || actor.serve(&receiver))?;
        Ok(handle)
    }

    /// Adds a page, which receives the current state.
    pub fn join(&self) -> Arc<Outbox> {
        let preset = |name: &'static str| {
            let Material { base_color: [r, g, b, _], metallic, roughness, .. } = Material::preset(name)?;
            Some(Preset { name, base_color: [r, g, b], metallic, roughness })
        };
        let materials = Material::preset_names().filter_map(preset).collect();
        self.pages.join(&ToPage::Hello { version: env!("CARGO_PKG_VERSION"), materials })
    }

    /// Enqueues a page's message. Replaceable messages are dropped if the queue is full.
    pub fn receive(&self, message: FromPage, outbox: &Arc<Outbox>) {
        if message.is_replaceable() {
            match self.messages.try_send(Message::Page(message, outbox.clone())) {
                Ok(()) | Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {}
            }
        } else {
            self.send(Message::Page(message, outbox.clone()));
        }
    }

    /// Requests to open a scene.
    pub fn open(&self, source: SceneSource) {
        self.send(Message::Open(source));
    }

    /// Requests to add a mesh to the photo.
    pub fn add_mesh(&self, mesh: UploadedMesh) {
        self.send(Message::Mesh(Box::new(mesh)));
    }

    /// Returns the worker of the open scene.
    pub fn current(&self) -> Option<Arc<Worker>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn send(&self, message: Message) {
        // The session thread lives as long as the program.
        let _ = self.messages.send(message);
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
    fn serve(mut self, receiver: &Receiver<Message>) {
        while let Ok(first) = receiver.recv() {
            let mut waiting = vec![first];
            waiting.extend(receiver.try_iter().take(QUEUE));
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
        }
    }

    fn handle_message(&mut self, message: Message) {
        match message {
            Message::Page(message, outbox) => self.handle_page(message, &outbox),
            Message::Mesh(mesh) => self.add_mesh(*mesh),
            Message::Open(source) => self.open(source),
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
                let is_valid = lift_m.is_finite() && crate::protocol::EXPOSURES_EV.contains(&exposure_ev);
                if is_valid {
                    worker.request_probe(ProbeRequest { pixel, lift_m: lift_m.clamp(0.0, 10.0), exposure_ev });
                }
                return;
            }
            FromPage::Outside { sequence, view } => {
                match view.check(session.scene().up()) {
                    Ok(()) => worker.outside.request(OutsideRequest {
                        outbox: outbox.clone(),
                        sequence,
                        view,
                        state: worker.state(),
                    }),
                    Err(error) => send(outbox, &ToPage::Refused { why: error.to_string() }, &[]),
                }
                return;
            }
            FromPage::Overlay { what } => {
                let scene = session.scene().clone();
                match guarded(|| overlay(&scene, what)) {
                    Ok(overlay) => {
                        let css = |[r, g, b]: [u8; 3]| format!("rgb({r} {g} {b})");
                        let legend = overlay.legend.into_iter().map(|(color, text)| (css(color), text)).collect();
                        match lo_imaging::encode_rgba8("overlay.png", &overlay.image, "lightoctree view") {
                            Ok(png) => send(outbox, &ToPage::Overlay { what, legend, lengths: [png.len()] }, &[&png]),
                            Err(error) => send(outbox, &ToPage::Refused { why: error.to_string() }, &[]),
                        }
                    }
                    Err(error) => send(outbox, &ToPage::Refused { why: error.to_string() }, &[]),
                }
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
        let UploadedMesh { file, content, parts, model, warnings } = mesh;
        let Status::Scene { session, .. } = &mut self.status else { return };
        let added = session
            .add_mesh(&file, model, content, parts)
            .and_then(|mesh| session.apply(&lo_session::Command::Add { mesh, pixel: None, material: None }));
        for why in warnings.into_iter().chain(added.err().map(|error: SessionError| error.to_string())) {
            self.handle.pages.send(&ToPage::Refused { why }, &[]);
        }
        self.changed();
    }

    fn open(&mut self, source: SceneSource) {
        if let Status::Opening { stop, .. } = &self.status {
            stop.store(true, Ordering::SeqCst);
        }
        self.handle.set_current(None);
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
                if let Status::Scene { worker, .. } = &status {
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
