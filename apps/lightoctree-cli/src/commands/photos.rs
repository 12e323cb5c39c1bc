//! Options of `estimate` for several photos of one room.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context;
use lightoctree::events::EstimateWarning;
use lightoctree::{Exposures, Input};
use lo_geometry::{Camera, Vec3};
use lo_imaging as imaging;
use lo_imaging::{PhotoExposure, PhotoFile};
use lo_mirror_ball::stops_from_exif;
use lo_scene::poses::PhotoPoses;
use lo_scene::{DistortedPhoto, Frame, PosedFrame, Undistortion};

use super::lens::LensArgs;
use super::parse;
use crate::depth_units::DepthUnits;
use crate::progress::Stages;
use crate::report;
use crate::usage::Usage;

/// Options of several photos.
#[derive(Debug, clap::Args)]
pub struct PhotosArgs {
    /// Camera poses of several photos: one file for all, or one per photo
    ///
    /// Formats are recognised by their content: lightoctree's JSON, Record3D's metadata.json, frames of 3D Scanner App
    /// and of Polycam's raw data, transforms.json of NeRF programs (in metres), TUM trajectories, Nuke's .chan (in
    /// metres, rotation order ZXY), USD as text (.usda). Their intrinsics are used unless --intrinsics or --hfov-deg is
    /// given.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub poses: Vec<PathBuf>,

    /// Exposure of each of several photos in stops; +1 shows the same light twice as bright [default: from the pose
    /// file or EXIF, else matched]
    #[arg(long, value_name = "EV,EV,…", value_parser = parse::exposures_ev, allow_hyphen_values = true)]
    exposures: Option<parse::ExposuresEv>,
}

/// Error of predicted or inverse depth for several photos.
pub const PREDICTED: &str =
    "--depth-is: several photos need measured depth, because predicted depths have no common scale";

/// Separates photos from depth maps. If the options precede the photos, clap parses the photos as depth maps.
///
/// # Errors
/// The number of depth maps does not match the number of photos.
pub fn files<'a>(photos: &'a [PathBuf], depths: &'a [PathBuf]) -> anyhow::Result<(&'a [PathBuf], &'a [PathBuf])> {
    let (photos, depths) = match photos {
        [] if depths.len().is_multiple_of(2) => (&depths[depths.len() / 2..], &depths[..depths.len() / 2]),
        [] => return Err(Usage("no photo; give the photos before --depth and --poses".into()).into()),
        _ => (photos, depths),
    };
    match (photos.len(), depths.len()) {
        (1, 0 | 1) => Ok((photos, depths)),
        (count, 0) => {
            let reason =
                "several photos need --depth with one file each, because predicted depths have no common scale";
            Err(Usage(format!("{count} photos without depth: {reason}")).into())
        }
        (count, files) if count != files => Err(Usage(format!(
            "{} of --depth for {count} photos; each photo needs one",
            report::counted(files, "file")
        ))
        .into()),
        _ => Ok((photos, depths)),
    }
}

/// Several photos of a room, read and validated.
pub struct PosedPhotos {
    /// Input of the estimate.
    pub input: Input,
    /// Up direction, if the pose file states it.
    pub up: Option<Vec3>,
    /// The first photo before its distortion was undone.
    pub distorted: Option<Arc<DistortedPhoto>>,
}

impl PhotosArgs {
    /// Checks that no option of several photos is given for a single one.
    pub fn check_unused(&self) -> anyhow::Result<()> {
        let option = match (self.poses.is_empty(), &self.exposures) {
            (true, None) => return Ok(()),
            (false, _) => "--poses",
            (true, Some(_)) => "--exposures",
        };
        Err(Usage(format!("{option} applies to several photos only, but one photo is given")).into())
    }

