use std::sync::OnceLock;

use lo_geometry::Vec3;
use lo_imaging::{BlackBars, Image};

use crate::Frame;

/// Cache of values computed from an estimate. It is not part of the estimate: clones start empty, and comparisons
/// ignore it.
#[derive(Debug, Default)]
pub struct Derived {
    pub(crate) black_bars: OnceLock<Option<BlackBars>>,
    pub(crate) surface: OnceLock<Frame>,
    pub(crate) surface_normals: OnceLock<Image<Option<Vec3>>>,
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
