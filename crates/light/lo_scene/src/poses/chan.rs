//! Nuke's `.chan`: lines of `frame tx ty tz rx ry rz [vfov]`, camera to world, OpenGL's axes in a world with +Y up. A
//! unit is not stated; metres are assumed. `rx ry rz` are degrees, `vfov` is the vertical field of view in degrees.
//!
//! The file does not state the order of the rotations. Importers use the order of the node that reads it: the camera
//! nodes of Nuke have `rot_order` ZXY by default (about z first, so R_y · R_x · R_z), which is used here. The exporter
//! of Blender (add-on "Nuke Animation Format", `io_anim_nuke_chan`) does *not* agree by default: it writes the order
//! XYZ, and its option "Rotation order" must be set to ZXY. Its option "Make Y up" is on by default, as needed here.
//!
//! Both programs write `vfov` for cameras: the angle of the film back's height (Nuke's `vaperture`, Blender's
//! `angle_y`). It is that of the image only if film back and image have the same aspect ratio. With Blender's sensor of
//! 36 × 24 mm, a lens of 35 mm and an image of 16:9 it is 37.8° instead of 32.3°.

use std::collections::HashMap;
use std::path::Path;

use lo_geometry::{DVec3, Vec3};

use super::pose::Axes;
use super::values::content;
use super::{Lens, Pose, PoseError, PoseFile, PoseFormat, euler};

/// Nuke's default order of rotations.
const ORDER: [char; 3] = ['Z', 'X', 'Y'];

/// Largest frame number, so that it is exact as a floating-point number.
const MAX_FRAME: f64 = 1e9;

/// Whether a file is a `.chan`: by its extension, or by seven numbers in its first line, of which one is a frame.
pub(super) fn is_track(text: &str, name: &str) -> bool {
    let extension = Path::new(name).extension();
    extension.is_some_and(|extension| extension.eq_ignore_ascii_case("chan"))
        || rows(text).next().and_then(|(_, row)| numbers(row)).is_some_and(|row| row.len() == 7 && is_frame(row[0]))
}

pub(super) fn read(text: &str, name: &str) -> Result<PoseFile, PoseError> {
    let mut poses = Vec::new();
    let mut lines_of_frames = HashMap::new();
    for (line, row) in rows(text) {
        let label = format!("line {line}");
        let (frame, position_m, degrees, vfov_deg) = match numbers(row).as_deref() {
            Some(&[frame, tx, ty, tz, rx, ry, rz]) => (frame, [tx, ty, tz], [rx, ry, rz], None),
            Some(&[frame, tx, ty, tz, rx, ry, rz, vfov]) => (frame, [tx, ty, tz], [rx, ry, rz], Some(vfov)),
            _ => {
                let expected = "seven or eight numbers `frame tx ty tz rx ry rz [vfov]`";
                return Err(content(name, format!("{label} is not {expected}")));
            }
        };
        if !is_frame(frame) {
            return Err(content(name, format!("{label}: the frame {frame} is not a whole number within ±1e9")));
        }
        if let Some(value) = degrees.into_iter().find(|angle| !angle.is_finite()) {
            return Err(PoseError::Value { file: name.to_owned(), pose: label, value });
        }
        if let Some(vfov_deg) = vfov_deg.filter(|angle| !(*angle > 0.0 && *angle < 180.0)) {
            let expected = "a vertical field of view between 0 and 180 degrees";
            return Err(content(name, format!("{label}: the eighth number is {vfov_deg}, not {expected}")));
        }
        if let Some(other) = lines_of_frames.insert(frame as i64, line) {
            return Err(content(name, format!("{label}: frame {frame} is in line {other} already")));
        }
        let rotation = euler::rotation(ORDER, degrees);
        let pose = Pose::from_matrix(rotation, DVec3::from_array(position_m), Axes::OpenGl, name, &label)?;
        poses.push(Pose { frame: Some(frame as i64), lens: vfov_deg.map(Lens::VfovDeg), ..pose });
    }
    Ok(PoseFile { name: name.to_owned(), format: PoseFormat::Chan, poses, world_up: Some(Vec3::Y) })
}

/// Lines that are not empty, without comments, numbered from 1.
fn rows(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
    lines.enumerate().map(|(index, line)| (index + 1, line)).filter(|(_, line)| !line.is_empty())
}

/// Parses the numbers of a line, at most one more than needed.
fn numbers(row: &str) -> Option<Vec<f64>> {
    row.split_whitespace().take(9).map(|word| word.parse().ok()).collect()
}

