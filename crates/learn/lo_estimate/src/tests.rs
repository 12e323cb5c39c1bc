//! `Estimator::estimate`, with untrained networks and without networks.
#![allow(clippy::unwrap_used)]

mod given_input;
mod photos;
#[cfg(feature = "weights")]
mod real_depth;

use std::ops::ControlFlow;
use std::sync::Arc;

use lo_cone::ConeTracer;
use lo_events::{Cancelled, Event};
use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, FocalLength, Image, Photo, PhotoFile};
use lo_nets::checkpoint::Checkpoint;
use lo_nets::depth::EncoderKind;
use lo_nets::light::{LightNetConfig, NetworkWarning};
use lo_nets::{Device, Networks};
use lo_scene::{CameraSource, Completion, Estimate, Frame, LitScene, SceneFile};

use lo_completion::{CompletionWarning, LampFit};

use crate::{EstimateError, EstimateOptions, EstimateWarning, Estimator, Input, plausible_light, stages};

/// A wall two metres away, grey, 96 × 64 pixels.
fn grey_wall() -> Frame {
    let photo = Photo::Srgb8(Image::new(96, 64, vec![[128; 3]; 96 * 64]));
    let depth_m = DepthMap::new(96, 64, vec![2.0; 96 * 64]);
    Frame::new(photo, depth_m, Camera::from_hfov_deg(65.0, 96, 64).unwrap(), 1.0).unwrap()
}

#[test]
fn without_completion_only_observed_leaves_exist() {
    let options = EstimateOptions { completion: Some(Completion::None), ..EstimateOptions::default() };
    let scene = Estimator::without_networks()
        .estimate(Input::MeasuredDepth(grey_wall()), &options, &mut lo_events::ignore)
        .unwrap();
    // sRGB 128/255 is 0.2158605 in linear light, by IEC 61966-2-1.
    for rgba in scene.light.rgba.last().unwrap() {
        assert!((rgba[0] - 0.215_860_5).abs() < 1e-6, "{rgba:?}");
    }
    assert!(scene.light.seen.last().unwrap().iter().all(|&share| share == 255));
    let edge_m = scene.light.cube.node_edge_m(7);
    let level = &scene.light.octree.levels()[7];
    for key in level.row_keys() {
        let z = scene.light.cube.origin_m.z + lo_octree::xyz_from_key(key)[2] as f32 * edge_m;
        assert!((-2.0 - edge_m..=-2.0 + edge_m).contains(&z), "a leaf at {z} m");
    }
}

#[test]
fn the_shell_adds_inferred_leaves_and_warns() {
    let mut events = Vec::new();
    let hear = &mut |event| {
        events.push(event);
        ControlFlow::Continue(())
    };
    let scene = Estimator::without_networks()
        .estimate(Input::MeasuredDepth(grey_wall()), &EstimateOptions::default(), hear)
        .unwrap();
    assert!(scene.light.seen.last().unwrap().contains(&0));
    assert_eq!(scene.room.as_ref().unwrap().planes.len(), 6);
    let stages = events.iter().filter(|event| matches!(event, Event::Done { .. })).count();
    assert_eq!(stages, 3);
    // One of four walls is observed, and neither floor nor ceiling.
    let planes = CompletionWarning::AssumedPlanes { floor: true, ceiling: true, walls: 3 };
    assert!(events.iter().any(|event| event.warning() == Some(&planes)), "{events:?}");
}

#[test]
fn missing_networks_and_invalid_depths_are_errors() {
    let network = EstimateOptions { completion: Some(Completion::Network), ..EstimateOptions::default() };
    let error = |input: Input, options: &EstimateOptions| {
        Estimator::without_networks().estimate(input, options, &mut lo_events::ignore).unwrap_err()
    };
    assert!(matches!(
        error(Input::MeasuredDepth(grey_wall()), &network),
        EstimateError::NoNetworks("completion by a network")
    ));
    let Frame { photo, camera, .. } = grey_wall();
    let alone = error(Input::Photo { photo, camera }, &EstimateOptions::default());
    assert!(matches!(alone, EstimateError::NoNetworks("a photo without depth")));
    let deep = EstimateOptions { octree_depth: Some(40), ..EstimateOptions::default() };
    assert!(matches!(error(Input::MeasuredDepth(grey_wall()), &deep), EstimateError::Octree(_)));
}

