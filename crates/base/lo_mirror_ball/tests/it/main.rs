//! Unwraps photos of a mirror ball, rendered by an independent method, and compares with the panorama.
#![allow(clippy::unwrap_used)]

mod render;

use lo_geometry::{DVec3, pixel_direction, pixel_solid_angle_sr};
use lo_imaging::{Photo, RadianceImage, read_radiance, resize, resize_equirectangular, srgb_from_linear};
use lo_mirror_ball::{
    BallCircle, BallDetection, BallError, BallLens, BallView, MergedPhotos, UnwrapOptions, UnwrappedBall,
    estimate_stops, find_ball, merge_exposures, unwrap_ball,
};
use render::{BallScene, expose, map_radiance};

const PINHOLE: BallScene =
    BallScene { size: [640, 480], middle: [320.0, 240.0], radius_px: 190.0, focal_px: Some(900.0) };
const ORTHOGRAPHIC: BallScene = BallScene { focal_px: None, ..PINHOLE };
const OFF_AXIS: BallScene =
    BallScene { size: [640, 480], middle: [230.0, 270.0], radius_px: 150.0, focal_px: Some(700.0) };

fn lens(scene: &BallScene) -> BallLens {
    scene.focal_px.map_or(BallLens::Orthographic, |focal_px| BallLens::Focal { focal_px })
}

/// The true outline: centre and mean semi-axis of an ellipse, from its vertices.
fn outline(scene: &BallScene) -> BallCircle {
    let [x, y] = scene.middle;
    let Some(focal) = scene.focal_px else { return BallCircle { x, y, radius_px: scene.radius_px } };
    let (dx, dy) = (x - 0.5 * scene.size[0] as f64, y - 0.5 * scene.size[1] as f64);
    let off = dx.hypot(dy);
    let (turn, half) = ((off / focal).atan(), (scene.radius_px / focal).atan());
    let (far, near) = (focal * (turn + half).tan(), focal * (turn - half).tan());
    let long = 0.5 * (far - near);
    // eccentricity of a cone's section: sin of the plane's tilt over the cosine of the half-angle
    let short = long * (1.0 - (turn.sin() / half.cos()).powi(2)).sqrt();
    let scale = if off > 0.0 { 0.5 * (far + near) / off } else { 0.0 };
    let middle = [0.5 * scene.size[0] as f64 + dx * scale, 0.5 * scene.size[1] as f64 + dy * scale];
    BallCircle { x: middle[0], y: middle[1], radius_px: 0.5 * (long + short) }
}

fn merged(photo: &RadianceImage) -> MergedPhotos {
    merge_exposures(&[Photo::Linear(photo.clone())], &[0.0]).unwrap()
}

fn unwrapped(photo: &RadianceImage, scene: &BallScene, size: [usize; 2]) -> UnwrappedBall {
    let view = BallView::new(outline(scene), lens(scene), scene.size).unwrap();
    unwrap_ball(&merged(photo), &view, &UnwrapOptions { size: Some(size), ..UnwrapOptions::default() }).unwrap()
}

/// PSNR over sRGB values of radiance clipped to 1, weighted by solid angle, of pixels farther than `hidden_deg` from
/// the viewing direction.
fn psnr_db(got: &RadianceImage, truth: &RadianceImage, hidden_deg: f32) -> f64 {
    let (width, height) = (truth.width(), truth.height());
    let [mut error, mut weights] = [0.0f64; 2];
    for (index, (a, b)) in got.pixels().iter().zip(truth.pixels()).enumerate() {
        let (x, y) = (index % width, index / width);
        let ahead = (-pixel_direction(x, y, width, height).z).clamp(-1.0, 1.0).acos().to_degrees();
        if ahead > hidden_deg {
            let weight = f64::from(pixel_solid_angle_sr(y, width, height));
            let code = |v: f32| srgb_from_linear(v.clamp(0.0, 1.0));
            error += weight * (0..3).map(|c| f64::from(code(a[c]) - code(b[c])).powi(2)).sum::<f64>() / 3.0;
            weights += weight;
        }
    }
    -10.0 * (error / weights).log10()
}

