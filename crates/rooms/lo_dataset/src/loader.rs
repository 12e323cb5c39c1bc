//! Iteration over any dataset: shuffled, split, prefetched, resumable.

use std::collections::VecDeque;
use std::sync::Arc;

use crate::loading::{LoadError, LoaderConfig, LoaderState};
use crate::order::Permutation;
use crate::prefetch::Prefetch;
use crate::{Dataset, Sample};

/// Iterates over a dataset's samples, prefetched by its own threads.
///
/// The order depends only on the seed. A sample that cannot be made is returned as an error, and the iteration
/// continues. A panic of the dataset is propagated to the thread that requests the sample. Dropping the loader stops
/// its threads after their current block.
pub struct Loader {
    made: Prefetch<Vec<LoadedSample>>,
    /// Blocks per epoch.
    blocks: u64,
    /// Remaining samples of the current block.
    current: VecDeque<LoadedSample>,
    state: LoaderState,
    epochs: Option<u64>,
    /// Consecutive blocks without a sample. A whole epoch of them ends the iteration.
    empty_blocks: u64,
}

impl Loader {
    /// Starts from the beginning.
    pub fn new(dataset: Arc<dyn Dataset>, config: LoaderConfig) -> Self {
        Self::resume(dataset, config, LoaderState::default())
    }

    /// Resumes at the [state](Self::state) of another loader of the same dataset and configuration.
    pub fn resume(dataset: Arc<dyn Dataset>, config: LoaderConfig, state: LoaderState) -> Self {
        let source = BlockSource::new(dataset, config, state);
        let blocks = source.count;
        let made = Prefetch::start(config.threads, config.prefetch, move |number| source.make(number));
        Self { made, blocks, current: VecDeque::new(), state, epochs: config.epochs, empty_blocks: 0 }
    }

    /// Starts at sample `index`. Only meaningful without shuffling.
    pub fn from_sample(dataset: Arc<dyn Dataset>, config: LoaderConfig, index: usize) -> Self {
        let size = dataset.block().max(1);
        let state = LoaderState { epoch: 0, block: (index / size) as u64, sample: (index % size) as u64 };
        Self::resume(dataset, config, state)
    }

    /// Returns the position of the next sample.
    pub fn state(&self) -> LoaderState {
        self.state
    }

    /// Waits for the next block. `None` at the end.
    fn next_block(&mut self) -> Option<Vec<LoadedSample>> {
        let ended = self.epochs.is_some_and(|epochs| self.state.epoch >= epochs);
        (self.blocks > 0 && self.empty_blocks < self.blocks && !ended).then(|| self.made.next())
    }

    fn end_block(&mut self) {
        self.state.sample = 0;
        self.state.block += 1;
        if self.state.block >= self.blocks {
            self.state = LoaderState { epoch: self.state.epoch + 1, ..LoaderState::default() };
        }
    }
}

impl Iterator for Loader {
    type Item = Result<Sample, LoadError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(made) = self.current.pop_front() {
                self.empty_blocks = 0;
                self.state.sample = made.number + 1;
                if self.current.is_empty() {
                    self.end_block();
                }
                return Some(made.result);
            }
            let already = self.state.sample;
            self.current = self.next_block()?.into_iter().filter(|made| made.number >= already).collect();
            if self.current.is_empty() {
                self.empty_blocks += 1;
                self.end_block();
            }
        }
    }
}

/// Sample with its position in the block.
struct LoadedSample {
    number: u64,
    result: Result<Sample, LoadError>,
}

/// A dataset's blocks in the order of iteration.
struct BlockSource {
    dataset: Arc<dyn Dataset>,
    config: LoaderConfig,
    /// Blocks per epoch.
    count: u64,
    first: LoaderState,
}

impl BlockSource {
    fn new(dataset: Arc<dyn Dataset>, config: LoaderConfig, first: LoaderState) -> Self {
        let count = (dataset.len() as u64).div_ceil(dataset.block().max(1) as u64);
        Self { dataset, config, count, first }
    }

