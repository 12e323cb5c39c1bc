//! `study` on the command line, and its page in a real browser. `LIGHTOCTREE_SHOTS=FOLDER` keeps screenshots.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::support::browser::Browser;
use crate::support::weights::write_weights;
use crate::support::{done, json, refused};

/// Two rooms with small photos and coarse light, two pairs each.
const SMALL: &str = "others = [\"single-map\", \"no-lamp\"]\nrooms = 2\nmesh = \"builtin:sphere\"\nobject_size = 0.15\n\
    frames = 3\nquality = \"draft\"\n[generator]\noctree_depth = 5\n[generator.room]\ncrop_size = [96, 64]\n\
    [generator.light]\nspacing_m = 0.5\ngather_rays = 16\nlight_rays = 4\n";

const HEADER: &str = "study,participant,pair,position,choice,seconds\n";

/// Makes a study in a new folder: `study` beside its configuration.
fn small_study() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_weights(at);
    std::fs::write(at.join("small.toml"), SMALL).unwrap();
    let summary = json(&done(at, &[&MAKE[..], &["-o", "study", "--json"]].concat()));
    assert_eq!((&summary["pairs"], &summary["videos"], &summary["complete"]), (&json!(4), &json!(8), &json!(true)));
    assert_eq!((&summary["frames"], &summary["frames_written"]), (&json!(24), &json!(24)));
    folder
}

const MAKE: [&str; 7] = ["study", "make", "small.toml", "--weights", "weights.safetensors", "--seed", "4"];

fn read_json(path: &Path) -> Value {
    json(&std::fs::read_to_string(path).unwrap())
}

fn frames(folder: &Path) -> Vec<PathBuf> {
    let videos = folder.join("videos").read_dir().unwrap().map(|entry| entry.unwrap().path());
    let mut frames: Vec<_> =
        videos.flat_map(|video| video.read_dir().unwrap()).map(|entry| entry.unwrap().path()).collect();
    frames.sort();
    frames
}

#[test]
fn a_study_is_made_continued_and_evaluated() {
    let folder = small_study();
    let at = folder.path();
    let key = read_json(&at.join("study/key.json"));
    assert_eq!((&key["generator"], &key["reference"]), (&json!("lightoctree study"), &json!("true-octree")));
    // The page shows no methods and no rooms, and its videos exist.
    let data = std::fs::read_to_string(at.join("study/study.js")).unwrap();
    for word in ["fitted", "single-map", "no-lamp", "octree", "synth"] {
        assert!(!data.contains(word), "{word} in {data}");
    }
    for pair in key["pairs"].as_array().unwrap() {
        let shown = ["left", "middle", "right"].map(|side| pair[side].as_str().unwrap());
        assert!(shown.iter().all(|video| data.contains(video)), "{pair}");
        assert_eq!(shown.iter().collect::<BTreeSet<_>>().len(), 3, "{pair}");
    }
    let all = frames(&at.join("study"));
    assert_eq!(all.len(), 24);
    // In the reference, objects move and most of the photo stays. Untrained networks may hide their objects.
    for video in key["videos"].as_array().unwrap().iter().filter(|video| video["method"] == "true-octree") {
        let frame = |number: usize| {
            let path = at.join("study/videos").join(video["id"].as_str().unwrap()).join(format!("{number:04}.jpg"));
            lo_imaging::read_photo(path).unwrap().photo
        };
        let (first, last) = (frame(0), frame(2));
        assert_eq!((first.width(), first.height()), (96, 64));
        let srgb = lo_imaging::srgb_from_linear;
        let changes = |pixel: &(usize, usize)| {
            std::iter::zip(first.linear_at(*pixel), last.linear_at(*pixel))
                .any(|(a, b)| (srgb(a) - srgb(b)).abs() > 0.03)
        };
        let changed = (0..96 * 64).map(|i| (i % 96, i / 96)).filter(changes).count();
        assert!((40..96 * 64 / 2).contains(&changed), "{changed} of {} pixels change in {video}", 96 * 64);
    }

    // A second run keeps what exists and renders what is missing, to the same bytes.
    let (kept, lost) = (&all[0], &all[13]);
    let bytes = std::fs::read(lost).unwrap();
    let written = std::fs::metadata(kept).unwrap().modified().unwrap();
    std::fs::remove_file(lost).unwrap();
    std::fs::remove_file(at.join("study/index.html")).unwrap();
    let summary = json(&done(at, &[&MAKE[..], &["-o", "study", "--threads", "1", "--json"]].concat()));
    assert_eq!((&summary["frames_written"], &summary["complete"]), (&json!(1), &json!(true)));
    assert!(std::fs::read(lost).unwrap() == bytes && at.join("study/index.html").exists());
    assert_eq!(std::fs::metadata(kept).unwrap().modified().unwrap(), written);

    // Another study does not replace it, unless forced.
    std::fs::write(at.join("other.toml"), SMALL.replace("frames = 3", "frames = 2")).unwrap();
    let other = ["study", "make", "other.toml", "--weights", "weights.safetensors", "--seed", "4", "-o", "study"];
    let message = refused(at, 2, &other);
    assert!(message.contains("contains the study") && message.contains("--force"), "{message}");
    assert_eq!(frames(&at.join("study")).len(), 24);

    evaluates(at, &key);

    done(at, &[&other[..], &["--force"]].concat());
    assert_eq!(frames(&at.join("study")).len(), 16);
}

