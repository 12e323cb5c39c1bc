use std::borrow::Cow;

use crate::{DatasetError, Sample, Split};

/// A set of samples that can be read in any order, from any thread.
pub trait Dataset: Send + Sync {
    /// How many samples there are.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The scene of a sample, without making or decoding it; [`Split::of`] it is the sample's split.
    ///
    /// # Panics
    /// May panic for an index that is not below [`len`](Self::len).
    fn scene_id(&self, index: usize) -> Cow<'_, str>;

    /// Makes or reads a sample; the same index always gives the same sample.
    ///
    /// # Errors
    /// Files that cannot be read or do not hold what they should; an index out of range.
    fn get(&self, index: usize) -> Result<Sample, DatasetError>;

    /// How many consecutive samples, from a multiple of this on, are made together at little more than the cost of one: the photos of one
    /// generated scene. A loader keeps them together.
    fn block(&self) -> usize {
        1
    }

    /// The part of the dataset that a sample belongs to.
    fn split(&self, index: usize) -> Split {
        Split::of(&self.scene_id(index))
    }
}

/// A number that tells datasets of different scenes apart, or of the same in another order: FNV-1a of the scene of every sample, one a line.
pub fn fingerprint(dataset: &dyn Dataset) -> u64 {
    let ids: Vec<u8> = (0..dataset.len()).flat_map(|i| [dataset.scene_id(i).as_bytes(), b"\n"].concat()).collect();
    lo_random::hash(&ids)
}

/// `count` of the numbers below `len`, or all of them, evenly spread.
pub fn evenly_spread(len: usize, count: usize) -> impl Iterator<Item = usize> {
    let count = count.min(len);
    (0..count).map(move |i| (2 * i + 1) * len / (2 * count.max(1)))
}

/// Samples of a part of a dataset (of all of it where `None`), no more than `most`, evenly spread.
pub fn indices_of(dataset: &dyn Dataset, part: Option<Split>, most: Option<usize>) -> Vec<usize> {
    let wanted = |index: &usize| part.is_none_or(|part| dataset.split(*index) == part);
    let all: Vec<usize> = (0..dataset.len()).filter(wanted).collect();
    evenly_spread(all.len(), most.unwrap_or(all.len())).map(|i| all[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_spread_stands_in_the_middles_of_equal_parts() {
        assert!(evenly_spread(10, 2).eq([2, 7]) && evenly_spread(3, 9).eq([0, 1, 2]));
        assert_eq!(evenly_spread(0, 4).count() + evenly_spread(4, 0).count(), 0);
    }
}
