use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use lo_imaging::DepthMap;

use super::crop::{CropModel, Surroundings};
use super::files::{entries, is_hdr, read_panorama, stem};
use super::room_plan::RoomPlan;
use crate::{Dataset, DatasetError, Sample};

/// A folder of equirectangular HDR panoramas (`.hdr`, `.exr`, `.pfm`): photos are cut out of them, the panorama is the truth where the camera
/// stands. The Laval Indoor HDR Dataset (Gardner et al. 2017) is such a folder. Depth is known where somebody has drawn a room's plan.
#[derive(Debug)]
pub struct Panoramas {
    /// Each with the geometry of its room, if there is a plan.
    files: Vec<(PathBuf, Option<Planned>)>,
    model: CropModel,
}

/// A room by its plan.
#[derive(Debug)]
struct Planned {
    plan: RoomPlan,
    /// [`RoomPlan::distance_m`] and [`RoomPlan::enclosure_m`] in the panorama's size: many photos are cut of each.
    distances: OnceLock<[DepthMap; 2]>,
}

impl Panoramas {
    /// Looks for panoramas in the folder itself.
    ///
    /// # Errors
    /// A folder that cannot be read or holds none.
    pub fn open(folder: &Path, model: CropModel) -> Result<Self, DatasetError> {
        let files = entries(folder)?.into_iter().filter(|path| is_hdr(path));
        let files: Vec<_> = files.map(|path| (path, None)).collect();
        if files.is_empty() {
            return Err(DatasetError::layout(folder, "no .hdr, .exr or .pfm in it"));
        }
        Ok(Self { files, model })
    }

    /// With the plans of a folder: `NAME.json` of the panorama `NAME.hdr` (`docs/data.md`). Panoramas without one keep having no depth.
    ///
    /// # Errors
    /// A plan that cannot be read or is none; a folder with plans of none of these panoramas.
    pub fn with_plans(mut self, folder: &Path) -> Result<Self, DatasetError> {
        for (path, plan) in &mut self.files {
            let file = folder.join(stem(path)).with_extension("json");
            let planned = || RoomPlan::read(&file).map(|plan| Planned { plan, distances: OnceLock::new() });
            *plan = file.is_file().then(planned).transpose()?;
        }
        if self.files.iter().all(|(_, plan)| plan.is_none()) {
            return Err(DatasetError::layout(folder, "no plan (NAME.json) of any of the panoramas"));
        }
        Ok(self)
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
        stem(&self.files[index / self.crops()].0).into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let len = self.len();
        let (path, plan) = self.files.get(index / self.crops()).ok_or(DatasetError::Index { index, len })?;
        let radiance = read_panorama(path)?;
        let (width, height) = (radiance.width(), radiance.height());
        let distances = plan.as_ref().map(|Planned { plan, distances }| {
            distances.get_or_init(|| [plan.distance_m(width, height), plan.enclosure_m(width, height)])
        });
        let [depth_m, enclosure_m] = [0, 1].map(|which| distances.map(|both| &both[which]));
        let around = Surroundings { radiance: &radiance, depth_m, enclosure_m, albedo: None };
        Ok(self.model.take(&stem(path), stem(path), index % self.crops(), &around).sample(0))
    }
}
