//! lightoctree's own pose file:
//!
//! ```json
//! {
//!   "axes": "opengl",
//!   "world_up": [0, 1, 0],
//!   "photos": [
//!     {"file": "a.jpg", "world_from_camera": [[1, 0, 0, 0], [0, 1, 0, 1.5], [0, 0, 1, 0], [0, 0, 0, 1]]},
//!     {"file": "b.jpg", "rotation_xyzw": [0, 0.866, 0, 0.5], "position_m": [0.1, 1.5, 0],
//!      "intrinsics": {"fx": 1450, "fy": 1450, "cx": 960, "cy": 720}, "exposure_ev": 0.5}
//!   ]
//! }
//! ```
//!
//! `axes` are the cameras' axes: `opengl` (default) or `opencv`. Optional are `world_up` (against gravity),
//! `intrinsics` (pixels of the photo) or `hfov_deg`, and `exposure_ev`: the photo's brightness relative to the others
//! in stops, +1 twice as bright. If one photo has `exposure_ev`, all must.

use lo_geometry::{DVec3, Vec3};
use serde::Deserialize;
use serde_json::Value;

use super::pose::Axes;
use super::values::{content, numbers};
use super::{Lens, Pose, PoseError, PoseFile, PoseFormat};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    axes: Option<Axes>,
    world_up: Option<[f64; 3]>,
    photos: Vec<Photo>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Photo {
    file: String,
    world_from_camera: Option<Value>,
    rotation_xyzw: Option<[f64; 4]>,
    position_m: Option<[f64; 3]>,
    intrinsics: Option<Intrinsics>,
    hfov_deg: Option<f64>,
    exposure_ev: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Intrinsics {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
}

/// Largest difference in exposure of two photos of one room, stops.
const MAX_EXPOSURE_EV: f64 = 20.0;

pub(super) fn read(value: Value, name: &str) -> Result<PoseFile, PoseError> {
    let file: File = serde_json::from_value(value).map_err(|error| content(name, error))?;
    let axes = file.axes.unwrap_or(Axes::OpenGl);
    let world_up = file.world_up.map(|up| {
        let up = DVec3::from_array(up).as_vec3();
        up.try_normalize().ok_or_else(|| content(name, "`world_up` is not a direction"))
    });
    let world_up: Option<Vec3> = world_up.transpose()?;
    let mut poses = Vec::with_capacity(file.photos.len());
    for photo in file.photos {
        let label = photo.file.clone();
        let mut pose = match (photo.world_from_camera, photo.rotation_xyzw, photo.position_m) {
            (Some(matrix), None, None) => {
                let rows = numbers(&matrix).filter(|rows| rows.len() == 16);
                let rows =
                    rows.ok_or_else(|| content(name, format!("{label}: `world_from_camera` is not a 4 × 4 matrix")))?;
                Pose::from_rows(&rows, axes, name, &label)?
            }
            (None, Some(xyzw), Some(position_m)) => {
                Pose::from_quaternion(xyzw, DVec3::from_array(position_m), axes, name, &label)?
            }
            _ => {
                let needs = "needs `world_from_camera`, or `rotation_xyzw` and `position_m`";
                return Err(content(name, format!("{label} {needs}")));
            }
        };
        pose.lens = match (photo.intrinsics, photo.hfov_deg) {
            (Some(_), Some(_)) => return Err(content(name, format!("{label} has both `intrinsics` and `hfov_deg`"))),
            (Some(Intrinsics { fx, fy, cx, cy }), None) => {
                Some(Lens::Pixels { intrinsics: [fx, fy, cx, cy], size: None })
            }
            (None, hfov_deg) => hfov_deg.map(Lens::HfovDeg),
        };
        if let Some(value) = photo.exposure_ev.filter(|ev| !ev.is_finite() || ev.abs() > MAX_EXPOSURE_EV) {
            return Err(content(name, format!("{label}: invalid exposure of {value} EV")));
        }
        poses.push(Pose { file: Some(photo.file), exposure_ev: photo.exposure_ev, ..pose });
    }
    if poses.iter().any(|pose| pose.exposure_ev.is_some()) && poses.iter().any(|pose| pose.exposure_ev.is_none()) {
        return Err(content(name, "`exposure_ev` is set for some photos but not for all"));
    }
    Ok(PoseFile { name: name.to_owned(), format: PoseFormat::Own, poses, world_up })
}