const SIZE: (usize, usize) = (96, 64);

fn config() -> LightNetConfig {
    let small = LightNetConfig { depth: 6, full_depth: 3, channels: 8, max_channels: 16, ..Default::default() };
    LightNetConfig { blocks: 1, bottleneck: 2, head_channels: 8, global_features: 6, global_channels: 2, ..small }
}

/// Untrained networks, with the given tensors replaced by constants.
fn estimator(config: &LightNetConfig, constants: &[(&str, &[usize], f32)]) -> Estimator {
    let mut checkpoint = Checkpoint::default();
    let mut networks = Networks::new(EncoderKind::default(), config, 5, &Device::flex()).unwrap();
    // Untrained, it predicts cameras upside down.
    networks.depth.perspective = None;
    networks.add_to(&mut checkpoint);
    for (name, shape, value) in constants {
        checkpoint.insert(name, shape, vec![*value; shape.iter().product()]);
    }
    Estimator::new(Networks::from_checkpoint(checkpoint, &Device::flex()).unwrap())
}

/// A wall two metres away: dark on the left, bright on the right, with a clipped square in the middle.
fn photo() -> Photo {
    let clipped = |x: usize, y: usize| (40..56).contains(&x) && (24..40).contains(&y);
    Photo::Srgb8(Image::from_fn(SIZE.0, SIZE.1, |x, y| match x {
        _ if clipped(x, y) => [255; 3],
        0..48 => [60, 50, 40],
        _ => [128, 140, 150],
    }))
}

fn camera() -> Camera {
    Camera::from_hfov_deg(65.0, SIZE.0 as u32, SIZE.1 as u32).unwrap()
}

fn wall() -> Frame {
    Frame::new(photo(), DepthMap::new(SIZE.0, SIZE.1, vec![2.0; SIZE.0 * SIZE.1]), camera(), 1.0).unwrap()
}

fn alone() -> Input {
    Input::Photo { photo: photo(), camera: camera() }
}

fn options() -> EstimateOptions {
    EstimateOptions { completion: Some(Completion::Network), ..EstimateOptions::default() }
}

fn estimated(frame: Frame, estimator: &Estimator) -> (Estimate, Vec<Event>) {
    let mut events = Vec::new();
    let hear = &mut |event| {
        events.push(event);
        ControlFlow::Continue(())
    };
    (estimator.estimate(Input::MeasuredDepth(frame), &options(), hear).unwrap(), events)
}

/// Estimates with the room closed by planes.
fn closed(input: Input, estimator: &Estimator) -> Estimate {
    let options = EstimateOptions { completion: Some(Completion::Shell), ..EstimateOptions::default() };
    estimator.estimate(input, &options, &mut lo_events::ignore).unwrap()
}

/// Asserts that at these pixels the octree, from the camera, has the wall's radiance and distance.
fn assert_seen(scene: &Estimate, pixels: &[(usize, usize)]) {
    let view = ConeTracer::new(&scene.light, lo_cone::Settings::default()).unwrap().perspective(&camera());
    let (wall, radiance) = (wall(), scene.frame.radiance());
    for &(x, y) in pixels {
        let (got, expected) = (view.radiance[(x, y)], radiance[(x, y)]);
        assert!(got.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 2e-3), "{x}, {y}: {got:?} {expected:?}");
        assert!((view.distance_m[(x, y)] / wall.point(x, y).unwrap().length() - 1.0).abs() < 0.1);
    }
}

