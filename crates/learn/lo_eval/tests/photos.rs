//! Three photos of a room, a third of a turn apart, against one: how much nearer the light comes to the truth where the first photo does not look.
#![allow(clippy::unwrap_used, missing_docs, dead_code)]

use lightoctree::cone::Viewers;
use lightoctree::scene::{Frame, PosedFrame, Scene};
use lightoctree::{EstimateOptions, Estimator, Exposures, Input};
use lo_dataset::{Generator, GeneratorConfig, Record, Shot};
use lo_eval::{Estimate, Light, Scorer, Scores};
use lo_geometry::{Quat, RigidTransform, Vec3};
use lo_imaging::{Photo, luminance};
use lo_random::RngExt;

/// Rooms with a photo and two more from about its place, each turned by a third of a turn, give or take, by one phone with automatic exposure and white
/// balance.
pub struct Rooms {
    seed: u64,
    generator: Generator,
}

impl Rooms {
    pub fn new(seed: u64, size: [u32; 2], panorama_height: u32) -> Self {
        let mut config = GeneratorConfig { panoramas: 3, panorama_height, ..GeneratorConfig::default() };
        config.room.crop_size = size;
        config.room.hfov_deg = [65.0, 70.0];
        Self { seed, generator: Generator::new(seed, config).unwrap() }
    }

    pub fn record(&self, index: u64) -> Record {
        let mut stream = lo_random::stream(self.seed, "turns", index);
        let mut within = |most: f32| stream.random_range(-most..most);
        let turns = [120.0f32, -120.0].map(|yaw_deg| {
            let [yaw, pitch, roll] = [yaw_deg + within(8.0), within(6.0), within(2.0)].map(f32::to_radians);
            let tilt = Quat::from_rotation_x(pitch) * Quat::from_rotation_z(roll);
            (Quat::from_rotation_y(yaw), tilt, Vec3::new(within(0.1), within(0.1), within(0.1)))
        });
        let record = self.generator.record_by_one_device(index, |interior, first| {
            let turned = |(yaw, tilt, step): (Quat, Quat, Vec3)| {
                let mut camera = *first;
                camera.pose.rotation = yaw * first.pose.rotation * tilt;
                if interior.is_free(first.pose.position + step, 0.15) {
                    camera.pose.position += step;
                }
                camera
            };
            turns.map(turned).to_vec()
        });
        record.unwrap()
    }
}

/// Whose depth.
#[derive(Clone, Copy)]
pub enum Depth {
    True,
    Sensor,
}

/// The photos with depth and true poses; `exposures` are the frames'.
pub fn photos(record: &Record, depth: Depth, exposures: &[f32]) -> Vec<PosedFrame> {
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

/// What linear values of each photo have to be multiplied by to be in the first one's measure.
pub fn true_exposures(record: &Record) -> Vec<f32> {
    let first = luminance(record.shots[0].gains);
    record.shots.iter().map(|shot| first / luminance(shot.gains)).collect()
}

pub fn scores(record: &Record, scene: Scene) -> Scores {
    let up = scene.room.as_ref().map(|room| room.up);
    let viewers = Viewers::new(&scene.light);
    let light = Light::Octree { octree: Box::new(scene.light), viewers };
    let estimate = Estimate { light, depth_m: Some(scene.frame.depth_m), up };
    let sample = record.sample(0);
    let panoramas = Scorer::panoramas(&sample, &estimate);
    Scorer::new(None).score(&sample, &estimate, &panoramas)
}

/// Of the first photo alone, with true and guessed exposures of all.
const WAYS: [&str; 3] = ["one photo", "three, exposures known", "three, exposures guessed"];

fn compare(estimator: &Estimator, record: &Record, depth: Depth) -> [Scores; 3] {
    let estimate = |input| {
        let scene = estimator.estimate(input, &EstimateOptions::default(), &mut lightoctree::events::ignore).unwrap();
        scores(record, scene)
    };
    let equal = vec![1.0; record.shots.len()];
    let one = photos(record, depth, &equal).swap_remove(0).frame;
    let known = Input::Photos { photos: photos(record, depth, &true_exposures(record)), exposures: Exposures::Known };
    let guessed = Input::Photos { photos: photos(record, depth, &equal), exposures: Exposures::Matched };
    [Input::MeasuredDepth(one), known, guessed].map(estimate)
}

#[test]
#[ignore = "half an hour: cargo test -p lo_eval --test photos three_photos -- --ignored --nocapture; PHOTOS_SEED and PHOTOS_ROOMS choose others than 24 rooms of seed 777"]
fn three_photos_tell_more_than_one() {
    let number = |name: &str, usual: u64| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let (seed, count) = (number("PHOTOS_SEED", 777), number("PHOTOS_ROOMS", 24));
    let rooms = Rooms::new(seed, [480, 320], 64);
    let estimator = Estimator::shipped().unwrap();
    let mut all: [[Vec<Scores>; 3]; 2] = Default::default();
    for index in 0..count {
        let record = rooms.record(index);
        for (depth, sums) in [Depth::True, Depth::Sensor].into_iter().zip(&mut all) {
            let found = compare(&estimator, &record, depth);
            let unseen = found.each_ref().map(|scores| scores.get("unseen_psnr_db").unwrap_or(f64::NAN));
            println!("{} unseen {unseen:.2?} dB", record.key);
            sums.iter_mut().zip(found).for_each(|(sum, scores)| sum.push(scores));
        }
    }
    for (depth, sums) in ["true depth", "sensor's depth"].into_iter().zip(&all) {
        let means = sums.each_ref().map(Scores::mean);
        for (way, mean) in WAYS.into_iter().zip(&means) {
            let of = |name: &str| mean.get(name).unwrap_or(f64::NAN);
            println!(
                "{depth}, {way}: unseen {:.2} dB, seen {:.2} dB, all {:.2} dB, unseen log-RMSE {:.3}, L_SC {:.4}",
                of("unseen_psnr_db"),
                of("seen_psnr_db"),
                of("psnr_db"),
                of("unseen_log_rmse"),
                of("coherence"),
            );
        }
        let gain = |way: usize| means[way].get("unseen_psnr_db").unwrap() - means[0].get("unseen_psnr_db").unwrap();
        assert!(gain(1) > 2.0 && gain(2) > 1.0, "{depth}: {} and {} dB", gain(1), gain(2));
    }
}
