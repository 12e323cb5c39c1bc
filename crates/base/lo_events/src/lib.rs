//! Progress events, warnings and cancellation of long jobs: one stream for the command line, the viewer and Python.
//!
//! A job takes a handler, [`OnEvent`], and calls it between its steps. A handler that returns
//! [`Break`](std::ops::ControlFlow::Break) cancels the job, which then returns [`Cancelled`].
//!
//! This crate defines no stages and no warnings. The crate of a job defines its [`Stage`]s as constants, and its
//! [`Warning`]s as an enum with the values and the message of each.
//!
//! ```
//! use std::ops::ControlFlow;
//! use lo_events::{Cancelled, Event, Stage, stage};
//!
//! const ADDITION: Stage = Stage::new("addition");
//!
//! let mut seen = Vec::new();
//! let on_event = &mut |event: Event| {
//!     seen.push(event);
//!     ControlFlow::Continue(())
//! };
//! let sum = stage(on_event, ADDITION, || 1 + 1)?;
//! assert_eq!(sum, 2);
//! assert!(matches!(&seen[..], [Event::Begun(begun), Event::Done { stage, .. }] if [begun, stage] == [&ADDITION; 2]));
//! # Ok::<(), Cancelled>(())
//! ```

mod event;
mod stage;
mod steps;
mod warning;

pub use event::{Cancelled, Event, Figure, OnEvent, figures, ignore, progress, stage, stage_of_steps, warn};
pub use stage::Stage;
pub use steps::Steps;
pub use warning::Warning;
