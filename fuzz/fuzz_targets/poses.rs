//! Files of camera poses and lenses: the bytes give an error, rigid transforms, or a lens.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lo_geometry::Vec3;
use lo_scene::Undistortion;
use lo_scene::poses::{PhotoLens, PhotoPoses, PoseFile};

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    let lens = PhotoLens::from_text(&text, "lens", "a.jpg".as_ref(), || Some(text.clone().into_owned()));
    if let Ok(lens) = lens
        && let Ok(camera) = lens.camera(640, 480)
        && let Some(distortion) = lens.distortion
        && let Ok(undistortion) = Undistortion::new(camera, distortion)
    {
        assert!(undistortion.camera.fx.is_finite() && undistortion.camera.fx > 0.0, "{undistortion:?}");
    }
    ["poses", "poses.chan"].iter().filter_map(|name| PoseFile::from_bytes(bytes, name).ok()).for_each(check);
});

fn check(file: PoseFile) {
    let names = [["a.jpg", "b.jpg"], ["0.jpg", "1.jpg"], ["1.0.png", "2.0.png"]];
    let of_all = names.iter().map(|photos| PhotoPoses::of(std::slice::from_ref(&file), photos));
    let of_each = std::iter::once(PhotoPoses::of(&[file.clone(), file.clone()], &names[0]));
    for poses in of_all.chain(of_each).flatten() {
        for motion in poses.first_from_cameras() {
            assert!(motion.translation_m.is_finite() && motion.rotation.is_normalized(), "{motion:?}");
            let forward = motion.direction(Vec3::NEG_Z);
            assert!((forward.length() - 1.0).abs() < 1e-3, "{forward}");
        }
        assert!(poses.up.is_none_or(|up| (up.length() - 1.0).abs() < 1e-3));
        for index in 0..2 {
            let camera = poses.camera(index, 640, 480);
            assert!(camera.is_err() || camera.is_ok_and(|camera| camera.is_none_or(|camera| camera.fx > 0.0)));
        }
        poses.exposures_ev().iter().flatten().for_each(|ev| assert!(ev.is_finite()));
    }
}
