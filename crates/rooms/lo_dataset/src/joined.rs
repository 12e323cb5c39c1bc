use std::borrow::Cow;
use std::sync::Arc;

use crate::{Dataset, DatasetError, Sample, Split};

/// Concatenation of several datasets.
pub struct Joined(Vec<Arc<dyn Dataset>>);

impl Joined {
    /// Concatenates datasets in this order.
    pub fn new(parts: Vec<Arc<dyn Dataset>>) -> Self {
        Self(parts)
    }

    /// Returns the dataset that holds a sample, and the sample's index there.
    fn part(&self, index: usize) -> Option<(&dyn Dataset, usize)> {
        let mut rest = index;
        for part in &self.0 {
            match rest.checked_sub(part.len()) {
                Some(beyond) => rest = beyond,
                None => return Some((&**part, rest)),
            }
        }
        None
    }
}

impl Dataset for Joined {
    fn len(&self) -> usize {
        self.0.iter().map(|part| part.len()).sum()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        let (part, index) = self.part(index).expect("the index is below the length");
        part.scene_id(index)
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let (part, index) = self.part(index).ok_or(DatasetError::Index { index, len: self.len() })?;
        part.get(index)
    }

    fn split(&self, index: usize) -> Split {
        let (part, index) = self.part(index).expect("the index is below the length");
        part.split(index)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::sample::tests::sample;

    struct Named(&'static str, usize);

    impl Dataset for Named {
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
        let parts: [Arc<dyn Dataset>; 3] = [Arc::new(Named("a", 2)), Arc::new(Named("b", 0)), Arc::new(Named("c", 3))];
        let joined = Joined::new(parts.into());
        let ids: Vec<String> = (0..joined.len()).map(|index| joined.get(index).unwrap().id).collect();
        assert_eq!(ids, ["a-0", "a-1", "c-0", "c-1", "c-2"]);
        assert_eq!((joined.scene_id(1), joined.scene_id(2)), ("a".into(), "c".into()));
        assert!(matches!(joined.get(5), Err(DatasetError::Index { index: 5, len: 5 })));
    }
}
