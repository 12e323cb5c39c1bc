//! Photos with black bars, distortion and other projections, and depth that contradicts the photo.

use std::ops::ControlFlow;

use lo_events::Event;
use lo_geometry::{Camera, Distortion, RigidTransform};
use lo_imaging::{BlackBars, DepthMap, Image, Photo, PhotoFile, SpecialProjection};
use lo_scene::{Completion, Frame, PosedFrame, Undistortion};

use crate::{
    DepthSource, EstimateError, EstimateOptions, EstimateWarning, Estimator, Exposures, Input, PhotoRequest,
    ResolvedPhoto,
};

const BARS: BlackBars = BlackBars { left: 8, top: 20, right: 12, bottom: 24 };

/// A textured corner of a room, 96 × 64 pixels.
fn corner() -> Frame {
    let photo =
        Photo::Srgb8(Image::from_fn(96, 64, |x, y| [60 + x as u8, 50 + 2 * y as u8, 90 + ((x * y) % 40) as u8]));
    let depth_m = DepthMap::from_fn(96, 64, |x, y| 3.0 - 0.01 * x as f32 - 0.02 * y.max(32) as f32);
    Frame::new(photo, depth_m, Camera::from_hfov_deg(65.0, 96, 64).unwrap(), 1.0).unwrap()
}

/// The corner with black bars around it. Depth in the bars is that of a program that does not know of them.
fn framed(frame: &Frame) -> Frame {
    let (width, height) = (96 + BARS.left + BARS.right, 64 + BARS.top + BARS.bottom);
    let place = |x: usize, y: usize| {
        let is_inside = (BARS.left..BARS.left + 96).contains(&x) && (BARS.top..BARS.top + 64).contains(&y);
        is_inside.then(|| (x - BARS.left, y - BARS.top))
    };
    let Photo::Srgb8(picture) = &frame.photo else { panic!() };
    let photo = Photo::Srgb8(Image::from_fn(width, height, |x, y| place(x, y).map_or([0; 3], |at| picture[at])));
    let depth_m = DepthMap::from_fn(width, height, |x, y| place(x, y).map_or(9.0, |at| frame.depth_m[at]));
    let Camera { fx, fy, cx, cy, .. } = frame.camera;
    let (cx, cy) = (cx + BARS.left as f64, cy + BARS.top as f64);
    let camera = Camera::new(fx, fy, cx, cy, width as u32, height as u32).unwrap();
    Frame::new(photo, depth_m, camera, 1.0).unwrap()
}

#[test]
fn black_bars_are_no_part_of_the_room() {
    let estimator = Estimator::without_networks();
    let mut bars = Vec::new();
    let mut estimate = |input: Input| {
        let hear = &mut |event: Event| {
            bars.extend(event.warning::<EstimateWarning>().cloned());
            ControlFlow::Continue(())
        };
        estimator.estimate(input, &EstimateOptions::default(), hear).unwrap()
    };
    let (frame, whole) = (corner(), framed(&corner()));
    let plain = estimate(Input::MeasuredDepth(frame.clone()));
    let measured = estimate(Input::MeasuredDepth(whole.clone()));
    let predicted = estimate(Input::PredictedDepth(whole.clone().into()));
    let posed = PosedFrame { frame: whole.clone(), first_from_camera: RigidTransform::IDENTITY };
    let posed = estimate(Input::Photos { photos: vec![posed], exposures: Exposures::Known });
    assert!(measured.light == plain.light && measured.room == plain.room);
    assert!(posed.light == plain.light && posed.room == plain.room);
    for scene in [measured, predicted, posed] {
        // The scene has the whole photo, without depth in its bars.
        assert!(scene.frame.photo == whole.photo && scene.frame.camera == whole.camera);
        let depth_m = &scene.frame.depth_m;
        assert_eq!((depth_m[(BARS.left, BARS.top)], depth_m[(0, 0)]), (frame.depth_m[(0, 0)], 0.0));
        assert_eq!(depth_m.pixels().iter().filter(|&&z| z > 0.0).count(), 96 * 64);
    }
    let expected = EstimateWarning::BlackBars { bars: BARS, photo: None };
    assert_eq!(bars.iter().filter(|&warning| *warning == expected).count(), 2, "{bars:?}");
    let of_photo = EstimateWarning::BlackBars { bars: BARS, photo: Some(0) };
    assert_eq!(bars.iter().filter(|&warning| *warning == of_photo).count(), 1, "{bars:?}");
    assert!(of_photo.to_string().starts_with("black bars around the picture of photo 1 are"), "{of_photo}");
    assert!(expected.to_string().contains("8 pixels at the left, 20 pixels at the top"), "{expected}");
}

fn file(photo: Photo) -> PhotoFile {
    PhotoFile::new(photo)
}

fn request(photo: Photo) -> PhotoRequest {
    PhotoRequest { photo: file(photo), camera: None, distortion: None, depth: DepthSource::Network }
}

