//! Rendering threads of one open scene: drafts, refined images, probes and the room from outside. The newest request of
//! each kind wins.

use std::ops::ControlFlow;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use lightoctree::{Event, Warning};
use lo_imaging as imaging;
use lo_insert::Composite;
use lo_session::{
    ImagePatch, LitSceneCache, OpenScene, Overlay, Probe, RenderStep, Renderer, SessionError, State, outputs,
    probe_position,
};

use crate::failure::{Failure, guarded, stage_of};
use crate::outbox::Pages;
use crate::outside::{self, OutsideRequest};
use crate::overlays;
use crate::page_queue::PageQueue;
use crate::protocol::{DRAFT_JPEG_QUALITY, ToPage};
use crate::sequence_download::SequenceDownload;
use crate::warning_text::WarningText;

/// Refinement starts after this time without a change.
const REFINE_DELAY: Duration = Duration::from_millis(150);

/// Height of a probe's panorama, pixels.
const PROBE_HEIGHT: usize = 96;

/// A state to render.
#[derive(Clone)]
pub(crate) struct Change {
    /// Number of the change.
    pub number: u64,
    /// Number of the last preview that it includes.
    pub sequence: u64,
    /// The state to render, without hidden objects.
    pub state: Arc<State>,
    /// The state with hidden objects, as scene files have it.
    pub document: Arc<State>,
}

/// A request for the light at a point.
#[derive(Clone, Copy)]
pub(crate) struct ProbeRequest {
    pub pixel: [f64; 2],
    pub lift_m: f32,
    pub exposure_ev: f32,
}

/// State shared by the rendering threads.
pub(crate) struct Worker {
    pub scenes: Arc<LitSceneCache>,
    /// Requests for images of the room from outside.
    pub outside: PageQueue<OutsideRequest>,
    /// Requests for overlays.
    pub overlays: PageQueue<Overlay>,
    /// The running sequence download.
    pub sequence_download: SequenceDownload,
    pub pages: Arc<Pages>,
    warning_text: WarningText,
    state: Mutex<WorkerState>,
    changed: Condvar,
}

struct WorkerState {
    change: Change,
    since: Instant,
    /// Number of the last change whose draft was sent or failed.
    drafted: u64,
    /// Final image, and the number of its change.
    finished: Option<(u64, Arc<Composite>)>,
    /// Error, and the number of the change that could not be rendered.
    failed: Option<(u64, String)>,
    probe: Option<ProbeRequest>,
    is_over: bool,
}

impl Worker {
    /// Starts the threads.
    ///
    /// # Errors
    /// If a thread cannot be started.
    pub fn start(
        scene: Arc<OpenScene>,
        change: Change,
        pages: Arc<Pages>,
        warning_text: WarningText,
    ) -> std::io::Result<Arc<Self>> {
        let (drafted, since) = (change.number, Instant::now());
        let state = WorkerState { change, since, drafted, finished: None, failed: None, probe: None, is_over: false };
        let worker = Arc::new(Self {
            scenes: Arc::new(LitSceneCache::new(scene)),
            outside: PageQueue::default(),
            overlays: PageQueue::default(),
            sequence_download: SequenceDownload::default(),
            pages,
            warning_text,
            state: Mutex::new(state),
            changed: Condvar::new(),
        });
        // One pool per thread: drafts must not wait for tasks of the refinement.
        let threads = rayon::current_num_threads();
        for (name, threads, run) in [
            ("draft", threads, Self::run_drafts as fn(&Self)),
            ("refine", threads, Self::run_refinement),
            ("probe", threads.div_ceil(2), Self::run_probes),
            ("outside", threads, |worker| outside::serve(&worker.outside, &worker.scenes)),
            ("overlay", threads.div_ceil(2), |worker| overlays::serve(&worker.overlays, worker.scenes.scene())),
        ] {
            let worker = worker.clone();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(std::io::Error::other)?;
            std::thread::Builder::new().name(name.into()).spawn(move || pool.install(|| run(&worker)))?;
        }
        Ok(worker)
    }

    fn lock(&self) -> MutexGuard<'_, WorkerState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the state to render.
    pub fn set_change(&self, change: Change) {
        let mut shared = self.lock();
        shared.change = change;
        shared.since = Instant::now();
        self.changed.notify_all();
    }

