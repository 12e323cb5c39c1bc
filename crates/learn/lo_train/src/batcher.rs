//! Groups examples into batches of one image size.

use std::collections::BTreeMap;

use lo_dataset::LoaderState;

/// Capacity of the buffer in batches; when it is full, an incomplete batch is emitted.
const MAX_WAITING: usize = 8;

/// Groups examples by image size; incomplete batches are buffered, including across a resume.
pub(crate) struct Batcher<T> {
    batch_size: usize,
    waiting: Vec<(LoaderState, [usize; 2], T)>,
}

impl<T> Batcher<T> {
    pub fn new(batch_size: usize) -> Self {
        Self { batch_size, waiting: Vec::new() }
    }

    /// Adds an example and returns the batch that it completes.
    ///
    /// If the buffer is full of different sizes, returns the examples of the commonest size as a smaller batch.
    pub fn add(&mut self, at: LoaderState, size: [usize; 2], example: T) -> Option<Vec<T>> {
        self.waiting.push((at, size, example));
        let mut counts = BTreeMap::new();
        self.waiting.iter().for_each(|(_, size, _)| *counts.entry(*size).or_insert(0) += 1);
        let (commonest, count) = counts.into_iter().max_by_key(|&(_, count)| count)?;
        if count < self.batch_size && self.waiting.len() < MAX_WAITING * self.batch_size {
            return None;
        }
        let batch = self.waiting.extract_if(.., |(_, size, _)| *size == commonest);
        Some(batch.map(|(_, _, example)| example).collect())
    }

    /// Returns the loader positions of the buffered examples.
    pub fn waiting(&self) -> Vec<LoaderState> {
        self.waiting.iter().map(|&(at, ..)| at).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Consecutive loader positions.
    fn at(block: u64) -> LoaderState {
        LoaderState { block, ..LoaderState::default() }
    }

    /// Returns a portrait size for every third photo.
    fn size(number: u64) -> [usize; 2] {
        if number.is_multiple_of(3) { [2, 3] } else { [3, 2] }
    }

    #[test]
    fn a_batch_has_one_size_and_nothing_is_lost() {
        let mut batches = Batcher::new(4);
        let made: Vec<Vec<u64>> = (0..16).filter_map(|i| batches.add(at(i), size(i), i)).collect();
        assert_eq!(made, [vec![1, 2, 4, 5], vec![0, 3, 6, 9], vec![7, 8, 10, 11]]);
        assert_eq!(batches.waiting(), [12, 13, 14, 15].map(at));
        // A resumed run starts with the buffered examples.
        let mut resumed = Batcher::new(4);
        for batches in [&mut batches, &mut resumed] {
            let held = if batches.waiting().is_empty() { 12 } else { 16 };
            let made: Vec<Vec<u64>> = (held..24).filter_map(|i| batches.add(at(i), size(i), i)).collect();
            assert_eq!(made, [vec![13, 14, 16, 17], vec![12, 15, 18, 21], vec![19, 20, 22, 23]]);
        }
    }

    #[test]
    fn single_examples_do_not_wait_and_many_sizes_do_not_wait_for_ever() {
        let mut single = Batcher::new(1);
        assert!((0..5).all(|i| single.add(at(i), [i as usize; 2], i) == Some(vec![i])));
        let mut many = Batcher::new(3);
        let made: Vec<Vec<u64>> = (0..30).filter_map(|i| many.add(at(i), [i as usize / 2; 2], i)).collect();
        assert_eq!(made[0].len(), 2, "{made:?}");
        assert!(many.waiting().len() < 3 * MAX_WAITING);
    }
}
