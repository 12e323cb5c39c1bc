use std::borrow::Cow;

use lo_dataset::{Dataset, DatasetError, Sample, Split};

/// Repeats every sample of a dataset within an epoch and assigns all of it to training.
///
/// Each repetition has its own identifier, and so its own augmentation.
pub(crate) struct Oversampled<D> {
    samples: D,
    times: usize,
}

impl<D: Dataset> Oversampled<D> {
    /// Repeats each sample `times` times.
    pub fn new(samples: D, times: usize) -> Self {
        Self { samples, times }
    }
}

impl<D: Dataset> Dataset for Oversampled<D> {
    fn len(&self) -> usize {
        self.samples.len() * self.times
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        self.samples.scene_id(index / self.times)
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        self.get_in_epoch(index, 0)
    }

    fn get_in_epoch(&self, index: usize, epoch: u64) -> Result<Sample, DatasetError> {
        let sample = self.samples.get_in_epoch(index / self.times, epoch)?;
        Ok(Sample { id: format!("{}-{}", sample.id, index % self.times), ..sample })
    }

    fn split(&self, _: usize) -> Split {
        Split::Train
    }
}
