use std::ops::ControlFlow;
use std::time::Instant;

use crate::{Event, OnEvent, Stage};

/// Reports the progress of a stage with many steps and remembers a cancellation.
///
/// For jobs that finish the work in progress before they stop.
pub struct Steps<'a> {
    on_event: OnEvent<'a>,
    stage: Stage,
    done: u64,
    total: u64,
    begun: Instant,
    cancelled: bool,
}

impl<'a> Steps<'a> {
    /// Begins a stage of `total` steps.
    pub fn begin(on_event: OnEvent<'a>, stage: Stage, total: usize) -> Self {
        let mut steps = Self { on_event, stage, done: 0, total: total as u64, begun: Instant::now(), cancelled: false };
        steps.send(Event::Begun(steps.stage.clone()));
        steps.send(Event::Progress { stage: steps.stage.clone(), done: 0, total: steps.total });
        steps
    }

    /// Reports that one more step is done.
    pub fn step(&mut self) {
        self.done += 1;
        self.send(Event::Progress { stage: self.stage.clone(), done: self.done, total: self.total });
    }

    /// Whether the handler has cancelled the job at any time so far.
    pub fn cancelled(&self) -> bool {
        self.cancelled
    }

    /// Ends the stage, complete or not.
    pub fn end(mut self) {
        self.send(Event::Done { stage: self.stage.clone(), took: self.begun.elapsed() });
    }

    fn send(&mut self, event: Event) {
        self.cancelled |= (self.on_event)(event) == ControlFlow::Break(());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cancellation_is_remembered() {
        let mut received = Vec::new();
        let mut on_event = |event: Event| {
            let first = matches!(event, Event::Progress { done: 1, .. });
            received.push(event.fraction());
            if first { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let mut steps = Steps::begin(&mut on_event, Stage::new("octree"), 2);
        assert!(!steps.cancelled());
        steps.step();
        assert!(steps.cancelled());
        steps.step();
        assert!(steps.cancelled());
        steps.end();
        assert_eq!(received, [0.0, 0.0, 0.5, 1.0, 1.0].map(Some));
    }
}
