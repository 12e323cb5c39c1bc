//! Sizes, places and materials of objects that are probably wrong.

use std::path::Path;

use assert_cmd::Command;
use lo_testdata::shared_data;

use crate::cli::{room_with_scene, write_mesh};
use crate::support::{done, json, refused};

/// Runs `insert` at draft quality with notes, and returns stderr.
fn notes(folder: &Path, args: &[&str]) -> String {
    let mut command = Command::cargo_bin("lightoctree").unwrap();
    let all = [&["insert", "room.scene", "--quality", "draft", "--force", "-o", "a.png"], args].concat();
    let output = command.current_dir(folder).args(all).output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{args:?}: {text}");
    text
}

#[test]
fn a_size_in_other_units_is_told_and_the_unit_mends_it() {
    let folder = room_with_scene();
    // The tetrahedron is 0.8 units high: 40 units of scale 50, that is centimetres.
    let large = "v 0 0 30\nv 25 0 -15\nv -25 0 -15\nv 0 40 0\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    std::fs::write(folder.path().join("large.obj"), large).unwrap();
    let told = notes(folder.path(), &["--mesh", "large.obj", "--pixel", "72,95"]);
    assert!(told.contains("the object is 40 m high, higher than the room ("), "{told}");
    assert!(told.contains(": centimetres? Set the unit of its file with --unit cm"), "{told}");
    let told = notes(folder.path(), &["--mesh", "large.obj", "--pixel", "72,95", "--unit", "cm"]);
    assert!(!told.contains("unit") && !told.contains("floats") && !told.contains("sunk"), "{told}");
    write_mesh(folder.path());
    let told = notes(folder.path(), &["--mesh", "object.obj", "--pixel", "72,95", "--scale", "0.001"]);
    assert!(told.contains("is only 1.00 mm in size: set its size with --height METRES"), "{told}");
}

/// Returns the arguments of a draft with an object of 20 cm.
fn insert<'a>(rest: &[&'a str]) -> Vec<&'a str> {
    let start = ["insert", "room.scene", "--mesh", "object.obj", "--height", "0.2", "--quality", "draft"];
    [&start[..], rest, &["--force", "--json", "-o", "a.png"]].concat()
}

#[test]
fn a_wall_is_refused_with_both_ways_out() {
    let folder = room_with_scene();
    write_mesh(folder.path());
    let message = refused(folder.path(), 1, &insert(&["--pixel", "72,30"]));
    assert!(message.contains("pixel (72, 30) shows a surface tilted by 90°, on which nothing stands"), "{message}");
    assert!(message.contains("attach its base to the tilted surface with --align surface"), "{message}");
    let (_, rest) = message.split_once("place it there with --pixel ").unwrap();
    let (pixel, _) = rest.split_once(", or").unwrap();
    let position = |args: &[&str]| {
        let summary = json(&done(folder.path(), args));
        [0, 1, 2].map(|axis| summary["objects"][0]["positions_m"][0][axis].as_f64().unwrap())
    };
    let [_, y, z] = position(&insert(&["--pixel", pixel]));
    assert!((y + 1.2).abs() < 0.03 && (z + 2.85).abs() < 0.1, "{y} {z}");
    let [_, _, z] = position(&insert(&["--pixel", "72,30", "--align", "surface"]));
    assert!((z + 3.0).abs() < 0.03, "{z}");
}

#[test]
fn bases_over_and_under_the_floor_are_told() {
    let folder = room_with_scene();
    let told = |at: &str| notes(folder.path(), &["--mesh", "builtin:sphere", "--height", "0.3", &format!("--at={at}")]);
    let over = told("0,-1.1,-2.9");
    assert!(
        over.contains("the object floats 10 cm over the surface below it; --pixel places it on a surface"),
        "{over}"
    );
    let under = told("0,-1.25,-2.9");
    assert!(under.contains("the object is sunk 5.0 cm into the surface under it"), "{under}");
    let on = told("0,-1.2,-2.9");
    assert!(!on.contains("floats") && !on.contains("sunk"), "{on}");
}

#[test]
fn meshes_as_people_have_them() {
    let Some(meshes) = shared_data("inputs/meshes", "inserting of people's meshes") else { return };
    let folder = room_with_scene();
    let told = |file: &str| {
        let mesh = meshes.join(file).canonicalize().unwrap();
        notes(folder.path(), &["--mesh", mesh.to_str().unwrap(), "--pixel", "72,95"])
    };
    assert!(told("cm100.glb").contains("the object is 30 m high, higher than the room ("));
    for file in ["tr1.obj", "d0.obj"] {
        let told = told(file);
        assert!(told.contains("the object is not visible: its material is transparent; --material"), "{file}: {told}");
        assert!(!told.contains("outside the photo"), "{file}: {told}");
    }
    for file in ["specgloss.glb", "blackkd.obj", "transm.glb"] {
        let told = told(file);
        let complaints = ["not visible", "ignored", "thin panes"];
        assert!(complaints.iter().all(|complaint| !told.contains(complaint)), "{file}: {told}");
    }
}