/// Smooth in all directions, so that resampling errors are negligible.
fn harmonics(d: DVec3) -> [f32; 3] {
    [0.5 + 0.4 * d.x * d.y, 0.4 + 0.3 * d.z, 0.5 + 0.2 * d.y + 0.2 * (3.0 * d.x).sin()].map(|v| v as f32)
}

fn lebombo() -> RadianceImage {
    read_radiance(lo_testdata::panoramas().join("lebombo_256.hdr")).unwrap()
}

#[test]
fn an_analytic_panorama_comes_back() {
    for scene in [ORTHOGRAPHIC, PINHOLE, OFF_AXIS] {
        let photo = scene.render(&harmonics, &|_, _| [0.0; 3], 2);
        let got = unwrapped(&photo, &scene, [256, 128]);
        let truth = RadianceImage::from_fn(256, 128, |x, y| harmonics(pixel_direction(x, y, 256, 128).as_dvec3()));
        let psnr = psnr_db(&got.radiance, &truth, 40.0);
        assert!(psnr > 50.0, "{scene:?}: {psnr:.1} dB");
        // filled regions are inferred, but smooth
        let all = psnr_db(&got.radiance, &truth, 0.0);
        assert!(all > 25.0, "{scene:?}: {all:.1} dB");
        assert!(got.filled_share > 0.0 && got.filled_share < 0.06, "{scene:?}: {}", got.filled_share);
    }
}

#[test]
fn a_real_panorama_comes_back() {
    let map = lebombo();
    for (scene, asked) in [(ORTHOGRAPHIC, 32.0), (PINHOLE, 32.0), (OFF_AXIS, 30.0)] {
        let photo = scene.render(&map_radiance(&map), &|ray, _| map_radiance(&map)(ray), 3);
        let got = unwrapped(&photo, &scene, [256, 128]);
        let psnr = psnr_db(&got.radiance, &map, 60.0);
        assert!(psnr > asked, "{scene:?}: {psnr:.1} dB");
        println!("{scene:?}: {psnr:.1} dB beyond 60°, {:.1} beyond 30°", psnr_db(&got.radiance, &map, 30.0));
    }
}

#[test]
fn a_smaller_panorama_is_a_mean_and_a_wrong_lens_is_worse() {
    let map = lebombo();
    let photo = PINHOLE.render(&map_radiance(&map), &|ray, _| map_radiance(&map)(ray), 3);
    let small = unwrapped(&photo, &PINHOLE, [64, 32]);
    let truth = resize_equirectangular(&map, 64, 32);
    let psnr = psnr_db(&small.radiance, &truth, 60.0);
    assert!(psnr > 36.0, "{psnr:.1} dB");
    let wrong = unwrapped(&photo, &BallScene { focal_px: None, ..PINHOLE }, [64, 32]);
    let worse = psnr_db(&wrong.radiance, &truth, 60.0);
    assert!(worse < psnr - 6.0, "{worse:.1} and {psnr:.1} dB");
}

#[test]
fn a_small_lamp_keeps_its_flux() {
    for scene in [ORTHOGRAPHIC, PINHOLE] {
        for at in [[0.0, 0.0, 1.0], [0.7, 0.5, 0.5], [-0.9, 0.3, -0.3], [0.2, 1.0, -0.6]] {
            let centre = DVec3::from(at).normalize();
            // half-angle of 1.5°, radiance 5000
            let cos = 1.5f64.to_radians().cos();
            let lamp = |d: DVec3| if d.dot(centre) > cos { [5000.0, 4000.0, 3000.0] } else { [0.0; 3] };
            let photo = scene.render(&lamp, &|_, _| [0.0; 3], 4);
            let got = unwrapped(&photo, &scene, [512, 256]).radiance;
            let flux: f64 = got
                .pixels()
                .iter()
                .enumerate()
                .map(|(index, rgb)| f64::from(rgb[0] * pixel_solid_angle_sr(index / 512, 512, 256)))
                .sum();
            let truth = 5000.0 * std::f64::consts::TAU * (1.0 - cos);
            assert!((flux / truth - 1.0).abs() < 0.05, "{scene:?} {at:?}: {:.3}", flux / truth);
        }
    }
}

