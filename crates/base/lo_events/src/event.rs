use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::{Stage, Warning};

/// What a job says.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub enum Event {
    /// A stage begins.
    Begun(Stage),
    /// A part of a stage is done.
    Progress {
        /// The stage.
        stage: Stage,
        /// Its steps that are done.
        done: u64,
        /// All of its steps.
        total: u64,
    },
    /// A stage is done.
    Done {
        /// The stage.
        stage: Stage,
        /// How long it took.
        took: Duration,
    },
    /// Numbers that a stage came to, on its way or at its end.
    Figures {
        /// The stage.
        stage: Stage,
        /// Its figures.
        figures: Vec<Figure>,
    },
    /// Something that the user should know.
    Warning(Warning),
}

/// A number with a name.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// What it is, with its unit where it has one: `psnr_db`, `depth_abs_rel`, `octree`.
    pub name: &'static str,
    /// How much.
    pub value: f64,
}

impl Event {
    /// Share of its stage that is done, from 0 to 1; `None` for what says nothing of that.
    pub fn fraction(&self) -> Option<f64> {
        match self {
            Self::Begun(_) => Some(0.0),
            Self::Progress { done, total, .. } => Some(if *total == 0 { 1.0 } else { *done as f64 / *total as f64 }),
            Self::Done { .. } => Some(1.0),
            Self::Figures { .. } | Self::Warning(_) => None,
        }
    }
}

/// Hears events, and says whether the job goes on.
pub type OnEvent<'a> = &'a mut dyn FnMut(Event) -> ControlFlow<()>;

/// The handler asked the job to end. What it had written is as it was before the step at which it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// The handler of who wants to hear nothing: `&mut ignore`.
pub fn ignore(_event: Event) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Does one stage, and says when it begins and how long it took.
///
/// # Errors
/// [`Cancelled`] before the work or after it.
pub fn stage<T>(on_event: OnEvent<'_>, stage: Stage, work: impl FnOnce() -> T) -> Result<T, Cancelled> {
    say(on_event, Event::Begun(stage.clone()))?;
    let begun = Instant::now();
    let result = work();
    say(on_event, Event::Done { stage, took: begun.elapsed() })?;
    Ok(result)
}

/// Does one stage that says how far it is, and says when it begins and how long it took.
///
/// # Errors
/// Those of the work; [`Cancelled`] before it, within it or after it.
pub fn stage_of_steps<T, E: From<Cancelled>>(
    on_event: OnEvent<'_>,
    stage: Stage,
    work: impl FnOnce(OnEvent<'_>) -> Result<T, E>,
) -> Result<T, E> {
    say(on_event, Event::Begun(stage.clone()))?;
    let begun = Instant::now();
    let result = work(on_event)?;
    say(on_event, Event::Done { stage, took: begun.elapsed() })?;
    Ok(result)
}

/// Says how far a stage is.
///
/// # Errors
/// [`Cancelled`].
pub fn progress(on_event: OnEvent<'_>, stage: Stage, done: u64, total: u64) -> Result<(), Cancelled> {
    say(on_event, Event::Progress { stage, done, total })
}

/// Says something that the user should know.
///
/// # Errors
/// [`Cancelled`].
pub fn warn(on_event: OnEvent<'_>, warning: Warning) -> Result<(), Cancelled> {
    say(on_event, Event::Warning(warning))
}

/// Says the numbers that a stage came to.
///
/// # Errors
/// [`Cancelled`].
pub fn figures(on_event: OnEvent<'_>, stage: Stage, figures: Vec<Figure>) -> Result<(), Cancelled> {
    say(on_event, Event::Figures { stage, figures })
}

fn say(on_event: OnEvent<'_>, event: Event) -> Result<(), Cancelled> {
    match on_event(event) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Cancelled),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_handler_that_breaks_ends_the_job_before_or_after_the_work() {
        let mut worked = 0;
        for at in 0..3 {
            let mut heard = 0;
            let on_event = &mut |_| {
                heard += 1;
                if heard > at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            let result = stage(on_event, Stage::Octree, || worked += 1);
            assert_eq!(result, if at < 2 { Err(Cancelled) } else { Ok(()) });
        }
        assert_eq!(worked, 2, "not where the beginning was refused");
    }

    #[test]
    fn fractions_go_from_none_to_all() {
        let at = |done, total| Event::Progress { stage: Stage::Octree, done, total }.fraction();
        assert_eq!((at(0, 4), at(3, 4), at(0, 0)), (Some(0.0), Some(0.75), Some(1.0)));
    }
}
