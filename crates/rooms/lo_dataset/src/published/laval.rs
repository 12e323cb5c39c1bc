use std::borrow::Cow;
use std::path::{Path, PathBuf};

use lo_geometry::{Camera, Quat};
use lo_imaging::{RadianceImage, read_radiance, resize_equirectangular};
use lo_sensor::PhotoModel;
use serde::Deserialize;

use super::files::{check_jpeg, clean, folders, name, photographed, read_panorama};
use crate::sample::Metadata;
use crate::{Dataset, DatasetError, NovelView, Record, Sample};

/// File that describes a scene's files.
const SCENE: &str = "scene.json";
/// Height of the returned panoramas.
const PANORAMA_HEIGHT: usize = 128;

/// Laval spatially varying test set (Garon et al. 2019): per scene an HDR photo and HDR light probes at positions in
/// it.
///
/// Each folder `<scene>/` needs a `scene.json` that names the photo and the probes. The published archive does not
/// contain it; its file names could not be verified and are not guessed. Example: `{"photo": "crop.exr", "hfov_deg":
/// 60, "probes": [{"file": "probe0.exr", "u": 210, "v": 190, "depth_m": 2.1}]}`. `u` and `v` are pixels of the photo
/// with centres at +0.5; depth is along the optical axis.
#[derive(Debug)]
pub struct LavalVarying {
    scenes: Vec<PathBuf>,
    photo: PhotoModel,
    seed: u64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    photo: String,
    hfov_deg: f64,
    probes: Vec<ProbeDescription>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ProbeDescription {
    file: String,
    u: f64,
    v: f64,
    depth_m: f64,
}

impl LavalVarying {
    /// Whether a folder looks like the dataset.
    pub(crate) fn is_at(folder: &Path) -> bool {
        folders(folder).is_ok_and(|scenes| scenes.iter().any(|scene| scene.join(SCENE).is_file()))
    }

    /// Opens the scenes of a folder. LDR photos are made with `photo` and `seed`.
    ///
    /// # Errors
    /// If the folder cannot be read or contains no scene.
    pub fn open(folder: &Path, photo: PhotoModel, seed: u64) -> Result<Self, DatasetError> {
        let scenes: Vec<PathBuf> = folders(folder)?.into_iter().filter(|scene| scene.join(SCENE).is_file()).collect();
        if scenes.is_empty() {
            return Err(DatasetError::layout(folder, format!("contains no <scene>/{SCENE}")));
        }
        Ok(Self { scenes, photo, seed })
    }
}

impl Dataset for LavalVarying {
    fn len(&self) -> usize {
        self.scenes.len()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        name(&self.scenes[index]).into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let folder = self.scenes.get(index).ok_or(DatasetError::Index { index, len: self.scenes.len() })?;
        let path = folder.join(SCENE);
        let text = std::fs::read(&path).map_err(DatasetError::io(&path))?;
        let scene: Description =
            serde_json::from_slice(&text).map_err(|error| DatasetError::field(&path, "description", error))?;
        let seen: RadianceImage = read_radiance(folder.join(&scene.photo))?;
        check_jpeg(&folder.join(&scene.photo), &seen)?;
        let camera = Camera::from_hfov_deg(scene.hfov_deg, seen.width() as u32, seen.height() as u32)
            .map_err(|error| DatasetError::field(&path, "hfov_deg", error))?;
        let mut views = Vec::with_capacity(scene.probes.len());
        for (i, probe) in scene.probes.iter().enumerate() {
            let wrong =
                |field: &str, reason: String| DatasetError::field(&path, format!("probes[{i}].{field}"), reason);
            if !(probe.depth_m > 0.0 && probe.depth_m.is_finite()) {
                return Err(wrong("depth_m", format!("{} is not positive", probe.depth_m)));
            }
            for (field, value, max) in [("u", probe.u, camera.width), ("v", probe.v, camera.height)] {
                if !(0.0..=f64::from(max)).contains(&value) {
                    return Err(wrong(field, format!("{value} is outside the photo's {max} pixels")));
                }
            }
            let map = read_panorama(&folder.join(&probe.file))?;
            views.push(NovelView {
                position_m: camera.unproject(probe.u, probe.v, probe.depth_m),
                rotation: Quat::IDENTITY,
                radiance: resize_equirectangular(&map, 2 * PANORAMA_HEIGHT, PANORAMA_HEIGHT),
                depth_m: None,
            });
        }
        let id = name(folder);
        let mut stream = lo_random::stream(self.seed ^ lo_random::hash(id.as_bytes()), "photo", 0);
        let settings = self.photo.draw(&mut stream);
        let mut shot = photographed(&settings, &seen, camera, &mut stream);
        shot.radiance = shot.radiance.map(|radiance| radiance.map(clean));
        shot.views = (0..views.len()).collect();
        let record = Record {
            key: id.clone(),
            scene_id: id,
            up: None,
            points: Vec::new(),
            point_area_m2: None,
            views,
            shots: vec![shot],
            metadata: Metadata::new(),
        };
        Ok(record.into_sample())
    }
}
