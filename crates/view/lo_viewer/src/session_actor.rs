//! The session at the desk: one thread that hears all pages, opens scenes and carries commands out.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use lightoctree::mesh::{Material, Model};
use lightoctree::{Event, OnEvent};
use lo_session::{Files, OpenScene, Session, SessionError, overlay};

use crate::EventText;
use crate::failure::{Failure, guarded, stage_of};
use crate::opening::{Opened, Source};
use crate::outbox::{Outbox, Pages, tell};
use crate::outside::OutsideRequest;
use crate::protocol::{FromPage, Preset, SceneInfo, ToPage};
use crate::worker::{Change, ProbeRequest, Worker};

/// Most messages that wait to be carried out.
const QUEUE: usize = 256;

/// What the desk hears.
enum Message {
    /// A page says something.
    Page(FromPage, Arc<Outbox>),
    /// A mesh was uploaded, which is to stand in the photo.
    Mesh(Box<UploadedMesh>),
    /// A scene is to be opened.
    Open(Source),
    /// That is done: number of the attempt, and what came of it.
    Opened(u64, Result<Box<Opened>, String>),
}

/// A mesh that a page brings.
pub(crate) struct UploadedMesh {
    /// Its file's name and content.
    pub file: String,
    pub content: Arc<[u8]>,
    /// The files that it names.
    pub parts: Files,
    pub model: Model,
    pub warnings: Vec<String>,
}

/// The desk, as other threads know it.
pub(crate) struct SessionHandle {
    messages: SyncSender<Message>,
    pub pages: Arc<Pages>,
    /// The open scene's pictures.
    current: Mutex<Option<Arc<Worker>>>,
}

impl SessionHandle {
    /// Starts the desk's thread.
    ///
    /// # Errors
    /// Where the system has no threads left.
    pub fn start(text: EventText, can_estimate: bool) -> std::io::Result<Arc<Self>> {
        let (messages, receiver) = sync_channel(QUEUE);
        let handle = Arc::new(Self { messages, pages: Arc::default(), current: Mutex::default() });
        let actor = SessionActor {
            handle: handle.clone(),
            text,
            can_estimate,
            status: Status::Nothing { error: None },
            attempt: 0,
            change: 0,
            sequence: 0,
        };
        handle.pages.tell(&actor.situation(), &[]);
        std::thread::Builder::new().name("session".into()).spawn(move || actor.serve(&receiver))?;
        Ok(handle)
    }

    /// A page came; it is told all that is.
    pub fn join(&self) -> Arc<Outbox> {
        let preset = |name: &'static str| {
            let Material { base_color: [r, g, b, _], metallic, roughness, .. } = Material::preset(name)?;
            Some(Preset { name, base_color: [r, g, b], metallic, roughness })
        };
        let materials = Material::preset_names().filter_map(preset).collect();
        self.pages.join(&ToPage::Hello { version: env!("CARGO_PKG_VERSION"), materials })
    }

    /// A page says something. What a newer message takes the place of is dropped where too much waits.
    pub fn say(&self, message: FromPage, outbox: &Arc<Outbox>) {
        if message.is_passing() {
            match self.messages.try_send(Message::Page(message, outbox.clone())) {
                Ok(()) | Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {}
            }
        } else {
            self.send(Message::Page(message, outbox.clone()));
        }
    }

    /// Opens a scene.
    pub fn open(&self, source: Source) {
        self.send(Message::Open(source));
    }

    /// Stands a mesh into the photo.
    pub fn stand(&self, mesh: UploadedMesh) {
        self.send(Message::Mesh(Box::new(mesh)));
    }

    /// The open scene's pictures.
    pub fn current(&self) -> Option<Arc<Worker>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn send(&self, message: Message) {
        // The thread ends with the program alone.
        let _ = self.messages.send(message);
    }

    fn set_current(&self, work: Option<Arc<Worker>>) {
        let before = std::mem::replace(&mut *self.current.lock().unwrap_or_else(PoisonError::into_inner), work);
        if let Some(before) = before {
            before.end();
        }
    }
}

/// Who sits at the desk.
struct SessionActor {
    handle: Arc<SessionHandle>,
    text: EventText,
    can_estimate: bool,
    status: Status,
    /// Number of the last scene that was to be opened.
    attempt: u64,
    /// Number of the last change.
    change: u64,
    /// Number of the last preview.
    sequence: u64,
}

