//! Options of `estimate` for a panorama of the room.

use std::path::PathBuf;

use anyhow::Context;
use lightoctree::{PanoramaError, PanoramaPrior};
use lo_geometry::{Orientation, Vec3};
use lo_scene::PanoramaSource;

use super::environment::ORIENTATIONS;
use super::parse;
use crate::choice::choice;
use crate::progress::Stages;

/// Options of a panorama of the room.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Panorama of the room")]
pub struct PanoramaPriorArgs {
    /// Equirectangular panorama of the same room, which lights unobserved regions: HDR, EXR, PFM (linear) or JPEG, PNG
    /// (clipped)
    ///
    /// It may come from a 360° camera, a mirror ball or a program that generates panoramas. Yaw, small tilts and
    /// exposure are found by comparing it with the photo.
    #[arg(long, value_name = "FILE")]
    pub panorama: Option<PathBuf>,

    /// Position of the panorama in metres: +X right, +Y up, the camera at 0,0,0 looks along -Z [default: 0,0,0]
    #[arg(long, value_name = "X,Y,Z", requires = "panorama", value_parser = parse::point, allow_hyphen_values = true)]
    panorama_at: Option<Vec3>,

    /// Orientation of the panorama, named after a program that uses it
    #[arg(long, value_name = "NAME", default_value = "lightoctree", requires = "panorama", value_parser = choice(&ORIENTATIONS))]
    panorama_orientation: Orientation,

    /// Angle in degrees from the photo's heading to the panorama's centre, to the right [default: found]
    #[arg(long, value_name = "A", requires = "panorama", value_parser = parse::angle_deg, allow_hyphen_values = true)]
    panorama_yaw_deg: Option<f64>,

    /// Exposure in stops from the panorama's values to the photo's [default: found]
    #[arg(long, value_name = "EV", requires = "panorama", value_parser = parse::exposure_ev, allow_hyphen_values = true)]
    panorama_exposure_ev: Option<f64>,
}

impl PanoramaPriorArgs {
    /// Reads the panorama, if one is given.
    pub fn read(&self, stages: &mut Stages) -> anyhow::Result<Option<PanoramaPrior>> {
        let Some(path) = &self.panorama else { return Ok(None) };
        let read = stages.stage("read panorama", || PanoramaPrior::read(path, self.panorama_orientation));
        let mut prior = match read {
            Err(PanoramaError::Image(error)) => return Err(error.into()),
            other => other.with_context(|| format!("{} cannot be used as a panorama of the room", path.display()))?,
        };
        prior.position_m = self.panorama_at.unwrap_or(Vec3::ZERO);
        prior.yaw_rad = self.panorama_yaw_deg.map(|yaw| (yaw as f32).to_radians());
        prior.exposure = self.panorama_exposure_ev.map(|ev| (ev as f32).exp2());
        Ok(Some(prior))
    }
}

/// Describes how a panorama was aligned with the photo.
pub fn description(source: &PanoramaSource) -> String {
    let PanoramaSource { file, yaw_deg, pitch_deg, roll_deg, exposure_ev, confidence, .. } = source;
    format!(
        "{file} was aligned with yaw {yaw_deg:.1}°, pitch {pitch_deg:+.1}°, roll {roll_deg:+.1}° and {exposure_ev:+.2} EV \
         (confidence {confidence:.2})"
    )
}