#[test]
fn the_panorama_turns_as_asked() {
    let map = lebombo();
    let photo = ORTHOGRAPHIC.render(&map_radiance(&map), &|ray, _| map_radiance(&map)(ray), 2);
    let view = BallView::new(outline(&ORTHOGRAPHIC), BallLens::Orthographic, ORTHOGRAPHIC.size).unwrap();
    let options = UnwrapOptions { size: Some([256, 128]), ..UnwrapOptions::default() };
    let plain = unwrap_ball(&merged(&photo), &view, &options).unwrap().radiance;
    let yaw_rad = std::f32::consts::FRAC_PI_2;
    let turned = unwrap_ball(&merged(&photo), &view, &UnwrapOptions { yaw_rad, ..options }).unwrap().radiance;
    // the centre shows the former +X
    let moved = RadianceImage::from_fn(256, 128, |x, y| plain[((x + 64) % 256, y)]);
    assert!(psnr_db(&turned, &moved, 0.0) > 45.0);
    // a camera pitched up by 30° sees the horizon below its axis: its viewing direction is 30° above the map's centre
    let pitch_rad = 30f32.to_radians();
    let level = unwrap_ball(&merged(&photo), &view, &UnwrapOptions { pitch_rad, ..options }).unwrap().radiance;
    let back = plain[(0, 64)];
    let expected_row = (64.0 + 128.0 * 30.0 / 180.0) as usize;
    assert!((0..3).all(|c| (level[(0, expected_row)][c] - back[c]).abs() < 0.05 * back[c].max(0.2)), "{back:?}");
    // reflectance and cut-out
    let options = UnwrapOptions { reflectance: [0.5, 0.25, 1.0], cut_out_camera_rad: 0.2, ..options };
    let half = unwrap_ball(&merged(&photo), &view, &options).unwrap();
    assert!((half.radiance[(60, 40)][1] / plain[(60, 40)][1] - 4.0).abs() < 1e-3);
    assert_eq!((half.observed[(0, 64)], half.observed[(60, 40)]), (0.0, 1.0));
}

/// With noise, in front of a real photo, and in the reflected room itself, which continues beyond the outline without
/// an edge.
#[test]
fn the_outline_is_found_within_half_a_pixel() {
    let photo = resize(&read_radiance(lo_testdata::asset("library_color.jpg")).unwrap(), 640, 480);
    let map = lebombo();
    let before_photo = |_: DVec3, [u, v]: [f64; 2]| photo[((u as usize).min(639), (v as usize).min(479))];
    let in_room = |ray: DVec3, _: [f64; 2]| map_radiance(&map)(ray);
    let small = BallScene { middle: [200.3, 150.8], radius_px: 71.4, ..PINHOLE };
    let tight = BallScene { middle: [330.0, 245.5], radius_px: 232.0, ..ORTHOGRAPHIC };
    for (index, scene) in [PINHOLE, OFF_AXIS, small, ORTHOGRAPHIC, tight].into_iter().enumerate() {
        let mut lights = vec![(scene.render(&map_radiance(&map), &before_photo, 2), 0.5)];
        // an orthographic view has one direction of the room as its whole background
        if scene.focal_px.is_some() {
            lights.push((scene.render(&map_radiance(&map), &in_room, 2), 1.0));
        }
        for (light, tolerance_px) in lights {
            // 2000 quanta at white: 2.2 % noise
            let noisy = expose(&light, 0.0, 2000.0, 7 + index as u32).into_radiance();
            let found = find_ball(&noisy, lens(&scene)).unwrap().unwrap();
            let (got, truth) = (found.view.circle(), outline(&scene));
            let off = [got.x - truth.x, got.y - truth.y, got.radius_px - truth.radius_px];
            println!("{truth:?}: off by {off:.2?} px, confidence {:.2}", found.confidence);
            assert!(found.confidence >= BallDetection::MIN_CONFIDENCE, "{scene:?}: {found:?}");
            assert!(off.iter().all(|off| off.abs() < tolerance_px), "{scene:?}: {off:.2?} px");
        }
    }
}

