//! The threads that make pictures of one open scene: of what moves, of what rests, of the light at a place, of the room from outside. The newest request of
//! each kind wins.

use std::ops::ControlFlow;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use lightoctree::imaging;
use lightoctree::insert::Composite;
use lightoctree::{Event, Warning};
use lo_session::{LitScenes, OpenScene, Part, Probe, Renderer, SessionError, State, Step, outputs, probe_place};

use crate::EventText;
use crate::failure::{Failure, guarded, stage_of};
use crate::film::Film;
use crate::outbox::Pages;
use crate::outside::OutsideQueue;
use crate::protocol::{MOVING_QUALITY, ToPage};

/// Nothing changes for this long: it rests.
const REST: Duration = Duration::from_millis(150);

/// Height of a probe's panorama, pixels.
const PROBE_HEIGHT: usize = 96;

/// A state to make pictures of.
#[derive(Clone)]
pub(crate) struct Change {
    /// Its number.
    pub number: u64,
    /// The last preview's number that went into it.
    pub sequence: u64,
    pub state: Arc<State>,
}

/// A place whose light is asked for.
#[derive(Clone, Copy)]
pub(crate) struct ProbeRequest {
    pub pixel: [f64; 2],
    pub lift_m: f32,
    pub exposure_ev: f32,
}

/// What the threads share.
pub(crate) struct Worker {
    pub scenes: Arc<LitScenes>,
    /// Who looks at the room from outside.
    pub outside: OutsideQueue,
    /// What is being taken away frame by frame.
    pub film: Film,
    pub pages: Arc<Pages>,
    text: EventText,
    wanted: Mutex<Wanted>,
    changed: Condvar,
}

struct Wanted {
    change: Change,
    since: Instant,
    /// Number of the change whose moving picture is out, or failed.
    moved: u64,
    /// The picture of `insert --quality high`, and of which change.
    last: Option<(u64, Arc<Composite>)>,
    /// Why there is none.
    failed: Option<(u64, String)>,
    place: Option<ProbeRequest>,
    is_over: bool,
}

impl Worker {
    /// Starts the threads.
    ///
    /// # Errors
    /// Where the system has no threads left.
    pub fn start(
        open: Arc<OpenScene>,
        change: Change,
        pages: Arc<Pages>,
        text: EventText,
    ) -> std::io::Result<Arc<Self>> {
        let (moved, since) = (change.number, Instant::now());
        let wanted = Wanted { change, since, moved, last: None, failed: None, place: None, is_over: false };
        let work = Arc::new(Self {
            scenes: Arc::new(LitScenes::new(open)),
            outside: OutsideQueue::default(),
            film: Film::default(),
            pages,
            text,
            wanted: Mutex::new(wanted),
            changed: Condvar::new(),
        });
        // Each has a pool of its own: what moves must not wait for the tasks of what rests.
        let threads = rayon::current_num_threads();
        for (name, threads, run) in [
            ("moving", threads, Self::moving as fn(&Self)),
            ("resting", threads, Self::resting),
            ("probe", threads.div_ceil(2), Self::probing),
            ("outside", threads, |work| work.outside.serve(&work.scenes)),
        ] {
            let work = work.clone();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(std::io::Error::other)?;
            std::thread::Builder::new().name(name.into()).spawn(move || pool.install(|| run(&work)))?;
        }
        Ok(work)
    }

    fn lock(&self) -> MutexGuard<'_, Wanted> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Another state is to be shown.
    pub fn show(&self, change: Change) {
        let mut wanted = self.lock();
        wanted.change = change;
        wanted.since = Instant::now();
        self.changed.notify_all();
    }

    /// The light of another place is to be shown.
    pub fn look(&self, place: ProbeRequest) {
        self.lock().place = Some(place);
        self.changed.notify_all();
    }

    /// Ends the threads.
    pub fn end(&self) {
        self.film.stop();
        self.lock().is_over = true;
        self.changed.notify_all();
        self.outside.end();
    }

    /// The state that is shown.
    pub fn state(&self) -> Arc<State> {
        self.lock().change.state.clone()
    }

