//! Objects in the images of a moving camera.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use lightoctree::footage::{ScaleFit, ScaleSource, Shot, ShotWarning, likeness};
use lightoctree::{Estimate, LitScene};
use lo_geometry::{Camera, Vec3};
use lo_imaging as imaging;
use lo_imaging::Photo;
use lo_insert::Plate;
use lo_scene::poses::{PhotoPoses, PoseFormat};
use lo_scene::{DistortedPhoto, Undistortion};

use crate::commands::parse;
use crate::numbered_name::NumberedName;
use crate::progress::Stages;
use crate::usage::Usage;

/// Largest difference between a plate and the scene's photo if they are one image.
const SAME_IMAGE: f32 = 0.015;

/// Number of plates that the scale of the track is measured with.
const SCALE_PLATES: usize = 8;

/// Largest relative difference between the scene's field of view and the track's without a warning.
const LENS_TOLERANCE: f64 = 0.02;

/// Largest relative difference in aspect ratio between plates and photo.
const ASPECT_TOLERANCE: f64 = 0.01;

/// Options of footage.
#[derive(Debug, clap::Args)]
pub struct FootageArgs {
    /// Images of a moving camera into which the objects are inserted, instead of the scene's photo: a file name with
    /// %04d. One of them is the scene's photo
    #[arg(long, value_name = "FILE_%04d", requires = "camera")]
    plate: Option<PathBuf>,

    /// Camera track of the plates: one file for all, or one per plate
    ///
    /// The formats are those of `estimate --poses`, and text models of COLMAP; docs/footage.md lists them.
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "plate")]
    camera: Vec<PathBuf>,

    /// Numbers of the first and the last plate [default: all files]
    #[arg(long, value_name = "FIRST-LAST", value_parser = parse::number_range, requires = "plate")]
    plate_range: Option<[u32; 2]>,

    /// Number of the plate that is the scene's photo [default: found by its content]
    #[arg(long, value_name = "N", requires = "plate")]
    scene_plate: Option<u32>,

    /// Metres of the scene per unit of the camera track [default: 1 if both are measured, else found by the plates]
    #[arg(long, value_name = "S", value_parser = parse::positive, allow_hyphen_values = true, requires = "plate")]
    track_scale: Option<f64>,

    /// Measured depth of the plates, a file name with %04d, for what moves in the room [default: the scene's surfaces]
    #[arg(long, value_name = "FILE_%04d", requires = "plate")]
    plate_depth: Option<PathBuf>,
}

/// Files of the plates.
pub struct PlateFiles {
    name: NumberedName,
    /// Numbers of all existing plates, which may include others than those to render.
    all: Vec<usize>,
    /// Range within them that is rendered.
    rendered: std::ops::Range<usize>,
    depth: Option<NumberedName>,
}

impl PlateFiles {
    /// Returns the numbers of the plates to render.
    pub fn numbers(&self) -> Vec<usize> {
        self.all[self.rendered.clone()].to_vec()
    }

    /// Returns a note about missing files between the first and the last.
    fn gap(&self) -> Option<String> {
        let numbers = self.numbers();
        let (first, last) = (*numbers.first()?, *numbers.last()?);
        let missing = (first..=last).filter(|number| numbers.binary_search(number).is_err());
        let (count, missing) = (missing.clone().count(), missing.map(|number| self.name.name(number)).next()?);
        Some(format!("{count} of the plates from {first} to {last} do not exist, such as {}", missing.display()))
    }
}

/// Plates with their cameras in a scene.
pub struct Footage<'a> {
    files: &'a PlateFiles,
    shot: Shot<'a>,
    poses: PhotoPoses,
    estimate: &'a Estimate,
}

impl FootageArgs {
    /// Finds the plates; `None` without them.
    ///
    /// # Errors
    /// [`Usage`] if there are none.
    pub fn plates(&self) -> anyhow::Result<Option<PlateFiles>> {
        let Some(pattern) = &self.plate else { return Ok(None) };
        let name = NumberedName::parse(pattern, "--plate")?;
        let all = name.existing().with_context(|| format!("cannot list {}", pattern.display()))?;
        let [first, last] = match self.plate_range {
            Some(range) => range.map(|number| number as usize),
            None => [0, usize::MAX],
        };
        let start = all.partition_point(|&number| number < first);
        let rendered = start..all.partition_point(|&number| number <= last).max(start);
        if rendered.is_empty() {
            let what = if all.is_empty() { "no such file" } else { "no file within --plate-range" };
            return Err(Usage(format!("--plate {}: {what}", pattern.display())).into());
        }
        let depth = self.plate_depth.as_deref().map(|depth| NumberedName::parse(depth, "--plate-depth")).transpose()?;
        Ok(Some(PlateFiles { name, all, rendered, depth }))
    }

