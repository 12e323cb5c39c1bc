//! Photos, depth and lenses as people have them: what is right is quiet, what is wrong is named.

use std::path::Path;

use lightoctree::Document;
use lo_imaging::{Image, Photo};
use lo_testdata::{asset, shared_data};

use super::support::done;

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