#[test]
fn observed_radiance_is_kept() {
    // These weights would change all radiance.
    let (scene, events) =
        estimated(wall(), &estimator(&config(), &[("light_net.regression.3.output.weights", &[8, 9], 0.5)]));
    let frame = &scene.frame;
    assert_eq!((&frame.photo, scene.origin.completion, scene.light.octree.depth()), (&photo(), Completion::Network, 7));
    // A leaf of 6 cm covers four pixels.
    assert_seen(&scene, &[(10, 10), (20, 50), (30, 20), (70, 12), (85, 55)]);
    let (seen, confidence) = (scene.light.seen.last().unwrap(), scene.confidence.as_ref().unwrap());
    assert!(seen.contains(&255) && seen.contains(&0), "seen, and clipped");
    assert!(!scene.origin.predicted_depth && confidence.iter().map(Vec::len).eq(scene.light.rgba.iter().map(Vec::len)));
    let stages = events.iter().filter(|event| matches!(event, Event::Done { .. })).count();
    assert_eq!(stages, 3);
    assert!((scene.room.as_ref().unwrap().up.y - 1.0).abs() < 0.1);
    assert_eq!(
        SceneFile::from_bytes(&SceneFile::from(scene.clone()).to_bytes("tests").unwrap()).unwrap(),
        SceneFile::from(scene)
    );
}

#[test]
fn a_window_without_depth_readings_lies_in_the_wall() {
    let window = |x: usize, y: usize| (60..88).contains(&x) && (10..54).contains(&y);
    let depth_m = DepthMap::from_fn(SIZE.0, SIZE.1, |x, y| if window(x, y) { 0.0 } else { 2.0 });
    let frame = Frame::new(photo(), depth_m, camera(), 1.0).unwrap();
    let (scene, events) = estimated(frame, &estimator(&config(), &[]));
    assert_seen(&scene, &[(10, 10), (64, 14), (74, 32), (84, 50)]);
    // The window's share of the photo.
    let filled = events.iter().find_map(|event| match event.warning()? {
        CompletionWarning::FilledDepth { filled, pixels } => Some(*filled as f32 / *pixels as f32),
        _ => None,
    });
    let window = (28.0 * 44.0) / (SIZE.0 * SIZE.1) as f32;
    assert!((filled.unwrap() - window).abs() < 0.005, "{filled:?} {window}");
}

#[test]
fn plausible_light_is_fitted_to_observed_shading() {
    // These weights make inferred light dark, in the light network and in the global panorama.
    let constants: [(&str, &[usize], f32); 2] =
        [("light_net.regression.3.output.bias", &[1, 9], -4.0), ("depth_net.panorama.output.bias", &[3], -9.0)];
    let dark = estimator(&config(), &constants);
    let (before, _) = estimated(wall(), &dark);
    let (scene, report) = plausible_light(&Arc::new(before.clone()));
    assert!(report.fit.surfaces > 1.5 && scene.light != before.light, "{report:?}");
    let darker = |(a, b): (&[f32; 4], &[f32; 4])| (0..3).any(|c| a[c] < b[c]) || a[3] != b[3];
    assert!(!scene.light.rgba.iter().flatten().zip(before.light.rgba.iter().flatten()).any(darker));
    let shell = closed(Input::MeasuredDepth(wall()), &dark);
    let (lit, report) = plausible_light(&Arc::new(shell.clone()));
    assert_eq!((report.fit, lit), (LampFit::default(), LitScene::as_estimated(shell)));
}

#[test]
fn the_same_photo_gives_the_same_bytes_on_any_number_of_threads() {
    // Untrained heads ignore their input; this one does not.
    let estimator = estimator(&config(), &[("light_net.regression.3.output.weights", &[8, 9], 0.1)]);
    let run = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let options = EstimateOptions { seed, ..options() };
        let bytes = |input| {
            let estimate = estimator.estimate(input, &options, &mut lo_events::ignore).unwrap();
            SceneFile::from(estimate).to_bytes("tests").unwrap()
        };
        pool.install(|| [bytes(Input::MeasuredDepth(wall())), bytes(alone())])
    };
    let first = run(2, 1);
    assert!(first == run(2, 1) && first == run(1, 1) && first == run(3, 1));
    assert!(first[0] != run(2, 2)[0]);
}

