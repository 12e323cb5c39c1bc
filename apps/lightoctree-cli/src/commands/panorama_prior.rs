//! Options for a panorama of the room, beside a photo of it.

use std::path::PathBuf;

use anyhow::Context;
use lightoctree::geometry::{Orientation, Vec3};
use lightoctree::scene::PanoramaSource;
use lightoctree::{PanoramaError, PanoramaPrior};

use super::environment::ORIENTATIONS;
use super::parse;
use crate::choice::choice;
use crate::progress::Stages;

/// Options of the panorama.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "A panorama of the room")]
pub struct PanoramaArgs {
    /// A panorama of the same room, whose light is laid onto what the photo does not show: equirectangular HDR, EXR, PFM (linear), or JPEG, PNG (clipped)
    ///
    /// From a 360-degree camera, a mirror ball, or a program that makes panoramas. Its yaw, small tilts and its exposure are found by what the photo shows.
    #[arg(long, value_name = "FILE")]
    pub panorama: Option<PathBuf>,

    /// Where it was taken, in metres: +X right, +Y up, the camera at 0,0,0 looks along -Z [default: 0,0,0]
    #[arg(long, value_name = "X,Y,Z", requires = "panorama", value_parser = parse::point, allow_hyphen_values = true)]
    panorama_at: Option<Vec3>,

    /// Which program's convention it follows
    #[arg(long, value_name = "NAME", default_value = "lightoctree", requires = "panorama", value_parser = choice(&ORIENTATIONS))]
    panorama_orientation: Orientation,

    /// Angle from the photo's heading to the panorama's centre, to the right: then only tilt and exposure are found [default: found]
    #[arg(long, value_name = "A", requires = "panorama", value_parser = parse::angle_deg, allow_hyphen_values = true)]
    panorama_yaw_deg: Option<f64>,

    /// Stops from the panorama's values to the photo's [default: found]
    #[arg(long, value_name = "EV", requires = "panorama", value_parser = parse::exposure_ev, allow_hyphen_values = true)]
    panorama_exposure_ev: Option<f64>,
}

impl PanoramaArgs {
    /// Reads the panorama, if there is one.
    pub fn read(&self, stages: &mut Stages) -> anyhow::Result<Option<PanoramaPrior>> {
        let Some(path) = &self.panorama else { return Ok(None) };
        let read = stages.stage("read panorama", || PanoramaPrior::read(path, self.panorama_orientation));
        let mut prior = match read {
            Err(PanoramaError::Image(error)) => return Err(error.into()),
            other => other.with_context(|| format!("{} is no panorama of a room", path.display()))?,
        };
        prior.position_m = self.panorama_at.unwrap_or(Vec3::ZERO);
        prior.yaw_rad = self.panorama_yaw_deg.map(|yaw| (yaw as f32).to_radians());
        prior.exposure = self.panorama_exposure_ev.map(|ev| (ev as f32).exp2());
        Ok(Some(prior))
    }
}

/// How a panorama was laid, in words.
pub fn found(source: &PanoramaSource) -> String {
    let PanoramaSource { file, yaw_deg, pitch_deg, roll_deg, exposure_ev, confidence, .. } = source;
    format!(
        "{file} was laid with yaw {yaw_deg:.1}, pitch {pitch_deg:+.1}, roll {roll_deg:+.1} degrees and {exposure_ev:+.2} EV (confidence {confidence:.2})"
    )
}
