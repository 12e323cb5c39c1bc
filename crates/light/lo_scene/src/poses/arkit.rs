//! Frames of ARKit as two apps export them, one JSON file for each photo. The world is upright: ARKit's +Y is against gravity
//! (`ARWorldTrackingConfiguration`, alignment `gravity`). Cameras have OpenGL's axes, those of the picture as the sensor has it: landscape.
//!
//! *3D Scanner App* ("All Data"): `cameraPoseARFrame`, 4 × 4 row by row, and `intrinsics`, 3 × 3 row by row, of a picture of the photo's size.
//! *Polycam* ("Raw data", github.com/PolyCam/polyform): `t_00` … `t_23`, rows and columns, `fx fy cx cy`, `width`, `height`.

use lo_geometry::Vec3;
use serde_json::Value;

use super::pose::Axes;
use super::record3d::whole_size;
use super::{Lens, Pose, PoseError, PoseFile, PoseFormat, content, number, numbers};

pub(super) fn scanner_app(value: &Value, name: &str) -> Result<PoseFile, PoseError> {
    let rows = numbers(&value["cameraPoseARFrame"]).filter(|rows| rows.len() == 16);
    let rows = rows.ok_or_else(|| content(name, "`cameraPoseARFrame` is no 4 × 4 matrix"))?;
    let mut pose = Pose::from_rows(&rows, Axes::OpenGl, name, "its frame")?;
    if let Some(k) = value.get("intrinsics") {
        let Some(&[fx, _, cx, _, fy, cy, _, _, _]) = numbers(k).as_deref() else {
            return Err(content(name, "`intrinsics` is no 3 × 3 matrix"));
        };
        pose.lens = Some(Lens::Pixels { intrinsics: [fx, fy, cx, cy], size: None });
    }
    Ok(upright(name, PoseFormat::ScannerApp, pose))
}

pub(super) fn polycam(value: &Value, name: &str) -> Result<PoseFile, PoseError> {
    let field = |key: &str| {
        value.get(key).and_then(number).ok_or_else(|| content(name, format!("`{key}` is missing or no number")))
    };
    let mut rows = Vec::with_capacity(12);
    for row in 0..3 {
        for column in 0..4 {
            rows.push(field(&format!("t_{row}{column}"))?);
        }
    }
    let mut pose = Pose::from_rows(&rows, Axes::OpenGl, name, "its frame")?;
    let (width, height) = (field("width")?, field("height")?);
    let size = whole_size(width, height).ok_or_else(|| content(name, format!("a size of {width} × {height}")))?;
    let intrinsics = [field("fx")?, field("fy")?, field("cx")?, field("cy")?];
    pose.lens = Some(Lens::Pixels { intrinsics, size: Some(size) });
    Ok(upright(name, PoseFormat::Polycam, pose))
}

fn upright(name: &str, format: PoseFormat, pose: Pose) -> PoseFile {
    PoseFile { name: name.to_owned(), format, poses: vec![pose], world_up: Some(Vec3::Y), distorted: false }
}
