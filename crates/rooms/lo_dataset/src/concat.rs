use std::borrow::Cow;
use std::sync::Arc;

use crate::{Dataset, DatasetError, Sample, Split};

/// Concatenation of several datasets.
pub struct ConcatDataset(Vec<Arc<dyn Dataset>>);

impl ConcatDataset {
    /// Concatenates datasets in this order.
    pub fn new(datasets: Vec<Arc<dyn Dataset>>) -> Self {
        Self(datasets)
    }

    /// Returns the dataset that holds a sample, and the sample's index there.
    fn dataset(&self, index: usize) -> Option<(&dyn Dataset, usize)> {
        let mut rest = index;
        for dataset in &self.0 {
            match rest.checked_sub(dataset.len()) {
                Some(beyond) => rest = beyond,
                None => return Some((&**dataset, rest)),
            }
        }
        None
    }
}

impl Dataset for ConcatDataset {
    fn len(&self) -> usize {
        self.0.iter().map(|dataset| dataset.len()).sum()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        let (dataset, index) = self.dataset(index).expect("the index is below the length");
        dataset.scene_id(index)
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let (dataset, index) = self.dataset(index).ok_or(DatasetError::Index { index, len: self.len() })?;
        dataset.get(index)
    }

    fn get_in_epoch(&self, index: usize, epoch: u64) -> Result<Sample, DatasetError> {
        let (dataset, index) = self.dataset(index).ok_or(DatasetError::Index { index, len: self.len() })?;
        dataset.get_in_epoch(index, epoch)
    }

    fn split(&self, index: usize) -> Split {
        let (dataset, index) = self.dataset(index).expect("the index is below the length");
        dataset.split(index)
    }

    fn left_out(&self) -> usize {
        self.0.iter().map(|dataset| dataset.left_out()).sum()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::sample::tests::sample;

    struct FixedScene(&'static str, usize);

    impl Dataset for FixedScene {
        fn len(&self) -> usize {
            self.1
        }

        fn scene_id(&self, _: usize) -> Cow<'_, str> {
            self.0.into()
        }

        fn get(&self, index: usize) -> Result<Sample, DatasetError> {
            Ok(Sample { id: format!("{}-{index}", self.0), ..sample() })
        }
    }

    #[test]
    fn samples_come_from_the_part_that_holds_them() {
        let datasets: [Arc<dyn Dataset>; 3] =
            [Arc::new(FixedScene("a", 2)), Arc::new(FixedScene("b", 0)), Arc::new(FixedScene("c", 3))];
        let concatenated = ConcatDataset::new(datasets.into());
        let ids: Vec<String> = (0..concatenated.len()).map(|index| concatenated.get(index).unwrap().id).collect();
        assert_eq!(ids, ["a-0", "a-1", "c-0", "c-1", "c-2"]);
        assert_eq!((concatenated.scene_id(1), concatenated.scene_id(2)), ("a".into(), "c".into()));
        assert!(matches!(concatenated.get(5), Err(DatasetError::Index { index: 5, len: 5 })));
    }
}
