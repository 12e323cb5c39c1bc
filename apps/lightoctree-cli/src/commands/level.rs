//! `--level`: writes panoramas in a frame aligned with gravity.

use lightoctree::{Estimate, LevelFrame};
use lo_cone::Rendering;
use lo_geometry::{Quat, Vec3};
use serde_json::json;

use crate::usage::Usage;

/// Option that selects the frame of the output.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct LevelArgs {
    /// Rotate the output so that gravity points straight down and the camera's heading is in the middle
    ///
    /// Positions in the output are rotated too. Positions on the command line remain in the camera's frame.
    #[arg(long)]
    level: bool,
}

impl LevelArgs {
    /// Whether the output is level.
    pub fn is_level(self) -> bool {
        self.level
    }
}

/// The frame of the output: the camera's, or a level one.
#[derive(Clone, Copy, Debug)]
pub struct OutputFrame {
    /// `None` for the camera's frame.
    level: Option<LevelFrame>,
}

impl OutputFrame {
    /// Selects the frame.
    ///
    /// # Errors
    /// A level frame is requested for a scene without an up direction.
    pub fn new(estimate: &Estimate, args: LevelArgs) -> anyhow::Result<Self> {
        if !args.level {
            return Ok(Self { level: None });
        }
        let room = estimate.room.as_ref().ok_or_else(|| {
            Usage("--level: the scene has no up direction; estimate it again, if necessary with --up".into())
        })?;
        Ok(Self { level: Some(LevelFrame::new(room)) })
    }

    /// Returns a level frame, or without one the camera's.
    pub fn of(level: Option<LevelFrame>) -> Self {
        Self { level }
    }

    /// Rows to render for a panorama of `height` rows.
    pub fn rendered_height(&self, height: usize) -> usize {
        if self.level.is_some() { LevelFrame::rendered_height(height) } else { height }
    }

    /// Converts what was rendered with [`OutputFrame::rendered_height`] rows to a panorama of `height` rows.
    pub fn panorama(&self, rendered: Rendering, height: usize) -> Rendering {
        match self.level {
            None => rendered,
            Some(level) => level.panorama(&rendered, height),
        }
    }

    /// Transforms a point in metres from the camera's frame into the output's.
    pub fn point(&self, at: Vec3) -> Vec3 {
        self.level.map_or(at, |level| level.point(at))
    }

    /// Describes unit and axes.
    pub fn description(&self) -> &'static str {
        match self.level {
            None => "metres; +X right, +Y up, the camera at the origin looks along -Z",
            Some(_) => "metres; +Y against gravity, the camera at the origin heads for -Z",
        }
    }

    /// Orientation of the camera in this frame, for JSON.
    pub fn camera(&self) -> serde_json::Value {
        let [pitch_deg, roll_deg] = self.level.map_or([0.0; 2], |level| level.camera_pitch_roll_deg());
        json!({
            "frame": self.name(),
            "position_m": [0.0, 0.0, 0.0],
            "rotation_xyzw": self.rotation().to_array(),
            "pitch_deg": pitch_deg,
            "roll_deg": roll_deg,
        })
    }

    /// Orientation of the camera in this frame, for an image's metadata.
    pub fn metadata(&self) -> [(String, String); 2] {
        let [x, y, z, w] = self.rotation().to_array();
        let rotation = format!("{x} {y} {z} {w}");
        [("lightoctree.frame".into(), self.name().into()), ("lightoctree.camera_rotation_xyzw".into(), rotation)]
    }

    fn rotation(&self) -> Quat {
        self.level.map_or(Quat::IDENTITY, |level| level.level_from_camera())
    }

    fn name(&self) -> &'static str {
        if self.level.is_some() { "level" } else { "camera" }
    }
}
