use std::collections::HashMap;

use crate::Split;
use crate::sample::Metadata;

/// The published split of a dataset. Scenes that it does not name are assigned by [`Split::of`].
#[derive(Debug, Default)]
pub(super) struct PublishedSplits(HashMap<String, Split>);

impl PublishedSplits {
    /// Assigns a scene and returns what it was assigned to before.
    pub fn assign(&mut self, scene: &str, split: Split) -> Option<Split> {
        self.0.insert(scene.to_owned(), split)
    }

    /// Returns the split of a scene.
    pub fn of(&self, scene: &str) -> Split {
        self.0.get(scene).copied().unwrap_or_else(|| Split::of(scene))
    }

    /// Notes a scene's published split in a sample's metadata, from which converted shards read it.
    pub fn note(&self, scene: &str, metadata: &mut Metadata) {
        if let Some(split) = self.0.get(scene) {
            metadata.insert(Split::KEY.to_owned(), serde_json::json!(split));
        }
    }
}
