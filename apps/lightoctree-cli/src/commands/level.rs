//! `--level`: panoramas with gravity straight down, whatever way the camera was held.

use lightoctree::Estimate;
use lightoctree::cone::Rendering;
use lightoctree::geometry::{Quat, Vec3};
use lightoctree::imaging;
use serde_json::json;

use crate::usage::Usage;

/// The option.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct LevelArgs {
    /// Turn what is written so that gravity points straight down and the camera's heading is the middle; positions that are
    /// written are turned too, those that are given stay in the camera's frame
    #[arg(long)]
    level: bool,
}

/// The frame that outputs are in.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    /// Output direction = rotation · direction in the camera's frame; `None` where they are the same.
    output_from_camera: Option<Quat>,
}

impl Level {
    /// # Errors
    /// Where the scene does not know which way is up.
    pub fn new(estimate: &Estimate, args: LevelArgs) -> anyhow::Result<Self> {
        if !args.level {
            return Ok(Self { output_from_camera: None });
        }
        let room = estimate.room.as_ref().ok_or_else(|| {
            Usage("--level: the scene does not know which way is up; estimate it anew, or with --up".into())
        })?;
        Ok(Self { output_from_camera: Some(Quat::from_mat3(&room.level_from_camera()).normalize()) })
    }

    /// Rows to render for a panorama of `height` rows: turned ones are made of twice as fine ones.
    pub fn height(&self, height: usize) -> usize {
        if self.output_from_camera.is_some() { 2 * height } else { height }
    }

    /// What was rendered with [`Level::height`] rows, as a panorama of `height` rows in the output's frame.
    pub fn panorama(&self, rendered: Rendering, height: usize) -> Rendering {
        let Some(rotation) = self.output_from_camera else { return rendered };
        let (width, turned) = (2 * height, imaging::rotate_equirectangular_nearest);
        Rendering {
            radiance: imaging::rotate_equirectangular(&rendered.radiance, rotation, width, height),
            distance_m: turned(&rendered.distance_m, rotation, width, height),
            opacity: turned(&rendered.opacity, rotation, width, height),
        }
    }

    /// A point in the output's frame, metres; the camera is at its origin.
    pub fn point(&self, at: Vec3) -> Vec3 {
        self.output_from_camera.map_or(at, |rotation| rotation * at)
    }

    /// The frame in words.
    pub fn description(&self) -> &'static str {
        match self.output_from_camera {
            None => "metres; +X right, +Y up, the camera at the origin looks along -Z",
            Some(_) => "metres; +Y against gravity, the camera at the origin heads for -Z",
        }
    }

    /// How the camera was held, for JSON.
    pub fn camera(&self) -> serde_json::Value {
        let rotation = self.rotation();
        let [pitch_deg, roll_deg] = held_deg(rotation);
        json!({
            "frame": self.name(),
            "position_m": [0.0, 0.0, 0.0],
            "rotation_xyzw": rotation.to_array(),
            "pitch_deg": pitch_deg,
            "roll_deg": roll_deg,
        })
    }

    /// The same for an image's metadata.
    pub fn metadata(&self) -> [(String, String); 2] {
        let [x, y, z, w] = self.rotation().to_array();
        let rotation = format!("{x} {y} {z} {w}");
        [("lightoctree.frame".into(), self.name().into()), ("lightoctree.camera_rotation_xyzw".into(), rotation)]
    }

    fn rotation(&self) -> Quat {
        self.output_from_camera.unwrap_or(Quat::IDENTITY)
    }

    fn name(&self) -> &'static str {
        if self.output_from_camera.is_some() { "level" } else { "camera" }
    }
}

/// Pitch (upwards) and roll (clockwise as the photographer sees it) of a camera in degrees.
fn held_deg(output_from_camera: Quat) -> [f32; 2] {
    let (ahead, right) = (output_from_camera * Vec3::NEG_Z, output_from_camera * Vec3::X);
    [ahead.y, 0.0 - right.y].map(|sine| sine.clamp(-1.0, 1.0).asin().to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pitch_and_roll_are_those_of_the_camera() {
        let held = Quat::from_rotation_x(0.3) * Quat::from_rotation_z(-0.1);
        let [pitch_deg, roll_deg] = held_deg(held);
        assert!((pitch_deg - 0.3f32.to_degrees()).abs() < 1e-3, "{pitch_deg}");
        // The camera's right side is 0.1 lower; pitch takes cos 0.3 of its sine.
        assert!((roll_deg - (0.1f32.sin() * 0.3f32.cos()).asin().to_degrees()).abs() < 1e-3, "{roll_deg}");
    }
}
