//! Runs as a whole: all stages on small rooms, stopped and resumed.
#![allow(clippy::unwrap_used)]

use std::cell::Cell;
use std::path::Path;

use dataset::{Generator, GeneratorConfig, Split, write_shard};
use lightoctree_train::{
    CHECKPOINT_FILE, DataConfig, DepthPhase, JointPhase, LOG_FILE, LightPhase, Message, Outcome, Request, SHEET_FILE,
    TrainConfig, ValidationConfig, WEIGHTS_FILE, train,
};
use nets::Networks;
use nets::checkpoint::Checkpoint;
use nets::light::LightNetConfig;
use synth::SynthConfig;

/// All three stages, the light network at two depths; a few steps each, on rooms of a second or two.
fn config() -> TrainConfig {
    let room = SynthConfig { crop_size: [64, 48], ..SynthConfig::default() };
    let small =
        GeneratorConfig { room, shots: 1, panoramas: 1, panorama_height: 16, octree_depth: 5, ..Default::default() };
    let network =
        LightNetConfig { depth: 5, full_depth: 3, channels: 8, max_channels: 16, blocks: 1, ..Default::default() };
    let light =
        |octree_depth| LightPhase { steps: 2, octree_depth, novel_rays: 300, visible_rays: 100, ..Default::default() };
    TrainConfig {
        log_steps: 2,
        network: LightNetConfig { bottleneck: 2, head_channels: 8, global_features: 8, ..network },
        data: DataConfig { generated_rooms: 12, generator: small, ..DataConfig::default() },
        validation: ValidationConfig { every_steps: 100, photos: 1, sheet_rows: 1 },
        depth: vec![
            DepthPhase { steps: 1, batch_size: 3, photo_width: 32, ..Default::default() },
            DepthPhase { steps: 1, batch_size: 1, frozen_statistics: true, ..Default::default() },
        ],
        light: vec![light(4), LightPhase { own_growth: [0.0, 1.0], predicted_share: 1.0, ..light(5) }],
        joint: vec![JointPhase {
            steps: 2,
            octree_depth: 5,
            novel_rays: 300,
            visible_rays: 100,
            predicted_share: 0.5,
            ..Default::default()
        }],
        ..TrainConfig::default()
    }
}

/// Runs until done, or until `steps` are made; gives how it ended and what it said.
fn run(config: &TrainConfig, folder: &Path, resume: bool, steps: u64) -> (Outcome, Vec<Message>) {
    let made = Cell::new(0);
    let mut messages = Vec::new();
    // A resumed run keeps its own seed.
    let seed = if resume { 6 } else { 5 };
    let request = Request { folder, resume, seed, weights: None, encoder_weights: None };
    let outcome = train(config, &request, &|| made.get() >= steps, &mut |message| {
        made.set(made.get() + u64::from(matches!(message, Message::Step { .. })));
        messages.push(message);
    });
    (outcome.unwrap(), messages)
}