#[test]
fn a_photo_alone_gets_its_depth() {
    let mut events = Vec::new();
    let estimator = estimator(&config(), &[]);
    let hear = &mut |event| {
        events.push(event);
        ControlFlow::Continue(())
    };
    let scene = estimator.estimate(alone(), &options(), hear).unwrap();
    let depth_m = &scene.frame.depth_m;
    assert_eq!((depth_m.width(), depth_m.height()), SIZE);
    assert!(scene.origin.predicted_depth && scene.confidence.is_some());
    // Completion by planes works with predicted depth.
    let shell = closed(alone(), &estimator);
    assert_eq!(
        (&shell.frame, shell.origin.completion, shell.origin.predicted_depth),
        (&scene.frame, Completion::Shell, true)
    );
    assert_eq!((shell.light.octree.depth(), shell.confidence), (7, None));
    assert!(events.iter().any(is_predicted_depth));
    // The estimate favours typical camera poses.
    let up = scene.room.as_ref().unwrap().up;
    assert!(up.y > 0.7 && up.x.abs() < 0.12, "{up}");
}

#[test]
fn the_networks_predict_the_camera_without_exif() {
    let networks = Networks::new(EncoderKind::EfficientNetLite0, &config(), 5, &Device::flex()).unwrap();
    let estimator = Estimator::new(networks);
    let file = |focal| PhotoFile { focal, ..PhotoFile::new(photo()) };
    let (lens, source) = estimator.camera_of(&file(FocalLength::default())).unwrap();
    let srgb8 = lo_scene::working_photo(&photo()).srgb8();
    let predicted = estimator.networks().unwrap().perspective(&srgb8, None).unwrap();
    assert!((lens.half_extent() / predicted.camera.half_extent - 1.0).abs() < 1e-9);
    assert_eq!(source, CameraSource::Network { deviation_deg: predicted.fov_deviation_deg as f32 });
    let film = FocalLength { equivalent_35mm: Some(28.0), ..FocalLength::default() };
    assert_eq!(estimator.camera_of(&file(film)).unwrap().1, CameraSource::Exif);

    let up_of = |scene: &Estimate| scene.room.as_ref().unwrap().up;
    let closed = |up| {
        let options = EstimateOptions { completion: Some(Completion::Shell), up, ..options() };
        estimator.estimate(alone(), &options, &mut lo_events::ignore).unwrap()
    };
    let perspective = estimator.networks().unwrap().perspective(&srgb8, Some(camera().half_extent())).unwrap();
    let scene = closed(None);
    assert!(up_of(&scene).angle_between(perspective.camera.up) < 1e-3, "{} {}", up_of(&scene), perspective.camera.up);
    assert_eq!(scene.origin.up_deviation_deg, Some(perspective.up_deviation_deg as f32));
    let level = closed(Some(Vec3::Y));
    assert_eq!((up_of(&level), level.origin.up_deviation_deg), (Vec3::Y, None));
    // With measured depth, surfaces determine up.
    let measured = Input::MeasuredDepth(grey_wall());
    assert_eq!(estimator.estimate(measured, &options(), &mut lo_events::ignore).unwrap().origin.up_deviation_deg, None);
}

#[test]
fn octrees_stay_within_the_node_budget_with_a_warning() {
    let config = LightNetConfig { max_nodes: Some(2000), ..config() };
    let split = |stage| format!("light_net.prediction.{stage}.output.bias");
    let names: Vec<String> = (0..4).map(split).collect();
    let all: Vec<(&str, &[usize], f32)> = names.iter().map(|name| (&name[..], &[1, 1][..], 5.0)).collect();
    let (scene, events) = estimated(wall(), &estimator(&config, &all));
    assert!(scene.light.octree.levels()[6].len() < 2000 * 8);
    let over = |event: &Event| matches!(event.warning(), Some(NetworkWarning::NodeBudget { .. }));
    assert!(events.iter().any(over), "{events:?}");
}

