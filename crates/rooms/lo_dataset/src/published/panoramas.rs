use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use lo_imaging::DepthMap;

use super::crop::{CropModel, PanoramaMaps};
use super::files::{entries, is_hdr, read_panorama, stem};
use super::room_plan::RoomPlan;
use crate::{Dataset, DatasetError, Sample, Split};

/// Folder of equirectangular HDR panoramas (`.hdr`, `.exr`, `.pfm`), such as the Laval Indoor HDR Dataset (Gardner et
/// al. 2017). Photos are cropped from them. The panorama is the ground truth at the camera. Depth is known only for
/// panoramas with a room plan.
#[derive(Debug)]
pub struct Panoramas {
    files: Vec<PanoramaFile>,
    model: CropModel,
}

#[derive(Debug)]
struct PanoramaFile {
    path: PathBuf,
    /// Geometry of its room, if there is a plan.
    room: Option<PlannedRoom>,
    /// Indices of its photos.
    photos: Range<usize>,
}

impl PanoramaFile {
    /// Returns the place it shows. Several files may show one place.
    fn place(&self) -> Cow<'_, str> {
        let named = self.room.as_ref().and_then(|room| room.plan.place());
        named.map_or_else(|| stem(&self.path).into(), Cow::from)
    }
}

/// Room plan with cached distance maps.
#[derive(Debug)]
struct PlannedRoom {
    plan: RoomPlan,
    /// [`RoomPlan::distance_m`] and [`RoomPlan::enclosure_m`] at the panorama's size. Cached because many photos are
    /// cropped from each panorama.
    distances: OnceLock<[DepthMap; 2]>,
}

impl Panoramas {
    /// Opens the panoramas of a folder, without subfolders.
    ///
    /// # Errors
    /// If the folder cannot be read or contains none.
    pub fn open(folder: &Path, model: CropModel) -> Result<Self, DatasetError> {
        let files = entries(folder)?.into_iter().filter(|path| is_hdr(path));
        let files: Vec<_> = files.map(|path| PanoramaFile { path, room: None, photos: 0..0 }).collect();
        if files.is_empty() {
            return Err(DatasetError::layout(folder, "contains no .hdr, .exr or .pfm"));
        }
        Ok(Self { files, model }.with_photo_ranges())
    }

    /// Assigns the same number of photos to each place, divided evenly among its files.
    fn with_photo_ranges(mut self) -> Self {
        let mut files_of = BTreeMap::<String, usize>::new();
        self.files.iter().for_each(|file| *files_of.entry(file.place().into_owned()).or_default() += 1);
        let (mut before, mut begin, all) = (BTreeMap::<String, usize>::new(), 0, self.model.crops.max(1) as usize);
        for file in &mut self.files {
            let (place, of) = (file.place().into_owned(), files_of[&*file.place()]);
            let nth = before.entry(place).or_default();
            let count = all * (*nth + 1) / of - all * *nth / of;
            *nth += 1;
            file.photos = begin..begin + count;
            begin += count;
        }
        self
    }

    fn file_of(&self, index: usize) -> Option<&PanoramaFile> {
        self.files.get(self.files.partition_point(|file| file.photos.end <= index))
    }

    /// Adds the plans of a folder: `NAME.json` of the panorama `NAME.hdr` (`docs/data.md`). Panoramas without a plan
    /// have no depth.
    ///
    /// # Errors
    /// If a plan cannot be read or is invalid, or the folder has a plan of none of the panoramas.
    pub fn with_plans(mut self, folder: &Path) -> Result<Self, DatasetError> {
        for PanoramaFile { path, room, .. } in &mut self.files {
            let file = folder.join(stem(path)).with_extension("json");
            let read = || RoomPlan::read(&file).map(|plan| PlannedRoom { plan, distances: OnceLock::new() });
            *room = file.is_file().then(read).transpose()?;
        }
        if self.files.iter().all(|file| file.room.is_none()) {
            return Err(DatasetError::layout(folder, "contains no plan (NAME.json) of any of the panoramas"));
        }
        Ok(self.with_photo_ranges())
    }
}

impl Dataset for Panoramas {
    fn len(&self) -> usize {
        self.files.last().map_or(0, |file| file.photos.end)
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        stem(&self.file_of(index).expect("the index is below the length").path).into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        self.get_in_epoch(index, 0)
    }

    fn get_in_epoch(&self, index: usize, epoch: u64) -> Result<Sample, DatasetError> {
        let PanoramaFile { path, room, photos } =
            self.file_of(index).ok_or(DatasetError::Index { index, len: self.len() })?;
        let radiance = read_panorama(path)?;
        let (width, height) = (radiance.width(), radiance.height());
        let distances = room.as_ref().map(|PlannedRoom { plan, distances }| {
            distances.get_or_init(|| [plan.distance_m(width, height), plan.enclosure_m(width, height)])
        });
        let [depth_m, enclosure_m] = [0, 1].map(|which| distances.map(|both| &both[which]));
        let maps = PanoramaMaps { radiance: &radiance, depth_m, enclosure_m, albedo: None };
        Ok(self.model.crop(&stem(path), stem(path), (index - photos.start, epoch), &maps).into_sample())
    }

    fn split(&self, index: usize) -> Split {
        Split::of(&self.file_of(index).expect("the index is below the length").place())
    }
}
