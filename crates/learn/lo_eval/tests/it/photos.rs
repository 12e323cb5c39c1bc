//! Three photos of a room, 120° apart, against one: gain in accuracy of light outside the first photo.

use lo_cone::OctreeRenderer;
use lo_dataset::{Generator, GeneratorConfig, NovelView, Record, Sample, Shot, observed_mask};
use lo_estimate::{EstimateOptions, Estimator, Exposures, Input};
use lo_eval::{EstimatedLight, MethodOutput, Scorer, Scores, Tracer, coherence};
use lo_geometry::{Quat, RigidTransform, Vec3};
use lo_imaging::{Photo, RadianceImage, luminance};
use lo_metrics::{PsnrCurve, log_rmse, psnr_db, solid_angles_sr};
use lo_random::RngExt;
use lo_scene::{Completion, Frame, PosedFrame};

/// Rooms with three photos from about one position, 120° apart.
///
/// One simulated phone takes them with automatic exposure and white balance. Panoramas are in the first photo's view.
struct Rooms {
    seed: u64,
    generator: Generator,
}

impl Rooms {
    fn new(seed: u64, size: [u32; 2], panorama_height: u32) -> Self {
        let mut config = GeneratorConfig { panoramas: 2, panorama_height, ..GeneratorConfig::default() };
        config.room.crop_size = size;
        config.room.hfov_deg = [65.0, 70.0];
        Self { seed, generator: Generator::new(seed, config).unwrap() }
    }

    fn record(&self, index: u64) -> Record {
        let mut stream = lo_random::stream(self.seed, "turns", index);
        let mut within = |most: f32| stream.random_range(-most..most);
        let record = self.generator.record_by_one_device(index, |interior| {
            let mut first = interior.camera_poses(1)[0];
            // Stand where there is free space: the freest of many positions around a good view's.
            let start = first.pose.position;
            let mut position = |_| Vec3::new(start.x + within(6.0), 1.5, start.z + within(6.0));
            let positions: Vec<Vec3> = (0..1000).map(&mut position).collect();
            let freest = |margin: f32| positions.iter().copied().find(|position| interior.is_free(*position, margin));
            first.pose.position = [1.2, 1.0, 0.8, 0.6, 0.5, 0.4, 0.3].into_iter().find_map(freest).unwrap_or(start);
            let turned = |yaw_deg: f32| {
                let [yaw, pitch, roll] = [yaw_deg + within(8.0), within(6.0), within(2.0)].map(f32::to_radians);
                let mut camera = first;
                let tilt = Quat::from_rotation_x(pitch) * Quat::from_rotation_z(roll);
                camera.pose.rotation = Quat::from_rotation_y(yaw) * first.pose.rotation * tilt;
                camera.pose.position += Vec3::new(within(0.1), within(0.1), within(0.1));
                camera
            };
            std::iter::once(first).chain([120.0, -120.0].map(turned)).collect()
        });
        record.unwrap()
    }
}

/// Source of depth.
#[derive(Clone, Copy, Debug)]
enum Depth {
    True,
    Sensor,
}

/// Returns the photos with depth, true poses and the given exposures.
fn photos(record: &Record, depth: Depth, exposures: &[f32]) -> Vec<PosedFrame> {
    let first = &record.shots[0];
    let posed = |(shot, exposure): (&Shot, &f32)| {
        let depth_m = match depth {
            Depth::True => &shot.depth_m,
            Depth::Sensor => &shot.sensor_depth_m,
        };
        let photo = Photo::Srgb8(shot.photo.clone());
        let frame = Frame::new(photo, depth_m.clone().unwrap(), shot.camera, *exposure).unwrap();
        let back = first.rotation.inverse();
        let rotation = (back * shot.rotation).normalize();
        let translation_m = back * (shot.position_m - first.position_m);
        PosedFrame { frame, first_from_camera: RigidTransform { rotation, translation_m } }
    };
    record.shots.iter().zip(exposures).map(posed).collect()
}

/// Returns the factors from linear values of each photo to the first photo's exposure.
fn true_exposures(record: &Record) -> Vec<f32> {
    let first = luminance(record.shots[0].gains);
    record.shots.iter().map(|shot| first / luminance(shot.gains)).collect()
}

/// Scores a scene's light at the panoramas; the seen part is what the first photo shows.
fn scores(record: &Record, scene: lo_scene::Estimate) -> Scores {
    let tracer = Tracer::Octree(OctreeRenderer::new(&scene.light));
    let light = EstimatedLight::Octree { octree: Box::new(scene.light), tracer };
    let estimate = MethodOutput::of_light(light);
    let sample = record.sample(0);
    let panoramas = Scorer::panoramas(&sample, &estimate);
    let of_view = |(view, got)| view_scores(&sample, view, got);
    let views: Vec<Scores> = sample.views.iter().zip(&panoramas).map(of_view).collect();
    let mut scores = Scores::mean(&views);
    scores.add("coherence", coherence(sample.views.iter().zip(&panoramas)));
    scores
}

/// Scores the estimate from the first photo with the truth wherever the other photos look: the upper bound.
fn ceiling(record: &Record, scene: lo_scene::Estimate) -> Scores {
    let tracer = Tracer::Octree(OctreeRenderer::new(&scene.light));
    let light = EstimatedLight::Octree { octree: Box::new(scene.light), tracer };
    let estimate = MethodOutput::of_light(light);
    let sample = record.sample(0);
    let first = &record.shots[0];
    let of_view = |(view, mut known): (&NovelView, RadianceImage)| {
        let mask = |shot: usize| {
            let other = &record.shots[shot];
            let back = other.rotation.inverse();
            let position_m = back * (first.rotation * view.position_m + first.position_m - other.position_m);
            let rotation = back * first.rotation * view.rotation;
            observed_mask(&record.sample(shot), &NovelView { position_m, rotation, ..view.clone() }).unwrap()
        };
        let masks: Vec<Vec<bool>> = (1..record.shots.len()).map(mask).collect();
        for (pixel, truth) in view.radiance.pixels().iter().enumerate() {
            if masks.iter().any(|mask| mask[pixel]) {
                known.pixels_mut()[pixel] = *truth;
            }
        }
        view_scores(&sample, view, &known)
    };
    let panoramas = Scorer::panoramas(&sample, &estimate);
    Scores::mean(&sample.views.iter().zip(panoramas).map(of_view).collect::<Vec<_>>())
}

