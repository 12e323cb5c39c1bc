//! Photos, depth and lenses as people have them: what is right is quiet, what is wrong is named.

use std::path::Path;

use lightoctree::events::EstimateWarning;
use lightoctree::{Document, EstimateOptions, Estimator, Event, Input};
use lo_geometry::Camera;
use lo_imaging::{DepthMap, Image, Photo};
use lo_scene::{Completion, Frame};
use lo_testdata::{asset, shared_data};

use super::support::done;

/// A photo with measured depth.
fn frame(photo: &Path, depth: &Path, scale: f64, intrinsics: Option<[f64; 4]>) -> Frame {
    let photo = lo_imaging::read_photo(photo).unwrap().photo;
    let depth_m = lo_imaging::read_depth(depth, Some(scale)).unwrap();
    let (width, height) = (photo.width() as u32, photo.height() as u32);
    let camera = match intrinsics {
        Some([fx, fy, cx, cy]) => Camera::new(fx, fy, cx, cy, width, height),
        None => Camera::from_hfov_deg(71.6, width, height),
    };
    Frame::new(photo, depth_m, camera.unwrap(), 1.0).unwrap()
}

/// All real photos with depth, and their names.
fn frames() -> Vec<(String, Frame)> {
    let library = frame(&asset("library_color.jpg"), &asset("library_lidar_depth.png"), 1000.0, None);
    let mut frames = vec![("library".to_owned(), library)];
    let Some(folder) = shared_data("rgbd_more", "comparison of real depth maps with the network's") else {
        return frames;
    };
    let list = std::fs::read_to_string(folder.join("frames.json")).unwrap();
    for entry in super::support::json(&list).as_array().unwrap() {
        let file = |key: &str| folder.join(entry[key].as_str().unwrap());
        let intrinsics = std::array::from_fn(|i| entry["intrinsics"][i].as_f64().unwrap());
        let scale = entry["depth_scale"].as_f64().unwrap();
        let name = entry["color"].as_str().unwrap().to_owned();
        frames.push((name, frame(&file("color"), &file("depth"), scale, Some(intrinsics))));
    }
    frames
}

#[test]
fn real_depth_is_quiet_and_wrong_depth_is_named() {
    let estimator = Estimator::shipped().unwrap();
    let options = EstimateOptions { completion: Some(Completion::None), ..EstimateOptions::default() };
    let warning = |frame: &Frame, change: &dyn Fn(f32) -> f32| {
        let depth_m: DepthMap = frame.depth_m.map(|&z| if z > 0.0 { change(z) } else { 0.0 });
        let frame = Frame::new(frame.photo.clone(), depth_m, frame.camera, 1.0).unwrap();
        let mut found = None;
        let hear = &mut |event: Event| {
            let warning = event.warning::<EstimateWarning>();
            if let Some(EstimateWarning::InverseDepth { .. } | EstimateWarning::DepthScale { .. }) = warning {
                found = warning.cloned();
            }
            std::ops::ControlFlow::Continue(())
        };
        estimator.estimate(Input::MeasuredDepth(frame), &options, hear).unwrap();
        found
    };
    let frames = frames();
    let (mut loud, mut inverse, mut scaled) = (Vec::new(), Vec::new(), Vec::new());
    for (name, frame) in &frames {
        loud.extend(warning(frame, &|z| z).map(|warning| format!("{name}: {warning:?}")));
        let found = warning(frame, &|z| 4.0 / z);
        if !matches!(found, Some(EstimateWarning::InverseDepth { .. })) {
            inverse.push(format!("{name}: {found:?}"));
        }
        for scale in [5.0, 0.2] {
            let found = warning(frame, &|z| scale * z);
            if !matches!(found, Some(EstimateWarning::DepthScale { .. })) {
                scaled.push(format!("{name} × {scale}: {found:?}"));
            }
        }
    }
    let count = frames.len();
    eprintln!("of {count} frames: quiet but inverse {inverse:#?}, quiet but scaled {scaled:#?}");
    assert!(loud.is_empty(), "{loud:#?}");
    // A wall seen from the front has no order of depths, and the network's own scale may be off.
    assert!(10 * inverse.len() <= count && 10 * scaled.len() <= 2 * count, "{inverse:#?} {scaled:#?}");
}

