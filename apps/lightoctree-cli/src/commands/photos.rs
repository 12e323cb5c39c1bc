//! Several photos of one room on the command line of `estimate`.

use std::path::PathBuf;

use anyhow::Context;
use lightoctree::geometry::{Camera, Vec3};
use lightoctree::imaging::mirror_ball::stops_from_exif;
use lightoctree::imaging::{self, PhotoExposure, PhotoFile};
use lightoctree::scene::poses::PhotoPoses;
use lightoctree::scene::{Frame, PosedFrame};
use lightoctree::{Exposures, Input};

use super::parse;
use crate::progress::Stages;
use crate::usage::Usage;

/// Options of several photos.
#[derive(Debug, clap::Args)]
pub struct PhotosArgs {
    /// Where the cameras of several photos stood: one file for all, or one for each
    ///
    /// Known by their content: lightoctree's own JSON, Record3D's metadata.json, frames of 3D Scanner App and of Polycam's raw data, transforms.json of
    /// NeRF programs (in metres), TUM trajectories. What they say of lenses is used where --intrinsics and --hfov-deg are not given.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub poses: Vec<PathBuf>,

    /// Stops by which each of several photos shows the same light brighter, +1 twice as bright [default: from the poses' file or EXIF, else matched]
    #[arg(long, value_name = "EV,EV,…", value_parser = parse::stops, allow_hyphen_values = true)]
    exposures: Option<parse::Stops>,
}

/// Why several photos need a sensor.
pub const PREDICTED: &str =
    "--depth-is predicted: predicted depths of several photos have no common scale; several photos need measured depth";

/// Photos and depth maps of the command line: where options stood before the photos, these are among the depth maps.
pub fn files<'a>(photos: &'a [PathBuf], depths: &'a [PathBuf]) -> anyhow::Result<(&'a [PathBuf], &'a [PathBuf])> {
    let (photos, depths) = match photos {
        [] if depths.len().is_multiple_of(2) => (&depths[depths.len() / 2..], &depths[..depths.len() / 2]),
        [] => return Err(Usage("no photo: name the photos before --depth and --poses".into()).into()),
        _ => (photos, depths),
    };
    match (photos.len(), depths.len()) {
        (1, 0 | 1) => Ok((photos, depths)),
        (count, 0) => {
            let needs = "several photos need --depth, a file for each: predicted depths have no common scale";
            Err(Usage(format!("{count} photos without depth: {needs}")).into())
        }
        (count, files) if count != files => {
            Err(Usage(format!("{files} files of --depth for {count} photos: each photo needs its own")).into())
        }
        _ => Ok((photos, depths)),
    }
}

/// What several photos are to an estimate.
pub struct Several {
    /// The photos.
    pub input: Input,
    /// Against gravity, where the poses know.
    pub up: Option<Vec3>,
}

impl PhotosArgs {
    /// Refuses what only several photos need.
    pub fn unused(&self) -> anyhow::Result<()> {
        let option = match (self.poses.is_empty(), &self.exposures) {
            (true, None) => return Ok(()),
            (false, _) => "--poses",
            (true, Some(_)) => "--exposures",
        };
        Err(Usage(format!("{option} belongs to several photos, and there is one")).into())
    }

    /// Reads photos, depths and poses; `given` is the camera by another option.
    pub fn read(
        &self,
        photos: &[PathBuf],
        depths: &[PathBuf],
        depth_scale: Option<f64>,
        given: impl Fn(&PhotoFile) -> anyhow::Result<Option<(Camera, &'static str)>>,
        stages: &mut Stages,
    ) -> anyhow::Result<Several> {
        if self.poses.is_empty() {
            return Err(Usage(format!("{} photos need --poses: where their cameras stood", photos.len())).into());
        }
        if let Some(parse::Stops(stops)) = self.exposures.as_ref().filter(|stops| stops.0.len() != photos.len()) {
            let count = stops.len();
            return Err(Usage(format!("--exposures: {count} exposures for {} photos", photos.len())).into());
        }
        let poses = PhotoPoses::read(&self.poses, photos)?;
        let files = stages.stage("read photos and depth", || -> anyhow::Result<Vec<_>> {
            let file = |(photo, depth): (&PathBuf, &PathBuf)| {
                Ok((imaging::read_photo(photo)?, imaging::read_depth(depth, depth_scale)?))
            };
            photos.iter().zip(depths).map(file).collect()
        })?;
        stages.note(&format!("poses by {}", poses.format));
        if poses.distorted {
            stages.note("the poses' file states a lens distortion, which is not undone");
        }
        let stops = match &self.exposures {
            Some(parse::Stops(stops)) => Some(stops.iter().map(|ev| ev - stops[0]).collect()),
            None => poses.exposures_ev().or_else(|| exif_stops(files.iter().map(|(photo, _)| photo))),
        };
        let mut frames = Vec::with_capacity(photos.len());
        for (index, (((photo, depth_m), pose), path)) in
            files.into_iter().zip(poses.first_from_cameras()).zip(photos).enumerate()
        {
            let (width, height) = (photo.photo.width() as u32, photo.photo.height() as u32);
            let (camera, source) = if let Some((camera, option)) = given(&photo)? {
                (camera, option.to_owned())
            } else if let Some(camera) = poses.camera(index, width, height)? {
                (camera, "the poses' file".to_owned())
            } else {
                // Depth with poses comes with its camera, or EXIF does: no network is asked.
                let (camera, source) = lightoctree::Estimator::without_networks().camera_of(&photo)?;
                (camera, source.to_string())
            };
            stages.note(&format!("{}: camera of {:.1} degrees across ({source})", path.display(), camera.hfov_deg()));
            let exposure = stops.as_ref().map_or(1.0, |stops: &Vec<f64>| (-stops[index]).exp2() as f32);
            let frame = Frame::new(photo.photo, depth_m, camera, exposure)
                .with_context(|| format!("{} and {} do not fit together", path.display(), depths[index].display()))?;
            frames.push(PosedFrame { frame, first_from_camera: pose });
        }
        let exposures = if stops.is_some() { Exposures::Known } else { Exposures::Matched };
        Ok(Several { input: Input::Photos { photos: frames, exposures }, up: poses.up })
    }
}

/// Stops by which each photo shows the same light brighter than the first, where EXIF tells exposure time and sensitivity of all.
fn exif_stops<'a>(photos: impl Iterator<Item = &'a PhotoFile>) -> Option<Vec<f64>> {
    let shots: Vec<PhotoExposure> = photos.map(|photo| photo.exposure).collect();
    let told = shots.iter().all(|shot| shot.time_s.is_some() && shot.iso.is_some());
    told.then(|| stops_from_exif(&shots)).flatten()
}