    /// Requests the light at another point.
    pub fn request_probe(&self, probe: ProbeRequest) {
        self.lock().probe = Some(probe);
        self.changed.notify_all();
    }

    /// Ends the threads.
    pub fn end(&self) {
        self.sequence_download.stop();
        self.lock().is_over = true;
        self.changed.notify_all();
        self.outside.end();
        self.overlays.end();
    }

    /// Returns the current state.
    pub fn state(&self) -> Arc<State> {
        self.lock().change.state.clone()
    }

    /// Returns the current change.
    pub fn change(&self) -> Change {
        self.lock().change.clone()
    }

    /// Returns the last final image, which may be that of an earlier change.
    pub fn last_image(&self) -> Option<Arc<Composite>> {
        self.lock().finished.as_ref().map(|(_, image)| image.clone())
    }

    /// Waits for the final image of the current state.
    ///
    /// # Errors
    /// If it cannot be rendered, or the state changes before.
    pub fn final_composite(&self) -> Result<Arc<Composite>, String> {
        let mut shared = self.lock();
        let number = shared.change.number;
        if shared.change.state.objects.is_empty() {
            return Err(SessionError::NoObjects.to_string());
        }
        loop {
            if shared.is_over || shared.change.number != number {
                return Err("the scene changed before the image was finished".to_owned());
            }
            match (&shared.finished, &shared.failed) {
                (Some((of, image)), _) if *of == number => return Ok(image.clone()),
                (_, Some((of, why))) if *of == number => return Err(why.clone()),
                _ => shared = self.changed.wait(shared).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }

    fn run_drafts(&self) {
        let mut renderer = Renderer::new(self.scenes.clone());
        let mut is_ready = false;
        loop {
            let change = {
                let mut shared = self.lock();
                while !shared.is_over && shared.drafted == shared.change.number {
                    shared = self.changed.wait(shared).unwrap_or_else(PoisonError::into_inner);
                }
                if shared.is_over {
                    return;
                }
                shared.change.clone()
            };
            // After the first change, when the pages know of the scene.
            if !is_ready
                && let Ok(bytes) =
                    imaging::encode_srgb8("photo.jpg", renderer.photo(), DRAFT_JPEG_QUALITY, "lightoctree view")
            {
                self.pages.send(&ToPage::Photo { lengths: [bytes.len()] }, &[&bytes]);
            }
            let begun = Instant::now();
            // Never cancelled: during a movement, no draft would ever finish.
            match guarded(|| renderer.draft(&change.state, &mut lo_events::ignore)) {
                Ok(patch) => self.send_draft(&change, &patch, begun),
                Err(Failure::Session(SessionError::NoObjects)) => self.send_photo(&change, begun),
                // The refinement reports the error.
                Err(_) => {}
            }
            self.lock().drafted = change.number;
            self.changed.notify_all();
            // The photo is sent: prepare what the first movement would wait for.
            if !is_ready {
                let _ = guarded(|| renderer.prepare(&change.state, RenderStep::Moving));
                is_ready = true;
            }
        }
    }

    fn run_refinement(&self) {
        let mut renderer = Renderer::new(self.scenes.clone());
        let mut done = 0;
        loop {
            let change = {
                let mut shared = self.lock();
                loop {
                    if shared.is_over {
                        return;
                    }
                    let number = shared.change.number;
                    let rested = shared.since.elapsed();
                    if number == done || shared.drafted != number {
                        shared = self.changed.wait(shared).unwrap_or_else(PoisonError::into_inner);
                    } else if rested < REFINE_DELAY {
                        let (next, _) = self
                            .changed
                            .wait_timeout(shared, REFINE_DELAY - rested)
                            .unwrap_or_else(PoisonError::into_inner);
                        shared = next;
                    } else {
                        break shared.change.clone();
                    }
                }
            };
            done = change.number;
            if !change.state.objects.is_empty() {
                self.refine(&mut renderer, &change);
            }
        }
    }

    /// Renders the refined images of a change, until a newer one arrives.
    fn refine(&self, renderer: &mut Renderer, change: &Change) {
        for step in [RenderStep::Resting, RenderStep::Final] {
            let begun = Instant::now();
            let mut warnings: Vec<Arc<dyn Warning>> = Vec::new();
            let mut sent = Instant::now();
            let on_event = &mut |event: Event| {
                if let (Some(done), Some(stage)) = (event.fraction(), stage_of(&event))
                    && sent.elapsed() > Duration::from_millis(100)
                {
                    sent = Instant::now();
                    let stage = stage.name().to_owned();
                    self.pages.send(&ToPage::Progress { change: change.number, step, stage, done }, &[]);
                }
                if let Event::Warning(warning) = event {
                    warnings.push(warning);
                }
                let shared = self.lock();
                if shared.is_over || shared.change.number != change.number {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            };
            match guarded(|| renderer.render(&change.state, step, on_event)) {
                Ok(composite) => {
                    self.send_image(change, step, &composite, begun);
                    let names: Vec<String> = change.state.objects.iter().map(|object| object.name.clone()).collect();
                    let notes = warnings.iter().map(|warning| (self.warning_text)(&**warning, &names)).collect();
                    self.pages.send(&ToPage::Notes { change: change.number, notes }, &[]);
                    if step == RenderStep::Final {
                        self.lock().finished = Some((change.number, Arc::new(composite)));
                        self.changed.notify_all();
                    }
                }
                Err(Failure::Session(error)) if error.is_cancelled() => return,
                Err(error) => {
                    let why = error.to_string();
                    self.pages.send(&ToPage::Refused { why: why.clone() }, &[]);
                    self.lock().failed = Some((change.number, why));
                    self.changed.notify_all();
                    return;
                }
            }
        }
    }

    fn send_image(&self, change: &Change, step: RenderStep, composite: &Composite, begun: Instant) {
        match outputs::image(composite) {
            Ok(bytes) => self.send_frame(change, step, "image/png", None, &bytes, begun),
            Err(error) => self.pages.send(&ToPage::Refused { why: error.to_string() }, &[]),
        }
    }

    fn send_draft(&self, change: &Change, patch: &ImagePatch, begun: Instant) {
        match imaging::encode_srgb8("patch.jpg", &patch.image, DRAFT_JPEG_QUALITY, "lightoctree view") {
            Ok(bytes) => self.send_frame(change, RenderStep::Moving, "image/jpeg", Some(patch.at), &bytes, begun),
            Err(error) => self.pages.send(&ToPage::Refused { why: error.to_string() }, &[]),
        }
    }

    /// Sends the photo as the final image of a state without objects.
    fn send_photo(&self, change: &Change, begun: Instant) {
        let photo = &self.scenes.scene().estimate().frame.photo;
        if let Ok(bytes) = imaging::encode_photo("photo.jpg", photo, "lightoctree view") {
            self.send_frame(change, RenderStep::Final, "image/jpeg", None, &bytes, begun);
        }
    }

    fn send_frame(
        &self,
        change: &Change,
        step: RenderStep,
        mime: &'static str,
        at: Option<[usize; 2]>,
        bytes: &[u8],
        begun: Instant,
    ) {
        let frame = ToPage::Frame {
            change: change.number,
            sequence: change.sequence,
            step,
            mime,
            at,
            lengths: [bytes.len()],
            took_ms: 1e3 * begun.elapsed().as_secs_f64(),
        };
        self.pages.send(&frame, &[bytes]);
    }

    fn run_probes(&self) {
        let mut probe = Probe::new(self.scenes.clone());
        loop {
            let (request, state) = {
                let mut shared = self.lock();
                let request = loop {
                    if shared.is_over {
                        return;
                    }
                    if let Some(request) = shared.probe.take() {
                        break request;
                    }
                    shared = self.changed.wait(shared).unwrap_or_else(PoisonError::into_inner);
                };
                (request, shared.change.state.clone())
            };
            let Some(at) = probe_position(self.scenes.scene(), request.pixel, request.lift_m) else {
                self.pages.send(&ToPage::NoProbe, &[]);
                continue;
            };
            match guarded(|| probe.images(&state, at, PROBE_HEIGHT, request.exposure_ev)) {
                Ok(images) => {
                    let images =
                        [images.panorama, images.ball, images.provenance].map(|image| imaging::encode_png(&image));
                    let lengths = [0, 1, 2].map(|i| images[i].len());
                    let message = ToPage::Probe { pixel: request.pixel, at_m: at.to_array(), lengths };
                    self.pages.send(&message, &[&images[0], &images[1], &images[2]]);
                }
                Err(error) => self.pages.send(&ToPage::Refused { why: error.to_string() }, &[]),
            }
        }
    }
}