    /// Reads the track, finds the scene's photo among the plates, and measures the track's scale, best at the positions
    /// `near`.
    ///
    /// # Errors
    /// Unreadable files, tracks without a pose of a plate, and plates without the scene's photo.
    pub fn open<'a>(
        &self,
        files: &'a PlateFiles,
        scene: &'a LitScene,
        near: &[Vec3],
        stages: &mut Stages,
    ) -> anyhow::Result<Footage<'a>> {
        files.gap().iter().for_each(|gap| stages.note(gap));
        let paths: Vec<PathBuf> = files.all.iter().map(|&number| files.name.name(number)).collect();
        let poses = PhotoPoses::read(&self.camera, &paths)?;
        let reference = self.reference(files, &paths, scene, stages)?;
        let shot = Shot::new(scene, &poses.first_from_cameras(), reference)?;
        let mut footage = Footage { files, shot, poses, estimate: scene };
        let own = &scene.frame.camera;
        if let Some(lens) = footage.poses.camera(reference, own.width, own.height)? {
            let (scene_deg, track_deg) = (own.hfov_deg(), lens.hfov_deg());
            let is_undistorted = scene.distorted.is_some();
            if !is_undistorted && (scene_deg / track_deg).ln().abs() > LENS_TOLERANCE {
                stages.warn(&ShotWarning::OtherLens { scene_deg, track_deg });
            }
        }
        let how = match self.track_scale {
            Some(scale) => {
                footage.shot.set_scale(scale as f32);
                format!("{scale} m per unit of the track")
            }
            None if !scene.origin.predicted_depth && is_metric(footage.poses.format) => "in metres".to_owned(),
            None => {
                let ScaleFit { scale, source } = stages.stage("scale of the track", || footage.fit_scale(near))?;
                match source {
                    ScaleSource::Plates => format!("{scale:.3} m per unit of the track, by the plates"),
                    ScaleSource::NoMotion => "the camera hardly moves".to_owned(),
                    ScaleSource::Unknown => {
                        stages.warn(&ShotWarning::ScaleUnknown);
                        "1 m per unit of the track".to_owned()
                    }
                }
            }
        };
        let format = footage.poses.format;
        let photo = paths[reference].display();
        stages.note(&format!("camera track: {format}, {how}; {photo} is the scene's photo"));
        Ok(footage)
    }

    /// Returns the index of the plate that is the scene's photo.
    fn reference(
        &self,
        files: &PlateFiles,
        paths: &[PathBuf],
        scene: &LitScene,
        stages: &mut Stages,
    ) -> anyhow::Result<usize> {
        if let Some(number) = self.scene_plate {
            return files.all.binary_search(&(number as usize)).map_err(|_| {
                let path = files.name.name(number as usize);
                Usage(format!("--scene-plate {number}: there is no {}", path.display())).into()
            });
        }
        let photo = scene.distorted.as_ref().map_or(&scene.frame.photo, |distorted| &distorted.photo);
        // Those named like the scene's photo first.
        let is_source = |path: &PathBuf| {
            let name = path.file_name().map(|name| name.to_string_lossy());
            name.is_some_and(|name| scene.origin.sources.iter().any(|source| *source == name))
        };
        let mut order: Vec<usize> = (0..paths.len()).collect();
        order.sort_by_key(|&index| !is_source(&paths[index]));
        let found = stages.stage("find the scene's photo", || -> anyhow::Result<(usize, f32)> {
            let mut best = (0, f32::INFINITY);
            for index in order {
                let difference = likeness(&imaging::read_photo(&paths[index])?.photo, photo);
                if difference < best.1 {
                    best = (index, difference);
                }
                // Without its name, its neighbours may look the same at this size.
                if difference < SAME_IMAGE && is_source(&paths[index]) {
                    break;
                }
            }
            Ok(best)
        })?;
        if found.1 > SAME_IMAGE {
            let likest = paths[found.0].display();
            let message = format!(
                "no plate is the scene's photo; {likest} is most like it. Estimate the scene from a plate, or name the \
                 plate that was taken from the same place with --scene-plate N"
            );
            return Err(Usage(message).into());
        }
        Ok(found.0)
    }
}