#[test]
fn photos_without_a_ball_give_no_sure_find() {
    let library = resize(&read_radiance(lo_testdata::asset("library_color.jpg")).unwrap(), 960, 720);
    let crops = [library.clone(), resize(&library, 320, 240), lebombo()];
    let grey = RadianceImage::new(300, 200, vec![[0.3; 3]; 300 * 200]);
    let noise = expose(&grey, 0.0, 500.0, 3).into_radiance();
    let tiny = RadianceImage::new(1, 1, vec![[0.3; 3]]);
    for photo in crops.into_iter().chain([grey, noise, tiny, RadianceImage::new(5, 400, vec![[1.0; 3]; 2000])]) {
        let found = find_ball(&photo, BallLens::Orthographic).unwrap();
        println!("{} × {}: {found:?}", photo.width(), photo.height());
        assert!(found.is_none_or(|found| found.confidence < BallDetection::MIN_CONFIDENCE), "{found:?}");
    }
    assert!(matches!(find_ball(&lebombo(), BallLens::Focal { focal_px: 0.0 }), Err(BallError::Lens { .. })));
}

#[test]
fn a_noisy_bracket_gives_exposures_and_range() {
    let map = lebombo();
    let light = PINHOLE.render(&map_radiance(&map), &|ray, _| map_radiance(&map)(ray), 2);
    let stops = [0.0, -2.5, -5.0, 1.5];
    let photos: Vec<Photo> =
        stops.iter().enumerate().map(|(i, &stop)| expose(&light, stop, 4000.0, i as u32)).collect();
    let estimated = estimate_stops(&photos).unwrap();
    for (got, expected) in estimated.iter().zip(stops) {
        let ratio = (got - f64::from(expected)).exp2();
        assert!((ratio - 1.0).abs() < 0.02, "{estimated:?}");
    }
    let merged = merge_exposures(&photos, &estimated).unwrap();
    let view = BallView::new(outline(&PINHOLE), lens(&PINHOLE), PINHOLE.size).unwrap();
    let got =
        unwrap_ball(&merged, &view, &UnwrapOptions { size: Some([256, 128]), ..UnwrapOptions::default() }).unwrap();
    let psnr = psnr_db(&got.radiance, &map, 60.0);
    assert!(psnr > 30.0, "{psnr:.1} dB");
    // the window's radiance of 20 times white is recovered
    let brightest = |map: &RadianceImage| {
        let small = resize_equirectangular(map, 64, 32);
        small.pixels().iter().map(|rgb| rgb[1]).fold(0.0, f32::max)
    };
    assert!((brightest(&got.radiance) / brightest(&map) - 1.0).abs() < 0.1);
    assert!(got.clipped_share < 0.001, "{}", got.clipped_share);
}

#[test]
fn invalid_circles_and_sizes_never_panic() {
    let photo = merged(&RadianceImage::from_fn(40, 30, |x, y| [(x + y) as f32; 3]));
    let circles = [-5.0, 0.0, 3.9, 4.0, 12.5, 29.9, 40.0, 1e7, f64::NAN];
    for (x, y, radius_px) in circles.iter().flat_map(|&x| circles.iter().flat_map(move |&y| circles.map(|r| (x, y, r))))
    {
        for lens in [BallLens::Orthographic, BallLens::Focal { focal_px: 20.0 }, BallLens::Distance { radii: 1.01 }] {
            let Ok(view) = BallView::new(BallCircle { x, y, radius_px }, lens, [40, 30]) else { continue };
            for size in [None, Some([2, 1]), Some([30, 15]), Some([0, 0]), Some([10, 10])] {
                let options = UnwrapOptions { size, cut_out_camera_rad: 1.5, ..UnwrapOptions::default() };
                if let Ok(got) = unwrap_ball(&photo, &view, &options) {
                    assert!(got.radiance.pixels().iter().flatten().all(|v| v.is_finite()), "{view:?} {size:?}");
                }
            }
        }
    }
}

