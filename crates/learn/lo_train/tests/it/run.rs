//! Complete runs: all stages on small rooms, stopped and resumed.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use lo_dataset::{CropModel, Generator, GeneratorConfig, Split, write_shard};
use lo_events::{Event, Figure};
use lo_nets::Networks;
use lo_nets::checkpoint::Checkpoint;
use lo_nets::depth::EncoderKind;
use lo_nets::light::LightNetConfig;
use lo_synth::SynthConfig;
use lo_train::{
    CHECKPOINT_FILE, DataConfig, DepthPhase, InitialWeights, LOG_FILE, LightPhase, SHEET_FILE, Schedule, TrainConfig,
    TrainError, TrainRequest, ValidationConfig, WEIGHTS_FILE, stages, train,
};
use tempfile::TempDir;

fn small_rooms(crop_size: [u32; 2], shots: u32) -> GeneratorConfig {
    let room = SynthConfig { crop_size, ..SynthConfig::default() };
    GeneratorConfig { room, shots, panoramas: 1, panorama_height: 16, octree_depth: 5, ..Default::default() }
}

/// Returns a shard of six rooms, one of them for validation, generated once for all tests; a room takes a second or
/// two.
pub fn rooms() -> PathBuf {
    static ROOMS: OnceLock<PathBuf> = OnceLock::new();
    let make = || {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("rooms");
        std::fs::create_dir_all(&folder).unwrap();
        let generator = Generator::new(5, small_rooms([64, 48], 1)).unwrap();
        let id = |room| generator.scene_id(room);
        let of = |split| (0..).filter(move |&room| Split::of(&id(room)) == split).take(5);
        let rooms = of(Split::Train).chain(of(Split::Validation).take(1));
        write_shard(&folder.join("rooms.tar"), rooms.map(|room| generator.record(room)), "tests").unwrap();
        folder
    };
    ROOMS.get_or_init(make).clone()
}

/// Configures three stages of a few steps each, the light network at two depths.
pub fn config() -> TrainConfig {
    let network =
        LightNetConfig { depth: 5, full_depth: 3, channels: 8, max_channels: 16, blocks: 1, ..Default::default() };
    let light = |defaults: LightPhase, octree_depth| LightPhase {
        schedule: Schedule { steps: 2, ..defaults.schedule },
        octree_depth,
        novel_rays: 300,
        visible_rays: 100,
        ..defaults
    };
    let depth =
        |steps| DepthPhase { schedule: Schedule { steps, ..DepthPhase::DEFAULT.schedule }, ..DepthPhase::DEFAULT };
    TrainConfig {
        log_steps: 2,
        encoder: EncoderKind::EfficientNetLite0,
        network: LightNetConfig { bottleneck: 2, head_channels: 8, global_features: 8, ..network },
        data: DataConfig { folder: Some(rooms()), ..DataConfig::default() },
        validation: ValidationConfig { every_steps: 100, photos: 1, sheet_rows: 1 },
        depth: vec![
            DepthPhase { batch_size: 3, photo_width: 32, ..depth(1) },
            DepthPhase { batch_size: 1, frozen_statistics: true, ..depth(1) },
        ],
        light: vec![
            light(LightPhase::DEFAULT, 4),
            LightPhase { scheduled_sampling: [0.0, 1.0], predicted_share: 1.0, ..light(LightPhase::DEFAULT, 5) },
        ],
        joint: vec![light(LightPhase::DEFAULT_JOINT, 5)],
        ..TrainConfig::default()
    }
}

