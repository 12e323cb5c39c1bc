#![allow(clippy::unwrap_used)]
use lo_geometry::{Quat, Vec3};
use proptest::prelude::*;

use super::*;

const PHOTOS: [&str; 2] = ["shots/a.jpg", "shots/b.jpg"];

/// Pose of the second camera in the first one's axes, from files of these contents.
fn second(files: &[&str], photos: &[&str]) -> Result<(Vec3, Quat, PhotoPoses), PoseError> {
    let name = |index: usize| format!("poses {index}");
    let files: Vec<PoseFile> = files
        .iter()
        .enumerate()
        .map(|(index, text)| PoseFile::from_bytes(text.as_bytes(), &name(index)))
        .collect::<Result<_, _>>()?;
    let poses = PhotoPoses::of(&files, photos)?;
    let motion = poses.first_from_cameras()[1];
    Ok((motion.translation_m, motion.rotation, poses))
}

fn refusal(files: &[&str], photos: &[&str]) -> String {
    let read = second(files, photos).and_then(|read| read.2.check_distances());
    read.err().unwrap_or_else(|| panic!("{files:?} is accepted")).to_string()
}

fn own(a: &str, b: &str) -> String {
    format!(r#"{{"photos": [{{"file": "b.jpg", {b}}}, {{"file": "a.jpg", {a}}}]}}"#)
}

/// The world's origin.
const HOME: &str = r#""rotation_xyzw": [0, 0, 0, 1], "position_m": [0, 0, 0]"#;

/// One pair of cameras in every format: the first is 1 m up and turned left by 90°, so that it looks along −X; the
/// second is 2 m in front of it, turned left by 90° once more. In the first one's axes it is at (0, 0, −2) and looks
/// along −X.
#[test]
fn all_formats_tell_of_the_same_cameras() {
    let half = 0.5f64.sqrt();
    // Columns: directions of the camera's axes in the world, and its position.
    let a = "0, 0, 1, 0,  0, 1, 0, 1,  -1, 0, 0, 0,  0, 0, 0, 1";
    let b = "-1, 0, 0, -2,  0, 1, 0, 1,  0, 0, -1, 0,  0, 0, 0, 1";
    // In OpenCV's axes the second and third column are negated.
    let (a_cv, b_cv) = (
        "0, 0, -1, 0,  0, -1, 0, 1,  -1, 0, 0, 0,  0, 0, 0, 1",
        "-1, 0, 0, -2,  0, -1, 0, 1,  0, 0, 1, 0,  0, 0, 0, 1",
    );
    let rows = |matrix: &str| {
        let numbers: Vec<&str> = matrix.split(',').map(str::trim).collect();
        let rows: Vec<String> = numbers.chunks(4).map(|row| format!("[{}]", row.join(","))).collect();
        format!("[{}]", rows.join(","))
    };
    let own_matrix = |a: &str, b: &str| {
        own(&format!(r#""world_from_camera": {}"#, rows(a)), &format!(r#""world_from_camera": [{b}]"#))
    };
    let quaternion = own(
        &format!(r#""rotation_xyzw": [0, {half}, 0, {half}], "position_m": [0, 1, 0]"#),
        r#""rotation_xyzw": [0, 1, 0, 0], "position_m": [-2, 1, 0]"#,
    );
    let opencv = own_matrix(a_cv, b_cv).replace(r#"{"photos""#, r#"{"axes": "opencv", "photos""#);
    let record3d = format!(
        r#"{{"w": 960, "h": 720, "fps": 60, "K": [700, 0, 0, 0, 701, 0, 480, 360, 1],
            "poses": [[0, 0, 0, 1, 9, 9, 9], [0, {half}, 0, {half}, 0, 1, 0], [0, 1, 0, 0, -2, 1, 0]]}}"#
    );
    let scanner = |m: &str| {
        format!(
            r#"{{"cameraPoseARFrame": [{m}], "intrinsics": [1400, 0, 960, 0, 1400, 720, 0, 0, 1], "frame_index": 3}}"#
        )
    };
    let polycam = |m: &str| {
        let numbers: Vec<&str> = m.split(',').map(str::trim).collect();
        let fields: Vec<String> = (0..12).map(|i| format!(r#""t_{}{}": {}"#, i / 4, i % 4, numbers[i])).collect();
        format!(
            r#"{{{}, "fx": 700, "fy": 700, "cx": 512, "cy": 384, "width": 1024, "height": 768}}"#,
            fields.join(", ")
        )
    };
    let nerf = |scale: f64, shift: f64| {
        let b = b.replacen("-2", &format!("{shift}"), 1);
        let a = a.replacen(" 1,  -1, 0", &format!(" {scale},  -1, 0"), 1);
        let b = b.replacen("1, 0, 1,", &format!("1, 0, {scale},"), 1);
        format!(
            r#"{{"applied_scale": {scale}, "fl_x": 800, "w": 1000, "h": 600, "k1": 0.01, "frames": [
                {{"file_path": "./shots/b.jpg", "transform_matrix": {}}}, {{"file_path": "./shots/a.jpg", "transform_matrix": {}}}]}}"#,
            rows(&b),
            rows(&a)
        )
    };
    // Camera in OpenCV's axes: q · (rotation by 180° about x).
    let tum = format!(
        "# timestamp tx ty tz qx qy qz qw\n10.0 0 0 0 0 0 0 1\n20.004 0 1 0 {half} 0 {} 0\n30.0 -2 1 0 0 0 -1 0\n",
        -half
    );
    let cases: [(&str, Vec<String>, [&str; 2], bool); 9] = [
        ("own, matrices", vec![own_matrix(a, b)], PHOTOS, false),
        ("own, quaternions", vec![quaternion], PHOTOS, false),
        ("own, OpenCV", vec![opencv], PHOTOS, false),
        ("Record3D", vec![record3d], ["rgb/1.jpg", "rgb/2.jpg"], false),
        ("3D Scanner App", vec![scanner(a), scanner(b)], PHOTOS, true),
        ("Polycam", vec![polycam(a), polycam(b)], PHOTOS, true),
        ("NeRF", vec![nerf(1.0, -2.0)], PHOTOS, false),
        ("NeRF, scaled", vec![nerf(0.5, -1.0)], PHOTOS, false),
        ("TUM", vec![tum], ["rgb/20.000.png", "rgb/30.01.png"], false),
    ];
    for (format, files, photos, upright) in &cases {
        let files: Vec<&str> = files.iter().map(String::as_str).collect();
        let (translation_m, rotation, poses) =
            second(&files, photos).unwrap_or_else(|error| panic!("{format}: {error}"));
        // f32 of exact numbers, and of halves of the root of two
        assert!((translation_m - Vec3::new(0.0, 0.0, -2.0)).length() < 1e-5, "{format}: {translation_m}");
        assert!((rotation * Vec3::NEG_Z - Vec3::NEG_X).length() < 1e-5, "{format}: {rotation}");
        assert!((rotation * Vec3::Y - Vec3::Y).length() < 1e-5, "{format}: {rotation}");
        assert_eq!(poses.up.is_some(), *upright, "{format}");
        assert!(poses.up.is_none_or(|up| (up - Vec3::Y).length() < 1e-6), "{format}");
        let distortion = format.starts_with("NeRF").then(|| lo_geometry::Distortion::brown(&[0.01]));
        assert_eq!((poses.distortion(0), poses.distortion(1)), (distortion, distortion), "{format}");
    }
}

#[test]
fn lenses_are_those_of_the_picture_at_hand() {
    let k = r#""K": [700, 0, 0, 0, 701, 0, 470, 365, 1]"#;
    let file = |rest: &str| {
        let text =
            format!(r#"{{"w": 960, "h": 720, {rest}, "poses": [[0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 1, 0, 0]]}}"#);
        second(&[&text], &["0.jpg", "1.jpg"]).unwrap().2
    };
    // Half the size, half the numbers.
    let camera = file(k).camera(0, 480, 360).unwrap().unwrap();
    assert_eq!((camera.fx, camera.fy, camera.cx, camera.cy), (350.0, 350.5, 235.0, 182.5));
    let own = r#""perFrameIntrinsicCoeffs": [[1, 1, 1, 1], [710, 711, 480, 360]]"#;
    assert_eq!(file(&format!("{k}, {own}")).camera(1, 960, 720).unwrap().unwrap().fx, 710.0);
    let turned = file(k).camera(1, 720, 960).unwrap_err().to_string();
    assert!(turned.contains("960 × 720 pixels, but 1.jpg has 720 × 960"), "{turned}");
    let degrees = super::tests::own(HOME, &format!(r#"{HOME}, "hfov_deg": 70"#));
    let poses = second(&[&degrees], &PHOTOS).unwrap().2;
    assert_eq!(poses.camera(0, 100, 50).unwrap(), None);
    assert!((poses.camera(1, 100, 50).unwrap().unwrap().hfov_deg() - 70.0).abs() < 1e-9);
    let wide = super::tests::own(HOME, &format!(r#"{HOME}, "hfov_deg": 190"#));
    let error = second(&[&wide], &PHOTOS).unwrap().2.camera(1, 100, 50).unwrap_err().to_string();
    assert!(error.contains("shots/b.jpg") && error.contains("190"), "{error}");
}

#[test]
fn upright_worlds_say_which_way_is_up_for_the_first_camera() {
    // Pitched down by 30°: up is in front of the camera's own up.
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let a = format!("1, 0, 0, 0,  0, {cos}, {sin}, 0,  0, {}, {cos}, 0,  0, 0, 0, 1", -sin);
    let files =
        [&*a, "1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1"].map(|m| format!(r#"{{"cameraPoseARFrame": [{m}]}}"#));
    let up = second(&[&files[0], &files[1]], &PHOTOS).unwrap().2.up.unwrap();
    assert!((up - Vec3::new(0.0, cos as f32, sin as f32)).length() < 1e-6, "{up}");
    let turned = own(HOME, HOME).replace(r#"{"photos""#, r#"{"world_up": [0, 0, 2], "photos""#);
    assert_eq!(second(&[&turned], &PHOTOS).unwrap().2.up, Some(Vec3::Z));
}

#[test]
fn exposures_are_relative_to_the_first() {
    let file = own(&format!(r#"{HOME}, "exposure_ev": -1"#), &format!(r#"{HOME}, "exposure_ev": 0.5"#));
    assert_eq!(second(&[&file], &PHOTOS).unwrap().2.exposures_ev(), Some(vec![0.0, 1.5]));
    assert_eq!(second(&[&own(HOME, HOME)], &PHOTOS).unwrap().2.exposures_ev(), None);
    let some = refusal(&[&own(HOME, &format!(r#"{HOME}, "exposure_ev": 0.5"#))], &PHOTOS);
    assert!(some.contains("for some photos but not for all"), "{some}");
}

#[test]
fn what_is_no_pose_is_named() {
    let matrix = |numbers: &str| refusal(&[&own(HOME, &format!(r#""world_from_camera": [{numbers}]"#))], &PHOTOS);
    let cases = [
        (matrix("2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1"), "the pose of b.jpg scales by 2.000"),
        (matrix("-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1"), "the pose of b.jpg is mirrored"),
        (matrix("1, 0.5, 0, 0, 0, 0.866, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1"), "two of its axes meet at 60.0 degrees"),
        (matrix("1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1"), "the last row is [3.0, 0.0, 0.0, 1.0]"),
        (matrix("1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0"), "`world_from_camera` is not a 4 × 4 matrix"),
        (matrix("1, 0, 0, 1e9, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1"), "contains 1000000000"),
        (matrix("0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1"), "scales by 0.000"),
        (matrix("1, 0, 0, 51, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1"), "51.0 m apart"),
        (
            refusal(&[&own(HOME, r#""rotation_xyzw": [0, 0, 0, 2], "position_m": [0, 0, 0]"#)], &PHOTOS),
            "length 2.0000, not 1",
        ),
        (refusal(&[&own(HOME, r#""position_m": [0, 0, 0]"#)], &PHOTOS), "b.jpg needs `world_from_camera`, or"),
        (refusal(&[&own(HOME, &format!(r#"{HOME}, "fov": 3"#))], &PHOTOS), "unknown field `fov`"),
        (refusal(&[&own(HOME, HOME)], &["a.jpg", "c.jpg"]), "has no pose of c.jpg"),
        (refusal(&[&own(HOME, HOME).replace("a.jpg", "b.jpg")], &PHOTOS), "has no pose of shots/a.jpg"),
        (refusal(&[&own(HOME, HOME).replace("a.jpg", "b.jpg")], &["b.jpg", "b.jpg"]), "several poses of b.jpg"),
        (refusal(&["10.0 0 0 0 0 0 nan 1\n"], &PHOTOS), "the pose of line 1 contains NaN"),
        (refusal(&["10.0 0 0 0 0 0 0 1\n20 1 2\n"], &PHOTOS), "line 2 is not eight numbers"),
        (refusal(&["10.0 0 0 0 0 0 0 1\n"], &["1.png", "9.png"]), "within 20 ms"),
        (refusal(&["hello"], &PHOTOS), "unknown pose file format"),
        (refusal(&[r#"{"cameras": []}"#], &PHOTOS), "unknown pose file format"),
        (refusal(&[r#"{"photos": []}"#], &PHOTOS), "it has no poses"),
        (refusal(&[r#"{"photos": "#], &PHOTOS), "EOF"),
        (refusal(&[r#"{"poses": [[0, 0, 0, 1, 0, 0, 0]]}"#], &["0.jpg", "1.jpg"]), "has no pose of 1.jpg"),
        (refusal(&[r#"{"poses": [[0, 0, 0, 1, 0, 0]]}"#], &["0.jpg", "1.jpg"]), "frame 0 is not seven numbers"),
        (
            refusal(&[r#"{"poses": [[0, 0, 0, 1, 0, 0, 0]]}"#], &["a.jpg", "b.jpg"]),
            "by the number in the photo's name, such as",
        ),
        (
            refusal(
                &[r#"{"camera_model": "EQUIRECTANGULAR", "frames": [{"file_path": "a.jpg", "transform_matrix":
                    [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]}"#],
                &PHOTOS,
            ),
            "camera model is EQUIRECTANGULAR",
        ),
        (
            refusal(&[r#"{"cameraPoseARFrame": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}"#], &PHOTOS),
            "1 pose files for 2 photos",
        ),
        (refusal(&[&own(HOME, HOME), &own(HOME, HOME)], &PHOTOS), "poses 0 has 2 poses"),
        (refusal(&[&own(HOME, HOME), &own(HOME, HOME)], &["a.jpg", "b.jpg", "c.jpg"]), "2 pose files for 3 photos"),
    ];
    for (message, expected) in cases {
        assert!(message.contains(expected), "{message:?} has no {expected:?}");
    }
    let missing = PoseFile::read(std::path::Path::new("nowhere.json")).unwrap_err().to_string();
    assert!(missing.contains("nowhere.json"), "{missing}");
}

#[test]
fn trajectories_go_by_order_where_names_have_no_times() {
    let text = "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n";
    assert_eq!(second(&[text], &PHOTOS).unwrap().0, Vec3::X);
    let names = second(&[text], &["2.0.png", "1.0.png"]).unwrap().0;
    assert_eq!(names, Vec3::NEG_X, "names come before order");
}

proptest! {
    /// Texts of the words of the track formats give an error or poses.
    #[test]
    fn no_text_panics(
        start in prop::sample::select(vec!["", "#usda 1.0\n", "1 1 0 0 0 0 0 0 1 a.jpg\n", "1 0 0 0 0 0 0\n"]),
        words in prop::collection::vec(prop::sample::select(vec![
            "def Camera \"c\"", "def Xform \"a\"", "class", "{", "}", "(", ")", "[", "]", "\n", "\n", " ", " = ", ":",
            ";", ",", "float focalLength", "double3 xformOp:translate", "quatf xformOp:orient", ".timeSamples", "\"",
            "uniform token[] xformOpOrder", "\"xformOp:translate\"", "\"!invert!xformOp:orient\"", "upAxis", "'''",
            "metersPerUnit", "\\", "@", "<", "#", "1", "-2.5", "1e308", "nan", "inf", "0", "99999999999999999999",
            "ä", "1 1 0 0 0 0 0 0 1 b.jpg", "1 0 0 0 0 0 0 40\n",
        ]), 0..40),
        name in prop::sample::select(vec!["poses", "poses.chan"]),
    ) {
        let text = start.to_owned() + &words.concat();
        if let Ok(file) = PoseFile::from_bytes(text.as_bytes(), name) {
            prop_assert!(file.poses.iter().all(|pose| pose.position_m.is_finite()));
            for photos in [["a.jpg", "b.jpg"], ["a_1.jpg", "a_0002.jpg"]] {
                let _ = PhotoPoses::of(std::slice::from_ref(&file), &photos).map(|poses| poses.camera(0, 640, 480));
            }
        }
    }
}
