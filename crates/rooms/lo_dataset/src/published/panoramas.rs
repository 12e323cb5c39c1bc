use std::borrow::Cow;
use std::path::{Path, PathBuf};

use super::crop::{CropModel, Surroundings};
use super::files::{entries, is_hdr, read_panorama, stem};
use crate::{Dataset, DatasetError, Sample};

/// A folder of equirectangular HDR panoramas (`.hdr`, `.exr`, `.pfm`): photos are cut out of them, the panorama is the truth where the camera
/// stands. The Laval Indoor HDR Dataset (Gardner et al. 2017) is such a folder.
#[derive(Debug)]
pub struct Panoramas {
    files: Vec<PathBuf>,
    model: CropModel,
}

impl Panoramas {
    /// Looks for panoramas in the folder itself.
    ///
    /// # Errors
    /// A folder that cannot be read or holds none.
    pub fn open(folder: &Path, model: CropModel) -> Result<Self, DatasetError> {
        let files: Vec<PathBuf> = entries(folder)?.into_iter().filter(|path| is_hdr(path)).collect();
        if files.is_empty() {
            return Err(DatasetError::layout(folder, "no .hdr, .exr or .pfm in it"));
        }
        Ok(Self { files, model })
    }

    fn crops(&self) -> usize {
        self.model.crops.max(1) as usize
    }
}

impl Dataset for Panoramas {
    fn len(&self) -> usize {
        self.files.len() * self.crops()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        stem(&self.files[index / self.crops()]).into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let len = self.len();
        let path = self.files.get(index / self.crops()).ok_or(DatasetError::Index { index, len })?;
        let radiance = read_panorama(path)?;
        let around = Surroundings { radiance: &radiance, depth_m: None, albedo: None };
        Ok(self.model.take(&stem(path), stem(path), index % self.crops(), &around).sample(0))
    }
}
