//! Several photos of one room.

use lo_cone::Cone;
use lo_geometry::{Plane, Quat, Ray, RigidTransform, Vec3};
use lo_scene::PosedFrame;

use super::*;
use crate::Exposures;

/// A photo of a corner from this pose, with linear values scaled by `gain`.
///
/// One wall is 2 m ahead of the first camera, another 2 m to its left.
fn corner(first_from_camera: RigidTransform, gain: f32) -> PosedFrame {
    let planes = [(Vec3::Z, -2.0), (Vec3::X, -2.0), (Vec3::Y, -1.2), (Vec3::NEG_Y, -1.2), (Vec3::NEG_X, -3.0)];
    let hit = |x: usize, y: usize| {
        let local = camera().direction(x as f64 + 0.5, y as f64 + 0.5);
        let ray = Ray { origin: first_from_camera.translation_m, direction: first_from_camera.direction(local) };
        let hits = planes.iter().filter_map(|&(normal, offset_m)| Plane { normal, offset_m }.intersect(&ray));
        let distance_m = hits.fold(f32::INFINITY, f32::min);
        (ray.at(distance_m), -distance_m * local.z)
    };
    let photo = Photo::Linear(Image::from_fn(SIZE.0, SIZE.1, |x, y| corner_light(hit(x, y).0).map(|c| gain * c)));
    let depth_m = DepthMap::from_fn(SIZE.0, SIZE.1, |x, y| hit(x, y).1);
    PosedFrame { frame: Frame::new(photo, depth_m, camera(), 1.0).unwrap(), first_from_camera }
}

/// Radiance of the corner's surfaces: three bands by height.
fn corner_light(point: Vec3) -> [f32; 3] {
    match point.y {
        y if y < -0.4 => [0.1, 0.12, 0.14],
        y if y < 0.4 => [0.3, 0.2, 0.2],
        _ => [0.2, 0.25, 0.2],
    }
}

fn turned(yaw_deg: f32) -> RigidTransform {
    RigidTransform {
        rotation: Quat::from_rotation_y(yaw_deg.to_radians()),
        translation_m: Vec3::new(0.1, 0.05, -0.1) * (yaw_deg / 90.0),
    }
}

fn several(
    photos: Vec<PosedFrame>,
    how: Completion,
    estimator: &Estimator,
) -> (Result<Estimate, EstimateError>, Vec<Event>) {
    let mut events = Vec::new();
    let hear = &mut |event| {
        events.push(event);
        ControlFlow::Continue(())
    };
    let options = EstimateOptions { completion: Some(how), ..EstimateOptions::default() };
    let scene = estimator.estimate(Input::Photos { photos, exposures: Exposures::Matched }, &options, hear);
    (scene, events)
}

#[test]
fn one_posed_photo_equals_one_photo() {
    let estimator = estimator(&config(), &[("light_net.regression.3.output.weights", &[8, 9], 0.1)]);
    let mut frame = wall();
    // Holes and a flying pixel take separate code paths.
    (20..30).for_each(|x| frame.depth_m[(x, 20)] = 0.0);
    frame.depth_m[(60, 40)] = 1.2;
    for how in [Completion::Network, Completion::Shell, Completion::None] {
        let options = EstimateOptions { completion: Some(how), ..EstimateOptions::default() };
        let one = estimator.estimate(Input::MeasuredDepth(frame.clone()), &options, &mut lo_events::ignore).unwrap();
        // The pose of a single camera has no influence.
        let photo = PosedFrame { frame: frame.clone(), first_from_camera: turned(40.0) };
        assert!(several(vec![photo], how, &estimator).0.unwrap() == one, "{how:?}");
    }
    assert!(matches!(several(Vec::new(), Completion::None, &estimator).0, Err(EstimateError::NoPhotos)));
}