/// Scores a panorama, and its seen and unseen parts.
fn view_scores(sample: &Sample, view: &NovelView, got: &RadianceImage) -> Scores {
    let angles = solid_angles_sr(got.width(), got.height());
    let seen = observed_mask(sample, view).unwrap();
    let mut scores = Scores::default();
    for (name, part) in [("psnr_db", None), ("seen_psnr_db", Some(true)), ("unseen_psnr_db", Some(false))] {
        let weight = |(&angle, &seen): (&f32, &bool)| if part.is_none_or(|part| part == seen) { angle } else { 0.0 };
        let weights: Vec<f32> = angles.iter().zip(&seen).map(weight).collect();
        scores.add(name, psnr_db(&view.radiance, got, &weights, PsnrCurve::ClippedSrgb));
        if part == Some(false) {
            scores.add("unseen_log_rmse", log_rmse(&view.radiance, got, &weights));
        }
    }
    scores
}

const WAYS: [&str; 4] =
    ["one photo", "three, exposures known", "three, exposures matched", "one, and the truth where the others look"];

/// Scores the light by each of [`WAYS`].
fn compare(estimator: &Estimator, record: &Record, depth: Depth, completion: Option<Completion>) -> [Scores; 4] {
    let options = EstimateOptions { completion, ..EstimateOptions::default() };
    let estimate = |input| estimator.estimate(input, &options, &mut lo_events::ignore).unwrap();
    let equal = vec![1.0; record.shots.len()];
    let one = photos(record, depth, &equal).swap_remove(0).frame;
    let known = Input::Photos { photos: photos(record, depth, &true_exposures(record)), exposures: Exposures::Known };
    let matched = Input::Photos { photos: photos(record, depth, &equal), exposures: Exposures::Matched };
    let one = estimate(Input::MeasuredDepth(one));
    let best = ceiling(record, one.clone());
    let [known, matched] = [known, matched].map(estimate);
    [scores(record, one), scores(record, known), scores(record, matched), best]
}

fn mean(all: &[[Scores; 4]], way: usize, name: &str) -> f64 {
    Scores::mean(all.iter().map(|ways| &ways[way])).get(name).unwrap_or(f64::NAN)
}

#[test]
#[ignore = "four minutes on two quiet cores: cargo test -p lo_eval --test it three_photos -- --ignored --nocapture; PHOTOS_SEED, PHOTOS_FROM, PHOTOS_TO choose other rooms, PHOTOS_DEPTH=true true depth"]
fn three_photos_tell_more_than_one() {
    let number = |name: &str, usual: u64| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let (seed, from, to) = (number("PHOTOS_SEED", 777), number("PHOTOS_FROM", 0), number("PHOTOS_TO", 24));
    let depth =
        if std::env::var("PHOTOS_DEPTH").is_ok_and(|depth| depth == "true") { Depth::True } else { Depth::Sensor };
    let rooms = Rooms::new(seed, [452, 339], 64);
    let estimator = Estimator::shipped().unwrap();
    let mut all: [Vec<[Scores; 4]>; 2] = Default::default();
    for index in from..to {
        let record = rooms.record(index);
        for (completion, all) in [None, Some(Completion::Shell)].into_iter().zip(&mut all) {
            let found = compare(&estimator, &record, depth, completion);
            for (way, scores) in WAYS.iter().zip(&found) {
                let figures: Vec<String> = scores.iter().map(|(name, value)| format!("{name} {value:.4}")).collect();
                println!("{} {depth:?} {completion:?} {way}: {}", record.key, figures.join(" "));
            }
            all.push(found);
        }
    }
    for (completion, all) in ["networks", "shell"].iter().zip(&all) {
        for (way, name) in WAYS.iter().enumerate() {
            let of = |figure: &str| mean(all, way, figure);
            let (unseen, seen, whole) = (of("unseen_psnr_db"), of("seen_psnr_db"), of("psnr_db"));
            let (log_rmse, coherence) = (of("unseen_log_rmse"), of("coherence"));
            println!(
                "{depth:?} depth, {completion}, {name}: unseen {unseen:.2} dB, seen {seen:.2} dB, all {whole:.2} dB, unseen log-RMSE {log_rmse:.4}, L_SC {coherence:.4}"
            );
        }
        if *completion == "networks" {
            // A gain of 2 dB exceeds the upper bound (`ceiling`); require some gain.
            assert!(mean(all, 1, "unseen_psnr_db") > mean(all, 0, "unseen_psnr_db"));
        }
    }
}

/// Quick version: two rooms, small photos, shell completion.
#[test]
fn three_photos_of_two_rooms() {
    let rooms = Rooms::new(4242, [96, 72], 24);
    let estimator = Estimator::without_networks();
    let all: Vec<[Scores; 4]> =
        (1..3).map(|index| compare(&estimator, &rooms.record(index), Depth::Sensor, Some(Completion::Shell))).collect();
    let [one, known, matched, best] = [0, 1, 2, 3].map(|way| mean(&all, way, "unseen_psnr_db"));
    assert!(known > one && best > one, "{one} {known} {matched} {best} dB");
}