/// Prints confidence and accuracy with and without a ball: the basis of [`BallDetection::MIN_CONFIDENCE`].
///
/// No photo without a ball may reach that confidence, and every ball that reaches it must be right.
#[test]
#[ignore = "surveys data beside the checkout: cargo test -p lo_mirror_ball --test it survey -- --ignored --nocapture"]
fn survey() {
    let Some(folder) = lo_testdata::shared_data("hdr", "finding the ball in other rooms") else { return };
    let mut panoramas: Vec<_> = folder.read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
    panoramas.retain(|path| path.extension().is_some_and(|end| end == "hdr" || end == "exr"));
    panoramas.sort();
    let is_confident = |found: &BallDetection| found.confidence >= BallDetection::MIN_CONFIDENCE;
    let mut confident = 0;
    for (index, path) in panoramas.iter().enumerate() {
        let map = read_radiance(path).unwrap();
        let mut all: Vec<f32> = map.pixels().iter().map(|rgb| rgb[1]).collect();
        let middle = all.len() / 2;
        let gain = 0.2 / all.select_nth_unstable_by(middle, f32::total_cmp).1.max(1e-4);
        let map = map.map(|rgb| rgb.map(|v| v * gain));
        let radius_px = 60.0 + 13.0 * index as f64;
        let scene = BallScene { middle: [300.0 + 3.3 * index as f64, 250.0], radius_px, ..PINHOLE };
        let light = scene.render(&map_radiance(&map), &|ray, _| map_radiance(&map)(ray), 2);
        let noisy = expose(&light, 0.0, 2000.0, index as u32).into_radiance();
        let found = find_ball(&noisy, lens(&scene)).unwrap();
        let truth = outline(&scene);
        let off = found.map(|found| {
            let got = found.view.circle();
            (got.x - truth.x).abs().max((got.y - truth.y).abs()).max((got.radius_px - truth.radius_px).abs())
        });
        let camera = lo_geometry::Camera::from_hfov_deg(70.0, 640, 480).unwrap();
        let turn = lo_imaging::view_rotation(0.7 * index as f32, 0.0, 0.0);
        let bare = lo_imaging::perspective_from_equirectangular(&map, &camera, turn);
        let bare = expose(&bare, 0.0, 2000.0, index as u32).into_radiance();
        let none = find_ball(&bare, BallLens::Orthographic).unwrap();
        println!(
            "{index:2} radius {radius_px:5.1}: off by {off:.2?} px, confidence {:.2?}; without a ball {:.2?} {:.0?}  {}",
            found.map(|found| found.confidence),
            none.map(|found| found.confidence),
            none.map(|found| found.view.circle().radius_px),
            path.file_name().unwrap().display()
        );
        assert!(!none.is_some_and(|found| is_confident(&found)), "{}", path.display());
        if found.is_some_and(|found| is_confident(&found)) {
            assert!(off.is_some_and(|off| off < 1.0), "{}: {off:?}", path.display());
            confident += 1;
        }
    }
    assert!(confident >= 3, "{confident} of {} balls are found", panoramas.len());
    for folder in ["photos_more", "rgbd", "rgbd_more"] {
        let Some(folder) = lo_testdata::shared_data(folder, "photos without a ball") else { return };
        let mut photos: Vec<_> = folder.read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
        photos.retain(|path| {
            path.extension().is_some_and(|end| end == "jpg") || path.display().to_string().ends_with("color.png")
        });
        photos.sort();
        for path in photos {
            let photo = read_radiance(&path).unwrap();
            let width = photo.width().min(1000);
            let photo = resize(&photo, width, photo.height() * width / photo.width());
            let none = find_ball(&photo, BallLens::Orthographic).unwrap();
            println!("without a ball {:.2?}  {}", none.map(|f| f.confidence), path.file_name().unwrap().display());
            assert!(!none.is_some_and(|found| is_confident(&found)), "{}", path.display());
        }
    }
}