/// Runs to the end or for `steps` steps. Returns whether the run was cancelled, and its events.
fn run(config: &TrainConfig, folder: &Path, resume: bool, steps: u64) -> (bool, Vec<Event>) {
    let mut made = 0;
    let mut events = Vec::new();
    // A resumed run keeps its own seed.
    let seed = if resume { 6 } else { 5 };
    let request = TrainRequest { folder, resume, seed, start: InitialWeights::Random };
    let phases = config.phase_stages();
    let result = train(config, &request, &mut |event| {
        made += u64::from(matches!(&event, Event::Figures { stage, .. } if phases.contains(stage)));
        events.push(event);
        if made >= steps { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    let cancelled = matches!(result, Err(TrainError::Cancelled(_)));
    if !cancelled {
        result.unwrap();
    }
    (cancelled, events)
}

/// Cancels a run before its first step.
fn at_once(_: Event) -> ControlFlow<()> {
    ControlFlow::Break(())
}

fn checkpoint(folder: &Path) -> Checkpoint {
    let mut checkpoint = Checkpoint::read(folder.join(CHECKPOINT_FILE)).unwrap();
    // Log lines contain timings, so their lengths vary.
    checkpoint.state["training"]["log_bytes"].take();
    checkpoint
}

#[test]
fn a_run_goes_on_as_if_it_had_not_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(name));
    std::fs::create_dir(&whole).unwrap();
    std::fs::create_dir(&parts).unwrap();
    let config = config();
    let (cancelled, events) = run(&config, &whole, false, u64::MAX);
    assert!(!cancelled);
    let warnings: Vec<&Event> = events.iter().filter(|event| matches!(event, Event::Warning(_))).collect();
    assert!(warnings.is_empty(), "{warnings:?}");
    let phases = events.iter().filter_map(|event| match event {
        Event::Begun(stage) if config.phase_stages().contains(stage) => Some(stage.name()),
        _ => None,
    });
    assert!(phases.eq(["depth 1/2", "depth 2/2", "light 1/2", "light 2/2", "joint"]));
    let reports: Vec<&[Figure]> = events
        .iter()
        .filter_map(|event| match event {
            Event::Figures { stage, figures } if *stage == stages::VALIDATION => Some(&figures[..]),
            _ => None,
        })
        .collect();
    let found = |report: usize, name: &str| {
        reports[report].iter().find(|figure| figure.name == name).map(|figure| figure.value)
    };
    assert!(found(0, "depth_abs_rel").is_some() && found(0, "psnr_db").is_none());
    assert!(found(4, "psnr_db").is_some() && found(4, "true_octree_psnr_db") > found(4, "psnr_db"), "{:?}", reports[4]);
    assert!(found(0, "global_contrast_stops").is_some() && found(0, "contrast_stops").is_none());
    for name in ["contrast_stops", "vector_deg", "level_log2", "unseen_irradiance_relative_si_rmse"] {
        assert!(found(4, name).is_some_and(|value| value > 0.0), "{name}: {:?}", reports[4]);
    }

    // Stops within a phase and between two phases, with different numbers of threads.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    assert!(run(&config, &parts, false, 1).0);
    assert!(pool.install(|| run(&config, &parts, true, 2).0));
    assert!(run(&config, &parts, true, 4).0);
    assert!(!run(&config, &parts, true, u64::MAX).0);
    assert!(checkpoint(&whole) == checkpoint(&parts), "weights, moments or state differ");

    // The exported weights are the averages and can be read.
    let networks = Networks::read(whole.join(WEIGHTS_FILE)).unwrap();
    assert_eq!(networks.config.depth, 5);
    assert_eq!(Networks::read(whole.join(CHECKPOINT_FILE)).unwrap().config, networks.config);
    assert!(whole.join(SHEET_FILE).exists());
    for path in [&whole, &parts] {
        let log = std::fs::read_to_string(path.join(LOG_FILE)).unwrap();
        let lines: Vec<serde_json::Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        let steps = lines.iter().filter(|line| line["means"].is_object()).map(|line| line["total_steps"].as_u64());
        assert!(steps.map(Option::unwrap).eq([1, 2, 4, 6, 8]), "{log}");
    }
}

/// Trains a step of each stage on a small published dataset that `write` creates, without skipping a sample, with the
/// configuration changed by `change`. Returns the folder of the run and its events.
fn trained_on(write: impl FnOnce(&Path), change: impl FnOnce(&mut TrainConfig)) -> (TempDir, Vec<Event>) {
    let (data, out) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    write(data.path());
    let mut config = config();
    config.data.folder = Some(data.path().to_owned());
    config.depth.truncate(1);
    config.light.truncate(1);
    change(&mut config);
    let (cancelled, events) = run(&config, out.path(), false, u64::MAX);
    let warnings: Vec<&Event> = events.iter().filter(|event| matches!(event, Event::Warning(_))).collect();
    assert!(!cancelled && warnings.is_empty(), "{warnings:?}");
    (out, events)
}

#[test]
fn futurehouse_trains_every_stage() {
    let crop = CropModel {
        width: 120,
        height: 80,
        panorama_height: 32,
        crops: 4,
        anew_each_epoch: true,
        ..Default::default()
    };
    let write = |data: &Path| {
        crate::layouts::futurehouse(data);
        std::fs::write(data.join("split.json"), r#"{"train": ["000123"], "val": ["000777"], "test": []}"#).unwrap();
    };
    let (_, events) = trained_on(write, |config| config.data.crop = crop);
    // The house of the published validation part has been measured.
    let mut reports = events.iter().filter_map(|event| match event {
        Event::Figures { stage, figures } if *stage == stages::VALIDATION => Some(figures),
        _ => None,
    });
    let last = reports.next_back().unwrap();
    let found = |name: &str| last.iter().find(|figure| figure.name == name).map(|figure| figure.value);
    assert!(found("depth_abs_rel").is_some_and(|value| value > 0.0), "{last:?}");
    assert!(
        found("psnr_db").is_some_and(f64::is_finite) && found("true_octree_psnr_db") > found("psnr_db"),
        "{last:?}"
    );
}

#[test]
fn interiorverse_trains_the_depth_network() {
    trained_on(crate::layouts::interiorverse, |config| {
        (config.light, config.joint, config.validation.photos) = (Vec::new(), Vec::new(), 0);
    });
}

#[test]
fn hypersim_trains_depth_and_light_without_panoramas() {
    let (out, _) = trained_on(crate::hypersim_layout::write, |config| {
        (config.joint, config.validation.photos) = (Vec::new(), 0);
    });
    let log = std::fs::read_to_string(out.path().join(LOG_FILE)).unwrap();
    let lines: Vec<serde_json::Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let found = |name: &str| lines.iter().filter_map(|line| line["means"][name].as_f64()).collect::<Vec<f64>>();
    for name in ["log_depth", "node_radiance", "visible_radiance"] {
        assert!(found(name).iter().all(|loss| *loss > 0.0) && found(name).len() == 1, "{name}: {log}");
    }
    assert_eq!(found("novel_radiance"), [0.0]);
}

#[test]
fn interiornet_trains_every_stage_without_light_above_white() {
    let write = |data: &Path| drop(crate::layouts::interiornet(data));
    let (out, _) = trained_on(write, |config| config.validation.photos = 0);
    // Rays below white are learned from. The panoramas are no truth for the global decoder.
    let log = std::fs::read_to_string(out.path().join(LOG_FILE)).unwrap();
    let lines: Vec<serde_json::Value> = log.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let found = |name: &str| lines.iter().filter_map(|line| line["means"][name].as_f64()).collect::<Vec<f64>>();
    assert!(found("novel_radiance").iter().all(|loss| *loss > 0.0) && found("novel_radiance").len() == 2, "{log}");
    assert!(["panorama", "panorama_irradiance"].iter().all(|name| found(name) == [0.0; 2]), "{log}");
}

#[test]
fn photos_of_two_sizes_wait_for_their_own_kind_also_over_a_stop() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, parts, rooms] = ["whole", "parts", "rooms"].map(|name| folder.path().join(name));
    [&whole, &parts, &rooms].into_iter().for_each(|path| std::fs::create_dir(path).unwrap());
    let base = config();
    for (seed, crop_size) in [(1, [64, 48]), (2, [48, 64])] {
        let generator = Generator::new(seed, small_rooms(crop_size, 4)).unwrap();
        assert_eq!(Split::of(&generator.scene_id(0)), Split::Train);
        write_shard(&rooms.join(format!("rooms-{seed}.tar")), [generator.record(0)].into_iter(), "tests").unwrap();
    }
    let config = TrainConfig {
        data: DataConfig { folder: Some(rooms), ..DataConfig::default() },
        validation: ValidationConfig { photos: 0, ..base.validation.clone() },
        depth: vec![DepthPhase {
            schedule: Schedule { steps: 5, ..DepthPhase::DEFAULT.schedule },
            batch_size: 3,
            photo_width: 64,
            ..DepthPhase::DEFAULT
        }],
        light: Vec::new(),
        joint: Vec::new(),
        ..base
    };
    assert!(!run(&config, &whole, false, u64::MAX).0);
    let mut waited = 0;
    for steps in 1..=5 {
        run(&config, &parts, steps > 1, 1);
        waited += checkpoint(&parts).state["training"]["waiting"].as_array().unwrap().len();
    }
    assert!(waited > 0, "no photo had to wait");
    assert!(checkpoint(&whole) == checkpoint(&parts), "weights, moments or state differ");
}

