//! Long loops in batches, between which an event handler can cancel them.

use std::ops::Range;

use lo_events::{Cancelled, OnEvent, Stage, progress};

/// Cones per batch: some tenths of a second of work, so that the overhead is negligible.
const CONES_PER_BATCH: usize = 1 << 23;

/// Progress of a stage with several loops.
pub(crate) struct Batches<'a> {
    on_event: OnEvent<'a>,
    stage: Stage,
    done: usize,
    total: usize,
}

impl<'a> Batches<'a> {
    /// Starts a stage with a total number of items in all of its loops.
    pub fn new(on_event: OnEvent<'a>, stage: Stage, total: usize) -> Self {
        Self { on_event, stage, done: 0, total }
    }

    /// Runs one loop over `count` items with a number of cones each; a batch is a multiple of `unit` items.
    pub fn each<T>(
        &mut self,
        count: usize,
        cones: usize,
        unit: usize,
        work: impl Fn(Range<usize>) -> Vec<T>,
    ) -> Result<Vec<T>, Cancelled> {
        let batch = (CONES_PER_BATCH / cones.max(1)).next_multiple_of(unit).max(unit);
        let mut all = Vec::with_capacity(count);
        for first in (0..count).step_by(batch) {
            let last = (first + batch).min(count);
            all.extend(work(first..last));
            self.done += last - first;
            progress(self.on_event, self.stage.clone(), self.done as u64, self.total as u64)?;
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use lo_events::Event;

    use super::*;
    use crate::stages;

    #[test]
    fn steps_make_all_items_once_and_end_where_they_are_told_to() {
        let mut heard = Vec::new();
        let hear = &mut |event: Event| {
            heard.push(event.fraction());
            if heard.len() < 4 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let mut batches = Batches::new(hear, stages::SHADING, 20);
        let made = batches.each(10, CONES_PER_BATCH / 3, 2, |range| range.collect());
        assert_eq!(made, Ok((0..10).collect()), "in steps of four");
        assert_eq!(batches.each(10, CONES_PER_BATCH, 10, |range| range.collect()), Err(Cancelled));
        assert_eq!(heard, [0.2, 0.4, 0.5, 1.0].map(Some));
    }
}
