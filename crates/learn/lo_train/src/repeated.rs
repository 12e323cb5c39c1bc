use std::borrow::Cow;

use lo_dataset::{Dataset, DatasetError, Sample, Split};

/// A dataset of which every sample is learned from, several times in an epoch: each time under another name, by which it is varied otherwise.
pub(crate) struct Repeated<D> {
    samples: D,
    times: usize,
}

impl<D: Dataset> Repeated<D> {
    /// So many times.
    pub fn new(samples: D, times: usize) -> Self {
        Self { samples, times }
    }
}

impl<D: Dataset> Dataset for Repeated<D> {
    fn len(&self) -> usize {
        self.samples.len() * self.times
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        self.samples.scene_id(index / self.times)
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let sample = self.samples.get(index / self.times)?;
        Ok(Sample { id: format!("{}-{}", sample.id, index % self.times), ..sample })
    }

    fn split(&self, _: usize) -> Split {
        Split::Train
    }
}