fn is_frame(value: f64) -> bool {
    value.fract() == 0.0 && value.abs() <= MAX_FRAME
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::DMat3;

    use super::super::{PhotoLens, PhotoPoses};
    use super::*;

    fn refusal(text: &str) -> String {
        PoseFile::from_bytes(text.as_bytes(), "shot.chan").unwrap_err().to_string()
    }

    #[test]
    fn rotations_are_about_z_then_x_then_y() {
        let file = PoseFile::from_bytes(b"# frame\n1001\t1 2 3\t30 90 0\t40\n1002 4 5 6 90 0 90\n", "s.chan").unwrap();
        assert_eq!((file.format, file.world_up, file.poses.len()), (PoseFormat::Chan, Some(Vec3::Y), 2));
        let (half, root) = (0.5, 0.75f64.sqrt());
        // By hand: R_y(90°) · R_x(30°), columns are the camera's axes. It looks along −X and up by 30°.
        let first = DMat3::from_cols_array_2d(&[[0.0, 0.0, -1.0], [half, root, 0.0], [root, -half, 0.0]]);
        assert!(file.poses[0].rotation.abs_diff_eq(first, 1e-12));
        // R_x(90°) · R_z(90°): the camera's x turns to y and on to z; its y turns to −x.
        let second = DMat3::from_cols_array_2d(&[[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);
        assert!(file.poses[1].rotation.abs_diff_eq(second, 1e-12));
        assert_eq!((file.poses[0].frame, file.poses[1].frame), (Some(1001), Some(1002)));
        assert_eq!(file.poses[0].position_m, DVec3::new(1.0, 2.0, 3.0));
        assert_eq!((file.poses[0].lens, file.poses[1].lens), (Some(Lens::VfovDeg(40.0)), None));
    }

    #[test]
    fn vertical_field_of_view() {
        // An image of 1080 rows and 90° has a focal length of 540 pixels.
        let camera = Lens::VfovDeg(90.0).camera(1920, 1080, "file", "photo").unwrap();
        assert!((camera.fx - 540.0).abs() < 1e-9 && camera.fx == camera.fy, "{camera:?}");
        assert_eq!((camera.cx, camera.cy), (960.0, 540.0));
        for angle in [0.0, -10.0, 180.0, 270.0, f64::NAN, f64::INFINITY] {
            assert!(Lens::VfovDeg(angle).camera(1920, 1080, "file", "photo").is_err(), "{angle}");
        }
        let lens =
            PhotoLens::from_text("7 0 0 0 0 0 0 90\n8 0 0 0 0 0 0 60\n", "s.chan", "s_0007.jpg".as_ref(), || None);
        assert!((lens.unwrap().camera(1920, 1080).unwrap().fx - 540.0).abs() < 1e-9);
    }

    #[test]
    fn frames_are_numbers_in_names() {
        let text = "0 0 0 0 0 0 0\n1 1 0 0 0 0 0\n2.0 2 0 0 0 0 0\n10 3 0 0 0 0 0\n";
        let file = PoseFile::from_bytes(text.as_bytes(), "without extension").unwrap();
        assert_eq!(file.format, PoseFormat::Chan);
        let x_of = |photos: &[&str]| -> Result<Vec<f32>, String> {
            let poses = PhotoPoses::of(std::slice::from_ref(&file), photos).map_err(|error| error.to_string())?;
            Ok(poses.first_from_cameras().iter().map(|motion| motion.translation_m.x).collect())
        };
        assert_eq!(x_of(&["a/b1_0000.jpg", "a/b1_0002.jpg", "b2.0010.exr"]).unwrap(), [0.0, 2.0, 3.0]);
        let missing = x_of(&["shot_0000.jpg", "shot_0003.jpg"]).unwrap_err();
        assert!(missing.contains("no pose of shot_0003.jpg") && missing.contains("the last number"), "{missing}");
        let unnumbered = x_of(&["shot_0000.jpg", "shot.jpg"]).unwrap_err();
        assert!(unnumbered.contains("no pose of shot.jpg"), "{unnumbered}");
        assert_eq!(x_of(&["a.jpg", "b.jpg", "c.jpg", "d.jpg"]).unwrap(), [0.0, 1.0, 2.0, 3.0], "by order");
        let up = PhotoPoses::of(&[file], &["0.jpg"]).unwrap().up;
        assert_eq!(up, Some(Vec3::Y));
    }

    #[test]
    fn eight_numbers_without_the_extension_are_a_tum_trajectory() {
        let text = b"1 0 0 0 0 0 0 1\n";
        assert_eq!(PoseFile::from_bytes(text, "poses.txt").unwrap().format, PoseFormat::Tum);
        assert_eq!(PoseFile::from_bytes(text, "poses.CHAN").unwrap().format, PoseFormat::Chan);
    }

    #[test]
    fn invalid_lines_are_named() {
        for (text, expected) in [
            ("1 2 3\n", "shot.chan: line 1 is not seven or eight numbers `frame tx ty tz rx ry rz [vfov]`"),
            ("# a\n\n1 2 3 4 5 6 7 8 9\n", "line 3 is not seven or eight numbers"),
            ("1 0 0 0 0 0 x\n", "line 1 is not seven or eight numbers"),
            ("1.5 0 0 0 0 0 0\n", "line 1: the frame 1.5 is not a whole number within ±1e9"),
            ("nan 0 0 0 0 0 0\n", "the frame NaN"),
            ("1e300 0 0 0 0 0 0\n", "is not a whole number within ±1e9"),
            ("1 0 inf 0 0 0 0\n", "the pose of line 1 contains inf"),
            ("1 0 0 0 0 nan 0\n", "the pose of line 1 contains NaN"),
            ("1 0 0 0 0 0 0 0\n", "the eighth number is 0, not a vertical field of view"),
            ("1 0 0 0 0 0 0 nan\n", "the eighth number is NaN"),
            ("1 0 0 0 0 0 0\n1 1 0 0 0 0 0\n", "line 2: frame 1 is in line 1 already"),
            ("# nothing\n", "it has no poses"),
        ] {
            let message = refusal(text);
            assert!(message.contains(expected), "{message:?} has no {expected:?}");
        }
    }
}
