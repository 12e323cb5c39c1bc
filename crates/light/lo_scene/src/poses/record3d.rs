//! Record3D, an app for iPhones and iPads with LiDAR: `metadata.json` of its "EXR + JPG sequence", and `metadata` in
//! a `.r3d` archive.
//!
//! According to its author (github.com/marek-simonik/record3d, issues 27, 33, 36 and 64), poses are `[qx, qy, qz, qw,
//! tx, ty, tz]`, camera to world, in OpenGL's axes, for the images as exported. The world is that of the first
//! camera, *not* upright. `K` is in column-major order.

use lo_geometry::DVec3;
use serde_json::Value;

use super::pose::Axes;
use super::values::{content, number, numbers};
use super::{Lens, Pose, PoseError, PoseFile, PoseFormat};

pub(super) fn read(value: &Value, name: &str) -> Result<PoseFile, PoseError> {
    let rows = value["poses"].as_array().ok_or_else(|| content(name, "`poses` is not an array"))?;
    let common = lens(value, name)?;
    let own = match value.get("perFrameIntrinsicCoeffs") {
        None | Some(Value::Null) => None,
        Some(rows) => {
            let rows = rows.as_array().ok_or_else(|| content(name, "`perFrameIntrinsicCoeffs` is not an array"))?;
            (!rows.is_empty()).then_some(rows)
        }
    };
    if let Some(own) = own.filter(|own| own.len() != rows.len()) {
        return Err(content(name, format!("intrinsics for {} frames, but poses for {}", own.len(), rows.len())));
    }
    let mut poses = Vec::with_capacity(rows.len());
    for (index, row) in rows.iter().enumerate() {
        let label = format!("frame {index}");
        let Some(&[x, y, z, w, tx, ty, tz]) = numbers(row).as_deref() else {
            return Err(content(name, format!("the pose of {label} is not seven numbers")));
        };
        let mut pose = Pose::from_quaternion([x, y, z, w], DVec3::new(tx, ty, tz), Axes::OpenGl, name, &label)?;
        pose.lens = match own {
            Some(own) => match numbers(&own[index]).as_deref() {
                Some(&[fx, fy, cx, cy]) => {
                    Some(Lens::Pixels { intrinsics: [fx, fy, cx, cy], size: size(value, name)? })
                }
                _ => return Err(content(name, format!("the intrinsics of {label} are not four numbers"))),
            },
            None => common,
        };
        poses.push(pose);
    }
    Ok(PoseFile { name: name.to_owned(), format: PoseFormat::Record3d, poses, world_up: None })
}

/// Reads the lens of all frames, if the file states it.
pub(super) fn lens(value: &Value, name: &str) -> Result<Option<Lens>, PoseError> {
    let Some(k) = value.get("K") else { return Ok(None) };
    let intrinsics = intrinsics_of_k(k).ok_or_else(|| content(name, "`K` is not a 3 × 3 matrix"))?;
    Ok(Some(Lens::Pixels { intrinsics, size: size(value, name)? }))
}

/// Reads the size of the images.
fn size(value: &Value, name: &str) -> Result<Option<(u32, u32)>, PoseError> {
    match ["w", "h"].map(|key| value.get(key).and_then(number)) {
        [Some(w), Some(h)] => {
            whole_size(w, h).map(Some).ok_or_else(|| content(name, format!("invalid size {w} × {h}")))
        }
        _ => Ok(None),
    }
}

/// Reads `fx fy cx cy` from a column-major matrix; a row-major one is recognised by its zeros.
fn intrinsics_of_k(k: &Value) -> Option<[f64; 4]> {
    let k: [f64; 9] = numbers(k)?.try_into().ok()?;
    let by_rows = k[6] == 0.0 && k[7] == 0.0 && (k[2] != 0.0 || k[5] != 0.0);
    Some(if by_rows { [k[0], k[4], k[2], k[5]] } else { [k[0], k[4], k[6], k[7]] })
}

/// Returns width and height if they are valid pixel counts.
pub(super) fn whole_size(width: f64, height: f64) -> Option<(u32, u32)> {
    let whole = |v: f64| (v.fract() == 0.0 && (1.0..=1e6).contains(&v)).then_some(v as u32);
    Some((whole(width)?, whole(height)?))
}
