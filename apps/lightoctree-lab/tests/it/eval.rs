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

/// The program's own panoramas, written and scored as another program's, have the same figures to the digit.
#[test]
fn panoramas_of_other_programs_are_scored_like_ours() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    rooms(at, "2", SMALL);
    write_weights(at);
    let common = ["eval", "rooms", "--split", "all", "--weights", "weights.safetensors", "--octree-depth", "6"];
    let run = |more: &[&str]| done(at, &[&common[..], more].concat());
    run(&["--methods", "mirrored,network,shell-true", "--walks", "0", "--panoramas", "kept", "-o", "one"]);
    let externals = ["--external", "theirs=kept/network", "--external", "flat=kept/mirrored"];
    run(&[&["--methods", "mean-colour", "--walks", "0", "-o", "two"][..], &externals].concat());
    let read = |file: &str| std::fs::read_to_string(at.join(file)).unwrap();
    let figures = |file: &str, method: &str| -> Vec<std::collections::BTreeMap<String, String>> {
        let text = read(file);
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        let head = lines.next().unwrap();
        let rows = lines.filter(|row| row[2] == method);
        rows.map(|row| head.iter().cloned().zip(row).skip(4).collect()).collect()
    };
    for (method, name) in [("network", "theirs"), ("mirrored", "flat")] {
        let (ours, theirs) = (figures("one/scenes.csv", method), figures("two/scenes.csv", name));
        assert_eq!((ours.len(), theirs.len()), (2, 2));
        for (ours, theirs) in ours.iter().zip(&theirs) {
            let scored: Vec<_> = theirs.iter().filter(|(_, value)| !value.is_empty()).collect();
            assert!(scored.len() > 30, "{scored:?}");
            for (figure, value) in scored {
                assert_eq!(ours.get(figure), Some(value), "{name}, {figure}");
            }
        }
    }
    assert!(!read("two/costs.csv").contains("theirs") && read("two/summary.md").contains("| theirs | 2 |"));

    // A folder for other programs: nothing is there to score yet.
    assert!(done(at, &["eval", "rooms", "--split", "all", "--write-views", "views"]).contains("views.json  photos: 2"));
    let message = refused(at, 2, &["eval", "rooms", "--split", "all", "--write-views", "views"]);
    assert!(message.contains("panoramas beside it may belong to it"), "{message}");
    let message = refused(at, 1, &[&common[..], &["--external", "none=views", "-o", "three"]].concat());
    assert!(
        message.contains("none of the panoramas that views.json lists is there, such as 000001-1.exr"),
        "{message}"
    );
    // One of two photos.
    std::fs::copy(at.join("kept/network/000002-1.exr"), at.join("views/000002.exr")).unwrap();
    run(&["--methods", "mean-colour", "--external", "half=views", "-o", "three"]);
    assert!(read("three/summary.md").contains("half: not possible on 1 photos: needs the panorama of each view"));
    // Panoramas of other photos are not scored in silence.
    done(at, &["synth", "--scenes", "1", "--config", "config.toml", "--seed", "5", "-o", "others"]);
    let message =
        refused(at, 2, &["eval", "others", "--split", "all", "--external", "theirs=kept/network", "-o", "four"]);
    assert!(message.contains("is not listed; the list was written with other options"), "{message}");
    for (option, expected) in [
        ("network=kept/network", "network has a meaning in the tables"),
        ("a|b=kept/network", "letters, digits"),
        ("kept/network", "expected NAME=DIR"),
    ] {
        let message = refused(at, 2, &[&common[..], &["--external", option, "-o", "five"]].concat());
        assert!(message.contains(expected), "{message}");
    }
}

/// Spheres in a photo under the true panorama and under those of two methods, one of them the true one as another
/// program's.
#[test]
fn objects_are_lit_by_every_methods_panorama() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // A room in which the camera looks down at the floor.
    let config = "shots = 1\npanoramas = 1\npanorama_height = 32\n[room]\ncrop_size = [144, 96]\n[light]\nspacing_m = 0.3\ngather_rays = 24\nlight_rays = 4\n";
    rooms(at, "3", config);
    let eval = ["eval", "rooms", "--split", "all", "--objects", "--walks", "0", "--json"];
    let methods = ["--methods", "mean-colour,true-octree"];
    let summary = json(&done(at, &[&eval[..], &methods, &["-o", "report"]].concat()));
    let text = std::fs::read_to_string(at.join("report/summary.md")).unwrap();
    assert!(
        text.contains("objects.png, from left to right: photo, lit by the truth, mean-colour, true-octree"),
        "{text}"
    );
    let figure = |method: usize, name: &str| summary["methods"][method]["figures"][name]["mean"].as_f64().unwrap();
    for name in ["object_diffuse_rmse", "object_rough_rmse", "object_mirror_rmse", "shadow_rms"] {
        let (flat, octree) = (figure(0, name), figure(1, name));
        assert!(octree < flat && octree > 0.0, "{name}: {flat} {octree}");
    }
    let sheet = imaging::read_photo(at.join("report/objects.png")).unwrap().photo;
    assert_eq!(sheet.width(), 4 + 4 * 148);
    let message = refused(at, 2, &["eval", "config.toml", "--protocol", "insertion", "--objects", "-o", "none"]);
    assert!(message.contains("remove --external, --baseline, --panoramas and --objects"), "{message}");
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
