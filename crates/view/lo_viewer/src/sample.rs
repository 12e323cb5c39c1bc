use serde::Serialize;

use crate::opening::{MakeEstimator, NamedFile, PhotoSource, SceneSource};

/// A photo to try the program with.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Title on the page.
    pub title: &'static str,
    /// Name and content of the photo, a JPEG.
    pub photo: (&'static str, &'static [u8]),
    /// Name and content of its depth, if it was measured.
    pub depth: Option<(&'static str, &'static [u8])>,
    /// Focal lengths and principal point, pixels of the photo.
    pub intrinsics: Option<[f64; 4]>,
}

/// A sample as listed on the page.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct SampleView {
    /// Title.
    pub title: &'static str,
    /// Name of the photo.
    pub file: &'static str,
}

impl Sample {
    /// Lists it.
    pub(crate) fn view(&self) -> SampleView {
        SampleView { title: self.title, file: self.photo.0 }
    }

    /// Returns what is opened for it.
    pub(crate) fn source(&self, estimator: MakeEstimator) -> SceneSource {
        let file = |(name, bytes): (&str, &[u8])| NamedFile { name: name.to_owned(), bytes: bytes.to_vec() };
        SceneSource::Photo(PhotoSource {
            photo: file(self.photo),
            depth: self.depth.map(file),
            #[cfg(feature = "depth-models")]
            depth_model: None,
            panorama: None,
            intrinsics: self.intrinsics,
            estimator,
        })
    }
}
