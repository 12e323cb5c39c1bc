use std::ops::ControlFlow;
use std::time::Instant;

use crate::{Event, OnEvent, Stage};

/// Tells how far a stage of many steps is, and remembers that the handler asked it to end: for jobs that finish what they have in hand first.
pub struct Steps<'a> {
    on_event: OnEvent<'a>,
    stage: Stage,
    done: u64,
    total: u64,
    begun: Instant,
    cancelled: bool,
}

impl<'a> Steps<'a> {
    /// The stage begins.
    pub fn begin(on_event: OnEvent<'a>, stage: Stage, total: usize) -> Self {
        let mut steps = Self { on_event, stage, done: 0, total: total as u64, begun: Instant::now(), cancelled: false };
        steps.say(Event::Begun(steps.stage.clone()));
        steps.say(Event::Progress { stage: steps.stage.clone(), done: 0, total: steps.total });
        steps
    }

    /// One more step is done.
    pub fn step(&mut self) {
        self.done += 1;
        self.say(Event::Progress { stage: self.stage.clone(), done: self.done, total: self.total });
    }

    /// Whether the handler asked the job to end, at any time so far.
    pub fn cancelled(&self) -> bool {
        self.cancelled
    }

    /// The stage is done, or as far as it will be.
    pub fn end(mut self) {
        self.say(Event::Done { stage: self.stage.clone(), took: self.begun.elapsed() });
    }

    fn say(&mut self, event: Event) {
        self.cancelled |= (self.on_event)(event) == ControlFlow::Break(());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wish_to_end_is_remembered() {
        let mut heard = Vec::new();
        let mut on_event = |event: Event| {
            let first = matches!(event, Event::Progress { done: 1, .. });
            heard.push(event.fraction());
            if first { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let mut steps = Steps::begin(&mut on_event, Stage::Octree, 2);
        assert!(!steps.cancelled());
        steps.step();
        assert!(steps.cancelled());
        steps.step();
        assert!(steps.cancelled());
        steps.end();
        assert_eq!(heard, [0.0, 0.0, 0.5, 1.0, 1.0].map(Some));
    }
}