#[test]
fn trained_weights_begin_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let weights = folder.path().join("trained.safetensors");
    let config = TrainConfig { depth: Vec::new(), joint: Vec::new(), ..config() };
    let trained = Networks::new(EncoderKind::EfficientNetLite0, &config.network, 3, &lo_nets::Device::flex()).unwrap();
    trained.write(&weights, lo_nets::checkpoint::Precision::Half).unwrap();
    let request =
        TrainRequest { folder: folder.path(), resume: false, seed: 5, start: InitialWeights::Networks(&weights) };
    assert!(matches!(train(&config, &request, &mut at_once), Err(TrainError::Cancelled(_))));
    // The light network starts at octree depth 4, without the finest stage of the trained one.
    let read = |file: &Path| {
        let Networks { depth, light, config, .. } = Networks::read(file).unwrap();
        let finest = &light.encoder[config.depth as usize - 4].blocks[0].first.weights;
        let weights = [light.global.weights.val(), finest.val()].map(|weights| weights.into_data());
        (config.depth, depth.decoder.output.weight.val().into_data(), weights)
    };
    let (begun, trained) = (read(&folder.path().join(CHECKPOINT_FILE)), read(&weights));
    assert_eq!([begun.0, trained.0], [4, 5]);
    assert!(begun.1 == trained.1 && begun.2 == trained.2);
    // With the depth network alone, the light network gets the random weights of the seed.
    let begin = |start: InitialWeights, seed: u64| {
        let request = TrainRequest { seed, start, ..request };
        assert!(matches!(train(&config, &request, &mut at_once), Err(TrainError::Cancelled(_))));
        read(&folder.path().join(CHECKPOINT_FILE))
    };
    let of_depth = begin(InitialWeights::DepthNetwork(&weights), 6);
    assert!(of_depth.1 == trained.1 && of_depth.2 == begin(InitialWeights::Random, 6).2);
    assert!(of_depth.2 != trained.2 && of_depth.2 != begin(InitialWeights::DepthNetwork(&weights), 7).2);
    let other = LightNetConfig { channels: 16, ..config.network.clone() };
    let error = train(&TrainConfig { network: other, ..config.clone() }, &request, &mut at_once).unwrap_err();
    assert!(error.to_string().contains("differs from [network] in the configuration"), "{error}");
    let request = TrainRequest { start: InitialWeights::DepthNetwork(&weights), ..request };
    let error =
        train(&TrainConfig { encoder: EncoderKind::EfficientNetLite2, ..config.clone() }, &request, &mut at_once);
    let error = error.unwrap_err();
    assert!(error.to_string().contains("its encoder is efficientnet-lite0"), "{error}");
    let other = LightNetConfig { global_features: 100, ..config.network.clone() };
    let error = train(&TrainConfig { network: other, ..config }, &request, &mut at_once).unwrap_err();
    assert!(error.to_string().contains("its number of global features"), "{error}");
}

