//! Many photos: results of single commands, parts, resumed and killed runs, photos that fail.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

use assert_cmd::Command;
use lo_imaging as imaging;
use lo_imaging::Image;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{done, json, refused};

/// Small maps, so that a photo takes a moment.
const MAP: [&str; 5] = ["--envmap-at", "0,0,-1", "--size", "32x16", "--level"];

/// Creates photos in two folders with equal names in both: `a/0.png` …, `b/0.png` ….
fn photos(each: usize) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (room, grey) in [("a", 60), ("b", 120)] {
        let path = folder.path().join("photos").join(room);
        std::fs::create_dir_all(&path).unwrap();
        for number in 0..each {
            let photo = Image::from_fn(96, 64, |x, y| {
                let lamp = (x as i32 - 20 - 3 * number as i32).pow(2) + (y as i32 - 10).pow(2) < 30;
                if lamp { [255; 3] } else { [grey + (y / 2) as u8, grey, grey - (x / 4) as u8] }
            });
            imaging::write_srgb8(path.join(format!("{number}.png")), &photo, 95, imaging::GENERATOR).unwrap();
        }
    }
    folder
}

/// Returns all files below a folder, except reports, by their relative paths.
fn results(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(current) = folders.pop() {
        for entry in std::fs::read_dir(current).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_none_or(|extension| extension != "jsonl") {
                found.insert(path.strip_prefix(folder).unwrap().to_owned(), std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

fn records(path: &Path) -> Vec<Value> {
    std::fs::read_to_string(path).unwrap().lines().map(json).collect()
}

#[test]
fn results_are_those_of_single_commands_on_any_threads() {
    let folder = photos(2);
    let summary = json(&done(folder.path(), &[&["batch", "photos", "-o", "all", "--json"], &MAP[..]].concat()));
    assert_eq!((&summary["photos"], &summary["estimated"], &summary["kept"]), (&4.into(), &4.into(), &0.into()));
    done(folder.path(), &[&["batch", "photos", "-o", "one", "--threads", "1"], &MAP[..]].concat());
    let all = results(&folder.path().join("all"));
    assert_eq!(all, results(&folder.path().join("one")));
    assert_eq!(all.len(), 9, "{:?}", all.keys());

    done(folder.path(), &["estimate", "photos/b/1.png", "-o", "single.scene"]);
    let at = ["envmap", "single.scene", "--at", "0,0,-1", "--sh9", "sh.json", "-o", "single.exr"];
    done(folder.path(), &[&at, &MAP[2..]].concat());
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(all[Path::new("b/1.png.scene")], read("single.scene"));
    assert_eq!(all[Path::new("b/1.png.exr")], read("single.exr"));
    assert_ne!(all[Path::new("a/1.png.exr")], read("single.exr"));

    let records = records(&folder.path().join("all/report.jsonl"));
    let record = records.iter().find(|record| record["photo"] == "b/1.png").unwrap();
    assert_eq!(records.len(), 4);
    assert_eq!(record["scene"], "b/1.png.scene");
    assert!(record["seconds"].as_f64().unwrap() > 0.0 && record["hfov_deg"].as_f64().unwrap() > 20.0);
    let sh9 = |value: &Value| serde_json::from_value::<imaging::Sh9>(value["sh9"].clone()).unwrap();
    assert_eq!(sh9(&record["light"]), sh9(&json(&String::from_utf8(read("sh.json")).unwrap())));
    // Maps alone.
    done(folder.path(), &[&["batch", "photos", "-o", "maps", "--no-scenes"], &MAP[..]].concat());
    let maps = results(&folder.path().join("maps"));
    assert_eq!(maps.len(), 5);
    assert_eq!(maps[Path::new("b/1.png.exr")], read("single.exr"));
}

#[test]
fn parts_fill_one_folder_and_failed_photos_do_not_stop_the_others() {
    let folder = photos(3);
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("photos/a/broken.jpg"), b"\xff\xd8\xff\xe0 no photo").unwrap();
    std::fs::write(path("photos/a/empty.png"), "").unwrap();
    done(folder.path(), &["batch", "photos/b", "--root", "photos", "-o", "expected"]);
    for part in 1..=3 {
        let shard = format!("{part}/3");
        let args = ["batch", "photos", "-o", "scenes", "--shard", &shard];
        // Names in order: a/0, a/1, a/2, a/broken, a/empty, b/0, b/1, b/2.
        match part {
            3 => assert!(done(folder.path(), &args).contains("2 of 2 photos estimated")),
            _ => {
                let message = refused(folder.path(), 1, &args);
                assert!(message.contains("1 of 3 photos failed; see scenes/report-"), "{message}");
            }
        }
    }
    let scenes = results(&path("scenes"));
    assert_eq!(scenes.keys().filter(|name| name.starts_with("a")).count(), 3);
    for (name, bytes) in results(&path("expected")) {
        assert!(scenes[&name] == bytes, "{}", name.display());
    }
    let reported: Vec<Value> = (1..=3).flat_map(|i| records(&path(&format!("scenes/report-{i}-of-3.jsonl")))).collect();
    assert_eq!(reported.len(), 8);
    let errors: Vec<_> = reported.iter().filter(|record| record.get("error").is_some()).collect();
    assert_eq!(errors.len(), 2, "{errors:?}");
    assert!(errors.iter().any(|record| record["photo"] == "a/broken.jpg"
        && record["error"].as_str().unwrap().contains("broken.jpg")
        && record.get("scene").is_none()));
    // A photo that was repaired, and one that was removed.
    std::fs::copy(path("photos/a/1.png"), path("photos/a/broken.jpg")).unwrap();
    std::fs::remove_file(path("photos/a/empty.png")).unwrap();
    let again = done(folder.path(), &["batch", "photos", "-o", "scenes"]);
    assert!(again.contains("1 of 7 photos estimated, 6 kept, 0 failed"), "{again}");
    assert_eq!(records(&path("scenes/report.jsonl")).len(), 7);
}

#[test]
fn a_killed_run_is_continued() {
    let folder = photos(8);
    done(folder.path(), &["batch", "photos", "-o", "expected"]);
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("lightoctree"));
    command.current_dir(folder.path()).args(["batch", "photos", "-o", "scenes", "--threads", "1", "--quiet"]);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let report = folder.path().join("scenes/report.jsonl");
    let begun = Instant::now();
    while std::fs::read_to_string(&report).unwrap_or_default().lines().count() < 3 {
        assert!(begun.elapsed() < Duration::from_secs(120) && child.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let killed = results(&folder.path().join("scenes"));
    let finished = killed.keys().filter(|name| name.extension().is_some_and(|e| e == "scene")).count();
    assert!((3..16).contains(&finished), "{:?}", killed.keys());
    // As after a crash of the machine: one is cut off, and the report's last line, too.
    let cut = folder.path().join("scenes/a/0.png.scene");
    std::fs::write(&cut, &killed[Path::new("a/0.png.scene")][..5000]).unwrap();
    let text = std::fs::read_to_string(&report).unwrap();
    std::fs::write(&report, &text[..text.len() - 20]).unwrap();
    let summary = json(&done(folder.path(), &["batch", "photos", "-o", "scenes", "--json"]));
    assert_eq!(summary["kept"], finished - 1);
    let is_temporary = |name: &Path| name.file_name().unwrap().to_str().unwrap().starts_with(".lightoctree-");
    let mut scenes = results(&folder.path().join("scenes"));
    scenes.retain(|name, _| !is_temporary(name));
    assert!(scenes == results(&folder.path().join("expected")));
    assert_eq!(records(&report).len(), 16);
}

#[cfg(unix)]
#[test]
fn ctrl_c_stops_after_the_current_photos() {
    let folder = photos(8);
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("lightoctree"));
    command.current_dir(folder.path()).args(["batch", "photos", "-o", "scenes", "--threads", "1"]);
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let report = folder.path().join("scenes/report.jsonl");
    while std::fs::read_to_string(&report).unwrap_or_default().is_empty() {
        std::thread::sleep(Duration::from_millis(2));
    }
    let sent = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("run the same command again to continue"), "{message}");
    // Nothing is left but whole results.
    let scenes = results(&folder.path().join("scenes"));
    assert_eq!(scenes.len(), records(&report).len() + 1, "{:?}", scenes.keys());
}

#[test]
fn wrong_batches_are_refused_before_any_work() {
    let folder = photos(1);
    let refuse = |code: i32, args: &[&str]| refused(folder.path(), code, &[&["batch"], args].concat());
    assert!(refuse(2, &["photos/a/0.png", "photos/b/0.png", "-o", "x"]).contains("would have the same result"));
    assert!(refuse(2, &["photos", "--shard", "3/2", "-o", "x"]).contains("3/2"));
    assert!(refuse(2, &["photos", "--no-scenes", "-o", "x"]).contains("--envmap-at"));
    assert!(refuse(2, &["-o", "x"]).contains("PHOTO|FOLDER"));
    assert!(refuse(1, &["fotos", "-o", "x"]).contains("fotos"));
    assert!(refuse(1, &["--list", "none.txt", "-o", "x"]).contains("none.txt"));
    assert!(refuse(2, &["photos", "--root", "photos/a", "-o", "x"]).contains("is outside of --root"));
    assert!(refuse(2, &["photos", "-o", "photos/a"]).contains("not empty"));
    std::fs::write(folder.path().join("list.txt"), "\n").unwrap();
    assert!(refuse(2, &["--list", "list.txt", "-o", "x"]).contains("no photos"));
    assert!(!folder.path().join("x").exists());
    // Wrong for every photo: an error of usage, not many failures.
    assert!(refuse(2, &["photos", "--hfov-deg", "300", "-o", "y"]).contains("--hfov-deg"));
}

#[test]
fn results_of_other_settings_are_not_mixed() {
    let folder = photos(1);
    done(folder.path(), &["batch", "photos", "-o", "scenes"]);
    let message = refused(folder.path(), 2, &["batch", "photos", "-o", "scenes", "--hfov-deg", "50"]);
    assert!(message.contains("scenes has results of other settings: lens was {"), "{message}");
    let message = refused(folder.path(), 2, &[&["batch", "photos", "-o", "scenes"], &MAP[..]].concat());
    assert!(message.contains("envmap was null"), "{message}");
}

/// A file has the folder's name: unlike a folder without permission, it stops root, too.
#[test]
fn results_that_cannot_be_written_end_the_run() {
    let folder = photos(4);
    std::fs::create_dir(folder.path().join("scenes")).unwrap();
    std::fs::write(folder.path().join("scenes/b"), "in the way").unwrap();
    let message = refused(folder.path(), 1, &["batch", "photos", "--force", "--threads", "1", "-o", "scenes"]);
    assert!(message.contains("cannot"), "{message}");
    assert!(!message.contains("photos failed"), "not a failure of each photo: {message}");
}

#[test]
fn lists_are_read_from_standard_input() {
    let folder = photos(1);
    let mut command = Command::cargo_bin("lightoctree").unwrap();
    let args = ["batch", "--list", "-", "--root", "photos", "-o", "scenes", "--quiet"];
    let output =
        command.current_dir(folder.path()).args(args).write_stdin("photos/a/0.png\r\nphotos/none.png\r\n").output();
    let message = String::from_utf8(output.unwrap().stderr).unwrap();
    assert!(message.contains("1 of 2 photos failed"), "{message}");
    let records = records(&folder.path().join("scenes/report.jsonl"));
    assert!(records.iter().any(|record| record["photo"] == "none.png" && record.get("error").is_some()));
    assert!(folder.path().join("scenes/a/0.png.scene").is_file());
}
