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
    random::hash(&ids)
}