/// Whether a format's unit is the metre because devices measure it.
fn is_metric(format: PoseFormat) -> bool {
    matches!(format, PoseFormat::Record3d | PoseFormat::ScannerApp | PoseFormat::Polycam | PoseFormat::Tum)
}

/// A plate as read.
struct Read {
    photo: Photo,
    camera: Camera,
    distorted: Option<Arc<DistortedPhoto>>,
    undistortion: Option<Undistortion>,
}

impl Footage<'_> {
    /// Returns the size of the plates.
    ///
    /// # Errors
    /// The first is unreadable.
    pub fn size(&self) -> anyhow::Result<(usize, usize)> {
        let photo = imaging::read_photo(self.path(self.files.rendered.start))?.photo;
        Ok((photo.width(), photo.height()))
    }

    /// Prepares a plate, counted from 0.
    ///
    /// # Errors
    /// Unreadable files, and plates whose shape is not that of the scene's photo.
    pub fn plate(&mut self, frame: usize) -> anyhow::Result<Plate> {
        let index = self.files.rendered.start + frame;
        let Read { photo, camera, distorted, undistortion } = self.read(index)?;
        let number = self.files.all[index];
        let depth_m = match &self.files.depth {
            Some(depth) => {
                let mut depth_m = imaging::read_depth(depth.name(number), None)?;
                let scale = self.shot.scale();
                depth_m.pixels_mut().iter_mut().for_each(|depth_m| *depth_m *= scale);
                Some(undistortion.map_or_else(|| depth_m.clone(), |undistortion| undistortion.depth(&depth_m)))
            }
            None => None,
        };
        let plate = self.shot.plate(index, photo, camera, distorted, depth_m);
        plate.with_context(|| self.path(index).display().to_string())
    }

    fn path(&self, index: usize) -> PathBuf {
        self.files.name.name(self.files.all[index])
    }

    /// Reads a plate and undoes the distortion of its lens, by the track or else the scene's.
    fn read(&self, index: usize) -> anyhow::Result<Read> {
        let path = self.path(index);
        let photo = imaging::read_photo(&path)?.photo;
        let (width, height) = (photo.width() as u32, photo.height() as u32);
        let scenes = self.estimate.distorted.as_ref().map(|distorted| &distorted.undistortion);
        let own = scenes.map_or(self.estimate.frame.camera, Undistortion::distorted_camera);
        let camera = match self.poses.camera(index, width, height)? {
            Some(camera) => camera,
            None => resized(&own, width, height, &path)?,
        };
        let distortion = self.poses.distortion(index).or(scenes.map(Undistortion::distortion));
        let Some(distortion) = distortion else {
            return Ok(Read { photo, camera, distorted: None, undistortion: None });
        };
        let undistortion = Undistortion::new(camera, distortion).with_context(|| path.display().to_string())?;
        let undistorted = undistortion.photo(&photo);
        let distorted = Some(Arc::new(DistortedPhoto::new(photo, undistortion)));
        Ok(Read { photo: undistorted, camera: undistortion.camera, distorted, undistortion: Some(undistortion) })
    }

    /// Measures the scale of the track.
    fn fit_scale(&mut self, near: &[Vec3]) -> anyhow::Result<ScaleFit> {
        let chosen = self.shot.scale_plates(SCALE_PLATES);
        let mut plates = Vec::with_capacity(chosen.len());
        for index in chosen {
            let Read { photo, camera, .. } = self.read(index)?;
            plates.push((index, photo, camera));
        }
        Ok(self.shot.fit_scale(&plates, near)?)
    }
}

/// Returns the scene's camera at the size of a plate.
fn resized(camera: &Camera, width: u32, height: u32, path: &Path) -> anyhow::Result<Camera> {
    let aspect = |width: u32, height: u32| f64::from(width) / f64::from(height);
    if (aspect(width, height) / aspect(camera.width, camera.height)).ln().abs() > ASPECT_TOLERANCE {
        anyhow::bail!(
            "{} has {width} × {height} pixels, another shape than the scene's photo of {} × {}, and the track states no \
             lens",
            path.display(),
            camera.width,
            camera.height
        );
    }
    Ok(camera.resized(width, height))
}
