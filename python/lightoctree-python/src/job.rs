//! Jobs on threads of their own, while the calling thread of the interpreter reports events and handles signals.

use std::any::Any;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

use lightoctree::Event;
use lightoctree::events::{Figure, InsertWarning};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::errors::{Failure, of_class};
use crate::listener::Listener;

/// Interval at which the calling thread looks for signals, and the longest delay of a Ctrl-C.
const POLL: Duration = Duration::from_millis(20);

/// Stack of a job's thread: that of a program's main thread.
const STACK_BYTES: usize = 8 << 20;

/// An event as plain values.
pub enum Report {
    /// A stage has begun.
    Begun { stage: String },
    /// Steps of a stage are done.
    Progress { stage: String, done: u64, total: u64 },
    /// A stage is done.
    Done { stage: String, took: Duration },
    /// Measured values of a stage.
    Figures { stage: String, figures: Vec<Figure> },
    /// A problem or an assumption.
    Warning { message: String },
}

/// Sends a job's events to the thread that waits for it.
pub struct Reporter {
    send: Box<dyn FnMut(Report) + Send>,
    is_cancelled: Arc<AtomicBool>,
    /// Names of the inserted objects, for warnings.
    objects: Vec<String>,
}

impl Reporter {
    /// Sets the names of the inserted objects; warnings use them if there are several.
    pub fn name_objects(&mut self, names: Vec<String>) {
        self.objects = names;
    }

    /// Handles an event of the library. Returns `Break` once the calling thread has left.
    pub fn handle(&mut self, event: Event) -> ControlFlow<()> {
        let report = match event {
            Event::Begun(stage) => Some(Report::Begun { stage: stage.name().to_owned() }),
            Event::Progress { stage, done, total } => {
                Some(Report::Progress { stage: stage.name().to_owned(), done, total })
            }
            Event::Done { stage, took } => Some(Report::Done { stage: stage.name().to_owned(), took }),
            Event::Figures { stage, figures } => Some(Report::Figures { stage: stage.name().to_owned(), figures }),
            Event::Warning(warning) => Some(Report::Warning {
                message: match warning.downcast_ref::<InsertWarning>() {
                    Some(warning) => warning.with_names(&self.objects).to_string(),
                    None => warning.to_string(),
                },
            }),
            _ => None,
        };
        report.into_iter().for_each(&mut self.send);
        if self.is_cancelled.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Reports a warning that is not an event of the library.
    pub fn warn(&mut self, message: impl ToString) {
        (self.send)(Report::Warning { message: message.to_string() });
    }
}

enum Message<T> {
    Report(Report),
    Done(Result<T, Failure>),
    Panicked(String),
}

/// Receiver of a job's events.
pub enum Handler<'a, 'py> {
    /// Nothing.
    Silent,
    /// Progress bars, where someone sees them.
    Bars,
    /// The user's function.
    Function(&'a Bound<'py, PyAny>),
}

impl<'a, 'py> Handler<'a, 'py> {
    /// Returns the user's function, or progress bars.
    pub fn new(on_event: Option<&'a Bound<'py, PyAny>>) -> Self {
        on_event.map_or(Self::Bars, Self::Function)
    }
}

/// Runs work on a thread of its own, passes its events to a handler and returns its result.
///
/// The interpreter is free meanwhile. If a signal handler or the event handler raises an exception, the function
/// returns at once, and the work ends at its next event.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    handler: Handler<'_, '_>,
    work: impl FnOnce(&mut Reporter) -> Result<T, Failure> + Send + 'static,
) -> PyResult<T> {
    check_process()?;
    let mut listener = Listener::new(py, &handler)?;
    let is_cancelled = CancelOnDrop(Arc::default());
    let (sender, mut receiver) = mpsc::channel();
    start(sender, is_cancelled.0.clone(), work)?;
    loop {
        let message;
        // A receiver cannot be shared with another thread, but moved there and back.
        (receiver, message) = py.detach(move || {
            let message = receiver.recv_timeout(POLL);
            (receiver, message)
        });
        match message {
            Ok(Message::Report(report)) => listener.receive(&report)?,
            Ok(Message::Done(result)) => return result.map_err(|failure| failure.raise(py)),
            Ok(Message::Panicked(text)) => return Err(of_class(py, "LightOctreeError", text)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(PyRuntimeError::new_err("the job ended without result")),
        }
        py.check_signals()?;
    }
}

fn start<T: Send + 'static>(
    sender: Sender<Message<T>>,
    is_cancelled: Arc<AtomicBool>,
    work: impl FnOnce(&mut Reporter) -> Result<T, Failure> + Send + 'static,
) -> PyResult<()> {
    let job = move || {
        // Nobody receives messages after a cancellation.
        let reports = sender.clone();
        let send = Box::new(move |report| drop(reports.send(Message::Report(report))));
        let mut reporter = Reporter { send, is_cancelled, objects: Vec::new() };
        let message = match catch_unwind(AssertUnwindSafe(|| work(&mut reporter))) {
            Ok(result) => Message::Done(result),
            Err(panic) => Message::Panicked(format!("internal error: {}", panic_text(&*panic))),
        };
        let _ = sender.send(message);
    };
    thread::Builder::new().name("lightoctree".to_owned()).stack_size(STACK_BYTES).spawn(job)?;
    Ok(())
}

fn panic_text(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("unknown")
}

struct CancelOnDrop(Arc<AtomicBool>);

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Refuses work in a process that was forked from one that has worked: its threads do not exist here, and waiting for
/// them would never end.
fn check_process() -> PyResult<()> {
    static PROCESS: OnceLock<u32> = OnceLock::new();
    if *PROCESS.get_or_init(std::process::id) == std::process::id() {
        return Ok(());
    }
    Err(PyRuntimeError::new_err(
        "this process was forked after lightoctree had started its threads; start processes with the method \"spawn\", \
         as in multiprocessing.get_context(\"spawn\")",
    ))
}
