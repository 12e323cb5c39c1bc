use std::path::PathBuf;

use lo_baselines::BaselineError;
use lo_dataset::DatasetError;
use lo_events::Cancelled;

use crate::ExternalError;

/// Errors of an evaluation.
#[derive(Debug, thiserror::Error)]
pub enum EvalError {
    /// The dataset or a sample cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// Panoramas of other programs cannot be read, or panoramas cannot be written.
    #[error(transparent)]
    External(#[from] ExternalError),
    /// The event handler cancelled the writing of photos.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A baseline does not belong to the networks.
    #[error(transparent)]
    Baseline(#[from] BaselineError),
    /// Lighthouse's choices are asked for of another dataset.
    #[error("{}: InteriorNet or Lighthouse's test set is needed, but the layout is {layout}", dataset.display())]
    NotInteriorNet {
        /// The dataset.
        dataset: PathBuf,
        /// Name of its layout.
        layout: &'static str,
    },
    /// The selected part has no photos.
    #[error("{}: none of the {photos} photos is in the selected part", dataset.display())]
    NoPhotos {
        /// The dataset.
        dataset: PathBuf,
        /// Photos in the whole dataset.
        photos: usize,
    },
}
