use std::borrow::Cow;

use crate::{DatasetError, Sample, Split};

/// Set of samples that can be read in any order, from any thread.
pub trait Dataset: Send + Sync {
    /// Returns the number of samples.
    fn len(&self) -> usize;

    /// Whether there are no samples.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the scene of a sample without making or decoding it.
    ///
    /// # Panics
    /// May panic if the index is not below [`len`](Self::len).
    fn scene_id(&self, index: usize) -> Cow<'_, str>;

    /// Makes or reads a sample. The same index always returns the same sample.
    ///
    /// # Errors
    /// If a file cannot be read or is invalid, or the index is out of range.
    fn get(&self, index: usize) -> Result<Sample, DatasetError>;

    /// Makes or reads a sample as it is in an epoch, counted from 0. Datasets whose photos are drawn at random may draw
    /// others in each epoch; the same index and epoch always return the same sample.
    ///
    /// # Errors
    /// As [`get`](Self::get).
    fn get_in_epoch(&self, index: usize, epoch: u64) -> Result<Sample, DatasetError> {
        let _ = epoch;
        self.get(index)
    }

    /// Returns the number of consecutive samples, starting at a multiple of it, that are made together at little more
    /// than the cost of one: the photos of a generated scene. A loader keeps them together.
    fn block(&self) -> usize {
        1
    }

    /// Returns the number of samples that were left out: those that the dataset's authors exclude, and those that its
    /// reader cannot represent.
    fn left_out(&self) -> usize {
        0
    }

    /// Returns the split that a sample belongs to: the published one, or [`Split::of`] its scene.
    fn split(&self, index: usize) -> Split {
        Split::of(&self.scene_id(index))
    }
}

/// Returns a hash that distinguishes datasets by their scenes and order: FNV-1a of the scene of every sample, one per
/// line.
pub fn fingerprint(dataset: &dyn Dataset) -> u64 {
    let ids: Vec<u8> = (0..dataset.len()).flat_map(|i| [dataset.scene_id(i).as_bytes(), b"\n"].concat()).collect();
    lo_random::hash(&ids)
}

/// Returns `count` of the numbers below `len`, or all of them, evenly spaced.
pub fn evenly_spread(len: usize, count: usize) -> impl Iterator<Item = usize> {
    let count = count.min(len);
    (0..count).map(move |i| (2 * i + 1) * len / (2 * count.max(1)))
}

/// Returns the samples of a split (of all where `None`), at most `most`, evenly spaced.
pub fn indices_of(dataset: &dyn Dataset, part: Option<Split>, most: Option<usize>) -> Vec<usize> {
    let wanted = |index: &usize| part.is_none_or(|part| dataset.split(*index) == part);
    let all: Vec<usize> = (0..dataset.len()).filter(wanted).collect();
    evenly_spread(all.len(), most.unwrap_or(all.len())).map(|i| all[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evenly_spread_takes_the_middles_of_equal_ranges() {
        assert!(evenly_spread(10, 2).eq([2, 7]) && evenly_spread(3, 9).eq([0, 1, 2]));
        assert_eq!(evenly_spread(0, 4).count() + evenly_spread(4, 0).count(), 0);
    }
}
