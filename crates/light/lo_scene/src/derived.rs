use std::sync::OnceLock;

use crate::Frame;

/// Values computed from an estimate once and kept. They are no part of it: copies begin without, and comparisons ignore
/// them.
#[derive(Debug, Default)]
pub struct Derived {
    pub(crate) surface: OnceLock<Frame>,
}

impl Clone for Derived {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for Derived {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
