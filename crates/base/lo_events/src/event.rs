use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::{Stage, Warning};

/// An event of a running job.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Event {
    /// A stage has begun.
    Begun(Stage),
    /// Steps of a stage are done.
    Progress {
        /// The stage.
        stage: Stage,
        /// Number of steps done.
        done: u64,
        /// Number of all steps.
        total: u64,
    },
    /// A stage is done.
    Done {
        /// The stage.
        stage: Stage,
        /// Duration of the stage.
        took: Duration,
    },
    /// Measured values of a stage, during it or at its end.
    Figures {
        /// The stage.
        stage: Stage,
        /// The values.
        figures: Vec<Figure>,
    },
    /// A problem or an assumption that the user should know about.
    Warning(Arc<dyn Warning>),
}

/// A named number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// Name, with the unit if there is one: `psnr_db`, `depth_abs_rel`, `octree`.
    pub name: &'static str,
    /// Value.
    pub value: f64,
}

impl Event {
    /// Completed share of the event's stage, from 0 to 1; `None` for events without progress.
    pub fn fraction(&self) -> Option<f64> {
        match self {
            Self::Begun(_) => Some(0.0),
            Self::Progress { done, total, .. } => Some(if *total == 0 { 1.0 } else { *done as f64 / *total as f64 }),
            Self::Done { .. } => Some(1.0),
            Self::Figures { .. } | Self::Warning(_) => None,
        }
    }

    /// Returns the warning of type `T`; `None` for other warnings and other events.
    pub fn warning<T: Warning>(&self) -> Option<&T> {
        match self {
            Self::Warning(warning) => warning.downcast_ref(),
            _ => None,
        }
    }
}

/// An event handler. It receives each event and returns whether the job continues.
pub type OnEvent<'a> = &'a mut dyn FnMut(Event) -> ControlFlow<()>;

/// Error of a job that its handler cancelled. Outputs are as they were before the step at which it stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// A handler that ignores all events: `&mut ignore`.
pub fn ignore(_event: Event) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Runs one stage and reports its beginning and its duration.
///
/// # Errors
/// [`Cancelled`] before or after the work.
pub fn stage<T>(on_event: OnEvent<'_>, stage: Stage, work: impl FnOnce() -> T) -> Result<T, Cancelled> {
    send(on_event, Event::Begun(stage.clone()))?;
    let begun = Instant::now();
    let result = work();
    send(on_event, Event::Done { stage, took: begun.elapsed() })?;
    Ok(result)
}

/// Runs one stage that reports its own progress, and reports its beginning and its duration.
///
/// # Errors
/// Errors of the work; [`Cancelled`] before, during or after it.
pub fn stage_of_steps<T, E: From<Cancelled>>(
    on_event: OnEvent<'_>,
    stage: Stage,
    work: impl FnOnce(OnEvent<'_>) -> Result<T, E>,
) -> Result<T, E> {
    send(on_event, Event::Begun(stage.clone()))?;
    let begun = Instant::now();
    let result = work(on_event)?;
    send(on_event, Event::Done { stage, took: begun.elapsed() })?;
    Ok(result)
}

/// Reports the progress of a stage.
///
/// # Errors
/// [`Cancelled`].
pub fn progress(on_event: OnEvent<'_>, stage: Stage, done: u64, total: u64) -> Result<(), Cancelled> {
    send(on_event, Event::Progress { stage, done, total })
}

/// Reports a warning.
///
/// # Errors
/// [`Cancelled`].
pub fn warn(on_event: OnEvent<'_>, warning: impl Warning) -> Result<(), Cancelled> {
    send(on_event, Event::Warning(Arc::new(warning)))
}

/// Reports measured values of a stage.
///
/// # Errors
/// [`Cancelled`].
pub fn figures(on_event: OnEvent<'_>, stage: Stage, figures: Vec<Figure>) -> Result<(), Cancelled> {
    send(on_event, Event::Figures { stage, figures })
}

fn send(on_event: OnEvent<'_>, event: Event) -> Result<(), Cancelled> {
    match on_event(event) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Cancelled),
    }
}

#[cfg(test)]
mod tests {
    use std::fmt;

    use super::*;

    const OCTREE: Stage = Stage::new("octree");

    #[derive(Debug, PartialEq)]
    struct Clipped {
        pixels: usize,
    }

    impl Warning for Clipped {}

    impl fmt::Display for Clipped {
        fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
            write!(f, "{} pixels are clipped", self.pixels)
        }
    }

    #[derive(Debug)]
    struct Other;

    impl Warning for Other {}

    impl fmt::Display for Other {
        fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("other")
        }
    }

    #[test]
    fn warnings_keep_their_message_and_their_type() {
        let mut events = Vec::new();
        let on_event = &mut |event: Event| {
            events.push(event);
            ControlFlow::Continue(())
        };
        assert_eq!(warn(on_event, Clipped { pixels: 3 }), Ok(()));
        assert_eq!(warn(on_event, Other), Ok(()));
        let messages = events.iter().filter_map(|event| match event {
            Event::Warning(warning) => Some(warning.to_string()),
            _ => None,
        });
        assert!(messages.eq(["3 pixels are clipped", "other"]));
        let found: Vec<Option<&Clipped>> = events.iter().map(Event::warning).collect();
        assert_eq!(found, [Some(&Clipped { pixels: 3 }), None]);
        assert_eq!(Event::Begun(OCTREE).warning::<Clipped>(), None);
    }

    #[test]
    fn a_handler_that_breaks_ends_the_job_before_or_after_the_work() {
        let mut worked = 0;
        for at in 0..3 {
            let mut received = 0;
            let on_event = &mut |_| {
                received += 1;
                if received > at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let result = stage(on_event, OCTREE, || worked += 1);
            assert_eq!(result, if at < 2 { Err(Cancelled) } else { Ok(()) });
        }
        assert_eq!(worked, 2, "no work after a handler that breaks at the stage's beginning");
    }

    #[test]
    fn fractions_go_from_none_to_all() {
        let at = |done, total| Event::Progress { stage: OCTREE, done, total }.fraction();
        assert_eq!((at(0, 4), at(3, 4), at(0, 0)), (Some(0.0), Some(0.75), Some(1.0)));
    }
}
