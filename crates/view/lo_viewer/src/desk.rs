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

use crate::Words;
use crate::opening::{Opened, Source};
use crate::outbox::{Outbox, Pages, tell};
use crate::outside::Look;
use crate::protocol::{FromPage, Preset, SceneInfo, ToPage};
use crate::work::{Change, Place, Work, guarded, stage_of};

/// Most messages that wait to be carried out.
const QUEUE: usize = 256;

/// What the desk hears.
enum Heard {
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
pub(crate) struct Desk {
    heard: SyncSender<Heard>,
    pub pages: Arc<Pages>,
    /// The open scene's pictures.
    current: Mutex<Option<Arc<Work>>>,
}

impl Desk {
    /// Starts the desk's thread.
    ///
    /// # Errors
    /// Where the system has no threads left.
    pub fn start(words: Words, can_estimate: bool) -> std::io::Result<Arc<Self>> {
        let (heard, hears) = sync_channel(QUEUE);
        let desk = Arc::new(Self { heard, pages: Arc::default(), current: Mutex::default() });
        let clerk = Clerk {
            desk: desk.clone(),
            words,
            can_estimate,
            at: At::Nothing { error: None },
            attempt: 0,
            change: 0,
            sequence: 0,
        };
        desk.pages.tell(&clerk.situation(), &[]);
        std::thread::Builder::new().name("desk".into()).spawn(move || clerk.serve(&hears))?;
        Ok(desk)
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
            match self.heard.try_send(Heard::Page(message, outbox.clone())) {
                Ok(()) | Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {}
            }
        } else {
            self.hear(Heard::Page(message, outbox.clone()));
        }
    }

    /// Opens a scene.
    pub fn open(&self, source: Source) {
        self.hear(Heard::Open(source));
    }

    /// Stands a mesh into the photo.
    pub fn stand(&self, mesh: UploadedMesh) {
        self.hear(Heard::Mesh(Box::new(mesh)));
    }

    /// The open scene's pictures.
    pub fn current(&self) -> Option<Arc<Work>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn hear(&self, heard: Heard) {
        // The thread ends with the program alone.
        let _ = self.heard.send(heard);
    }

    fn set_current(&self, work: Option<Arc<Work>>) {
        let before = std::mem::replace(&mut *self.current.lock().unwrap_or_else(PoisonError::into_inner), work);
        if let Some(before) = before {
            before.end();
        }
    }
}

/// Who sits at the desk.
struct Clerk {
    desk: Arc<Desk>,
    words: Words,
    can_estimate: bool,
    at: At,
    /// Number of the last scene that was to be opened.
    attempt: u64,
    /// Number of the last change.
    change: u64,
    /// Number of the last preview.
    sequence: u64,
}

/// What is open.
enum At {
    Nothing { error: Option<String> },
    Opening { file: String, stop: Arc<AtomicBool> },
    Scene { session: Box<Session>, work: Arc<Work>, info: Box<SceneInfo> },
}

impl Clerk {
    fn serve(mut self, hears: &Receiver<Heard>) {
        while let Ok(first) = hears.recv() {
            let mut waiting = vec![first];
            waiting.extend(hears.try_iter().take(QUEUE));
            for index in 0..waiting.len() {
                // Of several previews in a row only the last one is shown.
                let passed = matches!(
                    (&waiting[index], waiting.get(index + 1)),
                    (
                        Heard::Page(FromPage::Preview { command, .. }, _),
                        Some(Heard::Page(FromPage::Preview { command: next, .. }, _)),
                    ) if std::mem::discriminant(command) == std::mem::discriminant(next)
                ) || matches!(
                    (&waiting[index], waiting.get(index + 1)),
                    (Heard::Page(FromPage::Seek { .. }, _), Some(Heard::Page(FromPage::Seek { .. }, _)))
                );
                if passed {
                    continue;
                }
                let heard = std::mem::replace(&mut waiting[index], Heard::Page(FromPage::Stop, Arc::default()));
                if catch_unwind(AssertUnwindSafe(|| self.do_heard(heard))).is_err() {
                    let why = "this failed by a fault of the program; what the terminal says of it helps to mend it";
                    self.desk.pages.tell(&ToPage::Refused { why: why.into() }, &[]);
                }
            }
        }
    }

    fn do_heard(&mut self, heard: Heard) {
        match heard {
            Heard::Page(message, outbox) => self.do_message(message, &outbox),
            Heard::Mesh(mesh) => self.stand(*mesh),
            Heard::Open(source) => self.open(source),
            Heard::Opened(attempt, opened) => {
                let is_awaited = matches!(self.at, At::Opening { .. }) && attempt == self.attempt;
                if is_awaited {
                    self.opened(opened);
                }
            }
        }
    }