#[test]
fn what_cannot_be_trained_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let request = TrainRequest { folder: folder.path(), resume: false, seed: 5, start: InitialWeights::Random };
    let message = |config: &TrainConfig, request: &TrainRequest| {
        train(config, request, &mut lo_events::ignore).unwrap_err().to_string()
    };
    let nothing = TrainConfig { depth: Vec::new(), light: Vec::new(), joint: Vec::new(), ..config() };
    assert_eq!(
        message(&nothing, &request),
        "no training phases: add at least one of [[depth]], [[light]], [[joint]] and [[expected]]"
    );
    let gone = TrainRequest { resume: true, ..request };
    assert!(message(&config(), &gone).contains(CHECKPOINT_FILE));
    // A weights file is not a run.
    let networks =
        Networks::new(EncoderKind::EfficientNetLite0, &config().network, 1, &lo_nets::Device::flex()).unwrap();
    networks.write(folder.path().join(CHECKPOINT_FILE), lo_nets::checkpoint::Precision::Full).unwrap();
    assert!(
        message(&config(), &gone).contains("not the checkpoint of a training run"),
        "{}",
        message(&config(), &gone)
    );
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    let empty = DataConfig { folder: Some(folder.path().join("empty")), ..DataConfig::default() };
    assert!(message(&TrainConfig { data: empty, ..config() }, &request).contains("unknown dataset layout"));
}
