use std::borrow::Cow;
use std::path::{Path, PathBuf};

use lo_geometry::{Quat, Vec3, pixel_direction};
use lo_imaging::{DepthMap, Image, RadianceImage, read_radiance};
use lo_random::seq::SliceRandom;
use serde::Deserialize;

use super::crop::{CropModel, PanoramaMaps, pixel_at};
use super::files::{check_size, clean, entries, folders, name, read_panorama, size};
use super::panorama_depth::{filled, inverse, traced_m};
use super::splits::PublishedSplits;
use crate::{Dataset, DatasetError, NovelView, Record, Sample, Split};

/// Metres per unit of `_depth.hdr`: the authors' reader multiplies by 10 / 2.
const METRES: f32 = 5.0;
/// Largest depth that the authors' reader accepts.
const FARTHEST_M: f32 = 10.0;
/// Height of a probe in `_light.exr`, which contains a grid of probes.
const PROBE_HEIGHT: usize = 16;
/// Maximum number of probes per sample.
const PROBES: usize = 6;

/// FutureHouse (Li et al., "PhyIR", CVPR 2022), in the layout of its authors' reader (`DataSet.py` of the dataset's
/// repository): `<id>/ue4_result/CubemapData/<i>_{image,albedo,depth,…}.hdr`, equirectangular, and
/// `<id>/ue4_result/LightProbeData/<i>_light.exr`. Both are in one folder, or below `KePanoData` and `KePanoLight`.
///
/// Photos are cropped from the panoramas. The ground truth is the panorama at the camera and up to six probes in the
/// photo, if there are any. Surface points are the panorama's pixels; those without depth, such as windows, are at the
/// nearest known depth. Distances of a probe are traced through the panorama's depth; behind what the panorama shows
/// they are unknown.
///
/// The authors' `split.json`, in the folder or beside it, assigns the houses to training, validation and test. Houses
/// that it does not name, or all without it, are assigned by [`Split::of`].
#[derive(Debug)]
pub struct FutureHouse {
    panoramas: Vec<Panorama>,
    splits: PublishedSplits,
    model: CropModel,
}

/// The authors' `split.json`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct PublishedSplit {
    train: Vec<String>,
    val: Vec<String>,
    test: Vec<String>,
}

impl PublishedSplit {
    const FILE: &str = "split.json";

    /// Reads the file in one of these folders, if there is one.
    fn read<'a>(folders: impl IntoIterator<Item = &'a Path>) -> Result<PublishedSplits, DatasetError> {
        let Some(path) = folders.into_iter().map(|folder| folder.join(Self::FILE)).find(|path| path.is_file()) else {
            return Ok(PublishedSplits::default());
        };
        let text = std::fs::read(&path).map_err(DatasetError::io(&path))?;
        let Self { train, val, test } =
            serde_json::from_slice(&text).map_err(|error| DatasetError::field(&path, "split", error))?;
        let mut splits = PublishedSplits::default();
        for (houses, split) in [(train, Split::Train), (val, Split::Validation), (test, Split::Test)] {
            for house in houses {
                if splits.assign(&house, split).is_some_and(|other| other != split) {
                    return Err(DatasetError::field(&path, "split", format!("{house} is in two parts")));
                }
            }
        }
        Ok(splits)
    }
}

#[derive(Debug)]
struct Panorama {
    house: String,
    number: String,
    image: PathBuf,
    light: Option<PathBuf>,
}

impl FutureHouse {
    /// Whether a folder looks like the dataset.
    pub(crate) fn is_at(folder: &Path) -> bool {
        folder.join("KePanoData").is_dir()
            || folders(folder).is_ok_and(|houses| houses.iter().take(50).any(|h| h.join("ue4_result").is_dir()))
    }

    /// Opens the panoramas of a folder.
    ///
    /// # Errors
    /// If a folder or `split.json` cannot be read, or there is no panorama.
    pub fn open(folder: &Path, model: CropModel) -> Result<Self, DatasetError> {
        let (data, light) = match folder.join("KePanoData") {
            split if split.is_dir() => (split, folder.join("KePanoLight")),
            _ => (folder.to_owned(), folder.to_owned()),
        };
        let mut panoramas = Vec::new();
        for house in folders(&data)? {
            let cubemaps = house.join("ue4_result").join("CubemapData");
            if !cubemaps.is_dir() {
                continue;
            }
            for image in entries(&cubemaps)? {
                let Some(number) = name(&image).strip_suffix("_image.hdr").map(str::to_owned) else { continue };
                let house = name(&house);
                let probes = light.join(&house).join("ue4_result").join("LightProbeData");
                let light = Some(probes.join(format!("{number}_light.exr"))).filter(|path| path.is_file());
                panoramas.push(Panorama { house, number, image, light });
            }
        }
        if panoramas.is_empty() {
            return Err(DatasetError::layout(&data, "contains no <id>/ue4_result/CubemapData/<i>_image.hdr"));
        }
        let splits = PublishedSplit::read([folder, &data].into_iter().chain(folder.parent()))?;
        Ok(Self { panoramas, splits, model })
    }

    fn crops(&self) -> usize {
        self.model.crops.max(1) as usize
    }
}

impl Dataset for FutureHouse {
    fn len(&self) -> usize {
        self.panoramas.len() * self.crops()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        self.panoramas[index / self.crops()].house.as_str().into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        self.get_in_epoch(index, 0)
    }