/// Returns the answers of a participant, who chooses our method in the first `ours` pairs of each comparison.
fn answers(key: &Value, participant: &str, ours: usize) -> String {
    let mut text = HEADER.to_owned();
    for other in key["others"].as_array().unwrap() {
        let pairs = key["pairs"].as_array().unwrap().iter().filter(|pair| pair["other"] == *other);
        for (i, pair) in pairs.enumerate() {
            let choice = if (pair["ours"] == "left") == (i < ours) { "left" } else { "right" };
            let (study, id) = (key["study"].as_str().unwrap(), pair["id"].as_str().unwrap());
            text += &format!("{study},{participant},{id},{},{choice},2.50\n", i + 1);
        }
    }
    text
}

/// Evaluates answers written by hand for the study in `study`.
fn evaluates(at: &Path, key: &Value) {
    let write = |name: &str, text: &str| std::fs::write(at.join(name), text).unwrap();
    write("a.csv", &answers(key, "a", 2));
    write("b.csv", &answers(key, "b", 2));
    write("c.csv", &answers(key, "c", 1));
    let evaluate = ["study", "evaluate", "--study", "study"];
    let run = |more: &[&str]| done(at, &[&evaluate[..], more].concat());
    let results = json(&run(&["a.csv", "b.csv", "c.csv", "--json", "-o", "chart.svg"]));
    assert_eq!((&results["participants"], &results["answers"]), (&json!(3), &json!(12)));
    for (comparison, other) in results["comparisons"].as_array().unwrap().iter().zip(["single-map", "no-lamp"]) {
        assert_eq!((&comparison["other"], &comparison["answers"]), (&json!(other), &json!(6)));
        assert_eq!(comparison["ours_chosen"], 5);
        // (1 + 6) · 2 / 2⁶, times two comparisons.
        let p = |name: &str| comparison[name].as_f64().unwrap();
        assert!((p("p") - 14.0 / 64.0).abs() < 1e-12 && (p("p_holm") - 28.0 / 64.0).abs() < 1e-12, "{comparison}");
        assert_eq!(comparison["by_participant"]["ours"], 2);
        assert_eq!(comparison["by_participant"]["ties"], 1);
    }
    let svg = std::fs::read_to_string(at.join("chart.svg")).unwrap();
    assert!(svg.contains("83.3 % : 16.7 %") && svg.contains("p = 0.438"), "{svg}");
    let text = run(&["a.csv", "b.csv", "c.csv"]);
    assert!(text.contains("83.3 %") && text.contains("participants: 3, answers: 12"), "{text}");
    // A chart is replaced, another file is not.
    run(&["a.csv", "-o", "chart.svg"]);
    write("mine.svg", "<svg/>");
    let refusal = |code: i32, more: &[&str]| refused(at, code, &[&evaluate[..], more].concat());
    assert!(refusal(2, &["a.csv", "-o", "mine.svg"]).contains("--force"));
    assert!(refusal(2, &["a.csv", "-o", "chart.png"]).contains(".svg"));
    // Malformed answers.
    let message = refusal(1, &["a.csv", "a.csv"]);
    assert!(message.contains("a.csv, line 2: participant a has answered pair"), "{message}");
    write("bad.csv", &answers(key, "d", 1).replace("left", "both").replace("right", "both"));
    let message = refusal(1, &["a.csv", "bad.csv"]);
    assert!(message.contains("bad.csv, line 2: ") && message.contains("\"both\", not left or right"), "{message}");
    write("empty.csv", HEADER);
    assert!(refusal(1, &["empty.csv"]).contains("no answers"));
    assert!(refusal(1, &["missing.csv"]).contains("missing.csv"));
    let message = refused(at, 1, &["study", "evaluate", "a.csv", "--study", "."]);
    assert!(message.contains("key.json"), "{message}");
}