/// What is open.
enum Status {
    Nothing { error: Option<String> },
    Opening { file: String, stop: Arc<AtomicBool> },
    Scene { session: Box<Session>, work: Arc<Worker>, info: Box<SceneInfo> },
}

impl SessionActor {
    fn serve(mut self, receiver: &Receiver<Message>) {
        while let Ok(first) = receiver.recv() {
            let mut waiting = vec![first];
            waiting.extend(receiver.try_iter().take(QUEUE));
            for index in 0..waiting.len() {
                // Of several previews in a row only the last one is shown.
                let passed = matches!(
                    (&waiting[index], waiting.get(index + 1)),
                    (
                        Message::Page(FromPage::Preview { command, .. }, _),
                        Some(Message::Page(FromPage::Preview { command: next, .. }, _)),
                    ) if std::mem::discriminant(command) == std::mem::discriminant(next)
                ) || matches!(
                    (&waiting[index], waiting.get(index + 1)),
                    (Message::Page(FromPage::Seek { .. }, _), Some(Message::Page(FromPage::Seek { .. }, _)))
                );
                if passed {
                    continue;
                }
                let message = std::mem::replace(&mut waiting[index], Message::Page(FromPage::Stop, Arc::default()));
                if catch_unwind(AssertUnwindSafe(|| self.handle_message(message))).is_err() {
                    self.handle.pages.tell(&ToPage::Refused { why: Failure::Panic.to_string() }, &[]);
                }
            }
        }
    }

    fn handle_message(&mut self, message: Message) {
        match message {
            Message::Page(message, outbox) => self.handle_page(message, &outbox),
            Message::Mesh(mesh) => self.stand(*mesh),
            Message::Open(source) => self.open(source),
            Message::Opened(attempt, opened) => {
                let is_awaited = matches!(self.status, Status::Opening { .. }) && attempt == self.attempt;
                if is_awaited {
                    self.opened(opened);
                }
            }
        }
    }