    fn situation(&self) -> ToPage {
        match &self.at {
            At::Nothing { error } => ToPage::Empty { error: error.clone(), can_estimate: self.can_estimate },
            At::Opening { file, .. } => ToPage::Opening { file: file.clone(), stage: String::new(), done: None },
            At::Scene { info, .. } => ToPage::Scene((**info).clone()),
        }
    }

    fn do_message(&mut self, message: FromPage, outbox: &Arc<Outbox>) {
        match message {
            FromPage::Stop => {
                if let At::Opening { stop, .. } = &self.at {
                    stop.store(true, Ordering::SeqCst);
                }
                return;
            }
            FromPage::Close => {
                self.desk.set_current(None);
                self.at = At::Nothing { error: None };
                self.desk.pages.tell(&self.situation(), &[]);
                return;
            }
            _ => {}
        }
        let At::Scene { session, work, .. } = &mut self.at else { return };
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
                    work.look(Place { pixel, lift_m: lift_m.clamp(0.0, 10.0), exposure_ev });
                }
                return;
            }
            FromPage::Outside { sequence, view } => {
                match view.check(session.open().up()) {
                    Ok(()) => work.outside.ask(Look { outbox: outbox.clone(), sequence, view, state: work.state() }),
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
        let At::Scene { session, work, .. } = &self.at else { return };
        self.change += 1;
        let (view, state) = (Box::new(session.view()), Arc::new(session.state().clone()));
        // First: who has been told of a change and downloads something, gets it changed.
        work.show(Change { number: self.change, sequence: self.sequence, state });
        self.desk.pages.tell(&ToPage::State { change: self.change, view }, &[]);
    }

    fn stand(&mut self, mesh: UploadedMesh) {
        let UploadedMesh { file, content, parts, model, warnings } = mesh;
        let At::Scene { session, .. } = &mut self.at else { return };
        let stood = session
            .add_mesh(&file, model, content, parts)
            .and_then(|mesh| session.apply(&lo_session::Command::Add { mesh, pixel: None, material: None }));
        for why in warnings.into_iter().chain(stood.err().map(|error: SessionError| error.to_string())) {
            self.desk.pages.tell(&ToPage::Refused { why }, &[]);
        }
        self.changed();
    }

    fn open(&mut self, source: Source) {
        if let At::Opening { stop, .. } = &self.at {
            stop.store(true, Ordering::SeqCst);
        }
        self.desk.set_current(None);
        self.attempt += 1;
        let (attempt, file, stop) = (self.attempt, source.file(), Arc::new(AtomicBool::new(false)));
        self.at = At::Opening { file: file.clone(), stop: stop.clone() };
        self.desk.pages.tell(&self.situation(), &[]);
        let (desk, words) = (self.desk.clone(), self.words);
        let work = move || {
            let mut said = Instant::now();
            let mut last = None;
            let mut hear = |event: Event| {
                let stage = stage_of(&event).cloned();
                if let (Some(done), Some(stage)) = (event.fraction(), stage)
                    && (last.as_ref() != Some(&stage) || said.elapsed() > Duration::from_millis(100))
                {
                    said = Instant::now();
                    let text = (words.stage)(&stage).into_owned();
                    last = Some(stage);
                    desk.pages.tell(&ToPage::Opening { file: file.clone(), stage: text, done: Some(done) }, &[]);
                }
                if stop.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let opened = catch_unwind(AssertUnwindSafe(|| source.open(&words, &mut hear as OnEvent<'_>)));
            let opened = opened.unwrap_or_else(|_| Err("it could not be opened by a fault of the program".to_owned()));
            desk.hear(Heard::Opened(attempt, opened.map(Box::new)));
        };
        if let Err(error) = std::thread::Builder::new().name("opening".into()).spawn(work) {
            self.at = At::Nothing { error: Some(error.to_string()) };
            self.desk.pages.tell(&self.situation(), &[]);
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
                camera: open.scene.frame.camera,
                up: open.up().to_array(),
                extent: open.extent(),
                predicted_depth: open.scene.predicted_depth,
                has_panorama: open.scene.panorama.is_some(),
                notes,
            };
            let session = Session::new(open.clone()).map_err(|error| format!("{}: {error}", open.file))?;
            let change = Change { number: self.change, sequence: 0, state: Arc::new(session.state().clone()) };
            let work = Work::start(open, change, self.desk.pages.clone(), self.words).map_err(|e| e.to_string())?;
            Ok(At::Scene { session: Box::new(session), work, info: Box::new(info) })
        });
        match started {
            Ok(at) => {
                if let At::Scene { work, .. } = &at {
                    self.desk.set_current(Some(work.clone()));
                }
                self.at = at;
                self.desk.pages.tell(&self.situation(), &[]);
                self.changed();
            }
            Err(error) => {
                self.at = At::Nothing { error: Some(error) };
                self.desk.pages.tell(&self.situation(), &[]);
            }
        }
    }
}