    /// Reads photos, depth maps and poses. `lens` has precedence over the lenses of the pose file.
    pub fn read(
        &self,
        photos: &[PathBuf],
        depths: &[PathBuf],
        depth_scale: Option<f64>,
        lens: &LensArgs,
        stages: &mut Stages,
    ) -> anyhow::Result<PosedPhotos> {
        if self.poses.is_empty() {
            return Err(Usage(format!("{} photos need --poses with their camera poses", photos.len())).into());
        }
        if let Some(parse::ExposuresEv(exposures)) = &self.exposures
            && exposures.len() != photos.len()
        {
            let count = exposures.len();
            return Err(Usage(format!("--exposures: {count} exposures for {} photos", photos.len())).into());
        }
        let poses = PhotoPoses::read(&self.poses, photos)?;
        if !poses.format.has_unit() {
            let reason = "their unit is arbitrary, but depth is in metres";
            return Err(Usage(format!("--poses: poses of {} cannot be used: {reason}", poses.format)).into());
        }
        poses.check_distances()?;
        let files = stages.stage("read photos and depth", || -> anyhow::Result<Vec<_>> {
            let file = |(photo, depth): (&PathBuf, &PathBuf)| {
                Ok((imaging::read_photo(photo)?, imaging::read_depth_file(depth, depth_scale)?))
            };
            photos.iter().zip(depths).map(file).collect()
        })?;
        stages.photo_notes(photos.iter().map(PathBuf::as_path).zip(files.iter().map(|(photo, _)| photo)));
        // The first map is compared with the network's.
        if let Some((_, depth)) = files.first() {
            stages.set_depth_units(DepthUnits::of(depth));
        }
        stages.note(&format!("pose format: {}", poses.format));
        let exposures_ev = match &self.exposures {
            Some(parse::ExposuresEv(exposures)) => Some(exposures.iter().map(|ev| ev - exposures[0]).collect()),
            None => poses.exposures_ev().or_else(|| exif_exposures_ev(files.iter().map(|(photo, _)| photo))),
        };
        let mut frames = Vec::with_capacity(photos.len());
        let mut distorted = None;
        for (index, (((photo, depth), pose), path)) in
            files.into_iter().zip(poses.first_from_cameras()).zip(photos).enumerate()
        {
            let (width, height) = (photo.photo.width() as u32, photo.photo.height() as u32);
            let given = lens.without_exif(path, &photo)?;
            let (mut camera, source) = if let Some((camera, option)) = given.camera {
                (camera, option)
            } else if let Some(camera) = poses.camera(index, width, height)? {
                (camera, "from the pose file".to_owned())
            } else {
                // EXIF or the default; networks are not used for several photos.
                let (camera, source) = lightoctree::Estimator::without_networks().camera_of(&photo)?;
                (camera, source.to_string())
            };
            let (mut photo, mut depth_m) = (photo.photo, depth.depth_m);
            if let Some(distortion) = given.distortion.or_else(|| poses.distortion(index)) {
                let undistortion = Undistortion::new(camera, distortion).with_context(|| path.display().to_string())?;
                let undistorted = undistortion.photo(&photo);
                let original = std::mem::replace(&mut photo, undistorted);
                if index == 0 {
                    distorted = Some(Arc::new(DistortedPhoto::new(original, undistortion)));
                }
                depth_m = undistortion.depth(&depth_m);
                let [hfov_deg, pinhole_hfov_deg] = [&undistortion.camera, &camera].map(Camera::hfov_deg);
                camera = undistortion.camera;
                stages.warn(&EstimateWarning::Undistorted { hfov_deg, pinhole_hfov_deg });
            }
            stages.note(&format!("{}: horizontal field of view {:.1}° ({source})", path.display(), camera.hfov_deg()));
            let exposure = exposures_ev.as_ref().map_or(1.0, |stops: &Vec<f64>| (-stops[index]).exp2() as f32);
            let frame = Frame::new(photo, depth_m, camera, exposure).with_context(|| {
                format!("{} and {} cannot be used together", path.display(), depths[index].display())
            })?;
            frames.push(PosedFrame { frame, first_from_camera: pose });
        }
        let exposures = if exposures_ev.is_some() { Exposures::Known } else { Exposures::Matched };
        Ok(PosedPhotos { input: Input::Photos { photos: frames, exposures }, up: poses.up, distorted })
    }
}

/// Computes exposures relative to the first photo in stops, if EXIF states exposure time and sensitivity of all photos.
fn exif_exposures_ev<'a>(photos: impl Iterator<Item = &'a PhotoFile>) -> Option<Vec<f64>> {
    let shots: Vec<PhotoExposure> = photos.map(|photo| photo.exposure).collect();
    let is_complete = shots.iter().all(|shot| shot.time_s.is_some() && shot.iso.is_some());
    is_complete.then(|| stops_from_exif(&shots)).flatten()
}
