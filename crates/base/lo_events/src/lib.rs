//! Progress events, warnings and cancellation of long jobs: one stream for the command line, the viewer and Python.
//!
//! A job takes a handler, [`OnEvent`], and calls it between its steps. A handler that returns
//! [`Break`](std::ops::ControlFlow::Break) cancels the job, which then returns [`Cancelled`]. Events are structured
//! data; the front end formats them.
//!
//! ```
//! use std::ops::ControlFlow;
//! use lo_events::{Cancelled, Event, Stage, stage};
//!
//! let mut seen = Vec::new();
//! let on_event = &mut |event: Event| {
//!     seen.push(event);
//!     ControlFlow::Continue(())
//! };
//! let sum = stage(on_event, Stage::Octree, || 1 + 1)?;
//! assert_eq!(sum, 2);
//! assert!(matches!(seen[..], [Event::Begun(Stage::Octree), Event::Done { stage: Stage::Octree, .. }]));
//! # Ok::<(), Cancelled>(())
//! ```

mod event;
mod stage;
mod steps;
mod warning;

pub use event::{Cancelled, Event, Figure, OnEvent, figures, ignore, progress, stage, stage_of_steps, warn};
pub use stage::{Stage, TrainedNetworks, TrainingPhase};
pub use steps::Steps;
pub use warning::Warning;
