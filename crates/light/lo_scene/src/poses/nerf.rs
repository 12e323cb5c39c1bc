//! `transforms.json`, introduced by instant-ngp and written by nerfstudio and many others.
//!
//! It has `frames` with `file_path` and `transform_matrix` (camera to world, OpenGL's axes), and intrinsics for all
//! or for each. Its up axis and unit are not standardised; metres are assumed. nerfstudio's `applied_scale` is
//! undone.

use lo_geometry::{DVec3, Distortion};
use serde_json::Value;

use super::pose::Axes;
use super::record3d::whole_size;
use super::values::{checked_position, content, number, numbers};
use super::{Lens, Pose, PoseError, PoseFile, PoseFormat};

pub(super) fn read(value: &Value, name: &str) -> Result<PoseFile, PoseError> {
    let frames = value["frames"].as_array().ok_or_else(|| content(name, "`frames` is not an array"))?;
    let scale = match value.get("applied_scale") {
        None => 1.0,
        Some(scale) => number(scale)
            .filter(|scale| scale.is_finite() && *scale > 0.0)
            .ok_or_else(|| content(name, "`applied_scale` is not a positive number"))?,
    };
    let mut poses = Vec::with_capacity(frames.len());
    for (index, frame) in frames.iter().enumerate() {
        let file = frame.get("file_path").and_then(Value::as_str);
        let file = file.ok_or_else(|| content(name, format!("frame {index} has no `file_path`")))?;
        let of = |key: &str| frame.get(key).or_else(|| value.get(key));
        let rows = frame.get("transform_matrix").and_then(numbers);
        let rows = rows.ok_or_else(|| content(name, format!("{file}: `transform_matrix` is not a 4 × 4 matrix")))?;
        let mut pose = Pose::from_rows(&rows, Axes::OpenGl, name, file)?;
        pose.position_m = checked_position(pose.position_m / DVec3::splat(scale), name, file)?;
        pose.file = Some(file.to_owned());
        pose.lens = lens(&of, name)?;
        pose.distortion = distortion(&of, name)?;
        poses.push(pose);
    }
    Ok(PoseFile { name: name.to_owned(), format: PoseFormat::Nerf, poses, world_up: None })
}

pub(super) fn distortion<'a>(
    of: &impl Fn(&str) -> Option<&'a Value>,
    name: &str,
) -> Result<Option<Distortion>, PoseError> {
    let coefficient = |key: &str| match of(key) {
        None => Ok(0.0),
        Some(value) => number(value).ok_or_else(|| content(name, format!("`{key}` is not a number"))),
    };
    let [k1, k2, k3, k4, p1, p2] = ["k1", "k2", "k3", "k4", "p1", "p2"].map(coefficient);
    let model = of("camera_model").and_then(Value::as_str).unwrap_or("OPENCV");
    let is_fisheye = of("is_fisheye").and_then(Value::as_bool).unwrap_or(false);
    let distortion = match model {
        "OPENCV_FISHEYE" => Distortion::Fisheye([k1?, k2?, k3?, k4?]),
        _ if is_fisheye => Distortion::Fisheye([k1?, k2?, k3?, k4?]),
        // nerfstudio's k4 continues the polynomial; OpenCV's is another coefficient. Neither is ever set in practice.
        "OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "PERSPECTIVE" | "SIMPLE_RADIAL" | "RADIAL" => {
            Distortion::brown(&[k1?, k2?, p1?, p2?, k3?])
        }
        _ => return Err(PoseError::CameraModel { file: name.to_owned(), model: model.to_owned() }),
    };
    Ok((!distortion.is_identity()).then_some(distortion))
}

pub(super) fn lens<'a>(of: &impl Fn(&str) -> Option<&'a Value>, name: &str) -> Result<Option<Lens>, PoseError> {
    let figure = |key: &str| match of(key) {
        None => Ok(None),
        Some(value) => number(value).map(Some).ok_or_else(|| content(name, format!("`{key}` is not a number"))),
    };
    let size = match (figure("w")?, figure("h")?) {
        (Some(w), Some(h)) => Some(whole_size(w, h).ok_or_else(|| content(name, format!("invalid size {w} × {h}")))?),
        _ => None,
    };
    let Some(fx) = figure("fl_x")? else {
        return Ok(figure("camera_angle_x")?.map(|angle| Lens::HfovDeg(angle.to_degrees())));
    };
    let fy = figure("fl_y")?.unwrap_or(fx);
    let middle = size.map(|(w, h)| [f64::from(w) / 2.0, f64::from(h) / 2.0]);
    let centre = |key: &str, axis: usize| -> Result<f64, PoseError> {
        let middle = middle.map(|middle| middle[axis]);
        figure(key)?.or(middle).ok_or_else(|| content(name, format!("`fl_x` without `{key}`, `w` and `h`")))
    };
    Ok(Some(Lens::Pixels { intrinsics: [fx, fy, centre("cx", 0)?, centre("cy", 1)?], size }))
}
