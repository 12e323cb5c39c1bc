//! Files that are not replaced by mistake, and outputs that are refused before any work.

use lightoctree::Document;
use lo_geometry::Vec3;
use lo_scene::{EmitterEdit, LightChange};

use crate::cli::room_with_scene;
use crate::support::{done, json, refused};

const ESTIMATE: [&str; 9] =
    ["estimate", "photo.png", "--depth", "depth.png", "--hfov-deg", "65", "--completion", "shell", "-o"];

#[test]
fn a_scene_with_edits_is_not_estimated_anew_without_force() {
    let folder = room_with_scene();
    let again = [&ESTIMATE[..], &["room.scene"]].concat();
    done(folder.path(), &again);
    let add = ["lights", "add", "area", "room.scene", "--at", "0,1,-2", "--radius", "0.1", "--radiance", "5"];
    done(folder.path(), &add);
    let message = refused(folder.path(), 2, &again);
    assert!(message.contains("room.scene has 1 added light, which a new estimate would not have"), "{message}");
    done(folder.path(), &[&again[..], &["--force"]].concat());
    assert!(Document::read(folder.path().join("room.scene")).unwrap().light_edits.added.is_empty());
}

#[test]
fn an_edit_without_its_light_is_listed_and_can_be_reset() {
    let folder = room_with_scene();
    let path = folder.path().join("room.scene");
    let mut document = Document::read(&path).unwrap();
    let change = LightChange { scale: 2.0, ..LightChange::NONE };
    let edit = EmitterEdit { id: "L9".to_owned(), found_at_m: Vec3::new(0.0, 50.0, 0.0), change };
    document.light_edits.emitters.push(edit);
    document.write(&path, "lightoctree estimate").unwrap();
    let table = done(folder.path(), &["lights", "room.scene"]);
    assert!(table.contains("L9") && table.contains("missing") && table.contains("x 2"), "{table}");
    let listed = json(&done(folder.path(), &["lights", "room.scene", "--json"]));
    assert_eq!(listed["edits_without_light"][0]["id"], "L9");
    let reset = done(folder.path(), &["lights", "reset", "room.scene", "L9"]);
    assert!(!reset.contains("L9"), "{reset}");
}

#[test]
fn wrong_extensions_are_refused_before_any_work() {
    // The inputs do not exist: only a check before reading them gives exit code 2.
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("full")).unwrap();
    std::fs::write(folder.path().join("full/letter.txt"), "dear").unwrap();
    for args in [
        &["unwrap", "no.jpg", "-o", "a.gif"][..],
        &["unwrap", "no.jpg", "-o", "a.exr", "--mask-out", "m.exr"],
        &["probes", "no.scene", "--grid", "1,1,1", "-o", "full"],
        &["envmap", "no.scene", "--at", "0,0,-1", "-o", "a.png"],
        &["insert", "no.scene", "--mesh", "a.glb", "--at", "0,0,-1", "-o", "a.gif"],
        &["export", "no.scene", "--to", "glb", "-o", "a.usda"],
        &["estimate", "no.jpg", "-o", "a.exr"],
        &["lights", "set", "no.scene", "L1", "--off", "-o", "a.png"],
    ] {
        refused(folder.path(), 2, args);
    }
}

#[cfg(unix)]
#[test]
fn all_outputs_have_the_permissions_of_an_ordinary_file() {
    use std::os::unix::fs::PermissionsExt;

    let folder = room_with_scene();
    std::fs::write(folder.path().join("ordinary"), "").unwrap();
    let path =
        r#"{"keyframes": [{"time_s": 0, "position_m": [0, -1.2, -2]}, {"time_s": 1, "position_m": [0.2, -1.2, -2]}]}"#;
    std::fs::write(folder.path().join("path.json"), path).unwrap();
    let moving = ["insert", "room.scene", "--mesh", "builtin:sphere", "--path", "path.json", "--frames", "2"];
    let draft = ["--quality", "draft"];
    for args in [
        [&moving[..], &draft, &["-o", "a.y4m"]].concat(),
        [&moving[..], &draft, &["-o", "%d.png", "--layers", "%d.exr"]].concat(),
        vec![
            "envmap",
            "room.scene",
            "--at",
            "0,0,-1",
            "--size",
            "64x32",
            "--preview",
            "--sh9",
            "a.json",
            "-o",
            "a.hdr",
        ],
        vec!["export", "room.scene", "--to", "usda", "-o", "a.usda"],
        vec!["export", "room.scene", "--to", "glb", "-o", "a.glb"],
        vec!["probes", "room.scene", "--grid", "1,1,1", "--size", "64x32", "-o", "probes"],
    ] {
        done(folder.path(), &args);
    }
    let mode = |path: &std::path::Path| std::fs::metadata(path).unwrap().permissions().mode();
    let ordinary = mode(&folder.path().join("ordinary"));
    let folders = [folder.path().to_owned(), folder.path().join("probes")];
    let entries =
        folders.iter().flat_map(|folder| std::fs::read_dir(folder).unwrap()).map(|entry| entry.unwrap().path());
    let files: Vec<_> = entries.filter(|path| path.is_file()).collect();
    assert!(files.len() > 14, "{files:?}");
    for file in files {
        assert_eq!(mode(&file), ordinary, "{}", file.display());
    }
}

#[test]
fn export_names_the_lights_of_the_list() {
    let folder = room_with_scene();
    let add = ["lights", "add", "area", "room.scene", "--at", "0,1,-2", "--radius", "0.1", "--radiance", "50"];
    done(folder.path(), &add);
    let listed = json(&done(folder.path(), &["lights", "room.scene", "--json"]));
    let ids = |value: &serde_json::Value| -> Vec<String> {
        value.as_array().unwrap().iter().map(|light| light["id"].as_str().unwrap().to_owned()).collect()
    };
    for (format, file, name) in [("usda", "a.usda", "\"LampA1\""), ("glb", "a.glb", "\"Lamp A1\"")] {
        let report = json(&done(folder.path(), &["export", "room.scene", "--to", format, "--json", "-o", file]));
        assert_eq!(ids(&report["lights"]), ids(&listed["lights"]));
        let added = report["lights"].as_array().unwrap().iter().find(|light| light["id"] == "A1").unwrap();
        assert_eq!(added["lamps"], 1);
        let bytes = std::fs::read(folder.path().join(file)).unwrap();
        assert!(String::from_utf8_lossy(&bytes).contains(name), "{format}");
    }
}
