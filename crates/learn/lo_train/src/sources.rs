//! The datasets of a run.

use std::sync::Arc;

use lo_dataset::{ConcatDataset, CropModel, Dataset, DatasetLayout, Frames, GeneratedDataset, Generator};

use crate::config::{DataConfig, FramesData};
use crate::error::{ConfigError, TrainError};
use crate::oversampled::Oversampled;
use crate::panorama_data::PanoramaData;

/// Datasets that a run trains and validates on.
pub(crate) struct Sources {
    /// All training data.
    pub all: Arc<dyn Dataset>,
    /// Rooms with known light; one scene in ten is for validation.
    pub rooms: Arc<dyn Dataset>,
    /// Photos cropped from panoramas; one scene in ten is for validation.
    pub panoramas: Arc<dyn Dataset>,
}

impl Sources {
    /// Opens the configured datasets; `seed` determines generated rooms and crops.
    ///
    /// # Errors
    /// Invalid generator configurations, unreadable datasets.
    pub fn open(data: &DataConfig, seed: u64) -> Result<Self, TrainError> {
        let rooms: Arc<dyn Dataset> = match &data.folder {
            Some(folder) => DatasetLayout::detect(folder)?.open(folder, CropModel { seed, ..data.crop })?.into(),
            // Panoramas or frames alone are enough.
            None if !data.panoramas.is_empty() || !data.frames.is_empty() => Arc::new(ConcatDataset::new(Vec::new())),
            None => {
                let generator = Generator::new(seed, data.generator.clone())
                    .map_err(|error| ConfigError::Generator(error.to_string()))?;
                Arc::new(GeneratedDataset::new(generator, data.generated_rooms))
            }
        };
        let panoramas = open_panoramas(&data.panoramas, seed)?;
        let frames = data.frames.iter().map(|FramesData { list, repeats }| {
            Ok(Arc::new(Oversampled::new(Frames::open(list)?, *repeats as usize)) as Arc<dyn Dataset>)
        });
        let frames: Vec<_> = frames.collect::<Result<_, TrainError>>()?;
        // `ConcatDataset` has no blocks, but the photos of a generated room are one block: join only if needed.
        let all = if panoramas.is_empty() && frames.is_empty() {
            rooms.clone()
        } else {
            Arc::new(ConcatDataset::new([rooms.clone(), panoramas.clone()].into_iter().chain(frames).collect()))
        };
        Ok(Self { all, rooms, panoramas })
    }
}

/// Opens folders of panoramas as one dataset.
///
/// # Errors
/// Unreadable folders.
pub(crate) fn open_panoramas(panoramas: &[PanoramaData], seed: u64) -> Result<Arc<dyn Dataset>, TrainError> {
    let open = |PanoramaData { folder, plans, crop }: &PanoramaData| {
        let crop = CropModel { seed, ..*crop };
        Ok(Arc::from(DatasetLayout::Panoramas.open_with_plans(folder, crop, plans.as_deref())?))
    };
    Ok(Arc::new(ConcatDataset::new(panoramas.iter().map(open).collect::<Result<_, TrainError>>()?)))
}
