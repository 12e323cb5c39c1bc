//! `eval` on the command line.

use std::path::Path;

use lo_geometry::pixel_direction;
use lo_imaging as imaging;
use lo_imaging::{ExrOptions, Image};

use crate::support::weights::write_weights;
use crate::support::{done, json, refused};

/// Rooms with one small photo, few points and coarse light: about a second per room.
const SMALL: &str = "shots = 1\npanoramas = 2\npanorama_height = 16\noctree_depth = 5\n[room]\ncrop_size = [48, 32]\n[light]\nspacing_m = 0.5\ngather_rays = 16\nlight_rays = 4\n";

fn rooms(at: &Path, scenes: &str, config: &str) {
    std::fs::write(at.join("config.toml"), config).unwrap();
    done(at, &["synth", "--scenes", scenes, "--config", "config.toml", "--seed", "4", "-o", "rooms"]);
}

#[test]
fn every_method_has_its_line_and_threads_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    rooms(at, "2", SMALL);
    write_weights(at);
    assert!(done(at, &["eval", "rooms", "--make-profile", "profile.json"]).contains("profile.json  mean of "));
    let tools = ["--profile", "profile.json", "--weights", "weights.safetensors"];
    let common = [&["eval", "rooms", "--split", "all", "--octree-depth", "6", "--walks", "1"][..], &tools].concat();
    let run = |more: &[&str]| done(at, &[&common[..], more].concat());
    let summary = json(&run(&["-o", "one", "--threads", "1", "--json"]));
    run(&["-o", "two", "--threads", "2", "--methods", "profile,shell-sensor,network,true-octree"]);
    let read = |file: &str| std::fs::read_to_string(at.join(file)).unwrap();
    let (one, two) = (read("one/scenes.csv"), read("two/scenes.csv"));
    assert_eq!((one.lines().count(), two.lines().count()), (1 + 2 * 12, 1 + 2 * 4));
    assert!(two.lines().all(|line| one.lines().any(|other| other == line)), "{one}{two}");
    let methods = summary["methods"].as_array().unwrap();
    let names: Vec<&str> = methods.iter().map(|method| method["method"].as_str().unwrap()).collect();
    let all = [
        ["mean-colour", "profile", "fixed-shape", "mirrored", "single-map", "network-cubed"],
        ["shell-sensor", "shell-true", "network", "network-sensor", "network-true", "true-octree"],
    ];
    assert_eq!(names, all.concat());
    for method in methods {
        let db = method["figures"]["psnr_db"]["mean"].as_f64().unwrap();
        assert!(db > 0.0 && method["photos"] == 2 && method["scenes"] == 2, "{method}");
    }
    // Only the network without depth input predicts depth.
    let figure = |method: usize, name: &str| methods[method]["figures"][name]["mean"].as_f64();
    assert_eq!(figure(11, "split_accuracy"), Some(1.0));
    assert!(figure(8, "depth_abs_rel").unwrap() > 0.01 && figure(10, "depth_abs_rel").unwrap() < 1e-3);
    assert!(figure(10, "split_accuracy").is_some() && figure(0, "split_accuracy").is_none());
    assert!(figure(5, "contrast_stops") > figure(8, "contrast_stops"), "cubed luminance has more contrast");
    let text = read("one/summary.md");
    assert!(text.contains("| true-octree | 2 |") && text.contains("### Scenes won, unseen_si_rmse"), "{text}");
    assert!(
        text.contains("### Light on objects") && text.contains("### Scenes won, unseen_irradiance_relative_si_rmse")
    );
    let sheet = imaging::read_photo(at.join("one/sheet.png")).unwrap().photo;
    assert_eq!((sheet.width(), sheet.height()), (8 + 192 + 13 * 260, 4 + 2 * 132));
    // Previous results are replaced, other files are not.
    run(&["-o", "one", "--samples", "1", "--methods", "mirrored"]);
    assert_eq!(read("one/scenes.csv").lines().count(), 2);
    let message = refused(at, 2, &["eval", "rooms", "--split", "all", "-o", "rooms"]);
    assert!(message.contains("rooms"), "{message}");
}