#[test]
fn damaged_networks_and_invalid_depths_are_errors() {
    let error = |input: Input, estimator: &Estimator, options: &EstimateOptions| {
        estimator.estimate(input, options, &mut lo_events::ignore).unwrap_err()
    };
    let light = estimator(&config(), &[("light_net.global.weights", &[6, 2], f32::NAN)]);
    let light = error(Input::MeasuredDepth(wall()), &light, &options());
    assert!(matches!(light, EstimateError::Light(_)) && light.to_string().contains("NaN or infinite"), "{light}");
    let depth = estimator(&config(), &[("depth_net.decoder.output.bias", &[1], f32::NAN)]);
    let depth = error(alone(), &depth, &options());
    assert!(matches!(depth, EstimateError::NonFiniteDepth), "{depth}");
    let shallow = EstimateOptions { octree_depth: Some(5), ..options() };
    let shallow = error(Input::MeasuredDepth(wall()), &estimator(&config(), &[]), &shallow);
    assert!(matches!(shallow, EstimateError::OctreeDepth { asked: 5, own: 6 }), "{shallow}");
    let deep = EstimateOptions { octree_depth: Some(40), ..options() };
    let deep = error(Input::MeasuredDepth(wall()), &estimator(&config(), &[]), &deep);
    assert!(matches!(deep, EstimateError::Octree(_)), "{deep}");
}

fn is_predicted_depth(event: &Event) -> bool {
    event.warning() == Some(&EstimateWarning::PredictedDepth)
}

#[test]
fn external_predicted_depth_is_treated_like_own_depth() {
    let estimator = estimator(&config(), &[]);
    let own = estimator.estimate(alone(), &options(), &mut lo_events::ignore).unwrap();
    let estimate = |input| {
        let mut warned = false;
        let hear = &mut |event| {
            warned |= is_predicted_depth(&event);
            ControlFlow::Continue(())
        };
        (estimator.estimate(input, &options(), hear).unwrap(), warned)
    };
    // The own network's depth, passed as input, gives a bit-identical estimate.
    let (other, warned) = estimate(Input::PredictedDepth(own.frame.clone().into()));
    assert!(warned && other == own);
    // Measured depth is used without correction.
    let (measured, warned) = estimate(Input::MeasuredDepth(own.frame.clone()));
    assert!(!warned && !measured.origin.predicted_depth);
    // Depth of finer resolution has the same weight in the estimate of up.
    let depth_m = lo_imaging::resize_depth(&own.frame.depth_m, 10 * SIZE.0, 10 * SIZE.1);
    let (fine, _) = estimate(Input::PredictedDepth(Frame { depth_m, ..own.frame.clone() }.into()));
    let up = |scene: &Estimate| scene.room.as_ref().unwrap().up;
    assert!(up(&fine).dot(up(&own)) > 5f32.to_radians().cos(), "{} {}", up(&fine), up(&own));
}

#[test]
fn defaults_are_the_network_where_there_is_one() {
    let default = EstimateOptions::default();
    let with = |estimator: &Estimator| {
        let scene = estimator.estimate(Input::MeasuredDepth(wall()), &default, &mut lo_events::ignore).unwrap();
        scene.origin.completion
    };
    assert_eq!(with(&estimator(&config(), &[])), Completion::Network);
    assert_eq!(with(&Estimator::without_networks()), Completion::Shell);
}

#[test]
fn a_handler_can_cancel_after_every_event() {
    let estimator = estimator(&config(), &[]);
    let mut all = Vec::new();
    let hear = &mut |event| {
        all.push(event);
        ControlFlow::Continue(())
    };
    estimator.estimate(alone(), &options(), hear).unwrap();
    let begun = all.iter().filter_map(|event| if let Event::Begun(stage) = event { Some(stage) } else { None });
    let stages = [stages::WORKING_RESOLUTION, stages::DEPTH_AND_GLOBAL_LIGHT, stages::LIGHT_NETWORK];
    assert!(begun.eq(&stages), "{all:?}");
    for at in 0..all.len() {
        let mut heard = 0;
        let hear = &mut |_| {
            heard += 1;
            if heard > at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let error = estimator.estimate(alone(), &options(), hear).unwrap_err();
        assert!(matches!(error, EstimateError::Cancelled(Cancelled)), "{error}");
        assert_eq!(heard, at + 1, "no more events after that");
    }
}