    /// Makes block `number`, counted from the first one. `None` beyond the last epoch.
    fn make(&self, number: u64) -> Option<Vec<LoadedSample>> {
        let from_start = self.first.block.min(self.count).checked_add(number)?;
        let epoch = self.first.epoch.checked_add(from_start.checked_div(self.count)?)?;
        if self.config.epochs.is_some_and(|epochs| epoch >= epochs) {
            return None;
        }
        let position = from_start % self.count;
        let block = if self.config.shuffle {
            Permutation::new(self.count, self.config.seed, epoch).at(position)
        } else {
            position
        };
        let size = self.dataset.block().max(1);
        let first = block as usize * size;
        let indices = first..(first + size).min(self.dataset.len());
        let wanted = |index: &usize| self.config.split.is_none_or(|split| self.dataset.split(*index) == split);
        let made = indices.filter(wanted).map(|index| LoadedSample {
            number: (index - first) as u64,
            result: self.dataset.get_in_epoch(index, epoch).map_err(|source| LoadError {
                index,
                scene_id: self.dataset.scene_id(index).into_owned(),
                source,
            }),
        });
        Some(made.collect())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::borrow::Cow;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use super::*;
    use crate::sample::tests::sample;
    use crate::{DatasetError, Split};

    /// Samples whose id is their index. One may be broken, and later ones are faster than earlier ones.
    struct NumberedDataset {
        count: usize,
        block: usize,
        broken: Option<usize>,
        made: AtomicUsize,
    }

    impl NumberedDataset {
        fn new(count: usize) -> Self {
            Self { count, block: 1, broken: None, made: AtomicUsize::new(0) }
        }
    }

    impl Dataset for NumberedDataset {
        fn len(&self) -> usize {
            self.count
        }

        fn scene_id(&self, index: usize) -> Cow<'_, str> {
            format!("room-{}", index / self.block).into()
        }

        fn get(&self, index: usize) -> Result<Sample, DatasetError> {
            self.made.fetch_add(1, Ordering::SeqCst);
            std::thread::sleep(Duration::from_micros(if index.is_multiple_of(3) { 800 } else { 20 }));
            if self.broken == Some(index) {
                return Err(DatasetError::Index { index, len: self.count });
            }
            assert!(index != 9_999, "sample 9999 must not be requested");
            Ok(Sample { id: index.to_string(), ..sample() })
        }

        fn block(&self) -> usize {
            self.block
        }
    }

    fn ids(loader: impl Iterator<Item = Result<Sample, LoadError>>) -> Vec<String> {
        loader.map(|item| item.map_or_else(|error| error.to_string(), |sample| sample.id)).collect()
    }