#[test]
fn configurations_are_checked_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let refusal = |text: &str| {
        std::fs::write(at.join("bad.toml"), text).unwrap();
        let message = refused(at, 2, &["study", "make", "bad.toml", "-o", "study"]);
        assert!(message.contains("bad.toml") && !at.join("study").exists(), "{message}");
        message
    };
    assert!(refusal("ours = \"magic\"").contains("unknown method \"magic\"; available: no-lamp"));
    assert!(refusal("others = [\"true-panorama\"]").contains("true-panorama cannot be compared"));
    assert!(refusal("frame = 3").contains("line 1 (frame = 3): unknown field `frame`"));
    assert!(refusal("[generator]\nshots = 0").contains("shots is 0"));
    assert!(refused(at, 2, &["study", "make"]).contains("--output"));
    let printed = done(at, &["study", "make", "--print-config"]);
    assert!(printed.contains("ours = \"fitted\"") && printed.contains("[generator.room]"), "{printed}");
}

/// The page's position in the study; `Pair 1 of 4`.
const PROGRESS: &str = "document.getElementById('progress').textContent";

/// Frames that the three videos show.
const SHOWN: &str = "[...document.querySelectorAll('canvas')].map((canvas) => canvas.dataset.frame)";

fn is_visible(id: &str) -> String {
    format!("!document.getElementById('{id}').hidden")
}

fn shot(browser: &mut Browser, name: &str) {
    if let Some(folder) = std::env::var_os("LIGHTOCTREE_SHOTS") {
        browser.screenshot(&PathBuf::from(folder).join(name));
    }
}

/// Waits until the current pair may be answered, and presses a key.
fn answer(browser: &mut Browser, position: usize, key: &str) {
    browser.wait(&format!("{PROGRESS} === 'Pair {position} of 4' && !document.getElementById('left').disabled"));
    browser.key(key, 0);
}