/// Runs `estimate` on a photo; returns whether it succeeded, and its notes or error.
fn estimate(photo: &Path, more: &[&str]) -> (bool, String) {
    let folder = tempfile::tempdir().unwrap();
    let mut command = assert_cmd::Command::cargo_bin("lightoctree").unwrap();
    command.current_dir(folder.path()).arg("estimate").arg(photo).args(more).args(["-o", "a.scene"]);
    let output = command.output().unwrap();
    (output.status.success(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn depth_files_as_people_have_them() {
    let Some(folder) = shared_data("inputs", "depth files as people have them") else { return };
    let photo = folder.join("base.jpg");
    let with = |depth: &str, more: &[&str]| {
        let depth = folder.join(depth);
        estimate(&photo, &[&["--depth", depth.to_str().unwrap(), "--hfov-deg", "67.4"][..], more].concat())
    };
    let named = |depth: &str, more: &[&str], says: &[&str]| {
        let (success, notes) = with(depth, more);
        assert!(success && says.iter().all(|text| notes.contains(text)), "{depth} {more:?}: {notes}");
    };
    named("disparity16.png", &[], &["looks like inverse depth", "--depth-is inverse"]);
    named("norm_depth16.png", &[], &["scale?", "normalised"]);
    named("tum5000.png", &[], &["scale?", "--depth-scale 5000 would fit best (now 1000)"]);
    named("disparity16.png", &["--depth-is", "inverse"], &["it was fitted"]);
    named("disparity16.png", &["--depth-is", "disparity"], &["it was fitted"]);
    for (depth, more) in [
        ("tum5000.png", &["--depth-scale", "5000"][..]),
        ("depth_pro.npz", &["--depth-is", "predicted"]),
        ("depth_1xHxW.npy", &[]),
        ("depth_m_f32.tif", &[]),
    ] {
        let (success, notes) = with(depth, more);
        assert!(success && !notes.contains("scale?") && !notes.contains("inverse"), "{depth} {more:?}: {notes}");
    }
    let (success, notes) = with("tum5000.png", &["--depth-is", "inverse"]);
    assert!(!success && notes.contains("tum5000.png") && notes.contains("increase with distance"), "{notes}");
    let (success, notes) = with("disparity16.png", &["--depth-is", "inverse", "--depth-scale", "2"]);
    assert!(!success && notes.contains("--depth-scale has no effect"), "{notes}");
}

#[test]
fn photos_and_lenses_as_people_have_them() {
    let Some(folder) = shared_data("inputs", "photos and lenses as people have them") else { return };
    let run = |photo: &str, more: &[&str]| {
        let more: Vec<String> = more.iter().map(|text| text.replace("DIR", folder.to_str().unwrap())).collect();
        let more: Vec<&str> = more.iter().map(String::as_str).collect();
        estimate(&folder.join(photo), &[&["--completion", "shell"][..], &more].concat())
    };
    let named = |photo: &str, more: &[&str], says: &str| {
        let (success, notes) = run(photo, more);
        assert!(success && notes.contains(says), "{photo} {more:?}: {notes}");
    };
    named("square_crop_exif640.jpg", &[], "field of view 53.1° (focal length from EXIF of the uncropped photo)");
    named("r3d/rgb/0.jpg", &["--intrinsics", "DIR/r3d/metadata.json"], "field of view 49.6°");
    named("r3d/rgb/0.jpg", &["--intrinsics", "DIR/r3d/transforms_2x.json"], "field of view 49.6°");
    named("r3d/rgb/0.jpg", &["--intrinsics", "DIR/r3d/transforms_anglex.json"], "field of view 49.3°");
    named("r3d/rgb/0.jpg", &["--intrinsics", "DIR/r3d/transforms_dist.json"], "lens distortion is undone");
    named("r3d/rgb/0.jpg", &["--intrinsics", "DIR/r3d/transforms_fisheye.json"], "lens distortion is undone");
    named("base.jpg", &["--hfov-deg", "67.4", "--distortion", "-0.2,0,0,0"], "lens distortion is undone");
    named("truncated.jpg", &[], "52 % of the picture is missing and black");
    named("truncated.jpg", &[], "at the bottom");
    named("ultrahdr.jpg", &[], "highlights by the gain map");
    named("letterbox.png", &[], "80 pixels at the top, 80 pixels at the bottom");
    named("pillarbox.png", &[], "220 pixels at the left, 220 pixels at the right");
    assert!(!run("pillarbox.png", &[]).1.contains("panorama"));
    let refused = |photo: &str, more: &[&str], says: &[&str]| {
        let (success, notes) = run(photo, more);
        assert!(!success && says.iter().all(|text| notes.contains(text)), "{photo} {more:?}: {notes}");
    };
    refused("fisheye_circular.jpg", &[], &["circular fisheye", "--hfov-deg", "fisheye_circular.jpg"]);
    refused("photo.avif", &[], &["AVIF", "avifdec"]);
    refused("pano_gpano_cropped.jpg", &[], &["panorama"]);
    refused("phone_pano_180.jpg", &[], &["panorama", "--hfov-deg"]);
    refused("r3d/rgb_turned0.jpg", &["--intrinsics", "DIR/r3d/metadata.json"], &["480 × 720", "rotated or cropped"]);
    refused("base.jpg", &["--distortion", "-0.2,0,0,0"], &["--distortion needs the lens"]);
    refused("base.jpg", &["--intrinsics", "none.json"], &["none.json"]);
}

/// The light of a photo with bars is that of the photo without, and its composite has the bars.
#[test]
fn black_bars_change_neither_light_nor_their_own_pixels() {
    const BAR: usize = 60;
    let Photo::Srgb8(photo) = lo_imaging::read_photo(asset("library_color.jpg")).unwrap().photo else { panic!() };
    let (width, height) = (480, 360);
    let small = Image::from_fn(width, height, |x, y| photo[(4 * x, 4 * y)]);
    let framed = Image::from_fn(width, height + 2 * BAR, |x, y| {
        if (BAR..height + BAR).contains(&y) { small[(x, y - BAR)] } else { [0; 3] }
    });
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, image) in [("small", &small), ("framed", &framed)] {
        std::fs::write(at.join(format!("{name}.png")), lo_imaging::encode_png(image)).unwrap();
        done(at, &["estimate", &format!("{name}.png"), "-o", &format!("{name}.scene")]);
    }
    let [plain, scene] =
        ["small.scene", "framed.scene"].map(|name| Document::read(at.join(name)).unwrap().estimate.clone());
    assert!(plain.light == scene.light, "the light differs");
    assert_eq!(scene.frame.camera.cy, plain.frame.camera.cy + BAR as f64);
    let sphere = ["--mesh", "builtin:sphere", "--height", "0.5", "--pixel", "240,400", "-o", "out.png"];
    done(at, &[&["insert", "framed.scene"][..], &sphere].concat());
    let Photo::Srgb8(out) = lo_imaging::read_photo(at.join("out.png")).unwrap().photo else { panic!() };
    assert_eq!((out.width(), out.height()), (width, height + 2 * BAR));
    let mut changed = 0;
    for (x, y) in (0..height + 2 * BAR).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let is_bar = !(BAR..height + BAR).contains(&y);
        changed += usize::from(out[(x, y)] != framed[(x, y)]);
        assert!(!is_bar || out[(x, y)] == [0; 3], "{x}, {y}");
    }
    assert!(changed > 500, "{changed} pixels of the sphere");
}

#[test]
fn composites_keep_the_colour_space_of_the_photo() {
    let Some(inputs) = shared_data("inputs", "composites in Display P3") else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let photo = inputs.join("p3.png");
    done(at, &["estimate", photo.to_str().unwrap(), "-o", "room.scene"]);
    let sphere = ["--mesh", "builtin:sphere", "--height", "0.3", "--pixel", "300,420", "-o", "out.png"];
    done(at, &[&["insert", "room.scene"][..], &sphere].concat());
    let read = |path: &Path| match lo_imaging::read_photo(path).unwrap().photo {
        Photo::Encoded8(photo) => photo,
        _ => panic!("{} has no profile", path.display()),
    };
    let (before, after) = (read(&photo), read(&at.join("out.png")));
    assert_eq!(after.encoding.profile.as_ref().unwrap().name(), "Display P3");
    assert_eq!(after.encoding.profile, before.encoding.profile);
    let changed = before.image.pixels().iter().zip(after.image.pixels()).filter(|(a, b)| a != b).count();
    let share = changed as f64 / before.image.pixels().len() as f64;
    assert!((0.002..0.7).contains(&share), "{share}");
}

/// Composites of a distorted photo have its own pixels where no object changes them.
#[test]
fn composites_are_distorted_back() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let photo = lo_imaging::read_photo(asset("library_color.jpg")).unwrap().photo.into_srgb8();
    let (width, height) = (480, 360);
    let small = Image::from_fn(width, height, |x, y| photo[(4 * x, 4 * y)]);
    std::fs::write(at.join("small.png"), lo_imaging::encode_png(&small)).unwrap();
    let lens = ["--hfov-deg", "67", "--distortion", "-0.15,0.02,0,0"];
    done(at, &[&["estimate", "small.png", "-o", "room.scene"][..], &lens].concat());
    let scene = Document::read(at.join("room.scene")).unwrap().estimate;
    assert_eq!(scene.distorted.as_ref().unwrap().photo, Photo::Srgb8(small.clone()));
    let sphere = ["--mesh", "builtin:sphere", "--height", "0.2", "--pixel", "240,330", "-o", "out.png"];
    done(at, &[&["insert", "room.scene"][..], &sphere].concat());
    let out = lo_imaging::read_photo(at.join("out.png")).unwrap().photo.into_srgb8();
    let same = small.pixels().iter().zip(out.pixels()).filter(|(a, b)| a == b).count() as f64;
    let share = same / small.pixels().len() as f64;
    assert!((0.3..0.995).contains(&share), "{share}");
    // the upper corners are far from the object
    for (x, y) in (0..40).flat_map(|y| (0..40).map(move |x| (x, y))) {
        assert_eq!(out[(x, y)], small[(x, y)], "{x} {y}");
    }
}