    fn get_in_epoch(&self, index: usize, epoch: u64) -> Result<Sample, DatasetError> {
        let len = self.len();
        let panorama = self.panoramas.get(index / self.crops()).ok_or(DatasetError::Index { index, len })?;
        let radiance = read_panorama(&panorama.image)?;
        let depth_m = panorama.depth(&radiance)?;
        let albedo_file = panorama.beside("albedo");
        let albedo = if albedo_file.is_file() {
            let albedo = read_panorama(&albedo_file)?;
            check_size(&albedo_file, size(&albedo), "the panorama", size(&radiance))?;
            Some(albedo)
        } else {
            None
        };
        let enclosure_m = filled(&depth_m);
        let maps = PanoramaMaps {
            radiance: &radiance,
            depth_m: Some(&depth_m),
            enclosure_m: Some(&enclosure_m),
            albedo: albedo.as_ref(),
        };
        let id = format!("{}-{}", panorama.house, panorama.number);
        let mut record = self.model.crop(&id, panorama.house.clone(), (index % self.crops(), epoch), &maps);
        self.splits.note(&panorama.house, &mut record.shots[0].metadata);
        if let Some(light) = &panorama.light {
            add_probes(light, &depth_m, &enclosure_m, self.model.seed, &mut record)?;
        }
        Ok(record.into_sample())
    }

    fn split(&self, index: usize) -> Split {
        self.splits.of(&self.panoramas[index / self.crops()].house)
    }
}

impl Panorama {
    fn beside(&self, what: &str) -> PathBuf {
        self.image.with_file_name(format!("{}_{what}.hdr", self.number))
    }

    fn depth(&self, radiance: &RadianceImage) -> Result<DepthMap, DatasetError> {
        let path = self.beside("depth");
        let stored = read_radiance(&path)?;
        check_size(&path, size(&stored), "the panorama", size(radiance))?;
        let depth_m = stored.map(|rgb| match rgb[0] * METRES {
            metres if metres > 0.0 && metres <= FARTHEST_M => metres,
            _ => 0.0,
        });
        if depth_m.pixels().iter().all(|&z| z == 0.0) {
            return Err(DatasetError::field(&path, "depth", "no value within (0, 2], which is 0 to 10 m"));
        }
        Ok(depth_m)
    }
}

/// Adds the probes that the photo observes. Probe (column, row) of the grid is at the surface seen by the panorama's
/// pixel at the same relative position.
fn add_probes(
    path: &Path,
    depth_m: &DepthMap,
    enclosure_m: &DepthMap,
    seed: u64,
    record: &mut Record,
) -> Result<(), DatasetError> {
    let light = read_radiance(path)?;
    let (width, height) = (light.width(), light.height());
    let (columns, rows) = (width / (2 * PROBE_HEIGHT), height / PROBE_HEIGHT);
    if columns == 0 || rows == 0 || width % (2 * PROBE_HEIGHT) != 0 || height % PROBE_HEIGHT != 0 {
        let reason =
            format!("{width} × {height} pixels are not a grid of probes of {} × {PROBE_HEIGHT}", 2 * PROBE_HEIGHT);
        return Err(DatasetError::field(path, "size", reason));
    }
    let shot = &record.shots[0];
    let camera_from_record = shot.rotation.inverse();
    let mut seen: Vec<(usize, usize, Vec3)> = Vec::new();
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let direction = pixel_direction(column, row, columns, rows);
        let distance_m = depth_m[pixel_at(depth_m, direction)];
        if distance_m <= 0.0 {
            continue;
        }
        let position = direction * distance_m;
        let inside = shot.camera.project(camera_from_record * position).is_some_and(|(u, v, _)| {
            u >= 0.0 && v >= 0.0 && u < f64::from(shot.camera.width) && v < f64::from(shot.camera.height)
        });
        if inside {
            seen.push((column, row, position));
        }
    }
    let mut stream = lo_random::stream(seed ^ lo_random::hash(record.key.as_bytes()), "probes", 0);
    seen.shuffle(&mut stream);
    let inverse = inverse(enclosure_m);
    for (column, row, position_m) in seen {
        if record.views.len() > PROBES {
            break;
        }
        // The grid's probes are rotated by 180° from the panorama: their centre column looks backwards.
        let probe = Image::from_fn(2 * PROBE_HEIGHT, PROBE_HEIGHT, |x, y| {
            let x = (x + PROBE_HEIGHT) % (2 * PROBE_HEIGHT);
            clean(&light[(column * 2 * PROBE_HEIGHT + x, row * PROBE_HEIGHT + y)])
        });
        // In version 1, the probes of the top and bottom faces are black.
        if probe.pixels().iter().flatten().all(|&v| v == 0.0) {
            continue;
        }
        record.shots[0].views.push(record.views.len());
        let distance_m = Image::from_fn(2 * PROBE_HEIGHT, PROBE_HEIGHT, |x, y| {
            let direction = pixel_direction(x, y, 2 * PROBE_HEIGHT, PROBE_HEIGHT);
            traced_m(&inverse, position_m, direction).unwrap_or(0.0)
        });
        record.views.push(NovelView {
            position_m,
            rotation: Quat::IDENTITY,
            radiance: probe,
            depth_m: Some(distance_m),
        });
    }
    Ok(())
}