fn checkpoint(folder: &Path) -> Checkpoint {
    let mut checkpoint = Checkpoint::read(folder.join(CHECKPOINT_FILE)).unwrap();
    // Lines of the log hold times.
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
    let (outcome, messages) = run(&config, &whole, false, u64::MAX);
    assert_eq!(outcome, Outcome::Done);
    let notes: Vec<&Message> = messages.iter().filter(|message| matches!(message, Message::Note(_))).collect();
    assert!(notes.is_empty(), "{notes:?}");
    let phases: Vec<String> = messages
        .iter()
        .filter_map(|message| if let Message::Phase { name, .. } = message { Some(name.clone()) } else { None })
        .collect();
    assert_eq!(phases, ["depth 1/2", "depth 2/2", "light 1/2", "light 2/2", "joint"]);
    let reports: Vec<_> = messages
        .iter()
        .filter_map(|message| if let Message::Validation(report) = message { Some(report) } else { None })
        .collect();
    assert!(reports[0].depth_abs_rel.is_some() && reports[0].psnr_db.is_none());
    assert!(reports[4].psnr_db.is_some() && reports[4].true_octree_psnr_db > reports[4].psnr_db, "{:?}", reports[4]);

    // In the middle of a phase, between two, and on another number of threads.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    assert_eq!(run(&config, &parts, false, 1).0, Outcome::Stopped);
    assert_eq!(pool.install(|| run(&config, &parts, true, 2).0), Outcome::Stopped);
    assert_eq!(run(&config, &parts, true, 4).0, Outcome::Stopped);
    assert_eq!(run(&config, &parts, true, u64::MAX).0, Outcome::Done);
    assert!(checkpoint(&whole) == checkpoint(&parts), "weights, moments or state differ");

    // What is exported is the average, and of use.
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

#[test]
fn photos_of_two_sizes_wait_for_their_own_kind_also_over_a_stop() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, parts, rooms] = ["whole", "parts", "rooms"].map(|name| folder.path().join(name));
    [&whole, &parts, &rooms].into_iter().for_each(|path| std::fs::create_dir(path).unwrap());
    let base = config();
    for (seed, crop_size) in [(1, [64, 48]), (2, [48, 64])] {
        let room = SynthConfig { crop_size, ..SynthConfig::default() };
        let generator = GeneratorConfig { room, shots: 4, ..base.data.generator.clone() };
        let generator = Generator::new(seed, generator).unwrap();
        assert_eq!(Split::of(&generator.scene_id(0)), Split::Train);
        write_shard(&rooms.join(format!("rooms-{seed}.tar")), [generator.record(0)].into_iter()).unwrap();
    }
    let config = TrainConfig {
        data: DataConfig { folder: Some(rooms), ..DataConfig::default() },
        validation: ValidationConfig { photos: 0, ..base.validation.clone() },
        depth: vec![DepthPhase { steps: 5, batch_size: 3, photo_width: 64, ..Default::default() }],
        light: Vec::new(),
        joint: Vec::new(),
        ..base
    };
    assert_eq!(run(&config, &whole, false, u64::MAX).0, Outcome::Done);
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
    let trained = Networks::new(&config.network, 3, &nets::Device::flex()).unwrap();
    trained.write(&weights, nets::checkpoint::Precision::Half).unwrap();
    let request =
        Request { folder: folder.path(), resume: false, seed: 5, weights: Some(&weights), encoder_weights: None };
    assert_eq!(train(&config, &request, &|| true, &mut |_| ()).unwrap(), Outcome::Stopped);
    // The light network begins with octrees of depth 4, without the finest stage of the one that was trained.
    let read = |file: &Path| {
        let Networks { depth, light, config } = Networks::read(file).unwrap();
        let finest = &light.encoder[config.depth as usize - 4].blocks[0].first.weights;
        let weights = [light.global.weights.val(), finest.val()].map(|weights| weights.into_data());
        (config.depth, depth.encoder.conv0.weight.val().into_data(), weights)
    };
    let (begun, trained) = (read(&folder.path().join(CHECKPOINT_FILE)), read(&weights));
    assert_eq!([begun.0, trained.0], [4, 5]);
    assert!(begun.1 == trained.1 && begun.2 == trained.2);
    let other = LightNetConfig { channels: 16, ..config.network.clone() };
    let error = train(&TrainConfig { network: other, ..config }, &request, &|| true, &mut |_| ()).unwrap_err();
    assert!(error.to_string().contains("of another shape than [network]"), "{error}");
}

#[test]
fn what_cannot_be_trained_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let request = Request { folder: folder.path(), resume: false, seed: 5, weights: None, encoder_weights: None };
    let message = |config: &TrainConfig, request: &Request| {
        train(config, request, &|| false, &mut |_| ()).unwrap_err().to_string()
    };
    let nothing = TrainConfig { depth: Vec::new(), light: Vec::new(), joint: Vec::new(), ..config() };
    assert_eq!(message(&nothing, &request), "there are no phases: none of depth, light and joint is given");
    let gone = Request { resume: true, ..request };
    assert!(message(&config(), &gone).contains(CHECKPOINT_FILE));
    // Weights for use are no run.
    let networks = Networks::new(&config().network, 1, &nets::Device::flex()).unwrap();
    networks.write(folder.path().join(CHECKPOINT_FILE), nets::checkpoint::Precision::Full).unwrap();
    assert!(message(&config(), &gone).contains("its state is none of a run"), "{}", message(&config(), &gone));
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    let empty = DataConfig { folder: Some(folder.path().join("empty")), ..DataConfig::default() };
    assert!(message(&TrainConfig { data: empty, ..config() }, &request).contains("none of the layouts"));
}
