//! Trajectories of the TUM RGB-D benchmark: lines of `time tx ty tz qx qy qz qw`, camera to world, OpenCV's axes
//! (Sturm et al. 2012).

use lo_geometry::DVec3;

use super::pose::Axes;
use super::values::content;
use super::{Pose, PoseError, PoseFile, PoseFormat};

pub(super) fn read(text: &str, name: &str) -> Result<PoseFile, PoseError> {
    let mut poses = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let fields = line.split([' ', '\t', ',']).filter(|field| !field.is_empty());
        let fields: Option<Vec<f64>> = fields.map(|field| field.parse().ok()).collect();
        let Some(&[time_s, tx, ty, tz, x, y, z, w]) = fields.as_deref() else {
            // A file with another first line has another format.
            return Err(if poses.is_empty() {
                PoseError::Unknown(name.to_owned())
            } else {
                content(name, format!("line {} is not eight numbers `time tx ty tz qx qy qz qw`", index + 1))
            });
        };
        let label = format!("line {}", index + 1);
        if !time_s.is_finite() {
            return Err(PoseError::Value { file: name.to_owned(), pose: label, value: time_s });
        }
        let pose = Pose::from_quaternion([x, y, z, w], DVec3::new(tx, ty, tz), Axes::OpenCv, name, &label)?;
        poses.push(Pose { time_s: Some(time_s), ..pose });
    }
    if poses.is_empty() {
        return Err(PoseError::Unknown(name.to_owned()));
    }
    Ok(PoseFile { name: name.to_owned(), format: PoseFormat::Tum, poses, world_up: None })
}
