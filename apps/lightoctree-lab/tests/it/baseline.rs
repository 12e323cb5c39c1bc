//! `train-baseline` and `eval --baseline` on the command line.

use std::path::Path;

use crate::support::{done, json, refused};

const ROOMS: &str = "
shots = 1
panoramas = 2
panorama_height = 16
octree_depth = 5
[room]
crop_size = [64, 48]
[light]
spacing_m = 0.5
gather_rays = 16
light_rays = 4
";

/// Trains on two rooms for some steps.
fn train<'a>(name: &'a str, more: &[&'a str]) -> Vec<String> {
    let system = format!("system=\"{name}\"");
    let set = ["photos=3", "probes=2", "batch_size=2", "validation.photos=0", &system[..]].map(str::to_owned);
    let set = set.into_iter().flat_map(|value| ["--set".to_owned(), value]);
    let common = ["train-baseline", "--data", "rooms", "--seed", "3", "--examples", "examples"].map(str::to_owned);
    common.into_iter().chain(set).chain(more.iter().map(|&text| text.to_owned())).collect()
}

fn run(at: &Path, arguments: &[String]) -> String {
    done(at, &arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

#[test]
fn a_system_is_trained_resumed_and_scored() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("rooms.toml"), ROOMS).unwrap();
    done(at, &["synth", "--scenes", "2", "--split", "train", "--config", "rooms.toml", "-o", "rooms"]);
    let summary = json(&run(at, &train("garon2019", &["--set", "steps=4", "-o", "garon", "--json"])));
    assert_eq!((summary["done"].as_bool(), summary["steps"].as_u64()), (Some(true), Some(4)));
    run(at, &train("nir2019", &["--set", "steps=2", "-o", "nir"]));
    // More steps: the run goes on.
    let more = ["train-baseline", "--resume", "--examples", "examples", "--set", "steps=6", "-o", "garon", "--json"];
    assert_eq!(json(&done(at, &more))["steps"], 2);

    let eval = ["eval", "rooms", "--split", "all", "--walks", "1", "--methods", "mean-colour", "--json", "-o"];
    let baselines =
        ["--baseline", "garon2019=garon/weights.safetensors", "--baseline", "nir2019=nir/weights.safetensors"];
    let summary = json(&done(at, &[&eval[..], &["report"], &baselines].concat()));
    let methods = summary["methods"].as_array().unwrap();
    let names: Vec<&str> = methods.iter().map(|method| method["method"].as_str().unwrap()).collect();
    assert_eq!(names, ["mean-colour", "garon2019", "nir2019"]);
    for method in methods {
        assert!(method["figures"]["psnr_db"]["mean"].as_f64().unwrap() > 1.0 && method["photos"] == 2, "{method}");
        assert!(method["figures"]["coherence"]["mean"].as_f64().is_some());
    }
    assert!(std::fs::read_to_string(at.join("report/costs.csv")).unwrap().contains("garon2019"));

    let refusal = |more: &[&str]| refused(at, 2, &[&eval[..], &["none"], more].concat());
    assert!(refusal(&["--baseline", "garon=x"]).contains("no baseline is called \"garon\""));
    assert!(refusal(&["--baseline", "garon2019"]).contains("expected NAME=FILE"));
    assert!(refusal(&["--external", "li2020=x"]).contains("li2020 has a meaning in the tables"));
    let twice = [&baselines[..2], &baselines[..2]].concat();
    assert!(refusal(&twice).contains("garon2019 is given twice"));
    let failure = |code: i32, more: &[&str]| refused(at, code, &[&eval[..], &["none"], more].concat());
    let other = failure(1, &["--baseline", "li2020=nir/weights.safetensors"]);
    assert!(other.contains("the weights of nir2019, not of li2020"), "{other}");
    crate::support::weights::write_weights(at);
    let networks = failure(1, &["--baseline", "li2020=weights.safetensors"]);
    assert!(networks.contains("not the weights of a baseline"), "{networks}");
    let features = refusal(&["--weights", "weights.safetensors", "--baseline", "nir2019=nir/weights.safetensors"]);
    assert!(features.contains("trained on the image features of other weights"), "{features}");
}

#[test]
fn configurations_are_printed_and_checked() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let config = done(at, &["train-baseline", "--print-config", "--data", "rooms"]);
    assert!(config.contains("system = \"gardner2017\"") && config.contains("folder = \"rooms\""), "{config}");
    let message = refused(at, 2, &["train-baseline", "--set", "photos=0", "-o", "run"]);
    assert_eq!(message, "error: photos is 0; it must be between 1 and 1000000\n");
    let message = refused(at, 2, &["train-baseline", "--resume", "-o", "run"]);
    assert_eq!(message, "error: run has no checkpoint.safetensors to resume from\n");
    let message = refused(at, 1, &["train-baseline", "--data", "nowhere", "-o", "run"]);
    assert!(message.contains("nowhere"), "{message}");
}