#[test]
fn all_photos_contribute_with_matched_exposures() {
    let estimator = estimator(&config(), &[]);
    // The second is turned by 50° and overlaps both others.
    let gains = [1.0, 0.5, 1.5];
    let photos =
        || [0.0, 50.0, 100.0].into_iter().zip(gains).map(|(yaw, gain)| corner(turned(yaw), gain)).collect::<Vec<_>>();
    for how in [Completion::Network, Completion::Shell, Completion::None] {
        let (scene, events) = several(photos(), how, &estimator);
        let scene = scene.unwrap();
        assert_eq!(scene.frame, photos()[0].frame);
        for (other, gain) in scene.other_photos.iter().zip(&gains[1..]) {
            // 3 %: the bands' edges fall into different pixels of the two photos.
            assert!((other.exposure * gain - 1.0).abs() < 0.03, "{how:?} {other:?}");
        }
        let figures = events.iter().find_map(|event| match event {
            Event::Figures { stage, figures } if *stage == stages::PHOTOS => {
                Some(figures.iter().map(|f| f.value).collect::<Vec<f64>>())
            }
            _ => None,
        });
        let figures = figures.unwrap();
        assert!((figures[1] + 1.0).abs() < 0.05 && (figures[2] - 0.585).abs() < 0.05, "{figures:?}");
        assert!(!events.iter().any(|event| matches!(
            event.warning(),
            Some(EstimateWarning::AssumedExposures { .. } | EstimateWarning::PosesDisagree { .. })
        )));
        let tracer = ConeTracer::new(&scene.light, lo_cone::Settings::default()).unwrap();
        for photo in photos() {
            let PosedFrame { frame, first_from_camera: pose } = photo;
            for (x, y) in [(20, 32), (48, 30), (70, 34), (40, 8), (52, 58)] {
                let direction = pose.direction(camera().direction(x as f64 + 0.5, y as f64 + 0.5));
                let cone = Cone { origin: pose.translation_m, direction, tan_half_angle: 0.005 };
                let sample = tracer.trace(&cone);
                let point = pose.point(frame.point(x, y).unwrap());
                if [-0.4f32, 0.4].iter().any(|edge| (point.y - edge).abs() < 0.15) {
                    continue; // leaves at the edges mix two bands
                }
                let close = sample.radiance.iter().zip(corner_light(point)).all(|(a, b)| (a / b - 1.0).abs() < 0.08);
                assert!(close, "{how:?} {x}, {y}: {:?} {point}", sample.radiance);
                let distance_m = (point - pose.translation_m).length();
                assert!((sample.distance_m / distance_m - 1.0).abs() < 0.12, "{} {distance_m}", sample.distance_m);
            }
        }
        assert_eq!(
            SceneFile::from_bytes(&SceneFile::from(scene.clone()).to_bytes("tests").unwrap()).unwrap(),
            SceneFile::from(scene)
        );
    }
}

#[test]
fn photos_without_overlap_are_matched_by_brightness_with_a_warning() {
    let photos = vec![corner(turned(0.0), 1.0), corner(turned(150.0), 0.25)];
    let (scene, events) = several(photos, Completion::None, &Estimator::without_networks());
    let exposure = scene.unwrap().other_photos[0].exposure;
    assert!(exposure > 1.0 && exposure < 5.0, "{exposure}");
    let assumed = EstimateWarning::AssumedExposures { photos: vec![1] };
    assert!(events.iter().any(|event| event.warning() == Some(&assumed)), "{events:?}");
}

#[test]
fn poses_that_contradict_depth_are_refused() {
    let mut second = corner(turned(60.0), 1.0);
    second.first_from_camera = RigidTransform { translation_m: Vec3::new(0.0, 0.0, 1.5), ..turned(0.0) };
    let photos = vec![corner(turned(0.0), 1.0), second];
    let (scene, _) = several(photos, Completion::None, &Estimator::without_networks());
    assert!(matches!(scene, Err(EstimateError::PosesDisagree { photos: [0, 1], .. })), "{:?}", scene.err());
}