#[test]
fn the_lens_of_a_photo_with_bars_is_that_of_its_picture() {
    let (camera, _) = Estimator::without_networks().camera_of(&file(framed(&corner()).photo)).unwrap();
    let expected = framed(&corner()).camera;
    // The default lens of 65° belongs to the picture.
    assert!((camera.fx / expected.fx - 1.0).abs() < 1e-9, "{camera:?}");
    assert_eq!((camera.cx, camera.cy, camera.width, camera.height), (expected.cx, expected.cy, 116, 108));
}

fn resolve(request: PhotoRequest) -> (Result<ResolvedPhoto, EstimateError>, Vec<EstimateWarning>) {
    let mut warnings = Vec::new();
    let hear = &mut |event: Event| {
        warnings.extend(event.warning::<EstimateWarning>().cloned());
        ControlFlow::Continue(())
    };
    (Estimator::without_networks().resolve(request, hear), warnings)
}

#[test]
fn panoramas_and_fisheyes_are_refused_unless_the_lens_is_given() {
    let textured = |x: usize, y: usize| [60 + (x % 97) as u8, 50 + (y % 83) as u8, 90];
    let disc = Photo::Srgb8(Image::from_fn(200, 200, |x, y| {
        let distance = (x as f64 - 99.5).hypot(y as f64 - 99.5);
        if distance < 98.0 { textured(x, y) } else { [0; 3] }
    }));
    let wide = |width: usize| Photo::Srgb8(Image::from_fn(width, 100, textured));
    for (photo, expected) in [(disc, SpecialProjection::Fisheye), (wide(320), SpecialProjection::Panorama)] {
        let (error, _) = resolve(request(photo.clone()));
        assert!(matches!(error, Err(EstimateError::Projection(found)) if found == expected), "{error:?}");
        let (width, height) = (photo.width() as u32, photo.height() as u32);
        let camera = Some(Camera::from_hfov_deg(90.0, width, height).unwrap());
        let (given, warnings) = resolve(PhotoRequest { camera, ..request(photo) });
        assert!(given.is_ok() && warnings.is_empty());
    }
    let (accepted, warnings) = resolve(request(wide(239)));
    assert!(accepted.is_ok());
    assert!(matches!(warnings[..], [EstimateWarning::WidePhoto { aspect }] if (aspect - 2.39).abs() < 1e-9));
    assert!(resolve(request(wide(178))).1.is_empty());
}

#[test]
fn distortion_is_undone_in_photo_and_depth() {
    let Frame { photo, depth_m, camera, .. } = corner();
    let distortion = Distortion::brown(&[-0.2, 0.02]);
    let undistortion = Undistortion::new(camera, distortion).unwrap();
    let depth = DepthSource::Measured(depth_m.clone());
    let (resolved, warnings) =
        resolve(PhotoRequest { camera: Some(camera), distortion: Some(distortion), depth, ..request(photo.clone()) });
    let resolved = resolved.unwrap();
    assert_eq!((resolved.camera, resolved.camera_source), (undistortion.camera, None));
    let Input::MeasuredDepth(frame) = resolved.input else { panic!() };
    assert!(frame.photo == undistortion.photo(&photo) && frame.photo != photo);
    assert!(frame.depth_m == undistortion.depth(&depth_m) && frame.camera == undistortion.camera);
    assert!(matches!(warnings[..], [EstimateWarning::Undistorted { hfov_deg, .. }] if hfov_deg > 65.0), "{warnings:?}");
    let folded = Some(Distortion::brown(&[0.0, 0.0, 40.0, 0.0]));
    let (error, _) = resolve(PhotoRequest { camera: Some(camera), distortion: folded, ..request(photo) });
    assert!(matches!(error, Err(EstimateError::Undistortion(_))), "{error:?}");
}

/// Given depth, of the first photo if there are several, is compared with the network's, whose light and orientation
/// serve the estimate.
#[test]
fn one_pass_of_the_network_compares_depth_and_predicts_light() {
    let estimator = super::estimator(&super::config(), &[]);
    let options = EstimateOptions { completion: Some(Completion::Shell), ..super::options() };
    let stages = |input: Input| {
        let mut begun = Vec::new();
        let hear = &mut |event: Event| {
            if let Event::Begun(stage) = event {
                begun.push(stage);
            }
            ControlFlow::Continue(())
        };
        estimator.estimate(input, &options, hear).unwrap();
        begun
    };
    let posed = PosedFrame { frame: corner(), first_from_camera: RigidTransform::IDENTITY };
    let posed = Input::Photos { photos: vec![posed.clone(), posed], exposures: Exposures::Known };
    for begun in [stages(Input::MeasuredDepth(corner())), stages(posed)] {
        let passes = begun.iter().filter(|&stage| *stage == crate::stages::DEPTH_AND_GLOBAL_LIGHT).count();
        assert_eq!(passes, 1, "{begun:?}");
        assert!(!begun.contains(&crate::stages::GLOBAL_LIGHT), "{begun:?}");
    }
}