    #[test]
    fn the_order_is_that_of_the_seed_whatever_the_threads() {
        let config = LoaderConfig { seed: 4, epochs: Some(2), threads: 1, ..LoaderConfig::default() };
        let load = |config| ids(Loader::new(Arc::new(NumberedDataset::new(40)), config));
        let one = load(config);
        assert_eq!(one, load(LoaderConfig { threads: 7, prefetch: 9, ..config }));
        assert_ne!(one, load(LoaderConfig { seed: 5, ..config }));
        assert_ne!(one[..40], one[40..], "another order in every epoch");
        let mut sorted: Vec<usize> = one[40..].iter().map(|id| id.parse().unwrap()).collect();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..40));
        let plain = load(LoaderConfig { shuffle: false, epochs: Some(1), ..config });
        assert!(plain.into_iter().eq((0..40).map(|i| i.to_string())));
    }

    #[test]
    fn a_saved_position_goes_on_with_the_next_sample() {
        let dataset = || Arc::new(NumberedDataset { block: 3, ..NumberedDataset::new(20) });
        let config = LoaderConfig { seed: 1, epochs: Some(3), threads: 3, ..LoaderConfig::default() };
        let all = ids(Loader::new(dataset(), config));
        assert_eq!(all.len(), 60);
        for done in [0, 1, 7, 20, 21, 59, 60] {
            let mut loader = Loader::new(dataset(), config);
            for _ in 0..done {
                loader.next().unwrap().unwrap();
            }
            let saved = serde_json::to_string(&loader.state()).unwrap();
            let rest = Loader::resume(dataset(), config, serde_json::from_str(&saved).unwrap());
            assert_eq!(ids(rest), all[done..], "after {done}");
        }
    }

    #[test]
    fn any_sample_can_be_the_first() {
        let dataset = || Arc::new(NumberedDataset { block: 3, ..NumberedDataset::new(20) });
        let config = LoaderConfig { shuffle: false, ..LoaderConfig::default() };
        for first in [0, 2, 3, 16, 19] {
            let rest = ids(Loader::from_sample(dataset(), config, first));
            assert!(rest.into_iter().eq((first..20).map(|i| i.to_string())), "from {first}");
        }
    }

    #[test]
    fn splits_share_no_scene_and_miss_none() {
        let dataset = || Arc::new(NumberedDataset { block: 4, ..NumberedDataset::new(400) });
        let load = |split| {
            ids(Loader::new(dataset(), LoaderConfig { split: Some(split), prefetch: 20, ..LoaderConfig::default() }))
        };
        let (train, validation) = (load(Split::Train), load(Split::Validation));
        assert_eq!(train.len() + validation.len(), 400);
        // One in ten of 100 scenes, standard deviation 3.
        assert!((4..80).contains(&validation.len()), "{}", validation.len());
        let scene = |id: &String| id.parse::<usize>().unwrap() / 4;
        assert!(validation.iter().all(|v| train.iter().all(|t| scene(t) != scene(v))));
    }

    #[test]
    fn errors_come_in_place_and_name_the_sample() {
        let dataset = Arc::new(NumberedDataset { broken: Some(5), ..NumberedDataset::new(10) });
        let config = LoaderConfig { shuffle: false, ..LoaderConfig::default() };
        let all = ids(Loader::new(dataset, config));
        assert_eq!(all.len(), 10);
        assert_eq!(all[5], "sample 5 (scene room-5): sample index 5 is out of range; the dataset has 10 samples");
        assert_eq!(all[6], "6");
    }

    #[test]
    fn no_more_than_asked_for_is_made_ahead_and_threads_end() {
        let dataset = Arc::new(NumberedDataset::new(1000));
        let config = LoaderConfig { threads: 3, prefetch: 5, ..LoaderConfig::default() };
        let mut loader = Loader::new(dataset.clone(), config);
        loader.next().unwrap().unwrap();
        std::thread::sleep(Duration::from_millis(50));
        assert!(dataset.made.load(Ordering::SeqCst) <= 6);
        drop(loader);
        assert_eq!(Arc::strong_count(&dataset), 1, "no thread is left");
    }

    #[test]
    fn a_loader_without_samples_ends_even_with_infinite_epochs() {
        let forever = LoaderConfig { epochs: None, ..LoaderConfig::default() };
        assert_eq!(Loader::new(Arc::new(NumberedDataset::new(0)), forever).count(), 0);
        // A single scene belongs to one of the splits.
        let one = |split| {
            Loader::new(Arc::new(NumberedDataset::new(1)), LoaderConfig { split: Some(split), ..forever })
                .take(5)
                .count()
        };
        assert_eq!(one(Split::Train) + one(Split::Validation), 5);
    }

    #[test]
    #[should_panic(expected = "sample 9999")]
    fn a_panic_of_the_dataset_reaches_the_caller() {
        let config = LoaderConfig { shuffle: false, ..LoaderConfig::default() };
        Loader::resume(
            Arc::new(NumberedDataset::new(10_001)),
            config,
            LoaderState { block: 9_999, ..LoaderState::default() },
        )
        .for_each(drop);
    }
}
