//! ARKit frames as exported by two apps, one JSON file per photo. The world is upright: ARKit's +Y is against gravity
//! (`ARWorldTrackingConfiguration`, alignment `gravity`). Cameras have OpenGL's axes, in the sensor's landscape
//! orientation.
//!
//! *3D Scanner App* ("All Data"): `cameraPoseARFrame`, 4 × 4 in row-major order, and `intrinsics`, 3 × 3 in row-major
//! order, for an image of the photo's size.
//!
//! *Polycam* ("Raw data", github.com/PolyCam/polyform): `t_00` … `t_23`, rows and columns, `fx fy cx cy`, `width`,
//! `height`.

use lo_geometry::Vec3;
use serde_json::Value;

use super::pose::Axes;
use super::record3d::whole_size;
use super::values::{content, number, numbers};
use super::{Lens, Pose, PoseError, PoseFile, PoseFormat};

pub(super) fn scanner_app(value: &Value, name: &str) -> Result<PoseFile, PoseError> {
    let rows = numbers(&value["cameraPoseARFrame"]).filter(|rows| rows.len() == 16);
    let rows = rows.ok_or_else(|| content(name, "`cameraPoseARFrame` is not a 4 × 4 matrix"))?;
    let mut pose = Pose::from_rows(&rows, Axes::OpenGl, name, "its frame")?;
    if let Some(k) = value.get("intrinsics") {
        let Some(&[fx, _, cx, _, fy, cy, _, _, _]) = numbers(k).as_deref() else {
            return Err(content(name, "`intrinsics` is not a 3 × 3 matrix"));
        };
        pose.lens = Some(Lens::Pixels { intrinsics: [fx, fy, cx, cy], size: None });
    }
    Ok(upright(name, PoseFormat::ScannerApp, pose))
}

pub(super) fn polycam(value: &Value, name: &str) -> Result<PoseFile, PoseError> {
    let field = |key: &str| {
        value.get(key).and_then(number).ok_or_else(|| content(name, format!("`{key}` is missing or not a number")))
    };
    let mut rows = Vec::with_capacity(12);
    for row in 0..3 {
        for column in 0..4 {
            rows.push(field(&format!("t_{row}{column}"))?);
        }
    }
    let mut pose = Pose::from_rows(&rows, Axes::OpenGl, name, "its frame")?;
    let (width, height) = (field("width")?, field("height")?);
    let size = whole_size(width, height).ok_or_else(|| content(name, format!("invalid size {width} × {height}")))?;
    let intrinsics = [field("fx")?, field("fy")?, field("cx")?, field("cy")?];
    pose.lens = Some(Lens::Pixels { intrinsics, size: Some(size) });
    Ok(upright(name, PoseFormat::Polycam, pose))
}

fn upright(name: &str, format: PoseFormat, pose: Pose) -> PoseFile {
    PoseFile { name: name.to_owned(), format, poses: vec![pose], world_up: Some(Vec3::Y) }
}