    /// The final picture of the state at hand, once it is there.
    ///
    /// # Errors
    /// Where it cannot be made, or the state changes before.
    pub fn last(&self) -> Result<Arc<Composite>, String> {
        let mut wanted = self.lock();
        let number = wanted.change.number;
        if wanted.change.state.objects.is_empty() {
            return Err(SessionError::NoObjects.to_string());
        }
        loop {
            if wanted.is_over || wanted.change.number != number {
                return Err("the picture changed before it was finished".to_owned());
            }
            match (&wanted.last, &wanted.failed) {
                (Some((of, picture)), _) if *of == number => return Ok(picture.clone()),
                (_, Some((of, why))) if *of == number => return Err(why.clone()),
                _ => wanted = self.changed.wait(wanted).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }

    fn moving(&self) {
        let mut renderer = Renderer::new(self.scenes.clone());
        let mut is_ready = false;
        loop {
            let change = {
                let mut wanted = self.lock();
                while !wanted.is_over && wanted.moved == wanted.change.number {
                    wanted = self.changed.wait(wanted).unwrap_or_else(PoisonError::into_inner);
                }
                if wanted.is_over {
                    return;
                }
                wanted.change.clone()
            };
            // Not before the first change: pages have heard of the scene then.
            if !is_ready
                && let Ok(bytes) =
                    imaging::encode_srgb8("photo.jpg", renderer.photo(), MOVING_QUALITY, "lightoctree view")
            {
                self.pages.tell(&ToPage::Photo { lengths: [bytes.len()] }, &[&bytes]);
            }
            let begun = Instant::now();
            // Never broken off: something newer would be broken off, too.
            match guarded(|| renderer.moving(&change.state, &mut lightoctree::events::ignore)) {
                Ok(part) => self.send_moving(&change, &part, begun),
                Err(Failure::Session(SessionError::NoObjects)) => self.send_photo(&change, begun),
                // Who rests says why.
                Err(_) => {}
            }
            self.lock().moved = change.number;
            self.changed.notify_all();
            // The photo is out: what the first movement would wait for is made ready now.
            if !is_ready {
                let _ = guarded(|| renderer.prepare(&change.state, Step::Moving));
                is_ready = true;
            }
        }
    }

    fn resting(&self) {
        let mut renderer = Renderer::new(self.scenes.clone());
        let mut done = 0;
        loop {
            let change = {
                let mut wanted = self.lock();
                loop {
                    if wanted.is_over {
                        return;
                    }
                    let number = wanted.change.number;
                    let rested = wanted.since.elapsed();
                    if number == done || wanted.moved != number {
                        wanted = self.changed.wait(wanted).unwrap_or_else(PoisonError::into_inner);
                    } else if rested < REST {
                        let (next, _) =
                            self.changed.wait_timeout(wanted, REST - rested).unwrap_or_else(PoisonError::into_inner);
                        wanted = next;
                    } else {
                        break wanted.change.clone();
                    }
                }
            };
            done = change.number;
            if !change.state.objects.is_empty() {
                self.refine(&mut renderer, &change);
            }
        }
    }

    /// The pictures of something that rests, until something newer is wanted.
    fn refine(&self, renderer: &mut Renderer, change: &Change) {
        for step in [Step::Resting, Step::Final] {
            let begun = Instant::now();
            let mut warnings: Vec<Warning> = Vec::new();
            let mut said = Instant::now();
            let hear = &mut |event: Event| {
                if let (Some(done), Some(stage)) = (event.fraction(), stage_of(&event))
                    && said.elapsed() > Duration::from_millis(100)
                {
                    said = Instant::now();
                    let stage = (self.text.stage)(stage).into_owned();
                    self.pages.tell(&ToPage::Progress { change: change.number, step, stage, done }, &[]);
                }
                if let Event::Warning(warning) = event {
                    warnings.push(warning);
                }
                let wanted = self.lock();
                if wanted.is_over || wanted.change.number != change.number {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            };
            match guarded(|| renderer.render(&change.state, step, hear)) {
                Ok(composite) => {
                    self.send(change, step, &composite, begun);
                    let names: Vec<String> = change.state.objects.iter().map(|object| object.name.clone()).collect();
                    let notes = warnings.iter().map(|warning| (self.text.warning)(warning, &names)).collect();
                    self.pages.tell(&ToPage::Notes { change: change.number, notes }, &[]);
                    if step == Step::Final {
                        self.lock().last = Some((change.number, Arc::new(composite)));
                        self.changed.notify_all();
                    }
                }
                Err(Failure::Session(error)) if error.is_cancelled() => return,
                Err(error) => {
                    let why = error.to_string();
                    self.pages.tell(&ToPage::Refused { why: why.clone() }, &[]);
                    self.lock().failed = Some((change.number, why));
                    self.changed.notify_all();
                    return;
                }
            }
        }
    }

    fn send(&self, change: &Change, step: Step, composite: &Composite, begun: Instant) {
        match outputs::picture(composite) {
            Ok(bytes) => self.tell_frame(change, step, "image/png", None, &bytes, begun),
            Err(error) => self.pages.tell(&ToPage::Refused { why: error.to_string() }, &[]),
        }
    }

    fn send_moving(&self, change: &Change, part: &Part, begun: Instant) {
        match imaging::encode_srgb8("part.jpg", &part.image, MOVING_QUALITY, "lightoctree view") {
            Ok(bytes) => self.tell_frame(change, Step::Moving, "image/jpeg", Some(part.at), &bytes, begun),
            Err(error) => self.pages.tell(&ToPage::Refused { why: error.to_string() }, &[]),
        }
    }

    /// Without objects the picture is the photo.
    fn send_photo(&self, change: &Change, begun: Instant) {
        let photo = &self.scenes.open().estimate().frame.photo;
        if let Ok(bytes) = imaging::encode_photo("photo.jpg", photo, "lightoctree view") {
            self.tell_frame(change, Step::Final, "image/jpeg", None, &bytes, begun);
        }
    }

    fn tell_frame(
        &self,
        change: &Change,
        step: Step,
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
        self.pages.tell(&frame, &[bytes]);
    }

    fn probing(&self) {
        let mut probe = Probe::new(self.scenes.clone());
        loop {
            let (place, state) = {
                let mut wanted = self.lock();
                let place = loop {
                    if wanted.is_over {
                        return;
                    }
                    if let Some(place) = wanted.place.take() {
                        break place;
                    }
                    wanted = self.changed.wait(wanted).unwrap_or_else(PoisonError::into_inner);
                };
                (place, wanted.change.state.clone())
            };
            let Some(at) = probe_place(self.scenes.open(), place.pixel, place.lift_m) else {
                self.pages.tell(&ToPage::NoProbe, &[]);
                continue;
            };
            match guarded(|| probe.pictures(&state, at, PROBE_HEIGHT, place.exposure_ev)) {
                Ok(pictures) => {
                    let pictures =
                        [pictures.panorama, pictures.ball, pictures.origins].map(|p| imaging::encode_png(&p));
                    let lengths = [0, 1, 2].map(|i| pictures[i].len());
                    let message = ToPage::Probe { pixel: place.pixel, at_m: at.to_array(), lengths };
                    self.pages.tell(&message, &[&pictures[0], &pictures[1], &pictures[2]]);
                }
                Err(error) => self.pages.tell(&ToPage::Refused { why: error.to_string() }, &[]),
            }
        }
    }
}