    fn situation(&self) -> ToPage {
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
                self.handle.pages.tell(&self.situation(), &[]);
                return;
            }
            _ => {}
        }
        let Status::Scene { session, work, .. } = &mut self.status else { return };
        let done = match message {
            FromPage::Command { command } => session.apply(&command),
            FromPage::Preview { command, sequence } => {
                self.sequence = sequence;
                session.preview(&command)
            }
            FromPage::Seek { time_s, sequence } => {
                self.sequence = sequence;
                session.seek(time_s)
            }
            FromPage::StopFilm => {
                work.film.stop();
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
                let usable = lift_m.is_finite() && crate::protocol::EXPOSURES_EV.contains(&exposure_ev);
                if usable {
                    work.look(ProbeRequest { pixel, lift_m: lift_m.clamp(0.0, 10.0), exposure_ev });
                }
                return;
            }
            FromPage::Outside { sequence, view } => {
                match view.check(session.open().up()) {
                    Ok(()) => {
                        work.outside.ask(OutsideRequest { outbox: outbox.clone(), sequence, view, state: work.state() })
                    }
                    Err(error) => tell(outbox, &ToPage::Refused { why: error.to_string() }, &[]),
                }
                return;
            }
            FromPage::Overlay { what } => {
                let open = session.open().clone();
                match guarded(|| overlay(&open, what)) {
                    Ok(made) => {
                        let css = |[r, g, b]: [u8; 3]| format!("rgb({r} {g} {b})");
                        let legend = made.legend.into_iter().map(|(color, text)| (css(color), text)).collect();
                        match lightoctree::imaging::encode_rgba8("overlay.png", &made.image, "lightoctree view") {
                            Ok(png) => tell(outbox, &ToPage::Overlay { what, legend, lengths: [png.len()] }, &[&png]),
                            Err(error) => tell(outbox, &ToPage::Refused { why: error.to_string() }, &[]),
                        }
                    }
                    Err(error) => tell(outbox, &ToPage::Refused { why: error.to_string() }, &[]),
                }
                return;
            }
            FromPage::Stop | FromPage::Close => return,
        };
        match done {
            Ok(()) => self.changed(),
            Err(error) => tell(outbox, &ToPage::Refused { why: error.to_string() }, &[]),
        }
    }

    /// Tells all pages what stands there now, and asks for its picture.
    fn changed(&mut self) {
        let Status::Scene { session, work, .. } = &self.status else { return };
        self.change += 1;
        let (view, state) = (Box::new(session.view()), Arc::new(session.state().clone()));
        // First: who has been told of a change and downloads something, gets it changed.
        work.show(Change { number: self.change, sequence: self.sequence, state });
        self.handle.pages.tell(&ToPage::State { change: self.change, view }, &[]);
    }

    fn stand(&mut self, mesh: UploadedMesh) {
        let UploadedMesh { file, content, parts, model, warnings } = mesh;
        let Status::Scene { session, .. } = &mut self.status else { return };
        let stood = session
            .add_mesh(&file, model, content, parts)
            .and_then(|mesh| session.apply(&lo_session::Command::Add { mesh, pixel: None, material: None }));
        for why in warnings.into_iter().chain(stood.err().map(|error: SessionError| error.to_string())) {
            self.handle.pages.tell(&ToPage::Refused { why }, &[]);
        }
        self.changed();
    }

    fn open(&mut self, source: Source) {
        if let Status::Opening { stop, .. } = &self.status {
            stop.store(true, Ordering::SeqCst);
        }
        self.handle.set_current(None);
        self.attempt += 1;
        let (attempt, file, stop) = (self.attempt, source.file(), Arc::new(AtomicBool::new(false)));
        self.status = Status::Opening { file: file.clone(), stop: stop.clone() };
        self.handle.pages.tell(&self.situation(), &[]);
        let (handle, text) = (self.handle.clone(), self.text);
        let work = move || {
            let mut said = Instant::now();
            let mut last = None;
            let mut hear = |event: Event| {
                let stage = stage_of(&event).cloned();
                if let (Some(done), Some(stage)) = (event.fraction(), stage)
                    && (last.as_ref() != Some(&stage) || said.elapsed() > Duration::from_millis(100))
                {
                    said = Instant::now();
                    let label = (text.stage)(&stage).into_owned();
                    last = Some(stage);
                    handle.pages.tell(&ToPage::Opening { file: file.clone(), stage: label, done: Some(done) }, &[]);
                }
                if stop.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let opened = catch_unwind(AssertUnwindSafe(|| source.open(&text, &mut hear as OnEvent<'_>)));
            let opened = opened.unwrap_or_else(|_| Err("internal error; see the terminal output".to_owned()));
            handle.send(Message::Opened(attempt, opened.map(Box::new)));
        };
        if let Err(error) = std::thread::Builder::new().name("opening".into()).spawn(work) {
            self.status = Status::Nothing { error: Some(error.to_string()) };
            self.handle.pages.tell(&self.situation(), &[]);
        }
    }

    fn opened(&mut self, opened: Result<Box<Opened>, String>) {
        let started = opened.and_then(|opened| {
            let Opened { open, is_saved, notes } = *opened;
            let open: Arc<OpenScene> = Arc::new(open);
            let info = SceneInfo {
                scene: self.attempt,
                file: open.file.clone(),
                is_saved,
                camera: open.estimate().frame.camera,
                up: open.up().to_array(),
                extent: open.extent(),
                predicted_depth: open.estimate().origin.predicted_depth,
                has_panorama: open.estimate().panorama.is_some(),
                notes,
            };
            let session = Session::new(open.clone()).map_err(|error| format!("{}: {error}", open.file))?;
            let change = Change { number: self.change, sequence: 0, state: Arc::new(session.state().clone()) };
            let work = Worker::start(open, change, self.handle.pages.clone(), self.text).map_err(|e| e.to_string())?;
            Ok(Status::Scene { session: Box::new(session), work, info: Box::new(info) })
        });
        match started {
            Ok(at) => {
                if let Status::Scene { work, .. } = &at {
                    self.handle.set_current(Some(work.clone()));
                }
                self.status = at;
                self.handle.pages.tell(&self.situation(), &[]);
                self.changed();
            }
            Err(error) => {
                self.status = Status::Nothing { error: Some(error) };
                self.handle.pages.tell(&self.situation(), &[]);
            }
        }
    }
}