#[test]
fn a_participant_answers_by_keyboard_in_a_browser() {
    let Some(mut browser) = Browser::start("the page of user studies") else { return };
    let folder = small_study();
    let at = folder.path();
    let address = format!("file://{}", at.join("study/index.html").display());
    let downloads = at.join("downloads");
    std::fs::create_dir(&downloads).unwrap();
    browser.call("Browser.setDownloadBehavior", json!({ "behavior": "allow", "downloadPath": downloads }));
    browser.open(&address, [1280, 720]);
    browser.wait(&is_visible("welcome"));
    assert_eq!(browser.value("document.getElementById('participant').value.length"), 8);
    shot(&mut browser, "study_welcome.png");
    browser.value("document.getElementById('participant').value = 'p-7'");
    browser.value("document.getElementById('start').requestSubmit()");

    // Keys count only after the videos were shown once.
    browser.wait(&format!("{PROGRESS} === 'Pair 1 of 4' && {SHOWN}.every((frame) => frame !== undefined)"));
    let watched = browser.value("document.getElementById('left').disabled");
    if watched == true {
        browser.key("ArrowLeft", 0);
        assert_eq!(browser.value(PROGRESS), "Pair 1 of 4");
    }
    // All three show the same frame at any time, forth and back.
    let seen = browser.value(&format!(
        "(async () => {{ const seen = []; for (let i = 0; i < 60; i++) {{ await new Promise(requestAnimationFrame);
           seen.push({SHOWN}); }} return seen; }})()"
    ));
    let seen: Vec<[String; 3]> = serde_json::from_value(seen).unwrap();
    assert!(seen.iter().all(|[left, middle, right]| left == middle && middle == right), "{seen:?}");
    assert_eq!(seen.iter().map(|shown| &shown[0]).collect::<BTreeSet<_>>().len(), 3, "all frames: {seen:?}");
    shot(&mut browser, "study_pair.png");
    answer(&mut browser, 1, "ArrowLeft");
    browser.wait(&format!("{PROGRESS} === 'Pair 2 of 4' && !document.getElementById('left').disabled"));
    browser.key(" ", 0);
    answer(&mut browser, 2, "ArrowRight");
    browser.wait(&format!("{PROGRESS} === 'Pair 3 of 4'"));

    // Answers survive a reload.
    browser.open(&address, [1280, 720]);
    browser.wait(&is_visible("resumed"));
    assert_eq!(browser.value("document.getElementById('participant').value"), "p-7");
    browser.value("document.getElementById('start').requestSubmit()");
    answer(&mut browser, 3, "ArrowRight");
    answer(&mut browser, 4, "ArrowRight");
    browser.wait(&is_visible("end"));
    browser.key("Enter", 0);
    shot(&mut browser, "study_end.png");
    let key = read_json(&at.join("study/key.json"));
    let name = format!("answers-{}-p-7.csv", key["study"].as_str().unwrap());
    let file = downloads.join(&name);
    let begun = Instant::now();
    while !file.exists() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{name} is not saved");
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(browser.faults.is_empty(), "{:?}", browser.faults);
    let loaded = browser.value("performance.getEntriesByType('resource').map((entry) => entry.name)");
    let loaded: Vec<String> = serde_json::from_value(loaded).unwrap();
    assert!(loaded.iter().all(|name| ["file:", "data:", "blob:"].iter().any(|scheme| name.starts_with(scheme))));

    let text = std::fs::read_to_string(&file).unwrap();
    let choices: Vec<&str> = text.lines().skip(1).map(|line| line.split(',').nth(4).unwrap()).collect();
    assert_eq!(choices, ["left", "right", "right", "right"], "{text}");
    let results = json(&done(at, &["study", "evaluate", file.to_str().unwrap(), "--study", "study", "--json"]));
    assert_eq!(
        (&results["answers"], &results["left_chosen"], &results["participants"]),
        (&json!(4), &json!(1), &json!(1))
    );
    let pair_of = |line: &str| {
        key["pairs"]
            .as_array()
            .unwrap()
            .iter()
            .find(|pair| line.contains(&format!(",p-7,{},", pair["id"].as_str().unwrap())))
            .unwrap()
            .clone()
    };
    let chosen =
        text.lines().skip(1).filter(|line| line.contains(&format!(",{},", pair_of(line)["ours"].as_str().unwrap())));
    let ours: u64 = results["comparisons"].as_array().unwrap().iter().map(|c| c["ours_chosen"].as_u64().unwrap()).sum();
    assert_eq!(chosen.count() as u64, ours, "{text}");
}
