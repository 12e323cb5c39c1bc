//! What a long job says on its way: one stream for command line, viewer and Python alike.
//!
//! A job takes a handler, [`OnEvent`], and calls it between its steps. What the handler answers decides whether the job goes on:
//! [`Break`](std::ops::ControlFlow::Break) ends it with [`Cancelled`]. Events are data; the words for a person are the front end's.
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