/// Checks step sizes and parallax of a moving probe with the built-in weights.
#[test]
fn light_moves_as_geometry_says() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    rooms(
        at,
        "2",
        "shots = 1\npanoramas = 1\npanorama_height = 32\n[room]\ncrop_size = [240, 160]\n[light]\nspacing_m = 0.3\ngather_rays = 24\n",
    );
    let methods = ["--methods", "single-map,network-sensor,network-true"];
    let eval = ["eval", "rooms", "--split", "all", "--walks", "3", "--json", "-o", "report"];
    let summary = json(&done(at, &[&eval[..], &methods].concat()));
    let figure = |method: usize, name: &str| summary["methods"][method]["figures"][name]["mean"].as_f64();
    assert!(figure(0, "walk_parallax_px").unwrap() > 10.0, "{summary}");
    for method in [1, 2] {
        assert!(figure(method, "walk_parallax_px").unwrap() <= 2.0, "{summary}");
        assert!(figure(method, "walk_step_ratio").unwrap() <= 3.0, "{summary}");
    }
}

#[test]
fn panoramas_and_published_protocols() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::create_dir(at.join("maps")).unwrap();
    let map = Image::from_fn(64, 32, |x, y| pixel_direction(x, y, 64, 32).to_array().map(|v| 1.2 + v));
    imaging::write_radiance(at.join("maps/hall.hdr"), &map, &ExrOptions::default()).unwrap();
    let eval = ["eval", "maps", "--split", "all", "--json", "-o"];
    let run = |more: &[&str]| json(&done(at, &[&eval[..], more].concat()));
    let summary = run(&["plain", "--methods", "mean-colour,mirrored,shell-true"]);
    let methods = &summary["methods"];
    assert_eq!((&methods[0]["photos"], &methods[2]["photos"]), (&4.into(), &0.into()));
    assert_eq!(methods[2]["not_possible"]["needs true depth"], 4);
    let figure = |method: usize, name: &str| methods[method]["figures"][name]["mean"].as_f64().unwrap();
    assert!(figure(1, "seen_psnr_db") > figure(0, "seen_psnr_db"));
    assert!(std::fs::read_to_string(at.join("plain/summary.md")).unwrap().contains("not possible on 4 photos"));
    let three = run(&["three", "--protocol", "three-spheres"]);
    assert!(three["methods"][0]["figures"]["silver_normalised_rmse"]["mean"].as_f64().unwrap() > 0.0);
    let array = run(&["array", "--protocol", "sphere-array", "--methods", "mirrored", "--samples", "2"]);
    assert_eq!(array["methods"][0]["photos"], 2);
    assert!(array["methods"][0]["figures"]["array_si_rmse"]["median"].as_f64().unwrap() > 0.0);
    // The only scene is in the validation part.
    let message = refused(at, 2, &["eval", "maps", "--split", "train", "-o", "none"]);
    assert!(message.contains("none of the 4 photos is in the selected part; see --split"), "{message}");
}

#[test]
fn what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let profile = |factors: &str| format!(r#"{{"format_version":1,"samples":1,"dataset":"x","factors":{factors}}}"#);
    std::fs::write(at.join("bad.json"), profile("[]")).unwrap();
    let refusal = |code: i32, more: &[&str]| refused(at, code, &[&["eval", "rooms", "-o", "report"], more].concat());
    let message = refusal(2, &["--methods", "profile"]);
    assert!(message.contains("the method profile requires --profile FILE.json"), "{message}");
    let message = refusal(2, &["--methods", "magic"]);
    assert!(message.contains("available: mean-colour"), "{message}");
    let message = refusal(1, &["--profile", "bad.json"]);
    assert!(message.contains("bad.json") && message.contains("factors"), "{message}");
    let message = refusal(1, &[]);
    assert!(message.contains("rooms"), "{message}");
    assert!(refused(at, 2, &["eval", "rooms"]).contains("--output"));
}
