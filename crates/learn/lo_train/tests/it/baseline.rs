//! Runs that train a baseline on small rooms, stopped and resumed.

use std::ops::ControlFlow;
use std::path::Path;

use lo_baselines::{Baseline, System};
use lo_events::{Event, Figure};
use lo_nets::checkpoint::{Checkpoint, Precision};
use lo_nets::depth::EncoderKind;
use lo_nets::light::LightNetConfig;
use lo_nets::{Device, Networks};
use lo_train::{
    BaselineConfig, BaselineRequest, CHECKPOINT_FILE, DataConfig, LOG_FILE, TrainError, ValidationConfig, WEIGHTS_FILE,
    stages, train_baseline,
};

use crate::run::rooms;

/// Untrained networks, whose features are as good for a test as any.
fn networks(seed: u64) -> Networks {
    let network = LightNetConfig { depth: 4, full_depth: 3, channels: 8, max_channels: 16, ..Default::default() };
    let network = LightNetConfig { bottleneck: 2, head_channels: 8, global_features: 8, ..network };
    Networks::new(EncoderKind::EfficientNetLite0, &network, seed, &Device::flex()).unwrap()
}

fn config(system: System) -> BaselineConfig {
    BaselineConfig {
        system,
        steps: 6,
        batch_size: 2,
        learning_rate: 3e-3,
        warm_up_steps: 1,
        photos: 8,
        probes: 3,
        log_steps: 2,
        data: DataConfig { folder: Some(rooms()), ..DataConfig::default() },
        validation: ValidationConfig { every_steps: 4, photos: 1, sheet_rows: 0 },
        ..BaselineConfig::default()
    }
}

/// Runs to the end or for `steps` steps, and returns the figures of steps and validations.
fn run(
    config: &BaselineConfig,
    folders: [&Path; 2],
    networks: &Networks,
    resume: bool,
    steps: u64,
) -> Result<[Vec<Vec<Figure>>; 2], TrainError> {
    let [folder, examples] = folders;
    std::fs::create_dir_all(folder).unwrap();
    // A resumed run keeps its own seed.
    let request = BaselineRequest { folder, examples, networks, resume, seed: if resume { 9 } else { 4 } };
    let (mut losses, mut validations) = (Vec::new(), Vec::new());
    let stage = config.stage();
    train_baseline(config, &request, &mut |event| {
        if let Event::Figures { stage: of, figures } = event {
            if of == stage {
                losses.push(figures);
            } else if of == stages::VALIDATION {
                validations.push(figures);
            }
        }
        if losses.len() as u64 >= steps { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    Ok([losses, validations])
}

fn checkpoint(folder: &Path) -> Checkpoint {
    let mut checkpoint = Checkpoint::read(folder.join(CHECKPOINT_FILE)).unwrap();
    // Log lines contain timings, so their lengths vary.
    checkpoint.state["training"]["log_bytes"].take();
    checkpoint
}

#[test]
fn every_system_goes_on_as_if_it_had_not_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let (networks, examples) = (networks(1), folder.path().join("examples"));
    for system in System::ALL {
        let config = config(system);
        let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(system.name()).join(name));
        let run = |at: &Path, resume, steps| run(&config, [at, &examples], &networks, resume, steps);
        let [losses, validations] = run(&whole, false, u64::MAX).unwrap();
        assert_eq!((losses.len(), validations.len()), (6, 2), "{system}");
        assert!(validations.iter().flatten().all(|figure| figure.name == "psnr_db" && figure.value > 1.0));
        for (resume, steps) in [(false, 1), (true, 3)] {
            assert!(matches!(run(&parts, resume, steps), Err(TrainError::Cancelled(_))));
        }
        run(&parts, true, u64::MAX).unwrap();
        assert!(checkpoint(&whole) == checkpoint(&parts), "{system}: weights, moments or state differ");
        for file in [WEIGHTS_FILE, CHECKPOINT_FILE] {
            assert_eq!(Baseline::read(&whole.join(file), system).unwrap().system(), system);
        }
        let log = std::fs::read_to_string(whole.join(LOG_FILE)).unwrap();
        assert_eq!(log.lines().filter(|line| line.contains("\"means\"")).count(), 3, "{log}");
    }
    // All systems share their examples, and a pool that was not finished is made up to the same one.
    let all: Vec<_> = std::fs::read_dir(&examples).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(all.len(), 1);
    let file = |index: usize| all[0].join(format!("train-{index:06}.safetensors"));
    let before: Vec<_> = (0..8).map(|index| std::fs::read(file(index)).unwrap()).collect();
    (5..8).for_each(|index| std::fs::remove_file(file(index)).unwrap());
    let at = [&folder.path().join("again"), &examples].map(|path| path.to_owned());
    let config = BaselineConfig { steps: 1, ..config(System::Garon2019) };
    run(&config, [&at[0], &at[1]], &networks, false, u64::MAX).unwrap();
    let after: Vec<_> = (0..8).map(|index| std::fs::read(file(index)).unwrap()).collect();
    assert!(before == after);
}

#[test]
fn longer_training_lowers_the_loss() {
    let folder = tempfile::tempdir().unwrap();
    let config = BaselineConfig { steps: 60, ..config(System::Li2020) };
    let [run_folder, examples] = ["run", "examples"].map(|name| folder.path().join(name));
    let at = [&run_folder, &examples].map(|path| path.as_path());
    let [losses, _] = run(&config, at, &networks(1), false, u64::MAX).unwrap();
    let light = |of: &[Vec<Figure>]| of.iter().map(|figures| figures[0].value).sum::<f64>() / of.len() as f64;
    let (first, last) = (light(&losses[..6]), light(&losses[54..]));
    assert_eq!(losses[0][0].name, "light");
    assert!(last < 0.8 * first, "{first} {last}");
}

#[test]
fn other_systems_weights_and_data_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let [run_folder, examples] = ["run", "examples"].map(|name| folder.path().join(name));
    let at = [&run_folder, &examples].map(|path| path.as_path());
    let own = networks(1);
    let config = config(System::DeepLight2019);
    assert!(matches!(run(&config, at, &own, false, 1), Err(TrainError::Cancelled(_))));
    let message =
        |config: &BaselineConfig, networks: &Networks| run(config, at, networks, true, 1).err().unwrap().to_string();
    let other = BaselineConfig { system: System::Nir2019, ..config.clone() };
    assert!(message(&other, &own).contains("the run trains deeplight2019, not nir2019"));
    assert!(message(&config, &networks(2)).contains("features of other weights"));
    let fewer = BaselineConfig { probes: 2, ..config.clone() };
    assert!(message(&fewer, &own).contains("the probes or the augmentation changed"));
    own.write(at[0].join(CHECKPOINT_FILE), Precision::Half).unwrap();
    assert!(message(&config, &own).contains("not the checkpoint of a baseline's run"));
}
